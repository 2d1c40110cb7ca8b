"""Fingers on springs squeeze a free part on a frictionless palm, where only contact holds it."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import rungwise as rw


def squeeze(seed: int) -> tuple[dict[str, Any], list[dict[str, Any]]]:
    """A scene, and a schedule that closes its fingers on the part and then moves them along with it."""
    rng = np.random.default_rng(seed)
    count, size, mass = int(rng.integers(2, 4)), 10 ** rng.uniform(-2, 0), 10 ** rng.uniform(-1, 1)
    spring, mu = mass * 9.81 / size * 10 ** rng.uniform(0, 3), rng.uniform(0.3, 1.2)
    shape: dict[str, Any] = {"kind": "disc", "radius": 0.5 * size}
    if rng.random() < 0.5:
        shape = {"kind": "box", "width": size, "height": size * rng.uniform(0.7, 1.0)}
    radius, reach = size * rng.uniform(0.03, 0.15), size * math.sqrt(0.5)
    angles = 2 * math.pi / count * np.arange(count) + rng.uniform(-0.05, 0.05, count)
    away = (reach + 1.1 * radius) * np.column_stack([np.cos(angles), np.sin(angles)])
    names = [f"{axis}{i}" for i in range(count) for axis in "xy"]
    law = {"stiffness": 1e4 * spring, "damping": 10.0 * spring}
    bodies: dict[str, Any] = {
        "part": {"role": "object", "shape": shape, "motion": {"kind": "free"}, "mass": mass}
    }
    for i in range(count):
        drives = {
            axis: {"drive": {"kind": "servo", "stiffness": spring, "target": f"{axis}{i}"}} for axis in "xy"
        }
        bodies[f"finger{i}"] = {
            "role": "robot", "shape": {"kind": "disc", "radius": radius}, "mass": 0.1 * mass,
            "pose": {"x": f"x{i}", "y": f"y{i}"}, "motion": {"kind": "free"},
            "coordinates": drives | {"angle": {"drive": {"kind": "speed", "speed": 0}}},
        }  # fmt: skip
    scene = {
        "name": "squeeze",
        "parameters": {
            name: {"default": float(x), "range": [-100.0, 100.0]}
            for name, x in zip(names, away.ravel(), strict=True)
        },
        "inputs": names, "bodies": bodies,
        "contacts": [{"between": ["finger*", "part"], "friction": mu, **law}],
        "tolerance": 1e-6 * size, "step": 0.01,
    }  # fmt: skip
    closed = away * rng.uniform(0.6, 0.8)
    moved = closed + size * rng.uniform(-0.3, 0.3, 2)
    inputs = [
        {"inputs": dict(zip(names, to.ravel().tolist(), strict=True)), "duration": 0.6, "ramp": True}
        for to in (closed, moved)
    ]
    return scene, inputs


@pytest.mark.parametrize("model", [rw.QUASISTATIC_RIGID, rw.QUASISTATIC_COMPLIANT])
def test_fingers_that_squeeze_take_the_steps_they_are_given(model: rw.Rung) -> None:
    ended = []
    for seed in range(24):
        scene, inputs = squeeze(seed)
        run = rw.simulate(scene, model, inputs=inputs, frames=3)
        assert run.outcome != "not_converged", (seed, run.reason)
        ended.append(run.outcome == "missed" and run.steps <= 200)
    assert sum(ended) >= 20


@pytest.mark.parametrize("model", [rw.QUASISTATIC_RIGID, rw.QUASISTATIC_COMPLIANT])
def test_fingers_follow_their_targets_through_the_air_whatever_a_faint_spring_pulls(model: rw.Rung) -> None:
    """Servos with a limit exert next to nothing there, and hold all the same."""
    for seed in range(20):
        rng = np.random.default_rng(seed)
        size, mass, speed = 10 ** rng.uniform((-2, -2, -2), (1, 2, 1))
        spring = mass * 9.81 / size * 10 ** rng.uniform(0, 3)
        servo = {"kind": "servo", "stiffness": spring, "damping": 0.01 * spring, "limit": spring * size}
        turn = {"kind": "servo", "stiffness": spring * size**2, "target": 10 ** rng.uniform(-12, -6)}
        finger = {
            "role": "robot", "shape": {"kind": "disc", "radius": 0.1 * size}, "mass": mass,
            "motion": {"kind": "free"},
            "coordinates": {
                "x": {"drive": servo | {"target": f"{speed * size} * t"}},
                "y": {"drive": servo | {"target": 0}},
                "angle": {"drive": turn, "damping": spring * size**2},
            },
        }  # fmt: skip
        scene = {"name": "air", "bodies": {"finger": finger}, "step": 0.01, "duration": 0.1}
        run = rw.simulate(scene, model)
        assert run.outcome == "timeout", (seed, run.reason)
        lag = speed * size * 0.01
        assert run.final["finger"]["x"] == pytest.approx(0.1 * speed * size - lag, abs=lag)

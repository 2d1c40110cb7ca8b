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


@pytest.mark.few(1)
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


def _shape(rng: np.random.Generator, size: float) -> tuple[dict[str, Any], float, float]:
    """An outline, how it is turned to lie on a face, and how high its origin is then."""
    if rng.random() < 0.2:
        return {"kind": "disc", "radius": 0.5 * size}, 0.0, 0.5 * size
    if rng.random() < 0.4:
        height = size * rng.uniform(0.4, 1.0)
        return {"kind": "box", "width": size, "height": height}, 0.0, 0.5 * height
    n = int(rng.integers(3, 7))
    turn = -0.5 * math.pi - math.pi / n
    return {"kind": "regular", "corners": n, "reach": 0.5 * size}, turn, 0.5 * size * math.cos(math.pi / n)


def press(seed: int) -> tuple[dict[str, Any], list[dict[str, Any]], float | None]:
    """Two or three fingers at places around an object, seen from above or on a floor, that are led, or sent
    at once, to any places about it and within it; where they end with a condition, all must come to rest."""
    rng = np.random.default_rng(seed)
    lies, count = bool(rng.random() < 0.4), int(rng.choice([2, 2, 3]))
    size, mass, step = 10 ** rng.uniform((-1.5, -1, -3), (0.5, 1, -1.7))
    shape, turn, middle = _shape(rng, size)
    spring = mass * 9.81 / size * 10 ** rng.uniform(0, 3)
    servo = {"kind": "servo", "stiffness": spring, "damping": spring * 10 ** rng.uniform(-4, -0.5)}
    if rng.random() < 0.5:
        servo["limit"] = mass * 9.81 * 10 ** rng.uniform(-0.3, 1)
    radius, law = size * rng.uniform(0.03, 0.15), {"stiffness": 1e3 * spring, "damping": 10.0 * spring}
    part = {"role": "object", "shape": shape, "mass": mass, "motion": {"kind": "free"}}
    part["pose"] = {"angle": turn, "y": middle} if lies else {"angle": rng.uniform(-1, 1)}
    scene: dict[str, Any] = {"name": "press", "tolerance": 1e-6 * size, "step": step}
    contacts = [{"between": ["finger*", "*"], "friction": rng.uniform(0.2, 1.0), **law}]
    bodies: dict[str, Any] = {"part": part}
    if lies:
        bodies["floor"] = {"role": "obstacle", "shape": {"kind": "halfplane"}}
        contacts.append({"between": ["floor", "part"], "friction": rng.uniform(0.1, 0.6), **law})
        scene["gravity"] = [0, -9.81]
    else:
        part["support"] = {"friction": rng.uniform(0.1, 0.6), "gravity": 9.81}
    turns = rng.uniform(0, 0.2) + np.cumsum(rng.uniform(0.5, 1.0 if lies else 1.9, count))
    far = 0.8 * size + 1.2 * radius
    places = far * np.column_stack([np.cos(turns), np.sin(turns)]) + [0, middle if lies else 0]
    names = [f"{axis}{i}" for i in range(count) for axis in "xy"]
    for i in range(count):
        drives = {axis: {"drive": servo | {"target": f"{axis}{i}"}} for axis in "xy"}
        bodies[f"finger{i}"] = {
            "role": "robot", "shape": {"kind": "disc", "radius": radius}, "mass": 0.1 * mass,
            "pose": {"x": f"x{i}", "y": f"y{i}"}, "motion": {"kind": "free"},
            "coordinates": drives | {"angle": {"drive": {"kind": "speed", "speed": 0}}},
        }  # fmt: skip
    scene |= {"bodies": bodies, "contacts": contacts, "inputs": names}
    places[:, 1] = np.maximum(places[:, 1], 1.05 * radius) if lies else places[:, 1]
    scene["parameters"] = {
        name: {"default": float(x), "range": [-100.0, 100.0]}
        for name, x in zip(names, places.ravel(), strict=True)
    }
    inputs: list[dict[str, Any]] = []
    for _ in range(int(rng.integers(1, 5))):
        to = rng.uniform(-0.8, 0.8, (count, 2)) * size + [0, middle if lies else 0]
        to[:, 1] = np.maximum(to[:, 1], 1.02 * radius) if lies else to[:, 1]
        levels = dict(zip(names, to.ravel().tolist(), strict=True))
        inputs.append({"inputs": levels, "duration": 50 * step, "ramp": bool(rng.random() < 0.6)})
    if rng.random() < 0.5:
        inputs.append(
            inputs[-1] | {"until": " and ".join(f"rest({name})" for name in bodies if name != "floor")}
        )
    return scene, inputs, rng.choice([None, None, 1e-3 * size])


@pytest.mark.long
@pytest.mark.parametrize(("first", "count"), [(0, 40), pytest.param(40, 300, marks=pytest.mark.long)])
@pytest.mark.parametrize("model", [rw.QUASISTATIC_RIGID, rw.QUASISTATIC_COMPLIANT])
def test_what_servos_press_is_moved(model: rw.Rung, first: int, count: int) -> None:
    """A step with several fingers on servos is linearised about its end, whatever the part does."""
    failed = []
    for seed in range(first, first + count):
        scene, inputs, tol = press(seed)
        run = rw.simulate(scene, model, inputs=inputs, tol=tol, frames=3)
        failed += [(seed, run.reason)] if run.outcome == "not_converged" else []
    assert len(failed) <= 0.02 * count, failed

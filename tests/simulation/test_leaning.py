"""A finger lifts blocks that lean in a corner by next to nothing: where rest is no longer admissible, motion
begins at once and at a finite speed, and the sense of a slip is all but hidden by rounding."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import rungwise as rw

STEPS = 40
HARD = (64, 82, 154, 189, 205, 213, 389, 524)
"""Members of which longer steps were missed by Newton's method, the proximal method and pivoting alike."""


def leaning(rng: np.random.Generator) -> tuple[dict[str, Any], list[rw.Segment]]:
    """A block with one corner on the floor and one at a wall, turned by 1e-9 to 0.1, and a servo finger that
    presses at its side and pulls upwards, ever more."""
    turn, width, height = float(10 ** rng.uniform(-9, -1)), rng.uniform(0.05, 0.1), rng.uniform(0.015, 0.03)
    friction, wall, floor = (
        float(rng.uniform(low, high)) for low, high in ((0.4, 0.9), (0.1, 0.5), (0.1, 0.5))
    )
    step, radius = float(10 ** rng.uniform(-6, -2)), 0.004
    turned = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    corners = 0.5 * np.array([[-width, -height], [width, -height], [width, height], [-width, height]])
    corners = corners @ turned.T
    place = np.array([-corners[:, 0].max(), -corners[:, 1].min()])
    touched = turned @ np.array([-0.5 * width, (rng.uniform(0.5, 0.95) - 0.5) * height]) + place
    x, y = (float(c) for c in touched - turned[:, 0] * radius * (1.0 + 1e-9))
    press = float(rng.uniform(2, 20))
    drive = {"kind": "servo", "stiffness": 500, "damping": 15, "limit": 20}
    driven = {axis: {"drive": drive | {"target": f"{axis}1"}} for axis in "xy"}
    finger = {
        "role": "robot", "shape": {"kind": "disc", "radius": radius}, "pose": {"x": x, "y": y}, "mass": 0.1,
        "motion": {"kind": "free"}, "force": [0, 0.981],
        "coordinates": driven | {"angle": {"drive": {"kind": "speed", "speed": 0}}},
    }  # fmt: skip
    part = {
        "role": "object", "mass": 0.5, "motion": {"kind": "free"},
        "pose": {"x": float(place[0]), "y": float(place[1]), "angle": -turn},
        "shape": {"kind": "box", "width": float(width), "height": float(height)},
    }  # fmt: skip
    fixed = {
        "floor": {"role": "obstacle", "shape": {"kind": "halfplane"}},
        "wall": {"role": "obstacle", "shape": {"kind": "halfplane", "normal": [-1, 0]}},
    }
    scene = {
        "name": "leaning", "gravity": [0, -9.81], "inputs": ["x1", "y1"],
        "parameters": {"x1": {"default": x}, "y1": {"default": y}},
        "bodies": {"finger1": finger, "part": part} | fixed,
        "contacts": [
            {"between": ["finger1", "part"], "friction": friction},
            {"between": ["part", "floor"], "friction": floor},
            {"between": ["part", "wall"], "friction": wall},
            {"between": ["finger1", "*"], "friction": 0},
        ],
        "duration": 1, "step": step,
    }  # fmt: skip
    lift = float(rng.uniform(0.2, 1.0)) * friction * press
    target = {"x1": x + press / 500, "y1": y + lift / 500}
    return scene, [rw.Segment(inputs=target, duration=STEPS * step, ramp=True)]


MORE = [pytest.param(number, marks=pytest.mark.long) for number in range(8, 60)]


@pytest.mark.few(4)
@pytest.mark.parametrize("number", [*HARD, *range(8), *MORE])
def test_a_lifted_block_moves_on_in_usual_steps(number: int) -> None:
    rng = np.random.default_rng([number, 30])
    scene, inputs = leaning(rng)
    whole = rw.simulate(scene, "quasistatic-rigid", inputs=inputs)
    controlled = rw.simulate(scene, "quasistatic-rigid", inputs=inputs, tol=float(10 ** rng.uniform(-8, -5)))
    for run in (whole, controlled):
        assert run.outcome not in ("running", "not_converged"), run.reason
        assert run.attempts <= 20 * STEPS + 15 * run.steps

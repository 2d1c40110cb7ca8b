"""The kinematic rung: a servo whose target is far away, and other things that move."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import rungwise as rw


def beside(seed: int, blocked: bool) -> dict[str, Any]:
    """A servo that is told to go far at once, an arm that a joint turns, and a disc that another pushes.
    Where it is `blocked`, there is a wall before the servo."""
    rng = np.random.default_rng(seed)
    far, stiffness, damping, turn, push = rng.uniform((0.05, 10.0, 1.0, 0.2, 0.1), (1.0, 1e3, 1e2, 2.0, 1.0))
    disc = {"kind": "disc", "radius": 0.05}
    slide = {"kind": "slide", "axis": [1, 0], "name": "s"}
    drive = {
        "kind": "servo", "stiffness": float(stiffness), "damping": float(damping), "target": float(far)
    }  # fmt: skip
    bodies: dict[str, Any] = {
        "servo": {
            "role": "robot", "shape": disc, "pose": {"y": 3}, "mass": 1, "motion": slide,
            "coordinates": {"s": {"drive": drive}},
        },
        "pusher": {
            "role": "robot", "shape": disc, "pose": {"x": -0.1, "y": 9}, "mass": 1, "motion": slide,
            "coordinates": {"s": {"drive": {"kind": "speed", "speed": float(push)}}},
        },
        "pushed": {
            "role": "object", "shape": disc, "pose": {"x": 0.01, "y": 9.03}, "mass": 1,
            "motion": {"kind": "free"},
        },
        "arm": {
            "role": "robot", "shape": {"kind": "box", "width": 0.5, "height": 0.05}, "pose": {"x": -5.25},
            "mass": 1, "motion": {"kind": "free"},
        },
        "base": {"role": "obstacle", "shape": {"kind": "point"}, "pose": {"x": -5, "y": 0}},
    }  # fmt: skip
    if blocked:
        wall = {"shape": {"kind": "box", "width": 0.02, "height": 1.0}, "pose": {"x": 0.08, "y": 3}}
        bodies["wall"] = {"role": "obstacle"} | wall
    joint = {"kind": "hinge", "between": ["base", "arm"], "at": [-5, 0]}
    joint |= {"coordinate": {"drive": {"kind": "speed", "speed": float(turn)}}}
    return {"name": "beside", "bodies": bodies, "joints": {"j": joint}} | {
        "contacts": [{"between": ["*", "*"]}], "duration": 0.2, "step": 1e-3
    }  # fmt: skip


@pytest.mark.few(6)
@pytest.mark.parametrize("tol", [None, 1e-3])
@pytest.mark.parametrize("seed", range(6))
def test_servo_with_nothing_in_its_way_goes_where_it_is_told(seed: int, tol: float | None) -> None:
    scene = beside(seed, blocked=False)
    run = rw.simulate(scene, rw.KINEMATIC, tol=tol)
    assert str(run.outcome) == "timeout", run.reason
    target = scene["bodies"]["servo"]["coordinates"]["s"]["drive"]["target"]
    assert run.final["servo"]["s"] == pytest.approx(target)
    turn = scene["joints"]["j"]["coordinate"]["drive"]["speed"]
    assert run.final["arm"]["angle"] == pytest.approx(0.2 * turn, rel=1e-3)


def test_servo_is_named_where_something_is_in_its_way() -> None:
    run = rw.simulate(beside(0, blocked=True), rw.KINEMATIC)
    assert str(run.outcome) in ("not_converged", "jammed"), run.reason
    assert str(run.outcome) == "jammed" or "bodies.servo" in run.reason

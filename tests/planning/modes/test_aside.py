"""An object is led to its place among others that lie loose, which it pushes aside."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import rungwise as rw
from rungwise.planning.modes.running.execute import Scene
from rungwise.planning.motion.budget import Budget
from rungwise.planning.search.problem import begin
from rungwise.planning.task.task import task_of

SIDE, MASS, RUB, GRAVITY = 0.06, 0.4, 0.3, 9.81
STIFF = {"stiffness": 1e5, "damping": 100.0}
SHAPES: dict[str, Any] = {
    "disc": {"kind": "disc", "radius": 0.01},
    "box": {"kind": "box", "width": 0.02, "height": 0.015},
}


def among(places: list[tuple[float, float]], shape: str, asked: str = "") -> rw.Scene:
    """A finger, a box that is to go straight on, and pieces at these places, which lie loose (top view)."""
    drives, parameters = dict[str, Any](), dict[str, Any]()
    for axis, at in (("x", -0.06), ("y", 0.0)):
        parameters[axis] = {"default": at, "range": [-2, 2]}
        servo = {"kind": "servo", "target": axis, "stiffness": 1000, "damping": 20, "limit": 30}
        drives[axis] = {"drive": servo}
    drives["angle"] = {"drive": {"kind": "speed", "speed": 0}}
    bodies: dict[str, Any] = {
        "finger": {
            "role": "robot", "shape": {"kind": "disc", "radius": 0.006}, "mass": 0.1,
            "pose": {"x": "x", "y": "y"}, "motion": {"kind": "free"}, "coordinates": drives,
        },
        "box": _lying({"kind": "box", "width": SIDE, "height": SIDE}, 0.0, 0.0, MASS),
    }  # fmt: skip
    for k, (x, y) in enumerate(places):
        bodies[f"piece{k}"] = _lying(SHAPES[shape], x, y, 0.1 * MASS)
    pairs = [("finger", "box"), ("finger", "piece*"), ("box", "piece*"), ("piece*", "piece*")]
    entries = [{"between": pair, "friction": 0.4, **STIFF} for pair in pairs[: 3 + (len(places) > 1)]]
    return rw.load(
        {
            "name": "among", "parameters": parameters, "inputs": ["x", "y"], "bodies": bodies,
            "contacts": entries,
            "goal": f"hypot(box.x - 0.15, box.y) <= 0.02 and abs(box.angle) <= 0.3{asked}",
            "duration": 100, "step": 1e-3, "tolerance": 1e-7,
            "task": {
                "fingers": {"finger": {"speed": 0.05, "clearance": 0.004, "objects": "box"}}, "moves": [1, 8],
            },
        }
    )  # fmt: skip


def _lying(shape: Any, x: float, y: float, mass: float) -> dict[str, Any]:
    support = {"friction": RUB, "load": mass * GRAVITY, "pressure": {"kind": "uniform"}}
    return {
        "role": "object", "shape": shape, "pose": {"x": x, "y": y}, "motion": {"kind": "free"}, "mass": mass,
        "support": support,
    }  # fmt: skip


def drawn(seed: int, count: int) -> list[tuple[float, float]]:
    """Places ahead of the box, of pieces that are in its way."""
    rng = np.random.default_rng(seed)
    found = list[tuple[float, float]]()
    while len(found) < count:
        place = (float(rng.uniform(0.05, 0.19)), float(rng.uniform(-0.035, 0.035)))
        if all(np.hypot(place[0] - x, place[1] - y) > 0.028 for x, y in found):
            found.append(place)
    return found


@pytest.mark.long
@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("count", [1, 2, 4])
@pytest.mark.parametrize("seed", range(3))
def test_what_lies_loose_is_pushed_aside(shape: str, count: int, seed: int) -> None:
    scene = among(drawn(seed, count), shape)
    plan = rw.plan(scene, schedule="direct", seed=seed)
    assert plan.found, plan.reason
    run = plan.replay("dynamic-compliant", tol=0.1 * plan.tol)
    assert run.outcome.code == rw.Code.GOAL


@pytest.mark.parametrize(("asked", "kept"), [("", 2), (" and piece0.x <= 1", 1)])
def test_pieces_of_which_the_goal_speaks_are_not_pushed_aside(asked: str, kept: int) -> None:
    scene = among(drawn(0, 2), "disc", asked)
    ground = Scene(begin(task_of(scene), Budget(), 0, None).named).aside[1]
    names = scene.template.contacts
    left_out = {name for k in ground.beyond for name in names[k]} - {"finger"}
    assert left_out == {f"piece{k}" for k in range(2 - kept, 2)}
    assert all("piece0" in names[k] for k in (*ground.pairs, *ground.avoided))
    assert len(ground.pairs) == 2 - kept


@pytest.mark.few(1)
@pytest.mark.parametrize("count", [1, 7, 40])
def test_rest_of_many_objects_is_a_condition(count: int) -> None:
    """As robots wait for it where objects still move."""
    scene = among([(0.2 + 0.03 * k, 0.0) for k in range(count)], "disc")
    run = rw.simulate(
        scene, "quasistatic-rigid", inputs=[rw.Segment({"x": -0.06}, 1.0, task_of(scene).at_rest)]
    )
    assert run.outcome == rw.Outcome.MISSED

"""An object that fingers may touch pushes another one, of which the goal speaks, to its place."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import yaml

import rungwise as rw
from rungwise.planning.modes.balance import modes, motion
from rungwise.planning.modes.pushed import led_target
from rungwise.planning.modes.running.execute import Scene
from rungwise.planning.motion.budget import Budget
from rungwise.planning.search.problem import begin
from rungwise.planning.task.task import task_of

SIDE, MASS, RUB, GRAVITY = 0.06, 0.4, 0.3, 9.81
STIFF = {"stiffness": 1e5, "damping": 100.0}
PALM = {"kind": "box", "width": 0.01, "height": 0.04}
DISC = {"kind": "disc", "radius": 0.006}


def in_line(
    places: list[tuple[float, float]], shape: Any, contacts: int = 1, heavier: float = 1.0
) -> rw.Scene:
    """Fingers at these places, a box that they may touch, and one beyond it that is to go on (top view)."""
    parameters, bodies = dict[str, Any](), dict[str, Any]()
    for k, place in enumerate(places):
        drives = dict[str, Any]()
        for axis, at in zip("xy", place, strict=True):
            parameters[f"{axis}{k}"] = {"default": at, "range": [-2, 2]}
            servo = {"kind": "servo", "target": f"{axis}{k}", "stiffness": 1000, "damping": 20, "limit": 30}
            drives[axis] = {"drive": servo}
        bodies[f"finger{k}"] = {
            "role": "robot", "shape": shape, "pose": dict(zip("xy", place, strict=True)), "mass": 0.1,
            "motion": {"kind": "free"},
            "coordinates": drives | {"angle": {"drive": {"kind": "speed", "speed": 0}}},
        }  # fmt: skip
    for name, x, mass in (("near", -0.1, MASS), ("far", 0.05, heavier * MASS)):
        bodies[name] = {
            "role": "object", "shape": {"kind": "box", "width": SIDE, "height": SIDE}, "pose": {"x": x},
            "motion": {"kind": "free"}, "mass": mass, "support": {"friction": RUB, "gravity": GRAVITY},
        }  # fmt: skip
    pairs = [("finger*", "near"), ("finger*", "far"), ("near", "far"), ("finger*", "finger*")]
    entries = [
        {"between": pair, "friction": 0.4, **STIFF} for pair in (pairs if len(places) > 1 else pairs[:3])
    ]
    finger = {"speed": 0.1, "clearance": 0.006, "objects": "near", "contacts": contacts}
    return rw.load(
        {
            "name": "in_line", "parameters": parameters, "inputs": list(parameters), "bodies": bodies,
            "contacts": entries, "goal": "hypot(far.x - 0.2, far.y) <= 0.01 and abs(far.angle) <= 0.1",
            "duration": 100, "step": 1e-3, "tolerance": 1e-4,
            "task": {"fingers": {"finger*": finger}, "moves": [1, 6]},
        }
    )  # fmt: skip


@pytest.mark.parametrize("heavier", [1.0, 3.0])
def test_a_push_through_another_box_takes_the_friction_of_both(heavier: float) -> None:
    """The first goes behind the second, until it touches; then both go on, and the palm pushes for both."""
    work = begin(task_of(in_line([(-0.135, 0.0)], PALM, 2, heavier)), Budget(), 0, None)
    ground, q = Scene(work).grounds["near pushes far"], work.start.q[0]
    assert ground.pushes and ground.columns[ground.aims].tolist() == [6, 7, 8]
    used, rng, target = np.ones(1, np.int64), np.random.default_rng(0), q.copy()
    target[6] = 0.2
    ways = [led_target(ground, ground.look(q), target, rng) for _ in range(20)]
    assert all((way[6:] == q[6:]).all() for way in ways)
    behind = np.array([way[3] for way in ways if way[3] != q[3]])
    assert len(behind) > 10 and np.allclose(behind, 0.05 - SIDE, atol=1e-3)
    touching = q.copy()
    touching[[0, 3]] += 0.05 - SIDE - q[3]
    seen = ground.look(touching)
    ways = [led_target(ground, seen, target, rng) for _ in range(20)]
    both = [way for way in ways if way[6] == 0.2]
    assert len(both) > 10 and np.allclose([way[3] for way in both], 0.2 - SIDE)
    want = (both[0] - touching)[ground.columns] * ground.units
    (mode, _), *_ = modes(ground, seen, want)
    found = motion(ground, seen, used, mode, want, 0.1)
    assert found is not None
    assert found.change[[0, 3]] == pytest.approx([0.15, 0.15], rel=1e-3)
    assert found.pushes[0] == pytest.approx(RUB * (1.0 + heavier) * MASS * GRAVITY, rel=1e-2)


@pytest.mark.long
@pytest.mark.parametrize(
    ("places", "shape", "contacts", "seed"),
    [
        ([(-0.2, 0.0)], PALM, 2, 1),
        pytest.param([(-0.2, 0.02), (-0.2, -0.02)], DISC, 1, 0, marks=pytest.mark.long),
    ],
    ids=["palm", "two fingers"],
)  # fmt: skip
def test_a_box_pushes_another_to_its_goal(
    places: list[tuple[float, float]], shape: Any, contacts: int, seed: int
) -> None:
    found = rw.plan(in_line(places, shape, contacts), seed=seed)
    assert found.found, found.reason
    assert found.stage is not None and found.stage.model is rw.DYNAMIC_COMPLIANT
    assert found.replay(tol=0.1 * found.tol).outcome == rw.Outcome.GOAL


@pytest.mark.long
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("near", [(-0.1, 0.0), (0.05, 0.08), (0.05, -0.09)])
@pytest.mark.parametrize("robots", ["palm", "two fingers"])
def test_both_boxes_of_a_push_come_to_their_goals(robots: str, near: tuple[float, float], seed: int) -> None:
    """The one that pushes does so before it comes to its own place."""
    palm = robots == "palm"
    places = [(-0.2, 0.0)] if palm else [(-0.2, 0.02), (-0.2, -0.02)]
    data = yaml.safe_load(in_line(places, PALM if palm else DISC, 1 + palm).yaml())
    own = f"hypot(near.x - {near[0]}, near.y - {near[1]}) <= 0.02"
    data["goal"] = f"hypot(far.x - 0.2, far.y) <= 0.015 and {own}"
    data["task"]["moves"] = [1, 12]
    found = rw.plan(rw.load(data), seed=seed)
    assert found.found, found.reason
    assert found.replay(tol=0.1 * found.tol).outcome == rw.Outcome.GOAL


def on_a_floor() -> rw.Scene:
    """A palm and the same two boxes seen from the side, where gravity presses the boxes on a floor."""
    data = yaml.safe_load(in_line([(-0.2, 0.03)], PALM, 2).yaml())
    data["gravity"] = [0, -GRAVITY]
    for name in ("near", "far"):
        del data["bodies"][name]["support"]
        data["bodies"][name]["pose"]["y"] = SIDE / 2
    data["bodies"]["finger0"]["force"] = [0, 0.1 * GRAVITY]
    data["bodies"]["floor"] = {"role": "obstacle", "shape": {"kind": "halfplane"}}
    data["contacts"] += [
        {"between": [name, "floor"], "friction": 0.4, **STIFF} for name in ("near", "far", "finger0")
    ]
    data["goal"] = f"hypot(far.x - 0.12, far.y - {SIDE / 2}) <= 0.01"
    return rw.load(data)


def test_a_push_through_another_box_on_a_floor_is_balanced() -> None:
    """All six contacts of the boxes are told apart: two stick between them, four slide on the floor; the palm
    pushes against the friction of both."""
    work = begin(task_of(on_a_floor()), Budget(), 0, None)
    ground, q = Scene(work).grounds["near pushes far"], work.start.q[0].copy()
    q[3] = q[6] - SIDE
    q[0] = q[3] - SIDE / 2 - 0.005
    seen, want = ground.look(q), np.zeros(6)
    assert len(seen.closed) == 6
    want[[0, 3]] = 0.02
    (mode, _), *_ = modes(ground, seen, want)
    found = motion(ground, seen, np.ones(1, np.int64), mode, want, 0.1)
    assert found is not None and found.change == pytest.approx(want / ground.units, abs=1e-9)
    assert found.pushes[0] == pytest.approx(0.4 * 2.0 * MASS * GRAVITY, rel=0.2)


@pytest.mark.long
@pytest.mark.parametrize("seed", range(2))
def test_a_box_pushes_another_along_a_floor(seed: int) -> None:
    found = rw.plan(on_a_floor(), seed=seed)
    assert found.found, found.reason
    assert found.replay(tol=0.1 * found.tol).outcome == rw.Outcome.GOAL

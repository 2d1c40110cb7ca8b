"""Fingers that touch an object at several places: palms, bars and forks."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import rungwise as rw
from rungwise.planning.modes.balance import is_led, modes, motion, rests
from rungwise.planning.modes.grips import grips, touching
from rungwise.planning.modes.ground import Ground
from rungwise.planning.modes.running.execute import Scene
from rungwise.planning.motion.budget import Budget
from rungwise.planning.search.problem import begin
from rungwise.planning.task.task import task_of
from rungwise.world.find import world_of

STIFF = {"stiffness": 1e5, "damping": 100.0}
SIDE, MASS, GRAVITY = 0.08, 0.5, 9.81
PALM = {"kind": "box", "width": 0.01, "height": 0.04}
BAR = {"kind": "capsule", "length": 0.06, "radius": 0.005}
FORK = [
    {"kind": "box", "width": 0.012, "height": 0.02, "at": [-0.025, 0]},
    {"kind": "box", "width": 0.012, "height": 0.02, "at": [0.025, 0]},
    {"kind": "box", "width": 0.062, "height": 0.01, "at": [0, -0.015]},
]


def hold(
    robots: list[tuple[float, float, Any]], contacts: int, goal: str, below: str = "", height: float = SIDE,
    rough: float = 0.3,
) -> rw.Scene:  # fmt: skip
    """Robots at these places, of these shapes, and a box: on a table that is seen from above, on a floor, or
    on two posts."""
    parameters, inputs, bodies = dict[str, Any](), list[str](), dict[str, Any]()
    gravity = GRAVITY if below else 0.0
    for k, (x, y, shape) in enumerate(robots):
        for axis, at in (("x", x), ("y", y)):
            parameters[f"{axis}{k}"] = {"default": at, "range": [-2, 2]}
            inputs.append(f"{axis}{k}")
        servo = {"kind": "servo", "stiffness": 1000, "damping": 20, "limit": 30}
        bodies[f"palm{k}"] = {
            "role": "robot", "shape": shape, "pose": {"x": x, "y": y}, "mass": 0.1,
            "motion": {"kind": "free"}, "force": [0, 0.1 * gravity],
            "coordinates": {axis: {"drive": servo | {"target": f"{axis}{k}"}} for axis in "xy"}
            | {"angle": {"drive": {"kind": "speed", "speed": 0}}},
        }  # fmt: skip
    box: dict[str, Any] = {
        "role": "object", "shape": {"kind": "box", "width": SIDE, "height": height}, "mass": MASS,
        "motion": {"kind": "free"},
    }  # fmt: skip
    if below:
        box["pose"] = {"y": height / 2}
    else:
        box["support"] = {"friction": 0.3, "gravity": GRAVITY}
    bodies["box"] = box
    if below == "floor":
        bodies["floor"] = {"role": "obstacle", "shape": {"kind": "halfplane"}}
    if below == "posts":
        post = {"role": "obstacle", "shape": {"kind": "box", "width": 0.01, "height": 0.05}}
        bodies |= {f"post{k}": post | {"pose": {"x": 0.037 * k, "y": -0.025}} for k in (-1, 1)}
        bodies = {name.replace("-1", "0"): body for name, body in bodies.items()}
    others = [name for name, body in bodies.items() if body["role"] == "obstacle"]
    entries = [{"between": ["palm*", "box"], "friction": 0.5, **STIFF}]
    entries += [{"between": ["box", name], "friction": rough, **STIFF} for name in others]
    entries += [{"between": ["palm*", name], **STIFF} for name in others]
    if len(robots) > 1:
        entries.append({"between": ["palm*", "palm*"], **STIFF})
    fingers = {"palm*": {"speed": 0.1, "clearance": 0.006, "contacts": contacts}}
    return rw.load(
        {
            "name": "hold", "parameters": parameters, "inputs": inputs, "gravity": [0, -gravity],
            "bodies": bodies, "contacts": entries, "goal": goal, "duration": 100, "step": 1e-3,
            "tolerance": 1e-4, "task": {"fingers": fingers, "moves": [1, 4]},
        }
    )  # fmt: skip


def ground_of(scene: rw.Scene) -> tuple[Ground, np.ndarray[Any, Any]]:
    task = task_of(scene)
    return Scene(begin(task, Budget(), 0, None)).grounds["box"], world_of(scene).at(task.parameters).q


@pytest.mark.parametrize("contacts", [1, 2, 4])
def test_a_fork_carries_a_box_by_as_many_contacts_as_it_may_have(contacts: int) -> None:
    """One contact is not below its centre; two hold half of the weight each, or as their levers say."""
    for x in (0.0, 0.01):
        ground, q = ground_of(hold([(0.0, -0.09, FORK)], contacts, "box.y > 1", "posts"))
        q[ground.columns[1]] += 0.03
        q[list(ground.fingers[0].columns)] = x, 0.02
        seen, used = ground.look(q), np.ones(1, np.int64)
        assert len(touching(ground, seen, 0)) == min(contacts, 4)
        pushes = rests(ground, seen, used)
        assert (pushes is not None) == (contacts > 1)
        if pushes is not None:
            assert pushes[ground.fingers[0].columns] == pytest.approx([0.0, MASS * GRAVITY], abs=1e-4)


@pytest.mark.parametrize(("strongest", "carries"), [(1.05, True), (0.95, False)])
def test_what_a_finger_presses_with_is_the_sum_of_its_contacts_however_they_share_it(
    strongest: float, carries: bool
) -> None:
    """One prong of the fork carries seven tenths of the weight."""
    ground, q = ground_of(hold([(0.0, -0.09, FORK)], 2, "box.y > 1", "posts"))
    press = (0.0, strongest * MASS * GRAVITY)
    ground = replace(ground, fingers=tuple(replace(finger, press=press) for finger in ground.fingers))
    q[ground.columns[1]] += 0.03
    q[list(ground.fingers[0].columns)] = 0.01, 0.02
    assert (rests(ground, ground.look(q), np.ones(1, np.int64)) is not None) == carries


def test_a_palm_that_lies_on_a_side_pushes_it_without_turning_it() -> None:
    """Also beside the middle, as far as it has contacts on both sides of it; one contact turns the box."""
    for contacts, turns in ((1, True), (2, False)):
        ground, q = ground_of(hold([(-0.045, 0.012, PALM)], contacts, "box.x > 1"))
        seen, used = ground.look(q), np.ones(1, np.int64)
        found = motion(ground, seen, used, (), np.array([0.1, 0.0, 0.0]), 0.1)
        assert found is not None and found.change[0] > 0.0
        assert (abs(found.change[2]) > 1e-3 * found.change[0]) == turns
        assert is_led(ground, seen, used, ()) == (not turns)


def test_a_palm_that_tips_a_box_keeps_one_contact_and_leaves_the_other() -> None:
    """The lower one: at the other the box would turn into the palm. On a table none of them turns it."""
    ground, q = ground_of(hold([(-0.045, 0.05, PALM)], 2, "box.x > 1", "floor", rough=1.0))
    seen, used = ground.look(q), np.ones(1, np.int64)
    every, *single = grips(ground, seen, used)
    assert every.flat and sorted(every.contacts) == sorted(k for each in single for k in each.contacts)
    turn = np.array([0.04, 0.0, -1.0 * ground.units[2]])
    tips = [motion(ground, seen, used, mode, turn, 0.1) for mode, change in modes(ground, seen, turn)]
    led = {int(found.led[0]) for found in tips if found is not None and found.change[2] < -0.1}
    lower = min(every.contacts, key=lambda k: seen.touches.points[k, 1])
    assert led == {lower}
    ground, q = ground_of(hold([(-0.045, 0.0, PALM)], 2, "box.x > 1"))
    for way in (1.0, -1.0):
        assert motion(ground, ground.look(q), used, (), np.array([0.0, 0.0, way]), 0.1) is None


@pytest.mark.few(1)
@pytest.mark.parametrize(
    ("robots", "contacts", "goal", "below", "height", "seed"),
    [
        ([(0.0, -0.09, FORK)], 4, "box.y >= 0.07", "posts", SIDE / 2, 1),
        ([(-0.1, 0.04, PALM), (0.1, 0.04, PALM)], 2, "box.y >= 0.1 and abs(box.angle) <= 0.1", "floor", 0.06,
         2),
        ([(-0.12, 0.0, PALM)], 2, "hypot(box.x - 0.12, box.y) <= 0.004 and abs(box.angle) <= 0.02", "", SIDE,
         2),
        pytest.param(
            [(-0.12, 0.0, BAR | {"angle": "pi / 2"})], 2, "box.x >= 0.1 and abs(box.angle) <= 0.02", "",
            SIDE, 0, marks=pytest.mark.long,
        ),
    ],
    ids=["fork", "two palms", "palm", "bar"],
)  # fmt: skip
def test_a_plan_with_palms_holds_on_the_richest_rung(
    robots: list[tuple[float, float, Any]], contacts: int, goal: str, below: str, height: float, seed: int
) -> None:  # fmt: skip
    found = rw.plan(hold(robots, contacts, goal, below, height), seed=seed)
    assert found.found, found.reason
    assert found.stage is not None and found.stage.model is rw.DYNAMIC_COMPLIANT
    assert found.replay(tol=0.1 * found.tol).outcome == rw.Outcome.GOAL

"""Arms of hinges in the plane: their joints at places, and places on an outline to which these lead."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest

import rungwise as rw
from rungwise.planning.modes.arm_paths import arms_way
from rungwise.planning.modes.fingers import fingers_of
from rungwise.planning.modes.running.execute import Scene
from rungwise.planning.motion.budget import Budget
from rungwise.planning.search.problem import begin
from rungwise.planning.task.task import task_of

LINKS, THICK = (0.12, 0.1), 0.008


def arm_at_a_box(gravity: float = 0.0, on_joints: bool = False, goal: str = "box.x >= 0.1") -> rw.Scene:
    """An arm of two links beside a box on a table, seen from above; with gravity above a box on a floor. The
    first link is held by a hinge of its own, or by a joint to a post."""
    side = gravity > 0.0
    base, angles = (np.array([0.0, 0.2]), (-2.6, -1.0)) if side else (np.array([-0.1, -0.15]), (1.9, 0.9))
    elbow = base + LINKS[0] * np.array([np.cos(angles[0]), np.sin(angles[0])])
    middles = (
        base + 0.5 * (elbow - base),
        elbow + LINKS[1] / 2 * np.array([np.cos(angles[1]), np.sin(angles[1])]),
    )
    shapes = [{"kind": "capsule", "length": length, "radius": THICK} for length in LINKS]
    links = [
        {
            "role": "robot", "mass": 0.1, "shape": shape, "motion": {"kind": "free"},
            "pose": {"x": float(at[0]), "y": float(at[1]), "angle": angle}, "force": [0, 0.1 * gravity],
        }
        for shape, at, angle in zip(shapes, middles, angles, strict=True)
    ]  # fmt: skip
    drive = {"kind": "servo", "stiffness": 20.0, "damping": 2.0, "limit": 6.0}
    turns = [{"lower": -2.5, "upper": 2.5, "drive": drive | {"target": name}} for name in ("one", "two")]
    hinge: dict[str, Any] = {"kind": "hinge"}
    joints = {"elbow": hinge | {"between": ["upper", "lower"], "at": elbow.tolist(), "coordinate": turns[1]}}
    bodies: dict[str, Any] = {"upper": links[0], "lower": links[1]}
    if on_joints:
        bodies["post"] = {
            "role": "obstacle",
            "shape": {"kind": "point"},
            "pose": {"x": float(base[0]), "y": float(base[1])},
        }
        joints["shoulder"] = hinge | {
            "between": ["upper", "post"],
            "at": base.tolist(),
            "coordinate": turns[0],
        }
        turns[0]["drive"]["target"] = "-one"
    else:
        links[0] |= {"motion": hinge | {"pivot": base.tolist()}, "coordinates": {"angle": turns[0]}}
    bodies["box"] = {
        "role": "object", "mass": 0.3, "shape": {"kind": "box", "width": 0.08, "height": 0.05},
        "pose": {"x": 0.0, "y": 0.025 if side else 0.0}, "motion": {"kind": "free"},
    }  # fmt: skip
    contacts = [{"between": ["lower", "box"], "friction": 0.8}]
    if side:
        bodies["floor"] = {"role": "obstacle", "shape": {"kind": "halfplane"}}
        contacts += [
            {"between": ["box", "floor"], "friction": 0.2},
            {"between": ["lower", "floor"], "friction": 0},
        ]
    else:
        bodies["box"]["support"] = {"friction": 0.3, "load": 3.0, "pressure": {"kind": "uniform"}}
    stiff = {"stiffness": 1e5, "damping": 1e2}
    return rw.load(
        {
            "name": "arm", "parameters": {"one": {"default": 0.0}, "two": {"default": 0.0}},
            "inputs": ["one", "two"], "gravity": [0, -gravity], "bodies": bodies, "joints": joints,
            "contacts": [each | stiff for each in contacts], "goal": goal, "tolerance": 1e-7,
            "duration": 30, "step": 0.005,
            "task": {
                "inputs": {name: {"range": [-2.5, 2.5]} for name in ("one", "two")}, "moves": [1, 6],
                "fingers": {"lower": {"speed": 0.1, "clearance": 0.004, "press": [0.3, 20.0]}},
            },
        }
    )  # fmt: skip


@pytest.mark.few(1)
@pytest.mark.parametrize("on_joints", [False, True])
def test_joints_of_an_arm_are_those_by_which_it_was_posed(on_joints: bool) -> None:
    """Its rates are how its bodies move, and joints hold there."""
    scene = arm_at_a_box(on_joints=on_joints)
    (finger,) = fingers_of(task_of(scene))
    arm, q = finger.arm, rw.simulate(scene, "kinematic", duration=0.01).state.q
    assert arm is not None
    assert np.abs(arm.joints(q)).max() < 1e-9
    rng = np.random.default_rng(0)
    for joints in rng.uniform(-2.0, 2.0, (20, 2)):
        posed = arm.posed(q, joints)
        assert arm.joints(posed) == pytest.approx(joints)
        moved = arm.posed(q, joints + np.array([1e-4, -2e-4]))
        assert arm.rates(posed) @ [1e-4, -2e-4] == pytest.approx((moved - posed)[arm.columns], abs=1e-7)
        named = dict(zip(scene.template.coordinates, posed.tolist(), strict=True))
        run = rw.simulate(scene, "kinematic", state=rw.State.of(scene, q=named), duration=1e-3)
        assert not any("open" in note for note in (run.reason, *run.notes)), run.reason


@pytest.mark.long
def test_an_arm_is_placed_on_an_outline_where_it_reaches() -> None:
    work = begin(task_of(arm_at_a_box()), Budget(None, None), 0, 1)
    ground, q = Scene(work).grounds["box"], work.start.q[0]
    reached = [(part, ground.placed(q, 0, part)) for part in np.linspace(0.02, 0.98, 25).tolist()]
    found = [(part, ground.look(place)) for part, place in reached if place is not None]
    off = [abs(ground.part(seen, 0)[0] - part) * 0.26 for part, seen in found]
    assert sum(each < 2e-3 for each in off) >= 4
    for _, seen in found:
        assert abs(seen.touches.gaps[seen.held[0]]) < ground.closed
        assert ground.fingers[0].reaches(seen.q, ground.around)


def test_ways_of_an_arm_go_around_a_box() -> None:
    work = begin(task_of(arm_at_a_box()), Budget(None, None), 0, 1)
    ground, q = Scene(work).grounds["box"], work.start.q[0]
    finger = ground.fingers[0]
    pair = ground.own[0]

    def is_free(joints: np.ndarray) -> bool:
        return bool(ground.look(finger.put(q, joints)).touches.least[pair] > 0.004)

    draws = np.random.default_rng(0).uniform(-1.5, 1.5, (200, 2))
    straight = np.linspace(0, 1, 50)[:, None]
    barred = [end for end in draws if is_free(end) and not all(is_free(each) for each in straight * end)]
    goal = finger.put(q, min(barred, key=lambda end: float(np.abs(end).sum())))
    way = arms_way(ground, q, goal, np.array([0]), 0, lambda: True)
    assert way is not None and len(way) > 2
    joints = np.array([finger.drives(place) for place in way])
    dense = np.concatenate([a + np.linspace(0, 1, 40)[:, None] * (b - a) for a, b in pairwise(joints)])
    assert all(ground.look(finger.put(q, each)).touches.least[pair] > 0.0 for each in dense)


@pytest.mark.long
@pytest.mark.parametrize(
    ("gravity", "goal"),
    [
        (0.0, "hypot(box.x - 0.05, box.y) <= 0.01 and abs(box.angle) <= 0.3"),
        (9.81, "abs(box.x + 0.05) <= 0.01 and abs(box.angle) <= 0.1"),
    ],
    ids=["pushes on a table", "drags under gravity"],
)
def test_an_arm_is_planned_and_lifted(gravity: float, goal: str) -> None:
    found = rw.plan(arm_at_a_box(gravity, goal=goal), seed=0)
    assert found.found, found.reason
    assert {"touch", "follow"} <= set(found.labels)
    assert found.records[0].stage.startswith("quasistatic-rigid")
    assert found.replay(tol=0.1 * found.tol).outcome == rw.Outcome.GOAL


def test_links_that_carry_a_finger_are_no_surroundings() -> None:
    """They move with it: what touches the object there is in the way, and holds nothing."""
    file = arm_at_a_box().file.model_dump(exclude_unset=True)
    file["contacts"] = [*file["contacts"], {"between": ["upper", "box"]}]
    work = begin(task_of(rw.load(file)), Budget(), 0, 1)
    ground, names = Scene(work).grounds["box"], work.task.scene.template.contacts
    upper = [k for k, pair in enumerate(names) if "upper" in pair and "box" in pair]
    assert upper
    assert set(upper) <= set(ground.avoided.tolist())
    assert not set(upper) & set(ground.pairs.tolist())

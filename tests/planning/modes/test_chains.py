"""Arms of three hinges in the plane that push: more joints than a touch asks for, past posts and in turns."""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np
import pytest

import rungwise as rw
from rungwise.planning.modes.joints.inverse_kinematics import to_posture
from rungwise.planning.modes.running.execute import Scene
from rungwise.planning.motion.budget import Budget
from rungwise.planning.search.problem import begin
from rungwise.planning.task.task import task_of

STIFF = {"stiffness": 1e5, "damping": 1e2}
LINKS, THICK, LEAST = (0.12, 0.1, 0.09), 0.007, 2.6
BOX, PUSHED = (0.08, 0.05), "hypot(box.x - 0.05, box.y) <= 0.01"


def arm(side: str, base: tuple[float, float], angles: tuple[float, ...], within: float) -> dict[str, Any]:
    """Links from a base on, at these angles to the axis of x, with servos in their hinges: bodies, joints and
    inputs of a scene."""
    bodies, joints, at = dict[str, Any](), dict[str, Any](), np.array(base)
    drive = {"kind": "servo", "stiffness": 20.0, "damping": 2.0, "limit": 6.0}
    for k, (length, angle) in enumerate(zip(LINKS, angles, strict=False)):
        way = length * np.array([np.cos(angle), np.sin(angle)])
        turn = {"lower": -within, "upper": within, "drive": drive | {"target": f"{side}{k}"}}
        link = bodies[f"{side}_link{k}"] = {
            "role": "robot", "mass": 0.1, "motion": {"kind": "free"},
            "shape": {"kind": "capsule", "length": length, "radius": THICK},
            "pose": {"x": float((at + way / 2)[0]), "y": float((at + way / 2)[1]), "angle": angle},
        }  # fmt: skip
        if k == 0:
            link |= {"motion": {"kind": "hinge", "pivot": at.tolist()}, "coordinates": {"angle": turn}}
        else:
            joints[f"{side}_joint{k}"] = {
                "kind": "hinge", "between": [f"{side}_link{k - 1}", f"{side}_link{k}"], "at": at.tolist(),
                "coordinate": turn,
            }  # fmt: skip
        at = at + way
    return {"bodies": bodies, "joints": joints, "inputs": [f"{side}{k}" for k in range(len(angles))]}


def pushing(
    arms: int = 1, goal: str = PUSHED, posts: tuple[tuple[float, float], ...] = (),
    within: float = LEAST, shape: dict[str, Any] | None = None, room: dict[str, Any] | None = None,
) -> rw.Scene:  # fmt: skip
    """One arm, or two, of three links beside a box on a table, and posts."""
    made = [arm("left", (-0.16, -0.12), (2.2, 1.2, 0.2), within)]
    if arms > 1:
        made.append(arm("right", (0.16, -0.12), (np.pi - 2.2, np.pi - 1.2, np.pi - 0.2), within))
    led = {"speed": 0.1, "clearance": 0.004, "press": [0.3, 20.0]}
    tips = [f"{side}_link2" for side in ("left", "right")[:arms]]
    bodies = {name: body for each in made for name, body in each["bodies"].items()}
    links = list(bodies)
    inputs = [name for each in made for name in each["inputs"]]
    bodies["box"] = {
        "role": "object", "mass": 0.3, "shape": shape or {"kind": "box", "width": BOX[0], "height": BOX[1]},
        "pose": {"x": 0.0, "y": 0.0}, "motion": {"kind": "free"},
        "support": {"friction": 0.3, "load": 3.0, "pressure": {"kind": "uniform"}},
    }  # fmt: skip
    contacts: list[dict[str, Any]] = [
        {"between": [name, "box"], "friction": 0.6 if name in tips else 0.2} for name in links
    ]
    for k, (x, y) in enumerate(posts):
        bodies[f"post{k}"] = {
            "role": "obstacle", "shape": {"kind": "disc", "radius": 0.01}, "pose": {"x": x, "y": y}
        }  # fmt: skip
        contacts += [{"between": [name, f"post{k}"], "friction": 0.2} for name in (*links, "box")]
    if arms > 1:
        left, right = (list(each["bodies"]) for each in made)
        contacts += [{"between": list(pair), "friction": 0.0} for pair in product(left[1:], right[1:])]
    return rw.load(
        {
            "name": "chain", "parameters": {name: {"default": 0.0} for name in inputs}, "inputs": inputs,
            "bodies": bodies, "joints": {name: own for each in made for name, own in each["joints"].items()},
            "contacts": [each | STIFF for each in contacts], "goal": goal, "tolerance": 1e-7,
            "duration": 60, "step": 0.005,
            "task": {
                "inputs": {name: {"range": [-within, within]} for name in inputs}, "moves": [1, 8],
                "fingers": {"*_link2": led | ({"within": room} if room else {})},
            },
        }
    )  # fmt: skip


TASKS = {
    "pushes": pushing(),
    "turns": pushing(goal="hypot(box.x - 0.03, box.y - 0.02) <= 0.01 and abs(box.angle - 0.6) <= 0.2"),
    "narrow ranges": pushing(within=1.2),
    "past posts": pushing(
        goal="hypot(box.x - 0.04, box.y - 0.03) <= 0.012", posts=((0.1, 0.0), (-0.06, 0.06))
    ),
    "in a workspace": pushing(goal="hypot(box.x - 0.04, box.y + 0.01) <= 0.01", room={"y": [-0.06, 0.08]}),
    "two arms": pushing(arms=2, goal="hypot(box.x - 0.03, box.y - 0.03) <= 0.01 and abs(box.angle) <= 0.2"),
    "two arms turn": pushing(arms=2, goal="hypot(box.x, box.y) <= 0.01 and abs(box.angle - 0.8) <= 0.15"),
    "a disc turns": pushing(
        arms=2, goal="hypot(box.x, box.y) <= 0.01 and abs(box.angle - 0.35) <= 0.08",
        shape={"kind": "disc", "radius": 0.045},
    ),
}  # fmt: skip


@pytest.mark.few(1)
@pytest.mark.parametrize("name", list(TASKS))
def test_chains_of_three_are_planned_and_lifted(name: str) -> None:
    found = rw.plan(TASKS[name], seed=0)
    assert found.found, found.reason
    for rung in (rw.QUASISTATIC_RIGID, rw.DYNAMIC_COMPLIANT):
        assert found.replay(rung, tol=0.1 * found.tol).outcome == rw.Outcome.GOAL


def test_a_chain_moves_near_its_posture_without_moving_what_it_touches() -> None:
    """Where it has more joints than the touch takes; one that has not does not move."""
    work = begin(task_of(TASKS["pushes"]), Budget(None, None), 0, 1)
    ground, q = Scene(work).grounds["box"], work.start.q[0]
    arm = ground.fingers[0].arm
    assert arm is not None and arm.posture is not None
    away = arm.posed(q, np.array([0.5, -0.8, 0.4]))
    slope = np.random.default_rng(0).normal(size=(2, 3))
    change = to_posture(arm, away, slope, arm.posture)
    assert np.abs(slope @ change).max() < 1e-4 * np.abs(slope).max()
    assert change @ (arm.posture - arm.joints(away)) > 0.0
    assert not to_posture(arm, away, np.eye(3), arm.posture).any()


def test_a_chain_touches_where_it_is_to_and_stays_near_its_posture() -> None:
    """Not on the far side of the box, where a place is in reach."""
    work = begin(task_of(TASKS["pushes"]), Budget(None, None), 0, 1)
    ground, q = Scene(work).grounds["box"], work.start.q[0]
    finger = ground.fingers[0]
    assert finger.arm is not None
    for part in (0.6, 0.65, 0.7, 0.85, 0.9, 0.95):
        place = ground.placed(q, 0, part)
        assert place is not None
        seen = ground.look(place)
        assert abs(ground.part(seen, 0)[0] - part) < 0.02
        assert abs(seen.touches.gaps[seen.held[0]]) < ground.closed
        assert seen.touches.least[ground.avoided].min() >= ground.apart  # no link in the box
        assert np.abs(finger.arm.joints(place)).max() < 1.2

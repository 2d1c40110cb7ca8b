"""Fingers that pass over objects: how they are led there, and what plans they make."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rungwise as rw
from rungwise.planning.motion.moves import Moves
from rungwise.planning.motion.transit import Transit, over_objects
from rungwise.planning.task.fingers import fingers_of, taken
from rungwise.planning.task.task import task_of
from rungwise.world.carriers import TaskError
from rungwise.world.find import world_of

SIDE, RADIUS, FAR = 0.08, 0.006, 0.12
WALLS = (0.03, 1.0, 0.06)
"""Thickness, length and distance from the middle of the walls of a lane."""
FRAME = [
    {"kind": "box", "width": 0.08, "height": 0.01, "at": [0, 0.035]},
    {"kind": "box", "width": 0.08, "height": 0.01, "at": [0, -0.035]},
    {"kind": "box", "width": 0.01, "height": 0.06, "at": [-0.035, 0]},
    {"kind": "box", "width": 0.01, "height": 0.06, "at": [0.035, 0]},
]
BOX: dict[str, Any] = {"kind": "box", "width": SIDE, "height": SIDE}
STIFF = {"stiffness": 1e5, "damping": 100.0}


def lane(
    count: int = 1, servo: bool = True, shape: Any = BOX, walls: bool = True, goal: str = "box.x <= -0.1",
    **finger: Any,
) -> rw.Scene:  # fmt: skip
    """A box on a table, in a lane where fingers do not pass beside it; the first is to the left of it, others
    are to the right. It is to go to the left."""
    parameters, inputs, bodies = dict[str, Any](), list[str](), dict[str, Any]()
    for k in range(1, count + 1):
        place = {"x": -FAR if k == 1 else FAR, "y": 0.0}
        for axis, at in place.items():
            parameters[f"{axis}{k}"] = {"default": at if servo else 0.0, "range": [-2, 2]}
            inputs.append(f"{axis}{k}")
        own = {"kind": "servo", "stiffness": 500, "damping": 15, "limit": 20} if servo else {"kind": "speed"}
        name = "target" if servo else "speed"
        bodies[f"finger{k}"] = {
            "role": "robot", "shape": {"kind": "disc", "radius": RADIUS}, "pose": place, "mass": 0.1,
            "motion": {"kind": "free"},
            "coordinates": {axis: {"drive": {**own, name: f"{axis}{k}"}} for axis in "xy"}
            | {"angle": {"drive": {"kind": "speed", "speed": 0}}},
        }  # fmt: skip
    bodies["box"] = {
        "role": "object", "shape": shape, "motion": {"kind": "free"}, "mass": 0.5,
        "support": {"friction": 0.3, "gravity": 9.81},
    }  # fmt: skip
    for name, side in (("low", -1), ("high", 1)) if walls else ():
        thick, long, off = WALLS
        bodies[name] = {
            "role": "obstacle", "shape": {"kind": "box", "width": long, "height": thick},
            "pose": {"y": side * off},
        }  # fmt: skip
    contacts = [{"between": ["finger*", "box"], "friction": 0.5, **STIFF}]
    if walls:
        contacts += [{"between": ["box", wall], "friction": 0.2, **STIFF} for wall in ("low", "high")]
        contacts += [{"between": ["finger*", wall], **STIFF} for wall in ("low", "high")]
    if count > 1:
        contacts.append({"between": ["finger*", "finger*"], **STIFF})
    task = {
        "fingers": {"finger*": {"speed": 0.1, "clearance": RADIUS, "over": True} | finger},
        "moves": [1, 4], "weights": {"box.x": 1, "box.y": 1, "box.angle": 0.05},
    }  # fmt: skip
    return rw.load(
        {
            "name": "lane", "parameters": parameters, "inputs": inputs, "bodies": bodies,
            "contacts": contacts,
            "goal": goal, "duration": 100, "step": 1e-3, "tolerance": 1e-4, "task": task,
        }
    )  # fmt: skip


@pytest.mark.parametrize(
    ("scene", "seed"),
    [
        (lane(), 1),
        pytest.param(lane(servo=False), 1, marks=pytest.mark.long),
        pytest.param(lane(count=2), 1, marks=pytest.mark.long),
        pytest.param(
            lane(shape=FRAME, walls=False, goal="box.x <= -0.1 and abs(box.y) <= 0.02"), 1,
            marks=pytest.mark.long,
        ),
    ],
    ids=["servo", "speeds", "two fingers", "inside a frame"],
)  # fmt: skip
def test_a_finger_passes_over_the_box_and_pushes_it_from_behind(
    scene: rw.Scene, seed: int, tmp_path: Path
) -> None:
    """The plan holds on compliant rungs, from a file, too, and the finger keeps its clearance while it
    is raised: nearly, for the box may still creep after it where it left it."""
    found = rw.plan(scene, seed=seed, schedule=["quasistatic-rigid", "dynamic-compliant"])
    assert found.found, found.reason
    assert {"lift", "lower"} <= set(found.labels)
    assert found.stage is not None and found.stage.model is rw.DYNAMIC_COMPLIANT
    found.save(tmp_path / "plan.json")
    again = rw.load_plan(tmp_path / "plan.json")
    for model in ("quasistatic-compliant", "dynamic-compliant"):
        run = again.replay(model)
        assert run.outcome == rw.Outcome.GOAL, run.reason
        data = run.trajectory
        raised = (data["raised"] > 0.0).any("body").to_numpy()
        assert raised.any() and not raised.all()
        lifted = data["raised"].sel(body="finger1").to_numpy() > 0.0
        assert (data["gap"].sel(contact="finger1|box").to_numpy()[lifted] >= 0.9 * RADIUS).all()


def test_a_raised_finger_goes_straight_where_one_in_the_plane_finds_no_way() -> None:
    scene = lane()
    task = task_of(scene)
    question, start = Moves(task).question, world_of(scene).at(task.parameters).q
    behind = start.copy()
    behind[scene.template.coordinates.index("finger1.x")] = FAR
    assert not Transit(task, question, {}).goes_straight(start, behind)
    over = Transit(task, question, {}, ["finger1"])
    assert over.goes_straight(start, behind)
    way = over.way(start, behind, 0)
    assert way is not None and np.array_equal(way, [start, behind])
    through = behind.copy()
    through[scene.template.coordinates.index("finger1.y")] = 0.2
    assert not over.goes_straight(start, through)
    kept = [scene.template.contacts[k] for k in over_objects(task, ["finger1"])]
    assert kept == [("finger1", "box")]


def test_over_makes_an_input_that_raises_the_finger_and_that_searches_leave_alone() -> None:
    scene = lane(count=2)
    assert scene.template.inputs[-2:] == ("finger1_raised", "finger2_raised")
    assert rw.load(scene.file.model_dump(exclude_unset=True)).stored == scene.stored
    task = task_of(scene)
    assert task.lifting == {4, 5} and not len(task.free)
    assert [finger.lift for finger in fingers_of(task)] == [(4, RADIUS), (5, RADIUS)]
    assert not taken(task).notes


def test_a_scene_may_say_itself_what_raises_a_finger() -> None:
    def told(raised: Any, default: float = 0.0) -> rw.Scene:
        data = lane().file.model_dump(exclude_unset=True)
        data["parameters"]["lift"] = data["parameters"].pop("finger1_raised") | {"default": default}
        data["inputs"] = [*data["inputs"][:-1], *(["lift"] if raised != 0.1 else [])]
        data["bodies"]["finger1"]["raised"] = raised
        return rw.load(data)

    (finger,) = fingers_of(task_of(told("lift")))
    assert finger.lift == (2, RADIUS)
    for raised, default in ((0.1, 0.0), ("2 * lift", 0.0), ("lift", 0.5)):
        with pytest.raises(TaskError, match=r"over: bodies\.finger1\.raised must be an input of its own"):
            fingers_of(task_of(told(raised, default)))
    data = lane().file.model_dump(exclude_unset=True)
    del data["bodies"]["finger1"]["raised"]
    with pytest.raises(rw.SceneError, match="finger1_raised cannot, for it is a parameter"):
        rw.load(data)

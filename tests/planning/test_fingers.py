"""What a planner by contact modes takes for fingers, and what it is told of each."""

from __future__ import annotations

import copy
import json
import re
from typing import Any

import numpy as np
import pytest

import rungwise as rw
from rungwise.planning.motion.moves import Moves
from rungwise.planning.motion.propagate import Places
from rungwise.planning.task.fingers import Finger, fingers_of, taken
from rungwise.planning.task.task import task_of
from rungwise.world.carriers import TaskError
from rungwise.world.find import world_of

SERVO = {"kind": "servo", "stiffness": "k", "damping": "2 * sqrt(k * mass)", "limit": "most"}
ONE_LINE = re.compile(r"^[^\n]+$")
FINGER = {"speed": "v", "clearance": "0.5 * radius"}


def lifter(servo: bool = True, **task: Any) -> dict[str, Any]:
    """Two fingers, on servos or at given speeds, beside a block on a floor, which gravity holds there."""
    inputs, bodies = [], {}
    for n, x in ((1, -0.1), (2, 0.1)):
        names = [f"x{n}", f"y{n}"]
        inputs += names
        drives = [
            SERVO | {"target": name} if servo else {"kind": "speed", "speed": f"v * {name}"} for name in names
        ]
        bodies[f"finger{n}"] = {
            "role": "robot", "mass": "mass", "shape": {"kind": "disc", "radius": "radius"},
            "pose": {"x": x, "y": 0.05}, "motion": {"kind": "free"},
            "coordinates": dict(zip("xy", ({"drive": each} for each in drives), strict=True)),
        }  # fmt: skip
    parameters = {"v": 0.1, "k": 1e3, "mass": 0.1, "most": 20.0, "radius": 0.01} | dict.fromkeys(inputs, 0.0)
    return {
        "name": "lifter", "parameters": {name: {"default": value} for name, value in parameters.items()},
        "inputs": inputs, "gravity": [0, -10],
        "bodies": bodies | {
            "block": {
                "role": "object", "mass": 0.5, "shape": {"kind": "box", "width": 0.1, "height": 0.1},
                "pose": {"y": 0.05}, "motion": {"kind": "free"},
            },
            "floor": {"role": "obstacle", "shape": {"kind": "halfplane"}},
        },
        "contacts": [{"between": ["block", "*"], "friction": 0.5}, {"between": ["finger*", "floor"]}],
        "goal": "block.y >= 0.1", "tolerance": 1e-7,
        "task": {"inputs": {name: {"range": [-1, 1]} for name in inputs}, **task},
    }  # fmt: skip


def found(scene: dict[str, Any] | str, **parameters: float) -> tuple[Finger, ...]:
    return fingers_of(task_of(rw.load(scene), parameters))


def test_numbers_follow_parameters_and_patterns_hold_in_order() -> None:
    entry = FINGER | {
        "press": [0.05, "0.1 * most"], "within": {"x": [-0.5, "50 * radius"]}, "contacts": 2, "reserve": 0.3,
        "objects": "blo*", "over": True,
    }  # fmt: skip
    first, second = found(lifter(fingers={"*2": FINGER, "finger*": entry}), v=0.2)
    assert (first.name, first.inputs, first.objects) == ("finger1", ("x1", "y1"), ("block",))
    assert (first.speed, first.clearance) == (0.2, 0.005)
    assert first.press == (0.05, 2.0)
    assert first.within.tolist() == [[-0.5, -1.0], [0.5, 1.0]]  # y as far as the inputs lead it
    assert (first.contacts, first.reserve, first.over, first.is_rigid) == (2, 0.3, True, False)
    assert first.driven.servos.stiffness.tolist() == [1e3, 1e3]
    assert first.driven.servos.limit.tolist() == [20.0, 20.0]
    assert (second.contacts, second.reserve, second.over) == (1, 0.1, False)


def test_forces_not_given_are_those_of_the_load() -> None:
    """The block weighs 5: a twentieth of that, and twenty times as much, or what the servos are able to."""
    (finger, _), (weak, _) = (found(lifter(fingers={"*": FINGER}), most=most) for most in (200.0, 20.0))
    assert finger.press == pytest.approx((0.25, 100.0))
    assert weak.press == pytest.approx((0.25, 20.0))


@pytest.mark.parametrize("unit", [1e-3, 1e3])
def test_what_is_not_given_scales_with_the_unit_of_length(unit: float) -> None:
    plain, scaled = (_shared_hand(length) for length in (1.0, unit))
    for one, other in zip(found(plain), found(scaled), strict=True):
        assert other.speed == pytest.approx(one.speed * unit)
        assert other.clearance == pytest.approx(one.clearance * unit)
        assert other.press == pytest.approx(
            tuple(np.array(one.press) * unit)
        )  # forces are masses times these


def test_transit_gives_fingers_with_default_values() -> None:
    rod, *others = found("push")
    assert not others
    assert (rod.name, rod.inputs, rod.objects, rod.speed) == ("rod", ("ux", "uy"), ("box",), 0.02)
    assert rod.press is None
    assert rod.is_rigid
    assert np.isinf(rod.within).all()


def test_both_kinds_of_move_in_one_task() -> None:
    transit = {"finger1": {"speed": "2 * v", "clearance": 0.002, "push": [0.01, 0.1]}}
    first, second = found(lifter(transit=transit, fingers={"finger2": FINGER}))
    assert (first.speed, first.clearance) == (0.2, 0.002)
    assert (second.speed, second.clearance) == (0.1, 0.005)


def test_a_task_that_leads_none_has_fingers_as_fast_as_inputs_may_change() -> None:
    scene = lifter()
    for bounds in scene["task"]["inputs"].values():
        bounds["rate"] = 0.3
    for finger in found(scene):
        assert finger.speed == pytest.approx(0.3)
        assert finger.clearance == pytest.approx(min(0.5 * 0.01, 0.05 * 0.05 * np.sqrt(2.0)))


def test_rigid_fingers_at_what_gravity_holds_are_told() -> None:
    told = taken(task_of(rw.load(lifter(servo=False, fingers={"*": FINGER})))).notes
    assert len(told) == 2
    assert all("gravity presses block on floor" in note and "servos with a limit" in note for note in told)
    assert not taken(task_of(rw.load(lifter(fingers={"*": FINGER})))).notes
    assert not taken(task_of(rw.load("push"))).notes


def test_an_arm_that_is_to_touch_at_several_places_is_told_before_and_refused() -> None:
    """`check` still lists it."""
    data = rw.load("planar_hand").file.model_dump(mode="json", exclude_unset=True)
    for finger in data["task"]["fingers"].values():
        finger["contacts"] = 2
    scene = rw.load(data)
    told = taken(task_of(scene)).notes
    assert len(told) == len(fingers_of(task_of(scene))) == 2
    assert all("may touch objects at 2 places, and joints that turn it lead it" in note for note in told)
    with pytest.raises(rw.TaskError, match=r"task\.fingers: .*at 2 places.*leave contacts out"):
        rw.plan(scene)


def _shared_hand(length: float = 1.0) -> dict[str, Any]:
    """Two links, the second held by the first, and a ball; all lengths times `length`."""
    upper, lower = (
        {
            "role": "robot", "mass": 1,
            "shape": {"kind": "capsule", "length": 0.2 * length, "radius": 0.02 * length},
            "pose": {"x": x * length, "angle": 0.3}, "motion": {"kind": "free"},
        }
        for x in (0.1, 0.3)
    )  # fmt: skip
    servo = {"kind": "servo", "stiffness": 5.0 * length**2, "damping": length**2}
    return {
        "name": "hand", "parameters": {name: {"default": 0.0, "range": [-2, 2]} for name in ("a", "b")},
        "inputs": ["a", "b"],
        "bodies": {
            "post": {"role": "obstacle", "shape": {"kind": "point"}}, "upper": upper, "lower": lower,
            "ball": {
                "role": "object", "mass": 1, "shape": {"kind": "disc", "radius": 0.1 * length},
                "pose": {"x": 0.3 * length, "y": 0.5 * length}, "motion": {"kind": "free"},
            },
        },
        "joints": {
            "shoulder": {
                "kind": "hinge", "between": ["post", "upper"], "at": [0, 0],
                "coordinate": {"lower": -1, "upper": 2, "drive": servo | {"target": "a"}},
            },
            "elbow": {  # named from the far end: its angle is the upper link's in the frame of the lower one
                "kind": "hinge", "between": ["lower", "upper"], "at": [0.2 * length, 0.02 * length],
                "coordinate": {"lower": -0.5, "upper": 1.5, "drive": servo | {"target": "2 * b - a"}},
            },
        },
        "contacts": [{"between": ["*", "ball"], "friction": 0.5}],
        "goal": f"ball.x >= {length}", "tolerance": 1e-7 * length, "duration": 100.0,
        "task": {"inputs": {name: {"range": [-2, 2], "rate": 0.5} for name in ("a", "b")}},
    }  # fmt: skip


def test_an_arm_is_a_finger_by_its_joints() -> None:
    scene = rw.load(_shared_hand())
    (finger,) = (each for each in fingers_of(task_of(scene)) if each.name == "lower")
    assert finger.is_arm
    assert finger.inputs == ("a", "b")
    own = finger.driven
    assert [link.name for link in own.links] == ["shoulder", "elbow"]
    assert [(link.lower, link.upper) for link in own.links] == [(-1.0, 2.0), (-1.5, 0.5)]
    joints = np.array([[0.4, -0.3]])
    level = own.levels(joints, joints)
    assert level.tolist() == [[0.4, pytest.approx(0.5 * (0.3 + 0.4))]]
    turned = rw.Segment(dict(zip("ab", level[0].tolist(), strict=True)), 20.0)
    run = rw.simulate(scene, rw.QUASISTATIC_RIGID, inputs=[turned], tol=1e-6)
    ends = run.final["lower"]
    assert own.poses(joints)[0].tolist() == pytest.approx([ends["x"], ends["y"], ends["angle"]], abs=1e-5)
    assert own.poses(np.zeros((1, 2)))[0].tolist() == [0.3, 0.0, 0.3]


def test_robots_that_are_no_fingers_say_why() -> None:
    """A planner's fingers have two numbers of their own at least."""
    assert "finger1.x1 alone moves it" in taken(task_of(rw.load("two_finger"))).others["finger1"]
    hand = taken(task_of(rw.load(_shared_hand()))).others
    assert hand == {"upper": "one joint, shoulder, holds upper; an arm needs two at least"}
    scene = lifter(fingers={"finger1": FINGER})
    assert taken(task_of(rw.load(scene))).others == {"finger2": "no pattern of task.fingers fits it"}
    scene = lifter()
    scene["contacts"] = [{"between": ["block", "floor"]}, {"between": ["finger1", "block"]}]
    assert "touches no object" in taken(task_of(rw.load(scene))).others["finger2"]
    pytest.importorskip("mujoco")
    lift = taken(task_of(rw.load("three_finger_lift")))
    assert not lift.fingers
    assert "the input squeeze leads" in lift.others["finger0"]


WRONG: tuple[tuple[dict[str, Any], str], ...] = (
    ({"thumb": FINGER}, "task.fingers: 'thumb' names no free robot; valid: finger1, finger2, or *"),
    ({"*": FINGER | {"objects": ["block", "box"]}}, "task.fingers.*.objects.1: 'box' names no object"),
    ({"*": FINGER | {"within": {"z": [0, 1]}}}, "task.fingers.*.within: unknown axis 'z'; valid: x, y"),
    ({"*": FINGER | {"within": {"x": [1, 0]}}}, "task.fingers.*.within.x: the least, 1, is above"),
    ({"*": FINGER | {"within": {"x": [3, 4]}}}, "task.fingers.*.within.x: 3 to 4 is out of reach"),
    ({"*": FINGER | {"press": [2, 1]}}, "task.fingers.*.press: the least, 2, is above the greatest, 1"),
    ({"*": FINGER | {"press": [-1, 1]}}, "task.fingers.*.press.0: "),
    ({"*": FINGER | {"press": [0, 0]}}, "task.fingers.*.press.1: "),
    ({"*": FINGER | {"press": [30, 40]}}, "task.fingers.*.press: servos push finger1 with at most 20"),
    ({"*": FINGER | {"contacts": 1.5}}, "task.fingers.*.contacts: must be a whole number, not 1.5"),
    ({"*": FINGER | {"contacts": 0}}, "task.fingers.*.contacts: "),
    ({"*": FINGER | {"reserve": 1}}, "task.fingers.*.reserve: "),
    ({"*": FINGER | {"speed": 0}}, "task.fingers.*.speed: "),
    ({"*": FINGER | {"over": 1}}, "task.fingers.*.over: must be true or false, not 1"),
    ({"*": {"speed": 1}}, "task.fingers.*.clearance: is required"),
    ({"*": FINGER | {"pres": [1, 2]}}, "task.fingers.*: unknown field 'pres'"),
)


@pytest.mark.parametrize(("fingers", "words"), WRONG)
def test_each_mistake_is_one_line(fingers: dict[str, Any], words: str) -> None:
    with pytest.raises(rw.InputError, match=ONE_LINE) as caught:
        found(lifter(fingers=fingers))
    assert str(caught.value).startswith(words)


def test_fingers_need_drives_of_their_own() -> None:
    def refusal(scene: dict[str, Any]) -> str:
        with pytest.raises(TaskError, match=ONE_LINE) as caught:
            found(scene)
        return str(caught.value)

    speeds = lifter(servo=False, fingers={"*": FINGER | {"press": [1, 2]}})
    assert refusal(speeds).startswith("task.fingers.*.press: finger1 moves at given speeds")
    bare, timed, shared = (lifter(fingers={"*": FINGER}) for _ in range(3))
    turned = {"drive": {"kind": "speed", "speed": "y2"}}
    bare["bodies"]["finger2"]["coordinates"] |= {"y": {}, "angle": turned}
    timed["bodies"]["finger2"]["coordinates"]["y"]["drive"]["target"] = "y2 * (1 + t)"
    for scene in (bare, timed):
        assert "task.fingers.*: needs two inputs that drive the speeds of finger2.x" in refusal(scene)
    shared["bodies"]["finger2"]["coordinates"]["y"]["drive"]["target"] = "y1"
    shared["bodies"]["finger2"]["coordinates"]["angle"] = turned
    assert refusal(shared) == "task.fingers.*: the input y1 leads finger1 and finger2"
    apart = lifter(fingers={"*": FINGER})
    apart["contacts"] = [{"between": ["finger1", "block"]}, {"between": ["block", "floor"]}]
    assert refusal(apart).startswith("task.fingers.*: finger2 touches no object")


@pytest.mark.long
def test_a_finger_is_led_through_free_space_as_if_transit_named_it() -> None:
    """A plan of `push` whose rod is a finger alone."""
    file = json.loads(rw.load("push").stored)
    (entry,) = file["task"].pop("transit").values()
    file["task"]["fingers"] = {"r*": {name: entry[name] for name in ("speed", "clearance")}}
    scene = rw.load(file)
    (carrier,) = task_of(scene).carriers
    assert (carrier.body, carrier.speed, carrier.clearance) == ("rod", 0.02, 0.003)
    plan = rw.plan(scene, task_seed=1003, schedule=[("quasistatic-rigid", 1e-3)])
    assert plan.found, plan.reason
    assert "push" in plan.labels
    assert plan.replay().ok


def test_pushes_keep_to_where_fingers_may_be() -> None:
    """Moves that are drawn begin and end within the bounds that the task states; others begin anywhere."""
    file = json.loads(rw.load("push").stored)
    (entry,) = file["task"]["transit"].values()
    finger = {name: entry[name] for name in ("speed", "clearance")}
    rng = np.random.default_rng(0)
    for within in ({}, {"within": {"x": [-0.3, 0.02], "y": [-0.1, 0.12]}}):
        file["task"]["fingers"] = {"rod": finger | within}
        task = task_of(rw.load(file))
        moves, columns = Moves(task), list(task.carriers[0].places)
        start = world_of(task.scene).at(task.parameters).q
        m = 300
        places = Places(
            np.repeat(start[None], m, 0), np.zeros((m, len(start))), np.zeros(m), np.zeros((0, 1))
        )
        begun, fits = moves.begin(rng.random((m, moves.size)), places)
        assert fits.any() and (fits.sum() < m) == bool(within)
        assert (begun.q[fits][:, columns] <= [0.02, 0.12]).all() == bool(within)
        low, high = moves.transit.bounds(task.carriers[0])
        assert np.isfinite([low, high]).all() == bool(within)


def test_a_search_refuses_what_cannot_be_a_finger() -> None:
    with pytest.raises(TaskError, match="finger1 moves at given speeds"):
        rw.plan(lifter(servo=False, fingers={"*": FINGER | {"press": [1, 2]}}), budget=10)


def test_looking_at_drives_leaves_the_scene_as_it_was() -> None:
    scene = rw.load(lifter(fingers={"*": FINGER}))
    here = world_of(scene).at()
    before = copy.deepcopy(here.bound.buffer)  # type: ignore[attr-defined]
    here.driven("finger1", "")
    assert np.array_equal(here.bound.buffer, before)  # type: ignore[attr-defined]


def test_fingers_go_through_files() -> None:
    scene = rw.load(lifter(fingers={"finger*": FINGER | {"objects": "block", "over": True}}))
    again = rw.load(json.loads(scene.stored))
    assert [each.over for each in fingers_of(task_of(again))] == [True, True]

"""Goals that ask where a robot's own body is: a peg in a hole, a tip on a button, a pose in the air."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
import yaml

import rungwise as rw
from rungwise.kernel import Reals
from rungwise.planning.modes.reach import arm as arms
from rungwise.planning.modes.reach import moves, places, planner
from rungwise.planning.modes.reach.arm import Arm, arm_of
from rungwise.planning.modes.reach.places import Room
from rungwise.planning.modes.reach.planner import has_room, reach_in
from rungwise.planning.motion.budget import Budget
from rungwise.planning.search.problem import begin
from rungwise.planning.task.task import task_of

MODEL = """
<mujoco model="gantry">
  <compiler angle="radian"/>
  <worldbody>
    <body name="plate" pos="0.2 0 0">
      <geom type="box" pos="-0.0305 0 -0.02" size="0.02 0.05 0.02"/>
      <geom type="box" pos="0.0305 0 -0.02" size="0.02 0.05 0.02"/>
      <geom type="box" pos="0 -0.0305 -0.02" size="0.0105 0.02 0.02"/>
      <geom type="box" pos="0 0.0305 -0.02" size="0.0105 0.02 0.02"/>
    </body>
    <body name="wall" pos="0.1 0 0.03"><geom type="box" size="0.005 0.05 0.06"/></body>
    <body name="lamp" pos="0 0.2 0"><geom type="sphere" size="0.02"/></body>
    <body>
      <joint name="x" type="slide" axis="1 0 0" range="-0.3 0.4"/>
      <inertial pos="0 0 0" mass="0.1" diaginertia="1 1 1"/>
      <body>
        <joint name="y" type="slide" axis="0 1 0" range="-0.4 0.4"/>
        <inertial pos="0 0 0" mass="0.1" diaginertia="1 1 1"/>
        <body>
          <joint name="z" type="slide" axis="0 0 1" range="-0.1 0.4"/>
          <inertial pos="0 0 0" mass="0.1" diaginertia="1 1 1"/>
          <body name="peg">
            <joint name="turn" axis="0 0 1" range="-3 3"/>
            <geom type="box" pos="0 0 0.03" size="0.01 0.01 0.03" mass="0.1"/>
          </body>
        </body>
      </body>
    </body>
  </worldbody>
</mujoco>
"""
HOLE = "-0.02 <= at(peg, z, plate) <= -0.01 and hypot(at(peg, x, plate), at(peg, y, plate)) <= 0.003"


@pytest.fixture
def gantry(tmp_path: Any) -> Any:
    """A scene of this model with a goal."""
    (tmp_path / "gantry.xml").write_text(MODEL, "utf-8")

    def scene(goal: str, turn: float = 0.0, rate: float | None = 0.5) -> rw.SpaceScene:
        servo = {"stiffness": 2000, "damping": 60, "force": 100}
        content = {
            "name": "gantry",
            "parameters": {
                **{f"{axis}_to": {"default": 0.1 * (axis == "z"), "range": [-0.5, 0.5]} for axis in "xyz"},
                "turn_to": {"default": turn, "range": [-3.0, 3.0]},
            },
            "inputs": ["x_to", "y_to", "z_to", "turn_to"],
            "model": {
                "file": "gantry.xml",
                "servos": dict.fromkeys("xyz", servo)
                | {"turn": {"stiffness": 100, "damping": 4, "force": 10}},
            },
            "controls": {"x": "x_to", "y": "y_to", "z": "z_to", "turn": "turn_to"},
            "start": {"places": {"body6.z": "z_to", "peg.turn": "turn_to"}},
            "contacts": [{"friction": 0.2, "stiffness": 1e5, "damping": 100}],
            "goal": goal, "duration": 4, "step": 2e-3,
            "task": {} if rate is None else {"inputs": {"*": {"rate": rate}}},
        }  # fmt: skip
        path = tmp_path / "gantry.yaml"
        path.write_text(yaml.safe_dump(content), "utf-8")
        return rw.load(path)

    return scene


def room_of(scene: Any, parameters: dict[str, float] | None = None) -> tuple[Arm, Room, Reals]:
    task = task_of(scene, parameters)
    start = rw.State.of(scene, parameters=task.parameters).q
    arm = arm_of(task, start)
    assert arm is not None
    return arm, Room(arm, start), start


def at_the_goal(scene: Any, seed: int = 0) -> tuple[Room, list[Reals]]:
    _, room, _ = room_of(scene)
    return room, room.goals(np.random.default_rng(seed), lambda: True)


@pytest.mark.long
@pytest.mark.parametrize(
    ("goal", "enters"),
    [
        (HOLE, True),
        ("gap(peg, lamp) <= 0", True),
        ("hypot(at(peg, x) - 0.3, at(peg, y) - 0.2) <= 0.01 and tilt(peg, x) <= 0.05", False),
    ],
    ids=["a peg in a hole", "a lamp is touched", "a pose in the air"],
)
def test_a_body_of_a_robot_comes_to_where_a_goal_asks_for_it(gantry: Any, goal: str, enters: bool) -> None:
    found = rw.plan(gantry(goal), seed=0)
    assert found.found, found.reason
    assert (moves.ENTER in found.labels) == enters
    assert found.labels[0] == moves.FREE
    assert found.replay(tol=0.1 * found.tol).outcome == rw.Outcome.GOAL


@pytest.mark.long
def test_arms_turn_at_half_of_their_rates_and_go_on_beyond_the_goal(gantry: Any) -> None:
    found = rw.plan(gantry(HOLE), seed=0)
    last = found.segments[-1].inputs["z_to"]
    weight = 0.4 * 9.81 / 2000.0
    depth = -found.waypoints[-1][2]
    assert last - weight < -depth - 0.01
    begun = rw.Segment({"x_to": 0.0, "y_to": 0.0, "z_to": 0.1, "turn_to": 0.0}, 1.0)
    pace = max(
        abs(b.inputs[name] - a.inputs[name]) / b.duration
        for (a, b), label in zip(pairwise([begun, *found.segments]), found.labels, strict=True)
        for name in begun.inputs
        if label == moves.FREE
    )
    assert pace == pytest.approx(0.25)


def test_a_goal_that_no_joint_can_meet_is_said_in_a_line(gantry: Any) -> None:
    found = rw.plan(gantry("at(peg, x) >= 2"), seed=0)
    assert not found.found and "these terms fail: at(peg, x) >= 2" in found.reason


def test_a_square_peg_is_turned_to_fit_a_square_hole(gantry: Any) -> None:
    _, room, start = room_of(gantry(HOLE))
    askew = room.arm.posed(start, np.array([0.2, 0.0, -0.015, 0.7]))
    turned = list(room._turned(askew, room._questions[0]))
    assert max(room.gaps(place).min() for place in turned) > room.gaps(askew).min() + 1e-3


def test_a_place_at_the_goal_is_centred(gantry: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    _, room, start = room_of(gantry(HOLE))
    beside = room.arm.posed(start, np.array([0.2004, 0.0003, -0.015, 0.0]))
    before = room.gaps(beside).min()
    assert room.gaps(room.centred(beside, room._questions[0])).min() > 4e-4 > before  # of half a millimetre
    for name, value in (("CENTRED", 0), ("WIDEST", 1e-8), ("NARROWEST", 0.2)):
        with monkeypatch.context() as patch:
            patch.setattr(places, name, value)
            assert room.gaps(room.centred(beside, room._questions[0])).min() == pytest.approx(
                before, abs=1e-5
            )


def test_a_few_places_at_the_goal_are_drawn(gantry: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(places, "FEW", 2)
    _, goals = at_the_goal(gantry(HOLE))
    assert len(goals) == 2
    monkeypatch.setattr(places, "DRAWN", 0)
    assert at_the_goal(gantry(HOLE))[1] == []


@pytest.mark.long
def test_a_peg_leaves_a_hole_along_its_axis_until_it_is_clear(gantry: Any) -> None:
    room, goals = at_the_goal(gantry(HOLE))
    (entry,) = room.entries(goals[0])
    assert entry.direction == pytest.approx([0.0, 0.0, -1.0], abs=1e-6)
    free = room.gaps(entry.places[0]).min()
    assert 0.1 * room.size <= free <= 0.25 * room.size


@pytest.mark.few(1)
@pytest.mark.parametrize(("name", "value"), [("FARTHEST", 0.1), ("STEP", 8.0), ("STRAIGHT", 0.0)])
def test_with_other_numbers_it_finds_no_way_or_others(
    gantry: Any, monkeypatch: pytest.MonkeyPatch, name: str, value: float
) -> None:
    room, goals = at_the_goal(gantry(HOLE))
    monkeypatch.setattr(places, name, value)
    again = Room(room.arm, room.start).entries(goals[0])
    assert [entry.direction.round(3).tolist() for entry in again] != [[0.0, 0.0, -1.0]]


def test_ways_do_not_lead_through_walls(gantry: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    _, room, start = room_of(gantry(HOLE))
    low, there = start.copy(), start.copy()
    low[2] = there[2] = 0.01
    there[0] = 0.2
    least = np.zeros(len(room.gaps(low)))
    assert not room._is_free(low, there, least)
    high = [each + np.array([0.0, 0.0, 0.12, 0.0]) for each in (low, there)]
    assert room._is_free(*high, least)
    monkeypatch.setattr(places, "FINEST", 1e6)
    assert room._is_free(low, there, least)


def test_arms_come_to_poses(monkeypatch: pytest.MonkeyPatch) -> None:
    arm, _, start = room_of(rw.load("peg_arm"))
    rng = np.random.default_rng(1)
    aims = [arm.poses(arm.posed(start, start[:6] + 0.3 * rng.standard_normal(6))) for _ in range(4)]

    def missed() -> float:
        ends = [arm.brought(start, aim)[0] for aim in aims]
        return max(float(np.abs(arm.poses(q) - aim).max()) for q, aim in zip(ends, aims, strict=True))

    assert missed() < 1e-6
    for name, value in (
        ("ITERATIONS", 1),
        ("LONGEST", 1e-3),
        ("DAMPING", 1e3),
        ("DIFFERENCE", 2.0),
        ("CLOSE", 1.0),
    ):
        with monkeypatch.context() as patch:
            patch.setattr(arms, name, value)
            assert missed() > 1e-6, name


def test_an_arm_of_few_joints_keeps_places_rather_than_turns(gantry: Any) -> None:
    arm, _, start = room_of(gantry(HOLE))
    aim = arm.poses(start)
    aim[0, :3] += [0.05, 0.02, 0.03]
    aim[0, 3:] = [np.cos(0.2), np.sin(0.2), 0.0, 0.0]
    found, missed = arm.brought(start, aim)
    assert missed < 1e-6 and found[:3] == pytest.approx(aim[0, :3])


def test_inputs_without_rates_cross_their_ranges_in_a_part_of_the_duration(gantry: Any) -> None:
    arm, _, _ = room_of(gantry(HOLE, rate=None))
    assert arm.rates[:3] == pytest.approx(1.0 / (0.2 * 4.0))


@pytest.mark.long
def test_entries_are_tried_slowly_shifted_and_tilted(gantry: Any) -> None:
    """Where the straight way does not come to the goal; small ones first."""
    task = task_of(gantry(HOLE))
    work = begin(task, Budget(1_000_000, 100.0), 0, None)
    arm = planner.reach_in(work)
    assert arm is not None
    approach = next(planner._approaches(work, arm, 0))
    reaching = planner.Reaching(work, None, arm, approach)  # type: ignore[arg-type]
    shifts = list(reaching._shifts())
    lengths = [float(np.linalg.norm(by)) / task.size for by, _ in shifts if np.any(by)]
    turns = [float(np.linalg.norm(turn)) for _, turn in shifts if np.any(turn)]
    assert lengths == pytest.approx(np.repeat([0.02, 0.05, 0.1], 6)) and turns == pytest.approx(
        np.repeat([0.03, 0.08], 6)
    )
    assert all(abs(by @ approach.entry.direction) < 1e-9 for by, _ in shifts)
    node = planner.Node(work.start, task.before, (), 0.0, rw.Outcome.MISSED)
    lines = list(reaching._entered(node, np.zeros(4)))
    assert len(lines) == 2 + len(shifts)
    slow, fast = (sum(each.duration for each in line if each.label == moves.ENTER) for line in lines[1::-1])
    assert slow == pytest.approx(3.0 * fast)
    assert [each.label for each in lines[0]][-3:] == [moves.HOLD] * 3
    assert lines[0][-1].duration == pytest.approx(8.0 * arm.lag)
    deep = lines[0][-1].levels[2] - arm.levels(approach.entry.places[-1], task.before)[2]
    assert deep == pytest.approx(-0.5 * task.size, abs=1e-3)
    speed = max(
        abs(b.levels[2] - a.levels[2]) / b.duration for a, b in pairwise(lines[0]) if b.label == moves.ENTER
    )
    assert speed == pytest.approx(0.05)


@pytest.mark.long
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_an_arm_brings_a_peg_into_a_hole_that_is_elsewhere(seed: int) -> None:
    found = rw.plan("peg_arm", seed=seed)
    assert found.found, found.reason
    assert rw.verify(found, samples=10).successes >= 8


@pytest.mark.few(2)
@pytest.mark.parametrize(("empty", "found"), [(0, True), (1, True), (5, False)])
def test_two_draws_tell_whether_a_goal_has_room(
    gantry: Any, empty: int, found: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Goals that only overlap can reach are told after a few draws, and one draw may miss a narrow place."""
    drawn: list[int] = []

    def goals(room: Room, *_: Any) -> list[Reals]:
        drawn.append(1)
        return [room.start] if len(drawn) > empty else []

    monkeypatch.setattr(Room, "goals", goals)
    work = begin(task_of(gantry(HOLE)), Budget(None, None), 0, 1)
    arm = reach_in(work)
    assert arm is not None and has_room(work, arm) == found
    assert len(drawn) <= 5

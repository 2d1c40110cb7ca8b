"""The geometric rung: places at the goal, ways without overlap, and what they leave out."""

from __future__ import annotations

import sys
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
import yaml

import rungwise as rw
from rungwise.kernel import Reals
from rungwise.planning.lift.geometric_stage import Placed, put, untouched
from rungwise.planning.motion.budget import Budget, Stage
from rungwise.planning.motion.placements import Placing, needs_forces, placed_part
from rungwise.planning.search.goals import with_places
from rungwise.planning.search.problem import begin
from rungwise.planning.task.task import instances, task_of
from rungwise.scene.scene import LIBRARY
from rungwise.simulation.state import State

TASKS = ("push", "two_finger", "four_finger", "grasp")
BENT = (1007, 1010, 1027, 1039)
"""Instances of push in which a post stands in the straight way of the box."""


def changed(**fields: Any) -> rw.Scene:
    file: dict[str, Any] = yaml.safe_load((LIBRARY / "push.yaml").read_text("utf-8"))
    return rw.load(file | fields)


def gate(thickness: float, gap: float) -> rw.Scene:
    """A disc and a box on either side of a thin wall with a gate, to be exchanged."""
    table = {"friction": 0.3, "load": 1.0, "pressure": {"kind": "uniform"}}
    wall = {
        "role": "obstacle", "shape": [
            {"kind": "box", "width": thickness, "height": 80.0, "at": [0.0, 40.0 + gap / 2]},
            {"kind": "box", "width": thickness, "height": 80.0, "at": [0.0, -40.0 - gap / 2]},
        ],
    }  # fmt: skip
    return rw.load({
        "name": "gate", "parameters": {"ux": {"default": 0.0, "range": [-1.0, 1.0]}}, "inputs": ["ux"],
        "bodies": {
            "rod": {
                "role": "robot", "shape": {"kind": "disc", "radius": 0.05}, "pose": {"x": -1.5, "y": 0.7},
                "motion": {"kind": "free"},
                "coordinates": {
                    "x": {"drive": {"kind": "speed", "speed": "ux"}},
                    "y": {"drive": {"kind": "speed", "speed": 0}},
                    "angle": {"drive": {"kind": "speed", "speed": 0}},
                },
            },
            "disc": {
                "role": "object", "shape": {"kind": "disc", "radius": 0.1}, "pose": {"x": -1.0},
                "motion": {"kind": "free"}, "support": table,
            },
            "block": {
                "role": "object", "shape": {"kind": "box", "width": 0.3, "height": 0.1}, "pose": {"x": 1.0},
                "motion": {"kind": "free"}, "support": table,
            },
            "wall": wall,
        },
        "contacts": [{"between": ["*", "*"], "friction": 0.2}],
        "goal": "disc.x >= 2 and disc.y >= 0.3 and block.x <= -2 and abs(disc.x) + abs(block.x) <= 7",
        "duration": 1.0, "step": 1e-3, "task": {},
    })  # fmt: skip


def overlap(scene: rw.Scene, way: Reals, parameters: dict[str, float] | None = None) -> float:
    """The deepest overlap of any two bodies on a way (k, n), looked at in small parts."""
    deepest = 0.0
    for a, b in pairwise(way):
        rows = a + np.linspace(0.0, 1.0, 4000)[:, None] * (b - a)
        deepest = max(deepest, -float(rw.geometry(scene, rows, parameters).gaps.min()))
    return deepest


def way_of(plan: rw.Plan) -> Reals:
    start = State.of(plan.scene, parameters=plan.parameters).q
    return np.array([start, *plan.waypoints])


@pytest.mark.few(1)
@pytest.mark.parametrize("seed", BENT)
def test_ways_around_posts_touch_nothing_and_end_at_the_goal(seed: int) -> None:
    plan = rw.plan("push", task_seed=seed, to="geometric")
    assert plan.found and len(plan.waypoints) >= 2
    way = way_of(plan)
    assert overlap(plan.scene, way, plan.parameters) <= 1e-9
    assert rw.ask(plan.scene, "goal", way[-1:], plan.parameters).holds[0]
    assert overlap(plan.scene, way[[0, -1]], plan.parameters) > 1e-4, "the straight way is not free"


@pytest.mark.few(2)
@pytest.mark.parametrize("seed", BENT)
def test_ways_are_short(seed: int) -> None:
    """The centre of the box goes at most as far as about once round a post."""
    plan = rw.plan("push", task_seed=seed, to="geometric")
    way = way_of(plan)[:, 3:5]
    length = float(np.linalg.norm(np.diff(way, axis=0), axis=1).sum())
    assert length <= np.linalg.norm(way[-1] - way[0]) + 2.0 * np.pi * (0.05 * np.sqrt(2.0) + 0.015)
    assert f"; box travels {length:.3g}" in str(plan) and " legs on geometric @ 0.01>" in repr(plan)


@pytest.mark.few(1)
@pytest.mark.parametrize("name", ["two_finger", "four_finger"])
def test_coordinates_keep_their_travel(name: str) -> None:
    for seed in range(5):
        plan = rw.plan(name, task_seed=seed, to="geometric")
        assert plan.found, plan.reason
        travel = plan.scene.bind(plan.parameters).records.coordinates
        assert (way_of(plan) >= travel["lower"]).all() and (way_of(plan) <= travel["upper"]).all()


@pytest.mark.few(1)
@pytest.mark.parametrize("thickness", [0.2, 1e-2, 1e-3])
def test_thin_walls_are_not_jumped(thickness: float) -> None:
    """Two bodies change sides through the gate of a wall, however thin it is."""
    scene = gate(thickness, 0.5)
    plan = rw.plan(scene, to="geometric")
    assert plan.found, plan.reason
    assert overlap(scene, way_of(plan)) <= 1e-9


@pytest.mark.long
def test_no_way_through_a_gate_that_is_too_narrow() -> None:
    plan = rw.plan(gate(1e-2, 0.15), to="geometric")
    assert not plan.found
    assert plan.reason == "geometric @ 0.01: no path for the bodies was found, wall being in the way"


@pytest.mark.long
def test_an_obstacle_that_leaves_no_way_is_named_where_a_search_finds_nothing() -> None:
    plan = rw.plan(gate(1e-2, 0.15), to="quasistatic-rigid", budget=3000)
    assert not plan.found and "wall being in the way" in plan.reason and "moves tried" in plan.reason


def test_ways_keep_out_of_what_is_unsafe() -> None:
    """A band that the box must not enter, but for a door."""
    band = "abs(box.x - 0.15) <= 0.02 and abs(box.y - 0.2) >= 0.1"
    far = {"goal_x": 0.3, "goal_y": 0.0, "goal_angle": 0.0, "near": 0.02, "post1_y": -0.6, "post2_y": -0.7}
    scene = changed(task={"keep_out": [band]})
    plan = rw.plan(scene, to="geometric", parameters=far)
    assert plan.found and len(plan.waypoints) > 1
    for a, b in pairwise(way_of(plan)):
        rows = a + np.linspace(0.0, 1.0, 1000)[:, None] * (b - a)
        assert not rw.ask(scene, band, rows, plan.parameters).holds.any()


def test_a_way_is_sought_no_longer_than_the_limit() -> None:
    plan = rw.plan(gate(1e-2, 0.15), to="geometric", limit=0.2)
    assert plan.reason == "geometric @ 0.01: nothing found; the time is over"


def test_the_same_seed_gives_the_same_way() -> None:
    one, two, other = (rw.plan("push", task_seed=1007, to="geometric", seed=seed) for seed in (3, 3, 4))
    assert one.waypoints == two.waypoints != other.waypoints


@pytest.mark.few(1)
@pytest.mark.parametrize("name", TASKS)
def test_goals_of_tasks_have_places_also_where_contacts_must_close(name: str) -> None:
    """No false alarm: neither with two contacts to be closed within a millionth, nor with forces."""
    scene = rw.load(name)
    for parameters in instances(scene, 5, 5):
        task = task_of(scene, parameters)
        placing = Placing(task, task.search, State.of(scene, parameters=parameters).q)
        found = placing.goals(np.random.default_rng(0))
        assert len(found.places)
        goal = placed_part(task.search.file.goal or "")
        assert goal is not None
        assert rw.ask(scene, goal, found.places, parameters).holds.all()
        assert not rw.geometry(scene, found.places, parameters).collides.any()


@pytest.mark.few(1)
@pytest.mark.parametrize(
    ("goal", "words"),
    [
        ("box.x >= 1 and box.x <= -1", "at the nearest one these terms fail: "),
        ("hypot(box.x - post1_x, box.y - post1_y) <= 0.001", "holds only where box and post1 overlap"),
        ("gap(rod, box) <= 0 and gap(rod, box) >= 0.1", "no placement of the bodies was found"),
        ("gap(rod, box) <= 0 and gap(rod, box) >= 0.1", "these terms fail: gap(rod, box) >= 0.1 (by 0.1)"),
        ("gap(rod, box) <= -0.01", "holds only where rod and box overlap"),
        ("box.x ** 2 <= -1", "these terms fail: box.x ** 2 <= -1 (by "),
    ],
)
def test_goals_that_cannot_be_are_told_before_anything_is_tried(goal: str, words: str) -> None:
    plan = rw.plan(changed(goal=goal))
    assert not plan.found and plan.reason.startswith("goal: ") and words in plan.reason
    assert not plan.records


@pytest.mark.few(1)
@pytest.mark.parametrize("place", [0.1, 1.0, 3.0])
@pytest.mark.parametrize("width", [1.0, 0.1, 0.02, 0.001])
def test_a_goal_between_bounds_keeps_as_much_of_the_reserve_as_it_has_room_for(
    place: float, width: float
) -> None:
    """From `place` to (1 + width) place both bounds move by a reserve r if 1 + r <= (1 + width) (1 - r)."""
    scene = changed(goal=f"box.x >= {place} and box.x <= {place * (1.0 + width)}")
    work = with_places(begin(task_of(scene), Budget(10**6, 60.0), 0, None))
    most = width / (2.0 + width)
    expected = max(r for r in (0.2, 0.1, 0.05, 0.02, 0.0) if r <= most)
    assert work.task.numbers["task.reserve"] == pytest.approx(expected)
    assert rw.plan(scene, to="geometric").found


def test_a_goal_out_of_a_travel_is_told() -> None:
    file: dict[str, Any] = yaml.safe_load((LIBRARY / "two_finger.yaml").read_text("utf-8"))
    plan = rw.plan(rw.load(file | {"goal": "finger1.x1 >= 3"}))
    assert not plan.found and plan.reason.endswith("these terms fail: finger1.x1 >= 3 (by 1)")


@pytest.mark.few(1)
@pytest.mark.parametrize(
    "goal",
    [
        "(box.x - 0.2) ** 2 <= 1e-10", "(box.x - 0.2) ** 4 <= 1e-12", "exp(-box.x) <= 1e-12",
        "hypot(box.x - 0.2, box.y - 0.3) ** 2 <= 1e-8 and gap(rod, box) <= 0",
        "gap(rod, box) <= 0 and gap(post1, box) <= 0 and gap(post2, box) <= 0 and gap(post1, rod) <= 0",
        "gap(rod, post1) <= 0 and gap(rod, post2) <= 1e-5 and box.angle >= 100",
        "sqrt(box.x - 0.5) <= 0.6", "1 / box.x <= 1e-3 and box.x >= 0", "1e-12 * box.x >= 1",
        "box.x ** 9 >= 1e9", "not (box.x < 0.5 or box.y < 7)",
        "box.x <= -7 and box.x >= 8 or box.y >= 0.2",
    ],
)  # fmt: skip
def test_goals_that_can_be_have_places(goal: str) -> None:
    """Thin, curved, far, and not defined everywhere."""
    values = {"post1_x": 0.2, "post1_y": 0.02, "post2_x": 0.2, "post2_y": -0.02}
    plan = rw.plan(changed(goal=goal), parameters=values, budget=1)
    assert not plan.reason.startswith("goal: "), plan.reason
    if "e-12 *" not in goal:
        task = task_of(changed(goal=goal), values)
        placing = Placing(task, task.scene, State.of(task.scene, parameters=values).q, yields=True)
        assert len(placing.goals(np.random.default_rng(1)).places)


@pytest.mark.few(1)
@pytest.mark.parametrize("goal", ["gap(rod, box) <= -1e-4", "floor(box.x) >= 3", "force(rod, box) >= 1"])
def test_what_places_cannot_rule_out_is_tried(goal: str) -> None:
    """Contacts that yield, what changes at once, and forces."""
    plan = rw.plan(changed(goal=goal), budget=1)
    assert plan.records and not plan.reason.startswith("goal: ")


def test_what_places_do_not_decide_is_left_to_richer_rungs() -> None:
    assert placed_part("force(a, b) >= 1") is None
    assert placed_part("speed(box.x) <= 1 and box.x >= 2 and t < 3") == "(box.x >= 2)"
    assert placed_part("box.x >= 1 or box.y >= 1") == "(box.x >= 1 or box.y >= 1)"
    pushed = changed(goal="force(rod, box) >= 1")
    plan = rw.plan(pushed, schedule=["geometric"])
    assert not plan.found and "left out: places do not decide the goal" in plan.reason


@pytest.mark.parametrize(
    ("goal", "needs"),
    [
        ("force(rod, box) >= 1 and box.x >= 0", True), ("force(rod, box) <= 1 and box.x >= 0", False),
        ("force(rod, box) >= 1 or box.x >= 0", False), ("box.x >= 0", False),
        ("force(rod, box) >= box.x and box.y >= 0", False),
    ],
)  # fmt: skip
def test_rungs_without_forces_are_left_out_only_where_forces_are_needed(goal: str, needs: bool) -> None:
    scene = changed(goal=goal)
    task = task_of(scene)
    assert needs_forces(task, State.of(scene).q) == needs


def test_the_kinematic_rung_is_left_out_of_a_grasp_by_force() -> None:
    plan = rw.plan("grasp", task_seed=1000, schedule="climb")
    assert plan.found
    assert [record.how for record in plan.records][1] == "left out: no forces"
    blind = rw.plan("grasp", task_seed=1000, to="kinematic")
    assert not blind.found and blind.reason.endswith("left out: no forces")


def test_a_climb_from_the_geometric_rung_says_that_nothing_touched_the_box() -> None:
    plan = rw.plan("push", task_seed=1003, from_="geometric", to="kinematic")
    assert plan.found and plan.records[0].stage == "geometric @ 0.01"
    told = plan.diagnosis[0]
    assert told.causes == ("untouched",) and told.body == "box" and told.outcome == "missed"
    numbers = told.details["untouched"]
    goal = np.hypot(plan.parameters["goal_x"], plan.parameters["goal_y"])
    assert numbers["moved"] > 0.8 * goal and numbers["touched"] == 0.0
    assert "without being touched by a robot" in str(plan)
    assert rw.Diagnosis.of(told.summary()) == told


def test_what_is_at_its_goal_already_was_not_moved_without_a_touch() -> None:
    """A part that need not move, and a part that the fingers push of themselves."""
    for name, seed in (("two_finger", 1000), ("grasp", 1000)):
        plan = rw.plan(name, task_seed=seed, schedule="climb")
        first = [told.cause for told in plan.diagnosis if told.before.startswith("geometric")]
        assert first == [], name


def test_all_objects_that_moved_alone_are_named() -> None:
    plan = rw.plan(gate(1e-2, 0.5), from_="geometric", to="kinematic", budget=500)
    (told,) = plan.diagnosis
    assert {told.body, *told.details["untouched"]["others"]} == {"disc", "block"}
    assert "disc" in str(told) and "block" in str(told)


def test_what_need_not_move_is_not_told_to_have_moved_alone() -> None:
    """The goal is the robot's, behind the box."""
    plan = rw.plan(changed(goal="rod.x >= 0.5"), from_="geometric", to="kinematic", budget=200)
    assert plan.records[0].how == "planned"
    assert not any("untouched" in told.causes for told in plan.diagnosis)


def test_bodies_that_touch_nothing_go_straight() -> None:
    task = changed().file.model_dump(exclude_unset=True)["task"]
    del task["transit"]
    plan = rw.plan(changed(contacts=[], goal="box.x >= 0.3", task=task), to="geometric")
    assert plan.found and len(plan.waypoints) == 1


def test_an_object_that_a_robot_touches_all_the_way_did_not_move_alone() -> None:
    scene = rw.load("push")
    work, stage = begin(task_of(scene), Budget(), 0, None), Stage(rw.KINEMATIC, 1e-2)
    start, step = work.start.q[0].copy(), np.array([0.2, 0.0, 0.0, 0.2, 0.0, 0.0])
    start[0] += float(rw.geometry(scene, start[None]).gaps[0].min())
    work.start = work.start._replace(q=start[None])
    for moves, is_alone in ((step, False), (np.where(np.arange(6) > 2, step, 0.0), True)):
        way = np.array([start, start + moves])
        plan = put(rw.Plan(scene, scene.parameters()), Stage(rw.GEOMETRIC, 1e-2), Placed(way, "planned"))
        assert (untouched(work, plan, stage) is not None) == is_alone


def test_plans_of_places_are_told_from_plans_of_inputs(tmp_path: Any) -> None:
    plan = rw.plan("push", task_seed=1002, to="geometric")
    again = rw.load_plan(plan.save(tmp_path / "plan.json"))
    assert again.waypoints == plan.waypoints and str(again).startswith("push: a path of")
    with pytest.raises(rw.PlanError, match="it is of the geometric rung: it has places, but no inputs"):
        again.replay()
    with pytest.raises(rw.TaskError, match="it has places, but no inputs"):
        rw.verify(again)


def test_without_ompl_the_stage_is_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "ompl", None)
    straight = rw.plan("push", task_seed=1000, to="geometric")
    assert straight.found, "straight ways need no OMPL"
    plan = rw.plan("push", task_seed=1007, to="geometric")
    assert not plan.found and "left out: needs OMPL (pip install 'rungwise[plan]')" in plan.reason


def test_joined_bodies_are_left_to_richer_rungs() -> None:
    scene = rw.load("two_link")
    file = scene.file.model_dump(exclude_unset=True)
    file["task"] = {}
    if not file.get("inputs"):
        name = next(iter(file["parameters"]))
        file["inputs"] = [name]
    plan = rw.plan(rw.load(file), to="geometric")
    assert "left out: bodies are joined" in plan.reason

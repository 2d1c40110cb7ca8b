"""Pushes beyond the scene that ships: two boxes, fast pushes, soft contacts; and how they are found."""

from __future__ import annotations

import numpy as np
import pytest

import rungwise as rw
from rungwise.planning.lift import repair as lift
from rungwise.planning.lift import stages as schedule
from rungwise.planning.motion import early_stops as stops
from rungwise.planning.motion.budget import Budget, Stage
from rungwise.planning.motion.settle import rested
from rungwise.planning.motion.transit import Transit
from rungwise.planning.search import problem as work
from rungwise.planning.search import tree
from rungwise.planning.search.shooting import run_moves
from rungwise.planning.task.task import task_of
from tests.planning.members import lifted_block, push, two_boxes

QUASISTATIC = Stage(rw.QUASISTATIC_RIGID, 1e-3)


def begun(scene: rw.Scene, seed: int = 0) -> work.Work:
    return work.begin(task_of(scene), Budget(), seed, 2)


def is_confirmed(plan: rw.Plan) -> bool:
    return plan.found and plan.replay(tol=plan.tol / 10).outcome.code == rw.Code.GOAL


@pytest.mark.long
@pytest.mark.parametrize("seed", [2, *(pytest.param(seed, marks=pytest.mark.long) for seed in (1, 5))])
def test_two_boxes_both_come_to_their_goals(seed: int) -> None:
    plan = rw.plan(two_boxes(seed), budget=600_000)
    assert is_confirmed(plan), str(plan)
    assert len(plan.waypoints) >= 2


@pytest.mark.long
@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.long) for seed in (1, 2))])
def test_fast_pushes_are_planned_with_their_coasting(seed: int) -> None:
    """At 1 m/s boxes coast by their size: a move begins when what the last one pushed is at rest."""
    plan = rw.plan(push(seed, v=1.0), task_seed=seed, budget=1_250_000)
    assert is_confirmed(plan), str(plan)
    data = plan.replay().trajectory
    begins = np.cumsum([0.0, *(segment.duration for segment in plan.segments)])
    still = task_of(plan.scene, plan.parameters).still
    for begin, label in zip(begins[1:], plan.labels[1:], strict=False):
        if label == "push":
            at = int(np.searchsorted(data.time.values, begin - 1e-9)) - 1
            speeds = data.velocity.sel(coordinate=["box.x", "box.y"]).values[at]
            assert np.hypot(*speeds) <= 2.0 * still


@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.long) for seed in (3, 5))])
def test_soft_contacts_are_planned(seed: int) -> None:
    plan = rw.plan(push(seed, stiffness=1e4, damping=10.0), task_seed=seed)
    assert is_confirmed(plan), str(plan)


def test_pushes_change_an_object_alike_wherever_it_lies() -> None:
    """What was seen of single pushes, composed, is what the rung makes of the plan."""
    own = begun(two_boxes(1))
    predictor, seen, group = own.predictor(QUASISTATIC), own.pushes(QUASISTATIC), own.groups[0][0]
    aim = own.part(group.parts, group.bodies)
    tree.grow(own.moves, predictor, own.start, own.task.before, aim, 3, 4, own.rng, seen.note)
    plans = seen.plans(group.bodies[0], own.start.q[0], own.goals, 3, 24, own.rng)
    assert len(plans) > 8
    found = run_moves(own.moves, predictor, own.start, plans, aim)
    before = float(aim.lack(own.start)[0])
    assert np.median(found.score[found.score < 1e3]) < 0.1 * before


def test_a_push_that_is_cut_ends_where_the_longer_one_was() -> None:
    own = begun(push(0))
    predictor, parts = own.predictor(QUASISTATIC), 8
    assert stops.parts_of(own.moves, predictor) == parts
    vectors = own.rng.random((12, own.moves.size))
    places, fits = own.moves.begin(vectors, own.start.take(np.zeros(12, np.int64)))
    segments = own.moves.segments_of(vectors, places, np.zeros((12, 2)), parts)
    ends = predictor.run(places, segments.levels, segments.durations, ramps=segments.ramps)
    found = stops.stops_of(own.moves, vectors, segments, ends, parts)
    rows = np.flatnonzero(fits[found.rows])
    assert len(rows) > 30
    again = own.moves.segments_of(
        found.vectors[rows], places.take(found.rows[rows]), np.zeros((len(rows), 2))
    )
    shorter = predictor.run(places.take(found.rows[rows]), again.levels, again.durations)
    off = own.task.off(shorter.places.q, found.places.q[rows])
    assert np.abs(off).max() < 0.01 * own.size


@pytest.mark.few(2)
@pytest.mark.parametrize("seed", range(4))
def test_what_robots_hold_is_let_go_before_they_are_placed_elsewhere(seed: int) -> None:
    """A block that two fingers hold in the air, at rest, comes down before the next move begins."""
    scene = lifted_block(seed)
    own = begun(scene)
    predictor = own.predictor(Stage(rw.DYNAMIC_COMPLIANT, 1e-3))
    shape = scene.file.bodies["part"].shape
    apart, high = 0.5 * float(shape.width) + 0.002 + 1e-6, 0.04
    q = own.start.q.copy()
    for name, value in {
        "finger1.x": -apart, "finger2.x": apart, "finger1.y": high, "finger2.y": high, "part.y": high,
    }.items():  # fmt: skip
        q[0, scene.template.coordinates.index(name)] = value
    places = own.start._replace(q=q)
    inward = 0.005 - apart
    levels = np.array([[[inward, high, -inward, high]]])
    held = predictor.run(places, levels, np.array([[0.5]]))
    y = scene.template.coordinates.index("part.y")
    assert held.places.q[0, y] > 0.9 * high and not own.task.moving(held.places.v)[0]
    found = rested(own.moves, predictor, held, levels[:, 0])
    assert found.ends.places.q[0, y] < 0.6 * high and not own.task.moving(found.ends.places.v)[0]
    assert found.left.durations[0] > 0.0 and found.waits[0] > 0.0


def test_ways_keep_to_the_places_that_inputs_reach() -> None:
    """Robots that are led by targets go nowhere beyond the bounds of these."""
    own, long = begun(lifted_block(5)), 0
    for seed in range(12):
        aim = own.start.q[0].copy()
        for carrier in own.task.carriers:
            low, high = own.moves.transit.bounds(carrier)
            aim[list(carrier.places)] = own.rng.uniform(low, high)
        way = own.transit.way(own.start.q[0], aim, seed)
        for carrier in own.task.carriers if way is not None else ():
            low, high = own.moves.transit.bounds(carrier)
            at = way[:, list(carrier.places)]
            assert ((at >= low - 1e-12) & (at <= high + 1e-12)).all()
        long += way is not None and len(way) > 2
    assert long >= 1


def test_objects_of_the_goal_are_told_apart() -> None:
    own = begun(two_boxes(1))
    lacking, kept = own.groups
    assert sorted(group.bodies for group in lacking) == [("a",), ("b",)] and not kept
    turned = own.moves.aimed(own.rng.random((100, own.moves.size)), ("b",))
    assert own.moves.pushable == [["a", "b"]]
    assert ((turned[:, 0] >= 0.5) & (turned[:, 0] < 1.0)).all()


def test_a_plan_that_holds_is_not_led_anew(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where robots find no other way to their places, the schedule that there is holds as it is."""
    first = rw.plan("push", task_seed=1003, schedule=[("quasistatic-rigid", 1e-3)])
    monkeypatch.setattr(Transit, "way", lambda *_: None)
    lifted = rw.plan(
        "push",
        parameters=first.parameters,
        schedule=[("dynamic-compliant", 1e-3)],
        initial=first,
        budget=5_000,
    )
    assert lifted.found, str(lifted)
    assert lifted.records[-1].how == lift.HELD and lifted.segments == first.segments


def test_searches_go_on_until_the_budget_is_spent() -> None:
    """Where no plan is found, all steps are taken, in turns of the stages."""
    none = rw.plan("push", task_seed=1003, parameters={"near": 1e-6, "aligned": 1e-6}, budget=10_000)
    assert not none.found and none.reason.count("the budget is spent") == 1
    assert sum(record.steps for record in none.records) >= 10_000
    assert [record.stage for record in none.records] == [
        str(stage) for stage in schedule.stages("quasistatic", None, rw.DYNAMIC_COMPLIANT)
    ]

"""Cycles of a hand: fingers hold an object, turn it, let go and hold it anew, in the plane and in space."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rungwise as rw
from rungwise.planning.execution.feedback import Moves
from rungwise.planning.modes.hands import described
from rungwise.planning.modes.hands.beside import beside
from rungwise.planning.modes.hands.cycles import Cycles, inputs, wish
from rungwise.planning.modes.hands.gaits import ABREAST, by_hand, cycled, hand_in
from rungwise.planning.modes.hands.hand import Hand, hand_of
from rungwise.planning.modes.hands.press import held, rests, targets
from rungwise.planning.modes.hands.touch import CLOSED, closed, followed, opened
from rungwise.planning.motion.budget import Budget, Stage
from rungwise.planning.search.goals import goals_of
from rungwise.planning.search.problem import begin, known
from rungwise.planning.search.tree import IDLE
from rungwise.planning.task.fingers import taken
from rungwise.planning.task.task import Task, task_of
from rungwise.world.find import world_of
from tests.planning.members import unnamed_hand

BALL = '<geom name="ball" type="sphere" size="0.04" mass="0.1" condim="4" friction="0.8 0.004 0.0001"/>'
CUBE = '<geom name="ball" type="box" size="0.03 0.03 0.03" mass="0.1"/>'


def _cube(folder: Path) -> Any:
    """The hand of four fingers with a cube in place of the ball."""
    own = Path(rw.__file__).parent / "scene" / "library" / "space"
    text = (own / "hand_turn.xml").read_text()
    for ball, cube in ((BALL, CUBE), ('"0 0 0.04"', '"0 0 0.03"'), ('"0 0 0.04 1 ', '"0 0 0.03 1 ')):
        assert text.count(ball) == 1
        text = text.replace(ball, cube)
    (folder / "hand_turn.xml").write_text(text)
    (folder / "cube.yaml").write_text((own / "hand_turn.yaml").read_text())
    return rw.load(folder / "cube.yaml")


def _hand(task: Task) -> tuple[Hand, np.ndarray]:
    hand = hand_of(task)
    assert hand is not None
    return hand, np.asarray(world_of(task.scene).at(task.parameters).q)


def _plan(scene: Any, rung: str, seed: int, steps: int, **parameters: float) -> Any:
    work = begin(task_of(scene, parameters), Budget(steps, None), seed, 1)
    predictor = work.predictor(Stage(next(m for m in rw.LADDER if m.name == rung), 1e-2))
    hand = hand_in(work)
    assert hand is not None
    found = by_hand(work, predictor, hand)
    assert found is not None, work.nearest
    return found


def test_a_hand_has_the_chains_that_no_other_continues() -> None:
    hand, _ = _hand(task_of(rw.load("hand_turn")))
    assert [finger.driven.body for finger in hand.fingers] == [
        f"{name}_tip" for name in ("first", "second", "third", "thumb")
    ]
    assert all(len(finger.loose) == 4 and finger.loose.all() for finger in hand.fingers)
    assert all(len(finger.bodies) == 4 and len(finger.touching) == 1 for finger in hand.fingers)
    # Ranges of the inputs, not of the joints' travel alone.
    np.testing.assert_allclose(hand.fingers[0].low, [-0.5, -1.2, 0.0, 0.0], atol=1e-12)
    plane, _ = _hand(task_of(unnamed_hand(0.5, 40)))
    assert len(plane.fingers) == 2 and all(len(finger.loose) == 2 for finger in plane.fingers)


def test_what_is_told_of_a_hand_names_its_fingers_and_calls_no_link_of_it_none() -> None:
    task = task_of(rw.load("hand_turn"))
    hand = described.turning(task)
    assert hand is not None
    lines = described.described(task, hand)
    assert lines[0] == "hand that leads ball: chains of joints on servos"
    inputs = "thumb_aside, thumb_root, thumb_knuckle, thumb_end"
    assert lines[4].split(maxsplit=1) == ["thumb_tip", f"led by {inputs}; touches with thumb_tip"]
    said = described.summary(task, hand)["hand"]
    assert said["object"] == "ball" and list(said["fingers"]) == [
        f"{name}_tip" for name in ("first", "second", "third", "thumb")
    ]
    assert taken(task).others and not described.without_links(task, hand, taken(task)).others
    # What contact modes would take for fingers is not told beside it.
    task = task_of(rw.load("ball_turn"))
    hand = described.turning(task)
    assert hand is not None and len(taken(task).fingers) == 3
    assert not described.without_links(task, hand, taken(task)).fingers
    # Contact modes lead the fingers that a task names, and in the plane those with rates.
    assert described.turning(task_of(rw.load("planar_hand"))) is None
    assert described.turning(task_of(unnamed_hand(0.5, 40))) is None


@pytest.mark.parametrize("name", ["push", "floor_push", "three_finger_lift"])
def test_what_carriers_lead_or_fewer_than_two_chains_is_no_hand(name: str) -> None:
    task = task_of(rw.load(name))
    hand = hand_of(task)
    assert hand is None or len(hand.fingers) >= 2
    assert not task.carriers or hand is None


@pytest.mark.parametrize("plane", [True, False])
def test_a_finger_follows_the_object_and_neither_opens_nor_slips(plane: bool) -> None:
    task = task_of(unnamed_hand(0.5, 40) if plane else rw.load("hand_turn"))
    hand, q = _hand(task)
    finger, rng = hand.fingers[0], np.random.default_rng(0)
    for _ in range(40):
        drawn = finger.low + (finger.high - finger.low) * rng.random(len(finger.low))
        place = closed(hand, finger, finger.posed(q, drawn), finger.touching[0])
        if place is None:
            continue
        change = np.zeros(len(hand.around.owners))
        change[hand.columns[-1]] = 0.1
        touch = followed(hand, finger, place, finger.touching[0], change, 4, finger.chain.joints(q))
        if touch.steps == 4:
            break
    else:
        pytest.fail("no posture follows")
    moved = finger.posed(hand.around.changed(place, change), touch.joints[-1])
    begun, now = (hand.around.near(at, finger.touching[0]) for at in (place, moved))
    assert abs(begun.gap) < CLOSED * hand.size and abs(now.gap) < 2.0 * CLOSED * hand.size
    # The finger went with the object's surface.
    rate = begun.rows[1:, hand.columns] @ change[hand.columns]
    gone = begun.rows[1:, finger.chain.columns] @ finger.rates(place) @ (touch.joints[-1] - touch.joints[0])
    assert np.linalg.norm(rate + gone) < 0.3 * np.linalg.norm(rate)
    away = opened(hand, finger, place, 0.2 * hand.size)
    assert hand.around.near(away, finger.touching[0]).gap > 0.1 * hand.size


def test_forces_of_a_hold_balance_the_load_and_stay_in_their_cones() -> None:
    hand, q = _hand(task_of(rw.load("hand_turn")))
    rng, pairs, place = np.random.default_rng(1), list[int](), q
    for finger in (hand.fingers[1], hand.fingers[3]):
        found = None
        while found is None:
            drawn = finger.low + (finger.high - finger.low) * rng.random(4)
            found = closed(hand, finger, finger.posed(place, drawn), finger.touching[0])
        place = found
        pairs.append(finger.touching[0])
    hold = held(hand, place, pairs, 2.0)
    for pair, force in zip(pairs, hold.forces, strict=True):
        assert (
            force[0] >= 0.0 and np.linalg.norm(force[1:]) <= hand.around.near(place, pair).friction * force[0]
        )
    # The palm carries the ball without fingers, and nothing does in the air.
    assert rests(hand, q, [], 1.0)
    lifted = q.copy()
    lifted[2] += 0.03
    assert not rests(hand, lifted, [], 1.0)
    # Servos press by the force: what is left of their torque is the finger's own weight.
    finger = hand.fingers[3]
    pressed = targets(hand, finger, place, pairs[1], hold.forces[1])
    alone = targets(hand, finger, place, -1, np.zeros(0))
    torque = (pressed - alone) * finger.driven.servos.stiffness
    rows = hand.around.near(place, pairs[1]).rows[:, finger.chain.columns]
    np.testing.assert_allclose(torque, -rows.T @ hold.forces[1], atol=1e-9)


@pytest.mark.parametrize("plane", [True, False])
def test_fingers_keep_to_an_object_that_lies_elsewhere(plane: bool) -> None:
    """A fingertip touches it at the same point of its surface, as far as it reaches; else targets stay."""
    task = task_of(unnamed_hand(0.5, 40) if plane else rw.load("hand_turn"))
    hand, q = _hand(task)
    finger, rng, place = hand.fingers[0], np.random.default_rng(0), None
    while place is None:
        drawn = finger.low + (finger.high - finger.low) * rng.uniform(0.3, 0.7, len(finger.low))
        place = closed(hand, finger, finger.posed(q, drawn), finger.touching[0])
    change = np.zeros(len(hand.around.owners))
    change[hand.columns[0]], change[hand.columns[-1]] = 0.04 * hand.size, 0.05
    here = hand.around.changed(place, change)
    rows = np.array(
        [inputs(hand, task.before, np.concatenate([f.chain.joints(place) for f in hand.fingers]))]
    )
    found = beside(hand, rows, place, place, here)
    np.testing.assert_allclose(beside(hand, rows, place, place, place), rows, atol=1e-12)
    joints = finger.driven.led.at(found[0, list(finger.driven.columns)])
    before = hand.around.near(here, finger.touching[0]).gap
    after = hand.around.near(finger.posed(here, joints), finger.touching[0]).gap
    assert abs(before) > 5.0 * CLOSED * hand.size and abs(after) < 2.0 * CLOSED * hand.size


@pytest.mark.long
def test_cycles_give_values_to_all_inputs_and_lead_as_far_as_a_cycle_may() -> None:
    task = task_of(rw.load("hand_turn"))
    work = begin(task, Budget(1000, None), 0, 1)
    hand, q = _hand(task)
    goal = goals_of(work)[0]
    wanted = wish(hand, q, goal)
    assert np.degrees(wanted.change[hand.columns[-1]]) == pytest.approx(56.0, abs=5.0)
    rng = np.random.default_rng(0)
    found = Cycles(hand, q).proposals(q, goal, 3, rng)
    assert found
    for cycle in found:
        rows = np.array([inputs(hand, task.before, joints) for joints in cycle])
        assert rows.shape[1] == len(task.low) and np.isfinite(rows).all() and len(cycle) >= 3


@pytest.mark.few(1)
@pytest.mark.parametrize(("turn", "seed"), [(0.8, 0), (-0.8, 1), (2.0, 0), (2.0, 1)])
def test_two_fingers_turn_a_disc_as_far_as_is_asked(turn: float, seed: int) -> None:
    found = _plan(unnamed_hand(turn, 40), "quasistatic-compliant", seed, 20_000)
    assert found.course.reached


@pytest.mark.few(1)
@pytest.mark.parametrize("seed", range(4))
def test_a_hand_goes_on_by_cycles_where_nothing_of_its_plan_leads_on(seed: int) -> None:
    """Wherever the object is; all moves of a way that was found are made together."""
    scene, rng = unnamed_hand(0.8, 40), np.random.default_rng(seed)
    work = begin(task_of(scene), Budget(10_000, None), seed, 1)
    predictor = work.predictor(Stage(rw.QUASISTATIC_COMPLIANT, 1e-2))
    none = np.zeros((0, work.moves.size))
    rest = Moves(rw.Plan(scene, work.task.parameters, moves=none), predictor, work)
    start, levels, made = work.start, rest.before, 0
    start.q[0, list(scene.template.coordinates).index("disc.x")] += rng.uniform(-0.003, 0.003)
    reached = False
    while not reached:
        course = rest.next(replace(work, start=start), levels)
        assert course is not None
        np.testing.assert_array_equal(len(rest.made), len(course.counts))
        start, levels, reached = course.places[-1], course.levels, course.reached
        made += len(course.counts)
    assert made >= 3


@pytest.mark.long
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_three_fingers_lift_a_ball_and_turn_it(seed: int) -> None:
    found = _plan(rw.load("ball_turn"), "dynamic-compliant", seed, 12_000)
    assert found.course.reached


@pytest.mark.long
@pytest.mark.parametrize(("turn", "seed"), [(30.0, 0), (60.0, 1), (90.0, 2), (-90.0, 0)])
@pytest.mark.parametrize("cube", [False, True])
def test_four_fingers_turn_what_lies_in_the_palm(cube: bool, turn: float, seed: int, tmp_path: Path) -> None:
    scene = _cube(tmp_path) if cube else rw.load("hand_turn")
    _plan(scene, "dynamic-compliant", seed, 10_000, turn=turn)


@pytest.mark.long
def test_where_fingers_cannot_come_to_the_object_the_reason_says_so_and_trees_end_at_once() -> None:
    far = unnamed_hand(0.5, 40).file.model_dump(mode="json", exclude_unset=True)
    far["bodies"]["disc"]["pose"]["y"] = 3.0
    task = task_of(rw.load(far))
    work = begin(task, Budget(100_000, None), 0, 1)
    predictor = work.predictor(Stage(rw.QUASISTATIC_COMPLIANT, 1e-2))
    hand, _ = _hand(task)
    tree, way = cycled(work, predictor, hand, task.before, 0)
    assert tree is not None and len(tree.parent) == 1 and not len(way) and not work.budget.spent.total()
    assert "fewer than two fingers can touch the object and follow it" in known(work)
    assert work.failures.total() <= IDLE * ABREAST


@pytest.mark.long
def test_a_plan_is_led_on_from_as_far_as_it_comes() -> None:
    task = task_of(unnamed_hand(0.8, 40))
    work = begin(task, Budget(40_000, None), 0, 1)
    predictor = work.predictor(Stage(rw.QUASISTATIC_COMPLIANT, 1e-2))
    hand, _ = _hand(task)
    _, way = cycled(work, predictor, hand, task.before, 0)
    assert len(way) > 3
    tree, same = cycled(work, predictor, hand, task.before, 1, rounds=0, planted=way)
    assert tree is not None and np.array_equal(same, way) and len(tree.parent) == len(way) + 1
    tree, none = cycled(work, predictor, hand, task.before, 1, rounds=0, planted=way[:-2])
    assert tree is not None and not len(none) and np.array_equal(tree.vectors[1:], way[:-2])
    _, on = cycled(work, predictor, hand, task.before, 1, planted=way[:-2])
    assert len(on) and np.array_equal(on[: len(way) - 4], way[: len(way) - 4])

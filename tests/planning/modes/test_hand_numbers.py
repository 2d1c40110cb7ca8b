"""Numbers by which cycles of a hand are searched, from both sides."""

from __future__ import annotations

from collections import Counter
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import rungwise as rw
from rungwise.kernel import Reals
from rungwise.planning.modes.hands import cycles, gaits
from rungwise.planning.modes.hands.cycles import Cycles, Stance, Wish, wish
from rungwise.planning.modes.hands.hand import Hand, hand_of
from rungwise.planning.modes.hands.press import held, is_led, pressing, rests, targets
from rungwise.planning.modes.hands.touch import closed, followed, is_clear
from rungwise.planning.task.task import task_of
from rungwise.world.find import world_of
from tests.planning.members import unnamed_hand


def stub(**members: Any) -> Any:
    return SimpleNamespace(**members)


def _hand(scene: Any) -> tuple[Hand, Reals]:
    task = task_of(scene)
    hand = hand_of(task)
    assert hand is not None
    return hand, np.asarray(world_of(task.scene).at(task.parameters).q)


@pytest.fixture(scope="module", params=["plane", "space"])
def made(request: pytest.FixtureRequest) -> tuple[Hand, Reals]:
    """Two fingers about a disc, and four about a ball."""
    return _hand(unnamed_hand(0.5, 40) if request.param == "plane" else rw.load("hand_turn"))


def _pushes(at: tuple[float, float], way: tuple[float, float]) -> Reals:
    """Rows (2, 3) of a contact at a place of a body in the plane, which is pushed that way there."""
    (x, y), (c, s) = at, way
    return np.array([[c, s, x * s - y * c], [-s, c, x * c + y * s]])


def _held_thing(
    contacts: list[tuple[Reals, float]], floor: tuple[Reals, ...] = (), load: Reals | None = None,
    gap: float = 0.0,
) -> Any:  # fmt: skip
    """A body of size 1 in the plane, fingers at contacts with their friction, and a floor with a friction of
    1/2 at this gap."""
    loads = np.zeros(3) if load is None else load

    def touches(_q: Reals, within: float) -> Any:
        rows = np.array([each for each in floor if gap < within]).reshape(-1, 2, 3)
        return stub(pairs=np.full(len(rows), 9), rows=rows, friction=np.full(len(rows), 0.5))

    around = stub(
        dimension=2, near=lambda _q, pair: stub(rows=contacts[pair][0], friction=contacts[pair][1]),
        touches=touches, loads=lambda _q: loads,
    )  # fmt: skip
    return stub(around=around, columns=np.arange(3), fixed=frozenset({9}), size=1.0)


FLOOR = (_pushes((-0.5, -0.5), (0.0, 1.0)), _pushes((0.5, -0.5), (0.0, 1.0)))
NONE = np.zeros(0)


@pytest.mark.parametrize(("slope", "holds"), [(0.3, True), (0.45, False)])
def test_fingers_keep_a_part_of_their_friction(slope: float, holds: bool) -> None:
    """Two that face each other, aside of each other by a part of the friction of 1/2."""
    for low in (0.5, 2.0):
        hand = _held_thing(
            [
                (_pushes((-1.0 * low, -slope * low), (1.0, 0.0)), 0.5),
                (_pushes((low, slope * low), (-1.0, 0.0)), 0.5),
            ]
        )
        assert (held(hand, NONE, [0, 1], 1.0).off < 1e-6) == holds


def test_fingers_rather_balance_than_press_as_they_are_to_and_rather_press_than_not() -> None:
    """What is carried needs twice the force that is asked for; and what two smooth fingers turn, none."""
    weight = _held_thing([(_pushes((0.0, -0.5), (0.0, 1.0)), 0.5)], load=np.array([0.0, -2.0, 0.0]))
    assert held(weight, NONE, [0], 1.0).off < 0.3
    for aside in (0.1, 0.2):
        contacts = [
            (_pushes((-1.0, -aside), (1.0, 0.0)), 0.0),
            (_pushes((1.0, aside), (-1.0, 0.0)), 0.0),
        ]
        assert held(_held_thing(contacts), NONE, [0, 1], 1.0).forces[:, 0].min() > 0.5


@pytest.mark.parametrize(
    ("way", "pushed"),
    [((1.0, 0.0, 0.0), True), ((-1.0, 0.0, 0.0), False), ((0.3, 0.0, 0.0), True), ((-0.3, 0.0, 0.0), False)],
)
def test_friction_of_what_an_object_slides_over_is_against_its_motion(
    way: tuple[float, float, float], pushed: bool
) -> None:
    """A smooth finger pushes a weight of 1 over a floor, and never pulls it."""
    finger = (_pushes((-0.5, -0.5), (1.0, 0.0)), 0.0)
    thing = _held_thing([finger], FLOOR, np.array([0.0, -1.0, 0.0]))
    assert (held(thing, NONE, [0], 0.5, np.array(way)).off < 1e-6) == pushed


def test_what_supports_an_object_leaves_it_as_that_rises() -> None:
    thing = _held_thing([(_pushes((0.0, 0.5), (0.0, -1.0)), 0.0)], FLOOR, np.array([0.0, -1.0, 0.0]))
    for way, carried in ((1.0, False), (-1.0, True)):
        assert (held(thing, NONE, [0], 0.2, np.array([0.0, way, 0.0])).off < 1e-6) == carried


@pytest.mark.parametrize(("apart", "led"), [(0.005, False), (0.5, True)])
def test_fingers_that_are_far_from_each_other_leave_an_object_no_motion(apart: float, led: bool) -> None:
    contacts = [(_pushes((0.5, y), (-1.0, 0.0)), 0.5) for y in (-apart, apart)]
    assert is_led(_held_thing(contacts), NONE, [0, 1], np.array([0.0, 1.0, 0.0])) == led


def test_two_tips_that_lift_a_ball_count_less_than_three() -> None:
    hand, q = _hand(rw.load("ball_turn"))
    wanted = Wish(np.zeros(len(hand.around.owners)), 1)
    wanted.change[hand.columns[2]] = 0.01
    touches, place = dict[int, cycles.Touch](), q.copy()
    for f, finger in enumerate(hand.fingers):
        at, way = (
            q[:3] + np.array([0.0, 0.0, 0.005]),
            0.05 * np.array([np.cos(2.1 * f), np.sin(2.1 * f), 0.0]),
        )
        begun = finger.posed(place, at + way - hand.around.poses(q)[sorted(finger.bodies)[-1]][:3])
        found = closed(hand, finger, begun, finger.touching[0])
        assert found is not None
        joints = finger.chain.joints(found)
        touches[f] = cycles.Touch(finger.touching[0], np.array([joints, joints]))
    every = Cycles(hand, q)
    two, three = (
        every._firmness(q, Stance({f: touches[f] for f in which}, frozenset(), 1), wanted, 0)
        for which in ((0, 1), (0, 1, 2))
    )
    assert three > 0.7 and -1.5 < two < three - 0.1


def test_fingers_stay_where_they_touch_in_a_part_of_the_sets(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Cycles, "_firmness", lambda *_: 1.0)
    touch = cycles.Touch(0, np.zeros((3, 2)))
    pools = [[(True, touch), *[(False, touch)] * 12]] * 3
    hand: Any = stub(fingers=[])
    found = Cycles(hand, NONE)._stances(NONE, pools, Wish(NONE, 4), np.random.default_rng(0))
    stay = np.mean([len(stance.stays) == len(stance.touches) for stance in found])
    assert 0.1 < stay < 0.9


def test_what_hardly_slides_sticks() -> None:
    """A body that turns about its only contact with the floor, nearly, is held both ways."""
    for slip in (-0.01, 0.01):
        finger = (_pushes((-0.5, -0.5), (1.0, 0.0)), 0.0)
        thing = _held_thing([finger], (_pushes((0.0, -0.5), (0.0, 1.0)),), np.array([0.0, -1.0, 0.0]))
        assert held(thing, NONE, [0], 0.2, np.array([0.5 + slip, 0.0, -1.0])).off < 1e-6


@pytest.mark.parametrize(("of", "least", "most"), [(1, 6, 30), (12, 30, 80), (1000, 40, 100)])
def test_more_postures_are_drawn_where_few_touch(
    of: int, least: int, most: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where one of so many does."""
    seen = list[Reals]()

    def closes(_hand: Any, _finger: Any, q: Reals, _pair: int) -> Reals | None:
        seen.append(q)
        return q if len(seen) % of == 0 else None

    monkeypatch.setattr(cycles, "closed", closes)
    monkeypatch.setattr(cycles, "is_clear", lambda *_: True)
    monkeypatch.setattr(Cycles, "_touch", lambda *_: cycles.Touch(0, np.zeros((3, 2))))
    finger = stub(
        chain=stub(joints=lambda q: q), low=np.zeros(2), high=np.ones(2), touching=(0,),
        posed=lambda _q, joints: joints,
    )  # fmt: skip
    hand: Any = stub(fingers=[finger], around=stub(near=lambda *_: stub(gap=1.0)), size=1.0)
    found = Cycles(hand, np.zeros(2))._pool(0, np.zeros(2), Wish(np.zeros(1), 4), np.random.default_rng(0))
    assert least <= len(seen) <= most
    assert len(found) == len(seen) // of and (of > 12 or len(found) >= 3)


@pytest.mark.parametrize(("gap", "lies"), [(0.005, True), (0.1, False)])
def test_what_is_near_supports_an_object(gap: float, lies: bool) -> None:
    assert rests(_held_thing([], FLOOR, np.array([0.0, -1.0, 0.0]), gap), NONE, [], 1.0) == lies


@pytest.mark.parametrize(("slope", "pushed", "stays"), [(0.5, 0.1, True), (1.2, 1.2, False)])
def test_an_object_rests_where_its_load_is_nearly_balanced(slope: float, pushed: float, stays: bool) -> None:
    """By friction, of which a part is kept, or with a smooth finger that pushes down the slope, too."""
    assert rests(_held_thing([], FLOOR, np.array([slope, -1.0, 0.0])), NONE, [], 1.0) == stays
    finger = (_pushes((-0.5, 0.0), (1.0, 0.0)), 0.0)
    assert rests(_held_thing([finger], FLOOR, np.array([pushed, -1.0, 0.0])), NONE, [0], 1.0) == stays


@pytest.mark.parametrize(("load", "stays"), [(2e-7, True), (5e-6, False)])
def test_rounding_is_no_load(load: float, stays: bool) -> None:
    for press in (1.0, 1e3):
        thing = _held_thing([], load=np.array([0.0, 0.0, load * press]))
        assert rests(thing, NONE, [], press) == stays


def _joint(load: float, limit: float = 1.0) -> tuple[Any, Any]:
    """A finger of one joint that carries a load, in a hand."""
    chain = stub(joints=lambda q: q, columns=[0], hinges=np.array([True]))
    servos = stub(limit=np.array([limit]), stiffness=np.array([10.0]))
    finger = stub(rates=lambda _: np.eye(1), chain=chain, driven=stub(servos=servos))
    near = stub(rows=np.ones((1, 1)))
    return stub(around=stub(loads=lambda _: np.array([load]), near=lambda *_: near), size=1.0), finger


def test_servos_carry_fingers_with_half_of_their_force_and_never_press_with_all() -> None:
    for load, least, most in ((-0.5, 0.5, 0.5), (-5.0, 0.5, 0.9)):
        hand, finger = _joint(load)
        torque = 10.0 * float(targets(hand, finger, np.zeros(1), -1, np.zeros(0))[0])
        assert least - 1e-12 <= torque <= most + 1e-12
    # A finger that would yield little is as strong as its servos, but for a reserve.
    assert 0.4 < pressing(*_joint(0.0), np.zeros(1), 0, 10.0) < 0.9
    assert pressing(*_joint(0.0), np.zeros(1), 0, 0.02) == pytest.approx(0.2)


def test_fingers_overlap_by_less_than_a_hundredth() -> None:
    for gap, is_free in ((-3e-4, True), (-5e-3, False)):
        hand = stub(around=stub(least=lambda _, pairs, gap=gap: np.full(len(pairs), gap)), size=1.0)
        assert is_clear(hand, stub(around=np.arange(3)), np.zeros(1)) == is_free


def _drawn(hand: Hand, q: Reals, rng: np.random.Generator) -> tuple[Any, Reals | None]:
    """A finger, and the place with it led to the object from a posture that is drawn."""
    finger = hand.fingers[int(rng.integers(len(hand.fingers)))]
    posture = finger.low + (finger.high - finger.low) * rng.random(len(finger.low))
    return finger, closed(hand, finger, finger.posed(q, posture), finger.touching[0])


def test_fingers_come_to_the_object_from_nearly_everywhere(made: tuple[Hand, Reals]) -> None:
    hand, q = made
    rng, touching = np.random.default_rng(0), 0
    for _ in range(40):
        finger, place = _drawn(hand, q, rng)
        if place is not None:
            touching += 1
            assert abs(hand.around.near(place, finger.touching[0]).gap) < 3e-3 * hand.size
    assert touching >= 28


def _followed(hand: Hand, q: Reals, far: float, steps: int, count: int) -> list[tuple[Any, Reals, Any]]:
    """Fingers, places at which they touch, and how they follow as the object turns so far."""
    rng, found = np.random.default_rng(0), list[tuple[Any, Reals, Any]]()
    change = np.zeros(len(hand.around.owners))
    change[hand.columns[-1]] = far
    for _ in range(count):
        finger, place = _drawn(hand, q, rng)
        if place is not None:
            home = finger.chain.joints(q)
            found.append(
                (finger, place, followed(hand, finger, place, finger.touching[0], change, steps, home))
            )
    return found


@pytest.mark.few(1)
def test_fingers_that_reach_the_end_of_their_travel_stop_and_do_not_slip(made: tuple[Hand, Reals]) -> None:
    hand, q = made
    steps = [touch.steps for _, _, touch in _followed(hand, q, 1.6, 20, 24)]
    assert np.mean(steps) > 7 and min(steps) < 20
    for finger, place, touch in _followed(hand, q, 1.6, 20, 24):
        change = np.zeros(len(hand.around.owners))
        for k in range(touch.steps):
            change[hand.columns[-1]] = 0.08
            now = finger.posed(hand.around.changed(place, change * k), touch.joints[k])
            near = hand.around.near(now, finger.touching[0])
            way = near.rows[1:, hand.columns] @ change[hand.columns]
            own = near.rows[1:, finger.chain.columns] @ finger.rates(now)
            slip = np.linalg.norm(own @ (touch.joints[k + 1] - touch.joints[k]) + way)
            assert slip < 0.5 * np.linalg.norm(way)


def test_fingers_with_joints_to_spare_come_nearer_to_their_posture_and_stay_on_the_object() -> None:
    """Most do, by a fifth at least, and none at once."""
    hand, q = _hand(rw.load("hand_turn"))
    nearer = list[float]()
    for finger, _, touch in _followed(hand, q, 0.3, 12, 12):
        if touch.steps == 12:
            away = np.linalg.norm(touch.joints - finger.chain.joints(q), axis=1)
            nearer.append(float(away[-1] / away[0]))
            assert away[1] > 0.8 * away[0]
    assert len(nearer) > 3 and np.median(nearer) < 0.8


def test_postures_are_drawn_about_those_of_now_and_of_the_start_and_some_anywhere(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Of a finger of eight joints that is far from where it was: half of them here, half there."""
    seen = list[Reals]()
    monkeypatch.setattr(cycles, "closed", lambda _hand, _finger, q, _pair: seen.append(q))
    finger = stub(
        chain=stub(joints=lambda q: q), low=np.zeros(8), high=np.ones(8), touching=(0, 1),
        posed=lambda _q, joints: joints,
    )  # fmt: skip
    hand: Any = stub(fingers=[finger], around=stub(near=lambda *_: stub(gap=1.0)), size=1.0)
    home, now, rng = np.zeros(8), np.ones(8), np.random.default_rng(0)
    for _ in range(20):
        Cycles(hand, home)._pool(0, now, Wish(np.zeros(1), 4), rng)
    assert len(seen) >= 20 * 6
    away = np.sqrt(np.mean((np.array(seen)[:, None] - np.array([home, now])) ** 2, axis=2))
    near = away < 0.42
    assert 0.4 < near.any(axis=1).mean() < 0.8
    assert away[near].mean() > 0.1
    assert 0.6 < near[:, 0].sum() / near[:, 1].sum() < 1.6


def _towards(hand: Hand, q: Reals, turn: float) -> Reals:
    change = np.zeros(len(hand.around.owners))
    change[hand.columns[-1]] = turn
    return hand.around.changed(q, change)


def test_a_cycle_is_to_go_about_as_far_as_fingers_follow() -> None:
    """Of a turn of 2.5 radians: most follow half a radian, and on average half of what is wished."""
    hand, q = _hand(rw.load("hand_turn"))
    wanted = wish(hand, q, _towards(hand, q, 2.5))
    every, rng = Cycles(hand, q), np.random.default_rng(0)
    parts = [
        touch.steps / wanted.steps
        for f in range(len(hand.fingers))
        for _, touch in every._pool(f, q, wanted, rng)
    ]
    assert np.mean(parts) > 0.45
    assert np.median(parts) * wanted.change[hand.columns[-1]] > 0.5


@pytest.mark.few(1)
@pytest.mark.parametrize("seed", [0, 3])
def test_enough_sets_of_fingers_are_compared_for_three_cycles(seed: int) -> None:
    hand, q = _hand(unnamed_hand(0.5, 40))
    found = Cycles(hand, q).proposals(q, _towards(hand, q, 0.5), 3, np.random.default_rng(seed))
    assert len(found) == 3


class _Laid:
    """Stances of four fingers about a ball that is to turn, and the cycles that are laid out with them."""

    def __init__(self) -> None:
        self.hand, self.q = _hand(rw.load("hand_turn"))
        self.cycles, self.rng = Cycles(self.hand, self.q), np.random.default_rng(0)
        self.wanted = wish(self.hand, self.q, _towards(self.hand, self.q, 1.0))
        fingers = range(len(self.hand.fingers))
        pools = [self.cycles._pool(f, self.q, self.wanted, self.rng) for f in fingers]
        self.stances = self.cycles._stances(self.q, pools, self.wanted, self.rng)
        self.ends = np.cumsum([0, *(len(finger.low) for finger in self.hand.fingers)])

    def moves(self, count: int) -> list[tuple[Stance, list[list[Reals]]]]:
        """The first stances of which a cycle comes, and of its moves the joints, finger by finger."""
        found = list[tuple[Stance, list[list[Reals]]]]()
        for stance in self.stances:
            laid = self.cycles._laid(self.q, stance, self.wanted, self.rng)
            if laid is not None and len(found) < count:
                found.append((stance, [np.split(move, self.ends[1:-1]) for move in laid]))
        return found


@pytest.fixture(scope="module")
def laid_out() -> _Laid:
    return _Laid()


@pytest.mark.long
def test_fingers_stay_on_the_object_between_moves(laid_out: _Laid, monkeypatch: pytest.MonkeyPatch) -> None:
    """If servos went straight to where they are to be, halfway there as well."""
    own = laid_out
    monkeypatch.setattr(cycles, "targets", lambda _hand, finger, q, _pair, _force: finger.chain.joints(q))
    for stance, moves in own.moves(4):
        touching = [
            k for k, move in enumerate(moves)
            if all(np.allclose(move[f], touch.joints[0]) for f, touch in stance.touches.items())
        ][-1]  # fmt: skip
        rows, steps = moves[touching:], np.linspace(0, stance.steps, len(moves) - touching).round()
        for k in range(len(rows) - 1):
            turned = own.wanted.change * (0.5 * (steps[k] + steps[k + 1]) / own.wanted.steps)
            for f, touch in stance.touches.items():
                half = 0.5 * (rows[k][f] + rows[k + 1][f])
                place = own.hand.fingers[f].posed(own.hand.around.changed(own.q, turned), half)
                assert abs(own.hand.around.near(place, touch.pair).gap) < 0.03 * own.hand.size


@pytest.mark.long
def test_some_cycles_press_lightly_and_others_firmly(laid_out: _Laid) -> None:
    """By how far the targets of a joint are from it, at most, in the end: what servos yield by."""
    yields = [
        max(float(np.abs(moves[-1][f] - touch.joints[stance.steps]).max()) for f, touch in own.items())
        for stance, moves in laid_out.moves(20)
        for own in (stance.touches,)
    ]
    assert 0.005 < min(yields) < 0.05 and 0.05 < max(yields) < 0.3


def test_fingers_that_let_go_keep_a_clear_distance_and_stay_near(made: tuple[Hand, Reals]) -> None:
    hand, q = made
    rng, count = np.random.default_rng(0), 0
    while count < 6:
        finger, place = _drawn(hand, q, rng)
        if place is None:
            continue
        f = hand.fingers.index(finger)
        joints = Cycles(hand, q)._apart(place, Stance({}, frozenset(), 0))[f]
        gap = hand.around.near(finger.posed(place, joints), finger.touching[0]).gap
        assert 0.05 * hand.size < gap < 0.5 * hand.size
        count += 1


@pytest.mark.parametrize("between", [0.3, 0.5, 0.7])
def test_what_is_in_the_way_of_a_finger_is_seen(between: float) -> None:
    """A post whose width is a quarter of the way."""
    chain = stub(joints=lambda q: q)
    finger = stub(chain=chain, posed=lambda _q, joints: joints, around=np.zeros(1, np.int64))
    around = stub(least=lambda q, pairs: np.full(len(pairs), abs(q[0] - between) - 0.125))
    hand: Any = stub(fingers=[finger], around=around, between=np.zeros(0, np.int64), size=1.0)
    passes = Cycles(hand, np.zeros(1))._passes
    assert not passes(np.zeros(1), {0: np.zeros(1)}, {0: np.ones(1)})
    assert passes(np.zeros(1), {0: np.full(1, between + 0.2)}, {0: np.ones(1)})


def test_cycles_run_side_by_side_from_a_few_nodes(monkeypatch: pytest.MonkeyPatch) -> None:
    """Several from each, held for times that differ, in parts of the range."""
    proposed = list[int]()

    def proposals(_q: Reals, _goal: Reals, count: int, _rng: Any) -> list[list[Reals]]:
        proposed.append(count)
        return [[np.zeros(1)]] * count

    monkeypatch.setattr(gaits, "inputs", lambda *_: np.zeros(1))
    task: Any = stub(away=lambda goals, _q: np.zeros(len(goals)))
    goals, every, hand = np.zeros((1, 1)), list[float](), stub(fingers=[])
    moves: Any = stub(held_for=lambda rows, times: np.column_stack([rows, times]), size=2)
    tree: Any = stub(
        q=np.zeros((9, 1)), depth=np.zeros(9, np.int64), lack=np.ones(9), parent=np.zeros(9, np.int64),
        vectors=np.ones((9, 2)), levels=np.zeros((9, 1)),
    )  # fmt: skip
    for seed in range(8):
        proposed.clear()
        own = gaits.Gaits(task, hand, goals)
        own._cycles = stub(proposals=proposals)
        nodes, vectors = own(moves, tree, 40, np.random.default_rng(seed))
        assert 2 <= len(set(nodes.tolist())) <= 6 and min(proposed) >= 2 and len(nodes) <= 24
        every += vectors[:, -1].tolist()
    assert min(every) >= 0.0 and max(every) <= 1.0 and max(every) - min(every) > 0.2


@pytest.mark.parametrize(("deepest", "goes_on"), [(1, False), (2, True)])
def test_cycles_end_where_plans_may_have_no_more_moves(deepest: int, goes_on: bool) -> None:
    """Two moves of a cycle are left, the first of which was made."""
    move = np.ones(2)
    own: Any = stub(_seen=1, _running=[gaits.Running(0, [move, move], move.tobytes())])
    tree: Any = stub(parent=np.array([-1, 0]), vectors=np.ones((2, 2)), depth=np.array([0, 1]))
    gaits.Gaits._go_on(own, tree, deepest)
    assert [each.node for each in own._running] == ([1] if goes_on else [])


@pytest.mark.parametrize("most", [10, 50])
def test_trees_of_cycles_may_grow_deeper_than_a_plan(most: int, monkeypatch: pytest.MonkeyPatch) -> None:
    given = list[int]()

    def grow(*arguments: Any) -> Any:
        given.extend(each for each in arguments if isinstance(each, int))
        return stub(lack=np.ones(1), q=np.zeros((1, 1))), []

    monkeypatch.setattr(gaits, "grow", grow)
    monkeypatch.setattr(gaits, "goals_of", lambda _: np.zeros((1, 1)))
    task = stub(before=NONE, moves=(1, most))
    work: Any = stub(
        kept={}, task=task, seed=0, moves=None, start=None, whole=None, came_near=lambda *_: None,
        failures=Counter(),
    )  # fmt: skip
    assert gaits.by_hand(work, stub(), stub(fingers=[])) is None
    assert given[0] == most and given[1] >= 2 * most

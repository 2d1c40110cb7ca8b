"""Numbers by which contact modes are told, followed and led, from both sides."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import rungwise as rw
from rungwise.kernel import Reals
from rungwise.planning.modes import arm_paths, follow, guide
from rungwise.planning.modes.balance import is_led_by
from rungwise.planning.modes.forces.cones import PART, SLIDE, contact_edges, memory_for, ring_of
from rungwise.planning.modes.forces.drag import lying
from rungwise.planning.modes.forces.mode_motions import drags, every_mode, turn
from rungwise.planning.modes.grips import Grip, _not_followed, touching
from rungwise.planning.modes.ground import Ground
from rungwise.planning.modes.legs import Writer
from rungwise.planning.modes.outlines import alike
from rungwise.planning.modes.planner import ModePlanner
from rungwise.planning.modes.running.in_turn import InTurn
from rungwise.planning.motion.free_paths import is_clear
from rungwise.planning.search.layout import _kept
from rungwise.world.planar.surroundings import PlanarSurroundings
from tests.planning.modes.test_palms import PALM, ground_of, hold


def stub(**members: Any) -> Any:
    return SimpleNamespace(**members)


@pytest.mark.parametrize(("off", "clear"), [(3e-10, True), (3e-9, False)])
def test_ways_may_be_as_near_as_they_are_to_but_for_rounding(off: float, clear: bool) -> None:
    """Place by place, and in one call, with gaps that lack so much of the least one."""
    none, pairs = np.zeros(1), np.zeros(1, np.int64)
    for least in (1e-3, 0.2):
        gap = least * (1.0 - off)
        assert is_clear(lambda rows, gap=gap: np.full(len(rows), gap), none, none, 0.0, least) == clear
    scene = rw.load("push")
    around, q = PlanarSurroundings(scene, scene.parameters()), rw.State.of(scene).q.copy()
    q[0] -= 0.03
    gap = float(around.least(q, pairs)[0])
    assert gap > 0.0 and around.is_clear(q, q, 0.0, gap / (1.0 - off), pairs) == clear


MEMORY = memory_for(3, 2, 4, 3, 6)
UP, ACROSS, TURNING = np.eye(3)


def _seen(contacts: list[tuple[Reals, Reals]], friction: float = 0.5) -> np.ndarray[Any, Any]:
    """Write contacts with these normals and tangents; their numbers."""
    for i, (normal, tangent) in enumerate(contacts):
        MEMORY.normals[i], MEMORY.tangents[i], MEMORY.friction[i] = normal, tangent, friction
    MEMORY.bounds[0] = 0
    return np.arange(len(contacts))


@pytest.mark.parametrize(("slip", "edges"), [(2e-10, 2), (2e-8, 1)])
def test_rounding_is_no_slip(slip: float, edges: int) -> None:
    """What sticks has both edges of its cone, and what slides the one against its slip."""
    _seen([(UP, ACROSS)])
    for fast in (1.0, 1e3):
        change = fast * np.array([0.0, slip, 1.0])
        assert contact_edges(np.array([SLIDE]), change, 0.0, MEMORY, 0) == edges


@pytest.mark.parametrize(("tilt", "modes"), [(0.06, 2), (0.02, 1)])
def test_a_mode_makes_some_of_the_wanted_motion(tilt: float, modes: int) -> None:
    """Towards a contact, but for a tilt, an object goes where it parts from it, or hardly, along it."""
    _seen([(UP, ACROSS)])
    found = every_mode(1, np.array([math.cos(tilt), math.sin(tilt), 0.0]), MEMORY)
    assert found == modes


@pytest.mark.parametrize(("share", "carries"), [(5e-3, 2), (2e-4, 1)])
def test_contacts_that_carry_next_to_nothing_do_not_rub(share: float, carries: int) -> None:
    """A beam on two contacts that slide, whose weight is nearly above one of them."""
    ends = [np.array([1.0, 0.0, -1.0]), np.array([1.0, 0.0, 1.0])]
    weight = -((1.0 - share) * ends[0] + share * ends[1])
    lies = lying(np.full(2, SLIDE), np.array(ends), np.tile(ACROSS, (2, 1, 1)), np.full(2, 1e-6), weight)
    forces = None if lies is None else lies.normal_forces(np.zeros(3))
    assert lies is not None and forces is not None
    found = lies.support(forces)
    assert found is not None and len(found[0]) == carries


@pytest.mark.parametrize(("off", "stays"), [(0.05, True), (0.3, False)])
def test_what_is_pushed_tips_where_much_is_out_of_balance(off: float, stays: bool) -> None:
    for weight in (1.0, 100.0):
        load, push = -weight * UP, weight * np.array([0.0, 0.0, off])
        lies = lying(np.array([SLIDE]), UP[None], ACROSS[None, None], np.zeros(1), load)
        assert lies is not None and lies.stands(np.array([weight]), push, ACROSS) == stays


def _pushed(edges: list[Reals], contacts: list[Reals], mode: int) -> bool:
    """Whether smooth fingers along edges push an object on a support, with contacts in a mode, along x."""
    which = _seen([(normal, UP) for normal in contacts], 0.0)
    turn(np.eye(3), MEMORY)
    for f, edge in enumerate(edges):
        MEMORY.edges[2 * f] = MEMORY.edges[2 * f + 1] = edge
    count = 2 * len(edges)
    for normal in contacts if mode != PART else ():
        MEMORY.edges[count], count = normal, count + 1
    MEMORY.hoped[:] = ACROSS
    return bool(drags(count, len(edges), 1.0, np.full(len(which), mode), ACROSS, MEMORY))


@pytest.mark.parametrize(("tilt", "keeps"), [(3e-5, True), (1e-3, False)])
def test_what_is_pushed_closes_no_contact_that_parts(tilt: float, keeps: bool) -> None:
    assert _pushed([ACROSS - tilt * UP], [UP], PART) == keeps


def test_a_wall_that_is_kept_takes_what_a_finger_presses_against_it() -> None:
    """It slides along the wall, however much of the force goes into it; and two fingers that together keep
    to the wall do so, even if they turn the object, which is not wanted."""
    for tilt in (0.1, 1.0, 2000.0):
        assert _pushed([ACROSS - tilt * UP], [UP], SLIDE)
        assert np.abs(MEMORY.change[0]) < 1e-4
    for tilt in (0.1, 1.0, 3.0):
        assert not _pushed([ACROSS + tilt * UP], [UP], SLIDE)
    for turned in (0.5, 1.0):
        assert _pushed([ACROSS + UP + turned * TURNING, -UP + turned * TURNING], [UP], SLIDE)
        assert np.abs(MEMORY.change[0]) < 1e-5


@pytest.mark.parametrize(("share", "presses"), [(5e-3, True), (2e-4, False)])
def test_of_two_fingers_neither_may_hang_loose(share: float, presses: bool) -> None:
    """The other one keeps the object from turning, with such a part of the force of the first."""
    assert _pushed([ACROSS - share * TURNING, TURNING], [], SLIDE) == presses


def test_edges_of_cones_keep_nine_tenths_of_friction() -> None:
    ways = np.linspace(0.0, 2.0 * math.pi, 100)
    sides = ring_of(2)
    middles = 0.5 * (sides + np.roll(sides, 1, axis=0))
    assert len(sides) <= 16 and np.linalg.norm(middles, axis=1).min() > 0.9
    assert (np.column_stack([np.cos(ways), np.sin(ways)]) @ sides.T).max(axis=1).min() > 0.9


@pytest.mark.parametrize(("lean", "led"), [(6e-4, True), (5e-5, False)])
def test_fingers_lead_an_object_by_contacts_that_differ(lean: float, led: bool) -> None:
    rows = np.array([[UP, ACROSS], [UP + lean * TURNING, ACROSS]])
    seen = stub(touches=stub(rows=rows), closed=np.zeros(0, np.int64))
    ground = stub(columns=np.arange(3), units=np.ones(3))
    both = Grip(np.arange(2), np.arange(2), np.arange(2), False)
    assert is_led_by(ground, seen, both, np.zeros(0, np.int64)) == led


@pytest.mark.parametrize(("slow", "bound"), [(5e-3, 1), (2e-4, 2)])
def test_joints_that_hardly_move_a_contact_do_not_follow(slow: float, bound: int) -> None:
    """Of two joints, one moves the contact less; the third direction none moves."""
    finger = stub(moved=[3, 4], rates=lambda _q: np.diag([1.0, slow]))
    rows = np.array([[[1, 0, 0, 1, 0], [0, 1, 0, 0, 1], [0, 0, 1, 0, 0]]], float)
    ground = stub(fingers=[finger], columns=np.arange(3), units=np.ones(3))
    seen = stub(q=None, touches=stub(rows=rows))
    held = Grip(np.zeros(1, np.int64), np.zeros(1, np.int64), np.zeros(1, np.int64), True)
    assert len(_not_followed(ground, seen, held)) == bound


@pytest.mark.parametrize(("apart", "count"), [(2e-3, 1), (0.05, 2)])
def test_contacts_of_a_finger_that_are_next_to_each_other_are_one(apart: float, count: int) -> None:
    for size in (0.1, 3.0):
        points = size * np.array([[0.0, 0.0], [0.0, apart]])
        touches = stub(points=points, pairs=np.zeros(2, np.int64), gaps=np.zeros(2))
        ground = stub(fingers=[stub(contacts=4)], own=np.zeros(1, np.int64), closed=1.0, task=stub(size=size))
        assert len(touching(ground, stub(touches=touches, held=np.zeros(1, np.int64)), 0)) == count


@pytest.mark.parametrize(("gap", "count"), [(5e-4, 2), (8e-3, 0)])
def test_contacts_are_closed_up_to_a_five_hundredth_of_the_size(gap: float, count: int) -> None:
    ground, q = ground_of(hold([(-0.12, 0.04, PALM)], 1, "box.x > 1", "floor"))
    q[ground.columns[1]] += gap * ground.task.size
    assert len(ground.look(q).closed) == count


@pytest.mark.parametrize(("weak", "follows"), [(5e-6, True), (3e-7, False)])
def test_drives_that_hardly_move_a_contact_do_not_lead_it(weak: float, follows: bool) -> None:
    """Of two joints, one moves the contact next to not at all: by rounding, or little."""
    finger = stub(moved=[1, 2], rates=lambda _q: np.diag([1.0, weak]), arm=None)
    finger.drives, finger.put = lambda _q: np.zeros(2), lambda _q, drives: drives
    rows = np.array([[[-1, 1, 0], [-1, 0, 1]]], float)
    seen = stub(q=np.zeros(3), held=np.zeros(1, np.int64), touches=stub(rows=rows))
    ground = stub(
        around=stub(owners=np.zeros(3), changed=lambda q, _whole: q.copy()), columns=np.zeros(1, np.int64),
        placing=np.array([[-1, -1]]), arms=[0], fingers=[finger], touched=lambda _seen, _f: [0],
    )  # fmt: skip
    joints = Ground.moved(ground, seen, np.array([0.01]), np.ones(1, np.int64))
    assert joints[0] == pytest.approx(0.01) and (abs(joints[1]) > 1.0) == follows


def _follows(
    monkeypatch: pytest.MonkeyPatch, far: float, motion: Any = None, after: Any = None, size: float = 1.0
) -> follow.Way:
    """A way of an object on one contact to a target that is so far."""
    touches = stub(features=np.array([7]), pairs=np.zeros(1, np.int64), points=np.zeros((1, 2)))
    seen = stub(q=np.zeros(3), closed=np.zeros(1, np.int64), touches=touches)
    ground = stub(
        task=stub(size=size), off=lambda _q, _to: np.array([far, 0.0, 0.0]), pushes=False,
        columns=np.arange(3), around=stub(dimension=2, owners=np.zeros(3)), moved=lambda *_: None,
        corrected=lambda *_: after,
    )  # fmt: skip
    monkeypatch.setattr(follow, "weights_of", lambda _task, columns: np.ones(len(columns)))
    monkeypatch.setattr(follow, "motion", lambda *_: motion)
    monkeypatch.setattr(follow, "_stopped", lambda *_: "")
    monkeypatch.setattr(follow, "_runs_into", lambda *_: "")
    return follow.follow(
        ground, seen, np.ones(1, np.int64), (SLIDE,), np.zeros(3), 0.0, lambda _steps: None
    )  # fmt: skip


@pytest.mark.parametrize(("far", "why"), [(5e-4, follow.TARGET), (5e-3, follow.BALANCE)])
def test_targets_are_reached_up_to_a_thousandth_of_the_size(
    far: float, why: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    for size in (0.1, 2.0):
        assert _follows(monkeypatch, far * size, size=size).why == why


@pytest.mark.parametrize(("away", "why"), [(0.03, follow.LENGTH), (0.4, follow.CONTACT)])
def test_contacts_that_go_on_to_a_next_feature_stay_the_same(
    away: float, why: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    for size in (0.1, 2.0):
        motion = stub(change=np.array([size, 0.0, 0.0]), led=None, pushes=np.zeros(3))
        touches = stub(
            features=np.array([8]), pairs=np.zeros(1, np.int64), points=np.array([[0.0, away * size]])
        )
        after = stub(q=np.zeros(3), closed=np.zeros(1, np.int64), touches=touches)
        assert _follows(monkeypatch, size, motion, after, size).why == why


@pytest.mark.parametrize(("bow", "count"), [(5e-4, 1), (5e-3, 2)])
def test_legs_keep_to_their_way_up_to_a_thousandth_of_the_size(bow: float, count: int) -> None:
    """A way that is bowed by so much of the size becomes one segment, or two."""
    for size in (0.1, 2.0):
        put = list[str]()
        ground = stub(fingers=[stub(places=[0, 1])], task=stub(size=size))
        own = stub(
            ground=ground,
            aimed=lambda q, _push: q,
            _aims=np.zeros(2),
            _put=lambda _row, label, put=put: put.append(label),
        )
        places = size * np.array([[0.0, 0.0], [1.0, bow], [2.0, 0.0]])
        way = stub(places=places, pushes=places, used=np.ones(1, np.int64))
        Writer._follow(own, stub(way=way))
        assert put == ["touch", *(["follow"] * count)]


def test_places_that_face_alike_are_within_a_right_angle_and_are_several() -> None:
    def circle(parts: Reals) -> tuple[Reals, Reals]:
        ways = np.column_stack([np.cos(2.0 * math.pi * parts), np.sin(2.0 * math.pi * parts)])
        return ways, ways

    rng = np.random.default_rng(0)
    parts = np.repeat([0.1, 0.6], 50)
    turned = 2.0 * math.pi * ((alike(circle, parts, rng) - parts + 0.5) % 1.0 - 0.5)
    assert np.abs(turned).max() < math.radians(60.0) and np.std(turned) > math.radians(10.0)


@pytest.mark.parametrize(("off", "near"), [(0.05, True), (0.5, False)])
def test_an_object_that_is_near_its_way_goes_on(off: float, near: bool) -> None:
    """A later leg is taken at once where it ends near where it was to."""
    for size in (0.1, 2.0):
        ground = stub(away=lambda _a, _b, size=size: off * size)
        made = stub(ground=ground, leg=stub(way=stub(places=[None])))
        own = stub(scene=stub(leg=lambda *_, made=made: made), work=stub(task=stub(size=size)), look=None)
        legs = [stub(changes=np.array([1])), stub(changes=np.array([1]))]
        found = InTurn._sooner(own, legs, [None, None], [None, None], 0, None, None)
        assert (found is not None) == near


def test_a_place_near_the_goal_from_which_no_tree_leads_on_is_given_up() -> None:
    """After some ten trees, not after as many as it is nearer; a few are grown there first."""
    for near in (1e-2, 1e-4):
        nodes = [stub(tries=[0]), stub(tries=[0])]
        rng = np.random.default_rng(0)
        own = stub(nodes=nodes, _lacks=lambda near=near: np.array([1.0, near]), work=stub(rng=rng))
        chosen = [ModePlanner._chosen(own) is nodes[1] for _ in range(12)]
        assert all(chosen[:4]) and not all(chosen)


@pytest.mark.parametrize("ramp", [False, True])
def test_a_plan_goes_on_a_little_after_it_came_to_the_goal(ramp: bool) -> None:
    """In the second of three moves, at three quarters of it."""
    rows: Any = [(np.full(1, float(k)), 1.0, ramp) for k in range(3)]
    run: Any = stub(outcome=[rw.Code.GOAL], switches=[1], places=stub(time=np.array([11.75])))
    kept = _kept(rows, run, stub(time=np.array([10.0])), np.zeros(1))
    assert 1.75 * 1.01 < sum(row[1] for row in kept) < 1.75 * 1.25


def _arm(gap: Any) -> Any:
    finger = stub(
        carrier=stub(body="tip", columns=[0], clearance=0.02), units=np.ones(1), arm=None,
        bounds=(np.full(1, -2.0), np.full(1, 2.0)), drives=lambda q: q, put=lambda _q, drives: drives,
    )  # fmt: skip
    scene = stub(template=stub(contacts=[("tip", "post")], bodies=["tip", "post"]))
    around = stub(least=lambda q, _own, _within: np.array([gap(float(q[0]))]))
    return stub(fingers=[finger], around=around, task=stub(scene=scene, size=0.1))


def test_ways_of_arms_see_what_is_as_wide_as_a_finger(monkeypatch: pytest.MonkeyPatch) -> None:
    """Posts of a width of a twentieth of a radian, wherever they are."""
    monkeypatch.setattr(arm_paths, "over_objects", lambda *_: frozenset())
    monkeypatch.setattr(arm_paths, "grown", lambda *_: None)
    for at in np.linspace(0.3, 0.7, 9).tolist():
        ground = _arm(lambda q, at=at: abs(q - at) - 0.025)
        assert arm_paths.arms_way(ground, np.zeros(1), np.ones(1), np.array([0]), 0, lambda: True) is None
        assert arm_paths.arms_way(ground, np.zeros(1), np.full(1, at - 0.1), [0], 0, lambda: True) is not None


def _free_body(least: Any = None) -> Any:
    """An object of size 1/10 in space that touches what is below, with gaps to what may be in the way."""
    rows = np.zeros((1, 3, 6))
    rows[0, 0, 2] = 1.0
    around = stub(
        owners=np.zeros(6), changed=lambda q, change: q + change,
        least=lambda q, pairs: np.full(len(pairs), least(q) if least else 1.0),
        is_clear=lambda *_: False,
    )  # fmt: skip
    return stub(
        around=around, columns=np.arange(6), units=np.array([1.0, 1.0, 1.0, 0.1, 0.1, 0.1]),
        task=stub(size=0.1), pairs=np.zeros(1, np.int64), closed=2e-4, off=lambda q, to: to - q,
        look=lambda _q: stub(touches=stub(rows=rows), closed=np.zeros(1, np.int64)),
    )  # fmt: skip


def test_objects_are_lifted_by_about_a_tenth_of_their_size() -> None:
    raised = guide._raised(_free_body(), np.zeros(6))
    assert 0.003 < raised[2] < 0.03 and not np.delete(raised, 2).any()


@pytest.mark.parametrize("at", [0.21, 0.47, 0.77])
def test_walls_across_the_straight_way_are_seen(at: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """Even if they are thin: a tenth of the way. Then there is a way about them, or none."""
    monkeypatch.setattr(guide, "grown", lambda *_: None)
    goal = np.array([1.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    ground = _free_body(lambda q: math.inf if q[2] > 0.0 else abs(q[0] - at) - 0.05)
    assert guide._lifted(ground, np.zeros(6), goal, 0, lambda: True) is None
    assert guide._lifted(_free_body(), np.zeros(6), goal, 0, lambda: True) is not None


def test_objects_may_turn_on_their_way_but_not_about(monkeypatch: pytest.MonkeyPatch) -> None:
    """By about half a radian beyond what they turn from start to goal."""
    rooms = list[Reals]()
    monkeypatch.setattr(guide, "grown", lambda _q, _goals, _columns, low, high, *_: rooms.append(high - low))
    goal = np.array([1.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    ground = _free_body(lambda q: math.inf if q[2] > 0.0 else -1.0)
    assert guide._lifted(ground, np.zeros(6), goal, 0, lambda: True) is None
    assert (rooms[0][3:] / 0.1 > 0.5).all() and (rooms[0][3:] / 0.1 < 3.0).all()

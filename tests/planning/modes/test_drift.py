"""Objects that fingers drag go where legs say; and legs of a tree go on where an object went elsewhere."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import rungwise as rw
from rungwise.kernel import Ints, Reals
from rungwise.outcome import Code
from rungwise.planning.modes import balance
from rungwise.planning.modes.balance import _lying
from rungwise.planning.modes.follow import follow
from rungwise.planning.modes.forces.cones import SLIDE
from rungwise.planning.modes.forces.drag import Lying
from rungwise.planning.modes.ground import Ground, Seen
from rungwise.planning.modes.planner import ModePlanner
from rungwise.planning.modes.running import in_turn
from rungwise.planning.modes.running.execute import Begun, Manner
from rungwise.planning.modes.running.in_turn import InTurn
from rungwise.planning.modes.tree import Leg
from rungwise.planning.motion.budget import Budget, Stage
from rungwise.planning.search.problem import begin
from rungwise.planning.task.task import task_of
from rungwise.scene.space import SpaceScene
from tests.planning.modes.test_space import fingers, ground_of, touching

DRIFT = 0.05
"""Part of its size by which an object may be elsewhere at the end of a leg."""


def tee(folder: Path, rng: np.random.Generator) -> SpaceScene:
    """A T of two boxes on a floor, which touches it with eight corners, and a finger."""
    wide, long, thick = rng.uniform(0.05, 0.08), rng.uniform(0.03, 0.06), rng.uniform(0.015, 0.02)
    body = (
        f'<geom type="box" size="{wide} {thick} .02" mass="{rng.uniform(0.1, 0.3)}"/>'
        f'<geom type="box" size="{thick} {long} .02" pos="0 {-long - thick} 0" mass=".2"/>'
    )
    return fingers(folder, 1, "object.x >= 1", body, 0.02)


def planar(ground: Ground, q: Reals, change: list[float]) -> Reals:
    """The place (n,) with the object moved by x and y, and turned."""
    whole = np.zeros(len(ground.around.owners))
    whole[ground.columns[[0, 1, 5]]] = change
    return ground.around.changed(q, whole)


def pushed(ground: Ground, q: Reals, rng: np.random.Generator) -> tuple[Leg, Seen]:
    """A leg of some length in which a finger pushes the object somewhere, and what touches as it begins."""
    points, normals = ground.around.outline(ground.body)(np.arange(0.5, 240) / 240)
    sides = points[(np.abs(normals[:, 2]) < 0.1) & (np.abs(points[:, 2]) < 0.01)]
    for _ in range(200):
        begun, used = touching(ground, q, [sides[int(rng.integers(len(sides)))]])
        target = planar(ground, q, [*rng.uniform(-0.08, 0.08, 2), rng.uniform(-0.6, 0.6)])
        if not ground.is_held(begun, used) or not ground.is_free(begun, used):
            continue
        mode = (SLIDE,) * len(begun.closed)
        way = follow(ground, begun, used, mode, target, 0.05, lambda _: None)
        if len(way.places) > 5:
            return Leg(np.ones(1, np.int64), way), begun
    raise AssertionError("no leg")


@pytest.mark.few(1)
@pytest.mark.parametrize("seed", range(12))
def test_a_tee_that_a_finger_pushes_goes_where_the_leg_says(tmp_path: Path, seed: int) -> None:
    rng = np.random.default_rng(seed)
    work = begin(task_of(tee(tmp_path, rng)), Budget(100_000, None), seed, 1)
    planner = ModePlanner(work)
    node, ground = planner.nodes[0], planner.scene.grounds["object"]
    q = node.places.q[0]
    rung = next(each for each in rw.LADDER if each.name == "dynamic-compliant")
    after = None
    while after is None:  # a finger finds no way to some places
        leg, _ = pushed(ground, q, rng)
        begun = Begun(ground, ground.look(q), leg)
        after = planner.scene.run(work.predictor(Stage(rung, 1e-2)), node, begun, Manner(0.05, 1.0))
    assert ground.away(after.places.q[0], leg.way.places[-1]) < DRIFT * work.task.size


@pytest.mark.long
def test_pushes_and_the_friction_that_they_meet_balance(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Most of them, to a hundredth of the weight; where friction is not sought anew few do."""
    left, stands = list[float](), Lying.stands

    def looked(lies: Lying, forces: Reals, wrench: Reals, change: Reals, *others: Any, **more: Any) -> bool:
        found = stands(lies, forces, wrench, change, *others, **more)
        slips = lies.slips(change)
        rubs = (lies.friction * forces / slips) @ np.einsum(
            "eti,etj,j->ei", lies.tangents, lies.tangents, change
        )
        off = float(np.linalg.norm(lies.weight + wrench + lies.normals.T @ forces - rubs))
        left.extend([off / float(np.linalg.norm(lies.weight))] * found)
        return found

    def unbalanced() -> list[float]:
        left.clear()
        for seed in range(8):
            rng = np.random.default_rng(seed)
            ground, begun = ground_of(tee(tmp_path, rng))
            pushed(ground, begun.q, rng)
        return list(left)

    monkeypatch.setattr(Lying, "stands", looked)
    sought = unbalanced()
    monkeypatch.setattr(balance, "SETTLED", 10.0)
    assert np.quantile(sought, 0.8) < 0.01 < np.quantile(unbalanced(), 0.2)


@pytest.mark.few(3)
@pytest.mark.parametrize("seed", range(8))
def test_normal_forces_of_all_corners_are_those_of_the_rung(tmp_path: Path, seed: int) -> None:
    """Also of those corners that modes do not tell apart."""
    scene = tee(tmp_path, np.random.default_rng(seed))
    ground, seen = ground_of(scene)
    lies = _lying(ground, seen, np.full(len(seen.closed), SLIDE))
    assert lies is not None and len(lies.kinds) == 8
    forces = lies.normal_forces(np.zeros(6))
    simulation = rw.Simulation(scene, "dynamic-compliant")
    simulation.step(0.1)
    pushes = np.asarray(simulation.observe().contacts.pushes)
    assert forces is not None
    np.testing.assert_allclose(np.sort(forces), np.sort(pushes), rtol=1e-3)


@pytest.mark.few(3)
@pytest.mark.parametrize("seed", range(10))
def test_near_a_motion_the_support_resists_as_coulomb_says(seed: int) -> None:
    rng, count = np.random.default_rng(seed), 5
    tangents = np.zeros((count, 2, 3))
    tangents[:, 0, 0] = tangents[:, 1, 1] = 1.0
    tangents[:, :, 2] = rng.normal(size=(count, 2))
    forces, friction, change = rng.uniform(0.5, 1.0, count), rng.uniform(0.3, 0.5, count), rng.normal(size=3)
    lies = Lying(np.zeros((count, 3)), tangents, friction, np.full(count, SLIDE), np.array([0.0, 0.0, -1.0]))
    slips = lies.slips(change)
    found = lies.support(forces, slips)
    assert found is not None
    rows, limit = found
    rubs = (friction * forces / slips) @ np.einsum("eti,etj,j->ei", tangents, tangents, change)
    drag = rows.T @ rows @ change
    drag *= limit / float(np.linalg.norm(rows @ change)) / float(np.linalg.norm(rows @ change))
    np.testing.assert_allclose(drag / np.linalg.norm(drag), rubs / np.linalg.norm(rubs), atol=1e-9)
    assert limit == pytest.approx(float(friction @ forces))


@pytest.mark.parametrize("slip", [0.0, 1e-3])
def test_a_contact_about_which_others_turn_rubs_little_more_than_these(slip: float) -> None:
    """Its part of the ellipsoid is bounded, however little it slips."""
    tangents = np.zeros((2, 1, 1)) + np.array([1.0, slip])[:, None, None]
    lies = Lying(np.zeros((2, 1)), tangents, np.ones(2), np.full(2, SLIDE), np.ones(1))
    found = lies.support(np.ones(2), lies.slips(np.ones(1)))
    even = lies.support(np.ones(2), np.ones(2))
    assert found is not None and even is not None
    assert float((found[0] ** 2).max()) < 1.0 and np.isfinite(found[0]).all()
    lies = Lying(np.zeros((2, 1)), np.ones((2, 1, 1)), np.ones(2), np.full(2, SLIDE), np.ones(1))
    found = lies.support(np.ones(2), np.array([1.9, 0.1]))
    assert found is not None and found[0][1, 0] ** 2 == pytest.approx(19.0 * found[0][0, 0] ** 2)
    found = lies.support(np.ones(2), np.array([2.0, slip]))
    assert found is not None and 5.0 < (found[0][1, 0] / found[0][0, 0]) ** 2 < 100.0


class Line:
    """An object on a line, led by legs to 1, 2 and 3; some runs, by their numbers, fall short, or fail."""

    def __init__(
        self, short: dict[int, float], lost: tuple[int, ...] = (), failing: tuple[int, ...] = ()
    ) -> None:
        self.short, self.lost, self.failing = short, lost, failing
        self.runs, self.led_on = list[float](), 0
        self.work: Any = SimpleNamespace(
            task=SimpleNamespace(size=1.0, moves=(1, 9)), failures=Counter[str](), grown=Counter[str](),
            start=SimpleNamespace(q=np.zeros((1, 1))), rng=np.random.default_rng(0),
        )  # fmt: skip
        self.ground: Any = SimpleNamespace(look=lambda q: q, away=lambda a, b: float(np.abs(a - b).max()))

    def leg_to(self, end: float) -> Leg:
        way: Any = SimpleNamespace(places=np.array([[end - 1.0], [end]]))
        changes: Ints = np.zeros(1, np.int64)
        return Leg(changes, way)

    def node(self, at: float, outcome: Code = Code.MISSED) -> Any:
        places = SimpleNamespace(q=np.array([[at]]))
        return SimpleNamespace(places=places, outcome=outcome, found="found", grasps=0)

    def run(self, ends: tuple[float, ...] = (1.0, 2.0, 3.0)) -> Any:
        scene: Any = SimpleNamespace(
            vector=lambda _ground, leg, _manner: leg.way.places[-1].copy(),
            leg=lambda q, vector, *_: (
                None if round(vector[0]) in self.lost else Begun(self.ground, q, self.leg_to(vector[0]))
            ),
            going_on=self._going_on,
        )
        turns = InTurn(self.work, scene, self._ran, lambda _: None, "dynamic-compliant")
        legs = [self.leg_to(end) for end in ends]
        return turns.run(self.node(0.0), self.ground, legs, Manner(0.0, 1.0), False)

    def next(self, at: float, ends: tuple[float, ...] = (1.0, 2.0, 3.0), failed: int = 0) -> Any:
        """Where the next of legs to these ends leads from a place, and the ends that are left."""
        scene: Any = SimpleNamespace(
            ground=lambda _: self.ground, end=lambda _q, vector: vector[:1],
            vector=lambda _ground, leg, _manner: np.array([leg.way.places[-1][0], 0.0]),
            leg=lambda q, vector, *_: (
                None if round(vector[0]) in self.lost else Begun(self.ground, q, self.leg_to(vector[0]))
            ),
        )  # fmt: skip
        turns = InTurn(self.work, scene, self._ran, lambda _: None, "dynamic-compliant")
        goal: Any = np.array([[3.0]]), lambda place: abs(place[0] - 3.0) < 0.1
        vectors = np.array([[end, 0.0] for end in ends])
        manners = (Manner(0.0, 1.0), Manner(0.1, 2.0))
        found = turns.next(self.node(at), vectors, manners, failed, lambda *_: goal)
        return found if found is None else (float(found[0].places.q[0, 0]), found[1][:, 0].tolist())

    def _going_on(self, vector: Reals) -> Reals:
        self.led_on += 1
        return vector

    def _ran(self, _node: Any, begun: Begun, _manner: Manner) -> Any:
        end = float(begun.leg.way.places[-1][0])
        self.runs.append(end)
        if len(self.runs) in self.failing:
            return None
        at = end - self.short.pop(len(self.runs), 0.0)
        return self.node(at, Code.GOAL if abs(at - 3.0) < 0.1 else Code.MISSED)


def test_a_leg_is_led_on_where_the_object_drifts_and_the_rest_of_the_tree_is_kept() -> None:
    line = Line({2: 0.4})
    assert line.run() == "found"
    assert line.runs == [1.0, 2.0, 2.0, 3.0] and line.led_on == 1 and not line.work.failures


def test_a_leg_that_drifts_again_and_again_is_left_for_the_next_one() -> None:
    line = Line({2: 0.4, 3: 0.4, 4: 0.4})
    assert line.run() == "found"
    assert line.runs == [1.0, 2.0, 2.0, 2.0, 3.0]
    assert list(line.work.failures) == ["the object left its planned path on dynamic-compliant"]


def test_a_leg_that_cannot_be_made_is_joined_by_a_small_tree(monkeypatch: pytest.MonkeyPatch) -> None:
    line = Line({}, lost=(2,))
    joined = list[float]()

    def proposed(_ground: Any, q: Reals, _home: Any, goals: Reals, *others: Any) -> list[Leg]:
        rounds = others[3]
        assert 4 < rounds < 20  # a small tree
        joined.append(float(goals[0, 0]))
        return [line.leg_to(1.5), line.leg_to(float(goals[0, 0]))] if q[0] == 1.0 else []

    monkeypatch.setattr(in_turn, "propose", proposed)
    line.lost = (2,)
    assert line.run() is None and joined == [2.0, 2.0]
    assert line.runs == [1.0, 1.5]
    joined.clear()
    monkeypatch.setattr(in_turn, "propose", lambda *_: [line.leg_to(2.0)])
    line.runs.clear()
    assert line.run() == "found" and line.runs == [1.0, 2.0, 3.0]


def test_a_leg_that_nothing_joins_ends_the_tree(monkeypatch: pytest.MonkeyPatch) -> None:
    line = Line({}, lost=(2,))
    monkeypatch.setattr(in_turn, "propose", lambda *_: None)
    assert line.run() is None and line.runs == [1.0]
    assert list(line.work.failures) == ["no leg from where the object is"]


def test_a_leg_whose_run_fails_is_joined_by_a_small_tree(monkeypatch: pytest.MonkeyPatch) -> None:
    """As often as the tree has legs, from where the object was before, and the rest of it is kept."""
    begun = list[tuple[float, float]]()

    def proposed(_ground: Any, q: Reals, _home: Any, goals: Reals, *_: Any) -> list[Leg]:
        begun.append((float(q[0]), float(goals[0, 0])))
        return [line.leg_to(1.5), line.leg_to(2.0)] if len(begun) == 1 else [line.leg_to(2.0)]

    monkeypatch.setattr(in_turn, "propose", proposed)
    line = Line({}, failing=(2, 4))
    assert line.run() == "found"
    assert line.runs == [1.0, 2.0, 1.5, 2.0, 2.0, 3.0] and begun == [(1.0, 2.0), (1.5, 2.0)]
    begun.clear()
    line = Line({}, failing=tuple(range(2, 99)))
    assert line.run() is None and len(begun) == 3
    assert list(line.work.failures) == ["no leg from where the object is"]


def test_a_leg_whose_run_fails_as_it_is_led_on_is_joined_too(monkeypatch: pytest.MonkeyPatch) -> None:
    line = Line({2: 0.4}, failing=(3,))
    monkeypatch.setattr(in_turn, "propose", lambda *_: [line.leg_to(2.0)])
    assert line.run() == "found"
    assert line.runs == [1.0, 2.0, 2.0, 2.0, 3.0] and line.led_on == 1


def test_a_tree_of_one_leg_is_joined_a_few_times(monkeypatch: pytest.MonkeyPatch) -> None:
    joined = list[float]()
    line = Line({}, failing=tuple(range(1, 99)))

    def proposed(*_: Any) -> list[Leg]:
        joined.append(3.0)
        return [line.leg_to(3.0)]

    monkeypatch.setattr(in_turn, "propose", proposed)
    assert line.run((3.0,)) is None and 1 < len(joined) < 10


def small(line: Line, monkeypatch: pytest.MonkeyPatch, *ends: float) -> list[float]:
    """Let small trees lead to these ends, where the last is far enough; to where they were asked to lead."""
    asked = list[float]()

    def proposed(_ground: Any, _q: Any, _home: Any, goals: Reals, reached: Any, *_: Any) -> list[Leg] | None:
        asked.append(float(goals[0, 0]))
        return [line.leg_to(end) for end in ends] if reached(np.array(ends[-1:])) else None

    monkeypatch.setattr(in_turn, "propose", proposed)
    return asked


def test_the_next_leg_is_made_again_and_the_rest_is_left() -> None:
    line = Line({})
    assert line.next(0.0) == (1.0, [2.0, 3.0])


def test_a_leg_at_whose_end_the_object_is_is_left_out_unless_it_is_the_last() -> None:
    assert Line({}).next(0.9) == (2.0, [3.0])
    assert Line({}).next(2.87, (3.0,)) == (3.0, [])


def test_a_leg_that_cannot_be_made_is_joined_by_small_ones_of_which_the_first_is_run(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    line = Line({}, lost=(1,))
    assert small(line, monkeypatch, 0.5, 1.1) == []
    assert line.next(0.0) == (0.5, [1.1, 2.0, 3.0])


def test_a_leg_that_leads_nowhere_is_joined_by_small_ones(monkeypatch: pytest.MonkeyPatch) -> None:
    """In each manner the object comes less than half as near."""
    line = Line({1: 0.8, 2: 0.8})
    asked = small(line, monkeypatch, 1.0)
    assert line.next(0.0) == (1.0, [2.0, 3.0]) and asked == [1.0] and line.runs == [1.0, 1.0, 1.0]


def test_a_leg_that_failed_in_all_manners_is_not_made_again(monkeypatch: pytest.MonkeyPatch) -> None:
    line = Line({})
    asked = small(line, monkeypatch, 0.95)
    assert line.next(0.0, failed=2) == (0.95, [2.0, 3.0]) and asked == [1.0] and line.runs == [0.95]


def test_few_legs_that_cannot_be_made_are_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    line = Line({}, lost=(1, 2))
    asked = small(line, monkeypatch, 9.0)
    assert line.next(0.0) == (3.0, []) and asked == [1.0, 2.0]
    assert Line({}, lost=(1, 2, 3)).next(0.0, (1.0, 2.0, 3.0, 4.0)) is None


@pytest.mark.parametrize(("end", "goes"), [(2.6, True), (2.4, False)])
def test_after_the_last_leg_small_ones_lead_to_the_goal_or_half_the_way(
    monkeypatch: pytest.MonkeyPatch, end: float, goes: bool
) -> None:
    line = Line({}, lost=(3,))
    asked = small(line, monkeypatch, end)
    assert line.next(2.0, (3.0,)) == ((end, []) if goes else None) and asked == [3.0]


class Resumed(ModePlanner):
    """A planner whose legs, made again, lead where they say."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, *ends: tuple[bool, int]) -> None:
        """The ends of legs in turn: whether the goal is there, and how many legs are left; then none."""
        self.work: Any = SimpleNamespace(budget=SimpleNamespace(left=True))
        self.nodes, self.asked, left = [], list[list[float]](), list(ends)
        self.nodes.append(self._node(False))

        def next_(_node: Any, vectors: Reals, *_: Any) -> Any:
            self.asked.append(vectors[:, 0].tolist())
            if not left:
                return None
            there, count = left.pop(0)
            return self._node(there), vectors[len(vectors) - count :]

        monkeypatch.setattr(ModePlanner, "_in_turn", lambda _: SimpleNamespace(next=next_))
        monkeypatch.setattr(ModePlanner, "search", lambda *_: "searched")

    def _node(self, there: bool) -> Any:
        return SimpleNamespace(outcome=Code.GOAL if there else Code.MISSED, found="found")


LEGS = np.array([[1.0], [2.0], [3.0]])


def test_a_plan_is_led_on_leg_by_leg_and_at_last_to_the_goal(monkeypatch: pytest.MonkeyPatch) -> None:
    planner = Resumed(monkeypatch, (False, 2), (False, 1), (False, 0), (False, 0), (True, 0))
    assert planner.led_on(LEGS) == "found"
    assert planner.asked == [[1.0, 2.0, 3.0], [2.0, 3.0], [3.0], [3.0], [3.0]]


def test_a_plan_that_cannot_be_led_on_is_searched_on(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where a leg cannot be made, and where the last one leads to the goal again and again in vain."""
    planner = Resumed(monkeypatch, (False, 2))
    assert planner.led_on(LEGS) == "searched" and len(planner.asked) == 2
    planner = Resumed(monkeypatch, *[(False, 0)] * 99)
    assert planner.led_on(LEGS) == "searched" and len(planner.asked) < 20

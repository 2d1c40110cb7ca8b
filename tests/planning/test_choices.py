"""What searches take as nearest, best and confirmed, on numbers that are known."""

from __future__ import annotations

from functools import partial
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

import rungwise as rw
from rungwise.planning.lift import lift
from rungwise.planning.motion.budget import Budget, Stage
from rungwise.planning.motion.early_stops import Stops, best_stops
from rungwise.planning.motion.objective import Aim
from rungwise.planning.motion.propagate import Places
from rungwise.planning.search import improve, push_effects, search, shooting, tree
from rungwise.world.planar.boundary import boundary

N = 4000


def places(q: Any) -> Places:
    q = np.asarray(q, float)
    return Places(q, np.zeros_like(q), np.zeros(len(q)), np.zeros((0, 1)))


def grown(lacks: list[float], vectors: list[list[float]]) -> tree.Tree:
    """A root, and moves from there that lack so much."""
    n, d = len(lacks) + 1, len(vectors[0])
    return tree.Tree(
        np.zeros((n, 1)), np.zeros((n, 1)), np.zeros(n), np.zeros((n, 0)), np.zeros((n, 1)),
        np.array([-1, *[0] * (n - 1)]), np.array([[0.0] * d, *vectors]), np.array([0, *[1] * (n - 1)]),
        np.array([1.0, *lacks]), np.ones(n, bool),
    )  # fmt: skip


def test_nodes_are_taken_by_the_room_that_is_nearest_to_them() -> None:
    """Of nodes at 0, 1 and 10 seen from -5 to 15 their shares are those of their Voronoi cells, which lead a
    tree to where it has not been (LaValle 1998)."""
    moves = cast(Any, SimpleNamespace(task=SimpleNamespace(weights=np.array([0.0, 2.0]))))
    q = np.array([[7.0, 0.0], [-3.0, 1.0], [0.0, 10.0]])
    found = tree._nearest(moves, q, N, np.random.default_rng(0))
    assert np.bincount(found, minlength=3) / N == pytest.approx([0.275, 0.25, 0.475], abs=0.03)


def test_the_best_move_from_a_node_is_varied_most() -> None:
    moves = cast(Any, SimpleNamespace(task=SimpleNamespace(weights=np.ones(1)), size=4, periodic=False))
    values, counts = (0.15, 0.4, 0.65, 0.9), np.zeros(4)
    nodes = grown([0.8, 0.1, 0.4, 0.6], [[value] * 4 for value in values])
    rng = np.random.default_rng(1)
    for _ in range(20):
        _, vectors = tree._draw(moves, nodes, 1, rng)
        counts += [(np.abs(vectors - value).max(axis=1) < 0.05).sum() for value in values]
    assert counts.argmax() == 1 and counts[1] > 2.5 * counts[0]
    assert counts.argsort().tolist()[2:] == [2, 1]


def test_of_plans_that_reach_the_goal_the_shortest_is_best() -> None:
    reached = np.array([0, 3, 2, 0, 3])
    trials = shooting.Trials(
        np.arange(5.0)[:, None, None], np.array([0.2, 0.0, 0.0, 0.1, 0.0]), reached,
        places(np.zeros((5, 1)))._replace(time=np.array([1.0, 5.0, 9.0, 1.0, 4.0])), np.zeros(5),
    )  # fmt: skip
    best = shooting._best(trials, 4)
    assert best.vectors.ravel().tolist() == [2.0, 4.0, 1.0, 3.0] and best.reached.tolist() == [2, 3, 3, 0]


def test_numbers_that_come_round_differ_by_the_short_way() -> None:
    moves = cast(Any, SimpleNamespace(periodic=np.array([True, True, False])))
    apart = shooting._difference(moves, np.array([0.95, 0.1, 0.95]), np.array([0.05, 0.4, 0.05]))
    assert apart == pytest.approx([-0.1, -0.3, 0.9])


def test_pushes_are_cut_where_least_is_lacking_on_the_way() -> None:
    """The first passes its aim at 3, the second comes nearest at its end."""
    aim = Aim(lambda here: np.abs(here.q[:, 0] - 3.0))
    at = np.array([1.0, 2.9, 4.0, 0.5, 1.0])
    stops = Stops(np.array([0, 0, 0, 1, 1]), at[:, None], places(at[:, None]))
    best, lacks = best_stops(aim, stops, np.array([2.0, 1.5]))
    assert best.rows.tolist() == [0] and best.vectors.tolist() == [[2.9]] and lacks == pytest.approx([0.1])


def test_what_a_push_does_is_the_same_in_the_frame_of_the_object() -> None:
    rng = np.random.default_rng(2)
    before, after = rng.normal(size=(2, 50, 3))
    np.testing.assert_allclose(push_effects._moved(before, push_effects._seen_from(before, after)), after)
    # What lies along y, and goes on along y, goes ahead.
    ahead = push_effects._seen_from(np.array([[1.0, 2.0, np.pi / 2]]), np.array([[1.0, 2.5, np.pi / 2]]))
    assert ahead[0] == pytest.approx([0.5, 0.0, 0.0], abs=1e-12)


class Replayed:
    """A plan that comes to its goal where its steps err by `least` at least."""

    def __init__(self, least: float, tol: float) -> None:
        self.least, self.tol = least, tol

    def replay(self, tol: float, **_options: object) -> Any:
        code = rw.Code.GOAL if tol >= self.least else rw.Code.MISSED
        return SimpleNamespace(outcome=SimpleNamespace(code=code))


@pytest.mark.parametrize(("part", "confirmed"), [(0.5, False), (0.11, False), (0.09, True)])
def test_a_plan_is_confirmed_at_a_tenth_of_its_error(part: float, confirmed: bool) -> None:
    """A plan that holds for the error of its steps alone is none."""
    work = cast(Any, SimpleNamespace(budget=Budget()))
    assert lift._is_confirmed(work, cast(Any, Replayed(part * 1e-3, 1e-3))) is confirmed


def test_a_repair_of_a_plan_that_is_not_confirmed_takes_a_fifth_of_what_is_left(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    budget, given = Budget(10_000), list[int | None]()

    def repaired(work: Any, found: Any, *_stage: Any, **_options: Any) -> Any:
        given.append(work.budget.most)
        return found

    monkeypatch.setattr(lift, "_is_confirmed", lambda *_: False)
    monkeypatch.setattr(lift, "_take_stage", repaired)
    monkeypatch.setattr(lift, "replace", lambda *_, **__: None)
    stage = Stage(rw.KINEMATIC, 1e-3)
    found = cast(Any, SimpleNamespace(found=True, stage=stage))
    assert lift._confirmed(cast(Any, SimpleNamespace(budget=budget)), found, stage) is None
    assert given == [pytest.approx(2000, rel=0.6)] and budget.most == 10_000


TREE = SimpleNamespace(
    lack=np.ones(1), q=np.zeros((1, 1)), least=lambda _: 1.0, ways=lambda *_: np.full((2, 1, 3), 0.5)
)


def _searched() -> Any:
    """What searches share; all plans have a move of three numbers."""
    moves = SimpleNamespace(size=3, periodic=np.zeros(3, bool))
    task = SimpleNamespace(free=(), before=None)
    budget = SimpleNamespace(left=True)
    aim = SimpleNamespace(turned=lambda _moves, vectors: vectors, partial=True)
    return SimpleNamespace(
        moves=moves, task=task, budget=budget, aim=aim, whole=aim, rng=np.random.default_rng(0), start=None,
        predictor=SimpleNamespace(budget=budget, stage=None), begun=SimpleNamespace(places=None, levels=None),
        pushes=lambda _: SimpleNamespace(note=None),
    )  # fmt: skip


SEARCHES = {
    "plans with a move less": lambda work: improve._shortened(work, work.predictor, np.full((2, 3), 0.5)),
    "plans about a tree's ways": lambda work: list(
        search._plans(work, work.predictor, work.begun, work.aim, 1)
    ),
}


@pytest.mark.parametrize("name", SEARCHES)
def test_searches_about_plans_take_several_generations_and_no_more(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A goal that is near needs some of them, and one that is out of reach ends the search."""
    runs = list[int]()

    def run(lack: float, _moves: Any, _predictor: Any, _start: Any, vectors: Any, *_: Any) -> Any:
        runs.append(len(vectors))
        away = np.abs(vectors[:, 0] - [0.55, 0.42, 0.61]).max(axis=1)
        return shooting.Trials(vectors, away, (away < lack).astype(int), places(away[:, None]), away)

    monkeypatch.setattr(search, "grow", lambda *_: (TREE, []))
    monkeypatch.setattr(search, "PLANNERS", ())
    monkeypatch.setattr(search, "_steered", lambda *_: iter(()))
    for lack, few, many in ((0.012, 2, 5), (0.0, 4, 12)):
        runs.clear()
        monkeypatch.setattr(shooting, "run_moves", partial(run, lack))
        SEARCHES[name](_searched())
        assert few <= len(runs) <= many, runs


def test_places_on_a_boundary_are_evenly_apart_and_face_outward() -> None:
    """Round a rounded box: the sides and a circle are its length, and each place is a radius from the box."""
    sides, r = (0.4, 0.2), 0.05
    shape = {"kind": "polygon", "radius": r, "vertices": [[0, 0], [0.4, 0], [0.4, 0.2], [0, 0.2]]}
    box = {"role": "object", "motion": {"kind": "free"}, "mass": 1, "shape": shape}
    scene = rw.load({"name": "rounded", "bodies": {"box": box}, "contacts": []})
    found = boundary(scene.bind().records, 0)
    assert found.ends[-1] == pytest.approx(2.0 * sum(sides) + 2.0 * np.pi * r)
    at, normal = found(np.arange(N) / N)
    centre = np.array(sides) / 2.0
    at = at + centre if abs(at.mean()) < 1e-2 else at
    inner = np.clip(at, 0.0, sides)
    np.testing.assert_allclose(at - inner, r * normal, atol=1e-9)
    steps = np.linalg.norm(at - np.roll(at, 1, axis=0), axis=1)
    np.testing.assert_allclose(steps, found.ends[-1] / N, rtol=1e-2)

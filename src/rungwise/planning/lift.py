"""A plan on one stage: lifted from the stage before, repaired, or found anew."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from rungwise.kernel import Reals
from rungwise.models.ladder import Rung
from rungwise.planning.carriers import TaskError
from rungwise.planning.lay import Course, lay
from rungwise.planning.moves import Moves
from rungwise.planning.predict import Budget, Places, Predictor, Stage, predictor_of
from rungwise.planning.shoot import Search, shoot
from rungwise.planning.task import Task
from rungwise.planning.transit import Transit
from rungwise.planning.tree import Tree, grow
from rungwise.scene.space import SpaceScene
from rungwise.simulation.questions import Question
from rungwise.simulation.state import State

HELD = "held"
TREES, ROUNDS = 8, 8
"""Trees of a search, each with one move more than the last, and how often each grows."""
GENERATIONS, WAYS, PROMISING = 6, 12, 1.5
"""Generations of shooting about a tree's ways, how many of these, and how much more than the best of all the
best of so many moves may lack."""
CONTINUED = (0.01, 0.1, 0.4, 1.0)
"""Parts of a rung's inertia through which a plan is led to it."""


@dataclass
class Work:
    """What all stages of one planning share."""

    task: Task
    moves: Moves
    transit: Transit
    question: Question
    budget: Budget
    start: Places
    size: float
    threads: int | None
    rng: np.random.Generator
    seed: int
    nearest: float = np.inf

    def predictor(self, stage: Stage) -> Predictor:
        return predictor_of(
            self.task.search, stage, stage.tol * self.size, self.task.parameters, self.budget, self.threads
        )

    def lack(self, places: Places) -> Reals:
        """How much of the goal plans lack at their ends (m,)."""
        rows = np.hstack([places.q, places.v])
        known = np.isfinite(rows).all(axis=1)
        lacks = np.full(len(rows), np.inf)
        if known.any():
            lacks[known] = self.question.ask(rows[known]).lack
        return lacks

    def away(self, aim: Reals) -> Callable[[Places], Reals]:
        """Distances (m,) from a place of the objects."""
        return lambda places: self.task.away(places.q, aim)


def begin(task: Task, budget: Budget, seed: int, threads: int | None) -> Work:
    """Where planning starts. Raises TaskError where bodies overlap at the start."""
    moves, transit = _ways_of(task)
    start = State.of(task.scene, parameters=task.parameters)
    overlap = moves.question.overlap(start)
    if overlap:
        raise TaskError(f"start: {overlap}; change the parameters of the start")
    return Work(
        task=task, moves=moves, transit=transit,
        question=Question(task.search, "goal", task.parameters), budget=budget,
        start=Places(start.q[None].copy(), start.v[None].copy(), np.zeros(1), np.zeros((0, 1))),
        size=task.size, threads=threads, rng=np.random.default_rng(seed), seed=seed,
    )  # fmt: skip


def _ways_of(task: Task) -> tuple[Moves, Transit]:
    """Moves of a task, and its robots' ways between them."""
    if isinstance(task.scene, SpaceScene) and task.carriers:
        from rungwise.planning.space_transit import SpaceMoves, SpaceTransit

        moves = SpaceMoves(task)
        return moves, SpaceTransit(task, moves.question)
    plain = Moves(task)
    return plain, Transit(task, plain.question)


def known(work: Work) -> str:
    """What is known where nothing was found."""
    outcomes = work.budget.outcomes
    parts = ", ".join(f"{name} {count / outcomes.total():.0%}" for name, count in outcomes.most_common(4))
    nearest = f"; the nearest plan lacks {work.nearest:.3g} of the goal" if np.isfinite(work.nearest) else ""
    ended = f"{work.budget.ended}; " if work.budget.ended else ""
    return f"{ended}moves tried: {outcomes.total()} ({parts or 'none'}){nearest}"


class Lifted(NamedTuple):
    """What came of a stage: the course on it and its moves (k, d), None if there is none; and how it came
    about."""

    found: Found | None
    how: str


class Found(NamedTuple):
    """A course that comes to the goal, and its moves (k, d)."""

    course: Course
    vectors: Reals


@dataclass(frozen=True)
class Before:
    """The plan to lift: moves (k, d), where they ended (k, n), and the rung on which it was found."""

    vectors: Reals
    waypoints: Reals
    model: Rung


def on_stage(work: Work, stage: Stage, before: Before | None) -> Lifted:
    """The plan on this stage: the same one if it holds, repaired, or a new one."""
    predictor = work.predictor(stage)
    if before is not None:
        course = laid(work, predictor, before.vectors)
        if course.reached:
            return Lifted(Found(course, before.vectors), HELD)
        for repair in (_by_moves, _by_suffix, _by_continuation):
            found = repair(work, predictor, before) if work.budget.left else None
            if found is not None:
                return Lifted(found, REPAIRS[repair.__name__])
    found = _search(work, predictor)
    if found is not None:
        return Lifted(found, "planned" if before is None else "planned anew")
    return Lifted(None, "nothing found")


REPAIRS = {
    "_by_moves": "repaired move by move", "_by_suffix": "repaired at its end",
    "_by_continuation": "continued in inertia",
}  # fmt: skip


def laid(work: Work, predictor: Predictor, vectors: Reals) -> Course:
    return lay(work.moves, work.transit, predictor, work.start, vectors, work.seed)


def _search(work: Work, predictor: Predictor) -> Found | None:
    """A new plan: by a tree, and by shooting about its best ways; with few moves first."""
    least, most = work.task.moves
    for number in range(TREES):
        if not work.budget.left:
            return None
        deepest = min(max(3, least) + number, most)
        tree, way = grow(
            work.moves, predictor, work.start, work.task.before, work.lack, deepest, ROUNDS, work.rng
        )
        work.nearest = min(work.nearest, float(tree.lack.min()))
        found = _first(work, predictor, way[None]) if len(way) else _about(work, predictor, tree, deepest)
        if found is not None:
            return found
    return None


def _about(work: Work, predictor: Predictor, tree: Tree, deepest: int) -> Found | None:
    """A plan near the best ways of a tree, of each number of moves that nearly lack least."""
    for count in range(1, deepest + 1):
        if tree.least(count) <= PROMISING * float(tree.lack.min()) and work.budget.left:
            trials = shoot(
                work.moves, predictor, work.start, count, work.lack, work.rng,
                Search(generations=GENERATIONS), seeds=tree.ways(count, WAYS),
            )  # fmt: skip
            work.nearest = min(work.nearest, float(trials.score[0]))
            found = _first(work, predictor, trials.vectors[trials.reached > 0])
            if found is not None:
                return found
    return None


def _first(work: Work, predictor: Predictor, candidates: Reals) -> Found | None:
    """The first of these plans (r, k, d) that can be laid out to the goal."""
    for vectors in candidates:
        course = laid(work, predictor, vectors)
        if course.reached:
            return Found(course, vectors[: len(course.counts)])
    return None


def _by_moves(work: Work, predictor: Predictor, before: Before) -> Found | None:
    """The plan with each move mended in turn, so that it ends where it ended on the stage before, and the
    last at the goal."""
    vectors = before.vectors.copy()
    for k, aim in enumerate(before.waypoints[: len(vectors)]):
        start = _after(work, predictor, vectors[:k])
        if start is None:
            return None
        last = k == len(vectors) - 1
        away = work.lack if last else work.away(aim)
        search = Search(population=48, generations=6 if last else 3)
        trials = shoot(
            work.moves, predictor, start.places, 1, away, work.rng, search,
            seeds=vectors[None, k : k + 1], spread=0.1, before=start.levels,
        )  # fmt: skip
        vectors[k] = trials.vectors[0, 0]
    return _first(work, predictor, vectors[None])


def _by_suffix(work: Work, predictor: Predictor, before: Before) -> Found | None:
    """The plan with its last moves searched anew, about what they were: first one, then more."""
    for first in range(len(before.vectors) - 1, -1, -1):
        start = _after(work, predictor, before.vectors[:first])
        if start is None or not work.budget.left:
            continue
        tail = before.vectors[None, first:]
        trials = shoot(
            work.moves, predictor, start.places, tail.shape[1], work.lack, work.rng,
            Search(population=64, generations=6), seeds=tail, spread=0.1, before=start.levels,
        )  # fmt: skip
        tails = trials.vectors[trials.reached > 0]
        heads = np.repeat(before.vectors[None, :first], len(tails), axis=0)
        found = _first(work, predictor, np.concatenate([heads, tails], axis=1))
        if found is not None:
            return found
    return None


def _by_continuation(work: Work, predictor: Predictor, before: Before) -> Found | None:
    """The plan mended on rungs between the two, where they differ by their inertia."""
    model, stage = before.model, predictor.stage
    if model.metric or stage.model.inertia <= model.inertia:
        return None
    vectors, waypoints, found = before.vectors, before.waypoints, None
    for part in CONTINUED:
        between = Stage(stage.model.with_inertia(part * stage.model.inertia), stage.tol)
        own = work.predictor(between)
        course = laid(work, own, vectors)
        found = (
            Found(course, vectors)
            if course.reached
            else _by_moves(work, own, Before(vectors, waypoints, model))
        )
        if found is None or not work.budget.left:
            return None
        vectors, waypoints = found.vectors, np.array([place.q[0] for place in found.course.places])
    return found


class _Midway(NamedTuple):
    """Where a plan has come to, and its inputs (u,) there."""

    places: Places
    levels: Reals


def _after(work: Work, predictor: Predictor, vectors: Reals) -> _Midway | None:
    """Where these moves end; None where they cannot be made."""
    if not len(vectors):
        return _Midway(work.start, work.task.before)
    course = laid(work, predictor, vectors)
    if course.blocked or len(course.places) < len(vectors):
        return None
    return _Midway(course.places[-1], course.levels)

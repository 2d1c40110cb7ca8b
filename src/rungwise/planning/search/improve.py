"""Better plans: one after the other, each of less cost."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from rungwise.kernel import Reals
from rungwise.planning.motion.propagate import Predictor
from rungwise.planning.search.layout import Course
from rungwise.planning.search.problem import Found, Work, laid
from rungwise.planning.search.shooting import Search, Trials, run_moves, shoot

POPULATION, LAID = 96, 3
"""Plans that are run together, and how many of them are laid out, with the robots' ways."""
SPREADS = (0.003, 0.01, 0.03, 0.1)
"""How far moves are varied."""
KEPT = 0.5
"""Part of a plan's numbers that stay where it is varied."""
SHORTER = 6
"""Generations of a search for a plan with one move less."""
PATIENCE = 12
"""Rounds without a better plan after which no more follow."""


def cost_of(work: Work, course: Course) -> float:
    """The task's cost of a course."""
    duration = sum(segment.duration for segment in course.segments)
    return float(work.task.cost(duration, course.work, len(course.counts)))


def better(work: Work, predictor: Predictor, found: Found) -> Iterator[Found]:
    """Plans that cost less, each less than the one before, until the budget ends or none follow."""
    least, best = work.task.moves[0], found
    while len(best.vectors) > least and work.budget.left:
        shorter = _cheapest(work, predictor, _shortened(work, predictor, best.vectors), best)
        if shorter is None:
            break
        best = shorter
        yield best
    idle = 0
    while work.budget.left and idle < PATIENCE:
        trials = run_moves(
            work.moves, predictor, work.start, _varied(work, best.vectors), work.whole, work.task.before
        )
        cheaper = _cheapest(work, predictor, trials, best)
        idle += 1
        if cheaper is not None:
            best, idle = cheaper, 0
            yield best


def _shortened(work: Work, predictor: Predictor, vectors: Reals) -> Trials:
    """Plans with one move less, about the plan (k, d) without each of its moves."""
    seeds = np.array([np.delete(vectors, k, axis=0) for k in range(len(vectors))])
    return shoot(
        work.moves, predictor, work.start, len(vectors) - 1, work.whole, work.rng,
        Search(generations=SHORTER), seeds=seeds,
    )  # fmt: skip


def _varied(work: Work, vectors: Reals) -> Reals:
    """Plans (m, k, d) about one."""
    rng, shape = work.rng, (POPULATION, *vectors.shape)
    steps = rng.choice(SPREADS, size=(POPULATION, 1, 1)) * rng.standard_normal(shape)
    found = vectors + np.where(rng.random(shape) < KEPT, 0.0, steps)
    return np.where(work.moves.periodic, np.mod(found, 1.0), np.clip(found, 0.0, 1.0))


def _cheapest(work: Work, predictor: Predictor, trials: Trials, best: Found) -> Found | None:
    """Of the plans that reached the goal, the cheapest when laid out, if it costs less than the best; the
    robots' ways do not count in the order in which plans are laid out."""
    rows = np.flatnonzero(trials.reached)
    costs = work.task.cost(trials.places.time[rows], trials.work[rows], trials.reached[rows])
    courses = [
        (laid(work, predictor, trials.vectors[row, : trials.reached[row]]), trials.vectors[row])
        for row in rows[np.argsort(costs, kind="stable")][:LAID]
    ]
    reached = [(cost_of(work, course), course, vectors) for course, vectors in courses if course.reached]
    cost, course, vectors = min(
        reached, key=lambda each: each[0], default=(np.inf, best.course, best.vectors)
    )
    return Found(course, vectors[: len(course.counts)]) if cost < cost_of(work, best.course) else None

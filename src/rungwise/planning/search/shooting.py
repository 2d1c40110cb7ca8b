"""Shooting: vectors of moves are drawn, run, and drawn again near the best (an evolution of a population).

Children are drawn about single elites, with the spread of the elites along each number (a mixture in place of
one normal distribution, for a goal has several basins; compare the cross-entropy method, Rubinstein 1999, and
differential evolution, Storn and Price 1997).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from rungwise.kernel import Ints, Reals
from rungwise.outcome import Code
from rungwise.planning.motion.early_stops import best_stops, parts_of, stops_of
from rungwise.planning.motion.moves import Moves, Segments
from rungwise.planning.motion.objective import Aim
from rungwise.planning.motion.propagate import GOES_ON, Ends, Places, Predictor
from rungwise.planning.motion.settle import comes_to_hold, run_to_rest

UNFIT = 1e3
"""Score added for each move that could not be made."""


@dataclass
class Trials:
    """m plans that were run: vectors (m, k, d), score (m,): what they lack of the goal, and reached (m,):
    the number of moves with which the goal was reached, 0 if it was not; where they ended; time and work."""

    vectors: Reals
    score: Reals
    reached: Ints
    places: Places
    work: Reals


def run_moves(
    moves: Moves, predictor: Predictor, start: Places, vectors: Reals, aim: Aim, before: Reals | None = None
) -> Trials:
    """Run m plans of k moves, vectors (m, k, d), from one start or m starts, after inputs `before` (u,)."""
    m, vectors = len(vectors), vectors.copy()
    places = start.take(np.zeros(m, np.int64)) if len(start.q) == 1 else start
    levels = np.repeat((moves.task.before if before is None else before)[None], m, axis=0)
    reached, unfit, work = np.zeros(m, np.int64), np.zeros(m), np.zeros(m)
    going = np.arange(m)
    last = Places(*(a.copy() for a in places))
    now = places
    count, parts = vectors.shape[1], parts_of(moves, predictor)
    for k in range(count):
        if not len(going):
            break
        chosen = vectors[going, k]
        begun, fits = moves.begin(chosen, now)
        cuts = parts if k == count - 1 else 1
        segments = moves.segments_of(chosen, begun, levels[going], cuts)
        fits &= moves.task.allows(segments.levels).all(axis=1)
        unfit[going[~fits]] += UNFIT * (count - k)
        going, begun, segments = going[fits], begun.take(np.flatnonzero(fits)), segments.take(fits)
        if not len(going):
            break
        ends, levels[going], *_ = run_to_rest(moves, predictor, begun, segments)
        if cuts > 1:
            ends, own = _cut_short(moves, predictor, aim, chosen[fits], segments, ends)
            vectors[going, k] = own
        last = _put(last, going, ends.places)
        work[going] += ends.work
        goal, on = ends.outcome == Code.GOAL, np.isin(ends.outcome, GOES_ON)
        unfit[going[~goal & ~on]] += UNFIT * (count - k)
        if aim.partial:
            goal |= on & (aim.lack(ends.places) == 0.0)
            on &= ~goal
        reached[going[goal]] = k + 1
        now, going = ends.places.take(np.flatnonzero(on)), going[on]
    score = aim.lack(last) + unfit
    score[reached > 0] = 0.0
    return Trials(vectors, np.where(np.isfinite(score), score, math.inf), reached, last, work)


def _cut_short(
    moves: Moves, predictor: Predictor, aim: Aim, vectors: Reals, segments: Segments, ends: Ends
) -> tuple[Ends, Reals]:
    """The ends of moves, and their vectors (m, d), with pushes cut short where less is lacking on the way."""
    on = np.isin(ends.outcome, GOES_ON)
    lacks = np.where(on, aim.lack(ends.places), np.where(ends.outcome == Code.GOAL, 0.0, np.inf))
    cuts = parts_of(moves, predictor)
    stops, _ = best_stops(aim, stops_of(moves, vectors, segments, ends, cuts), lacks)
    vectors, outcome = vectors.copy(), ends.outcome.copy()
    held = comes_to_hold(moves, predictor, stops.places, segments.levels[stops.rows, -1])
    vectors[stops.rows], outcome[stops.rows] = stops.vectors, np.where(held, Code.GOAL, Code.MISSED)
    places = Places(*(field.copy() for field in ends.places))
    for old, new in zip(places, stops.places, strict=True):
        old[stops.rows] = new
    return ends._replace(outcome=outcome, places=places), vectors


def _put(places: Places, rows: Ints, new: Places) -> Places:
    for old, changed in zip(places[:3], new[:3], strict=True):
        old[rows] = changed
    return places


@dataclass(frozen=True)
class Search:
    """How a search goes: plans in each generation, generations, elites that it keeps."""

    population: int = 96
    generations: int = 14
    elites: int = 12
    fresh: float = 0.15


def shoot(
    moves: Moves,
    predictor: Predictor,
    start: Places,
    count: int,
    aim: Aim,
    rng: np.random.Generator,
    search: Search,
    seeds: Reals | None = None,
    spread: float = 0.3,
    before: Reals | None = None,
) -> Trials:
    """Plans of `count` moves whose best come to their aim, or come nearest to it; the elites, best first.

    `before`: inputs (u,) at the start, if not those of the instance. `seeds` (r, k, d) are plans to begin
    about, within `spread`; without seeds all moves are drawn evenly.
    """
    elites: Trials | None = None
    for generation in range(search.generations):
        vectors = _draw(moves, count, rng, search, elites, seeds if generation == 0 else None, spread)
        trials = run_moves(moves, predictor, start, aim.turned(moves, vectors), aim, before)
        elites = _best(trials if elites is None else _joined(elites, trials), search.elites)
        if (elites.reached > 0).any() or not predictor.budget.left:
            break
    assert elites is not None
    return elites


def _draw(
    moves: Moves, count: int, rng: np.random.Generator, search: Search, elites: Trials | None,
    seeds: Reals | None, spread: float,
) -> Reals:  # fmt: skip
    """The next generation (m, k, d)."""
    m, shape = search.population, (search.population, count, moves.size)
    even = rng.random(shape)
    if elites is None and seeds is None:
        return even
    if seeds is not None:
        parents = seeds[rng.integers(len(seeds), size=m)]
        widths = np.full(shape[1:], spread)
        widths = widths * rng.choice([0.1, 0.3, 1.0], size=(m, 1, 1))
        fresh = np.zeros(m, bool)
    else:
        assert elites is not None
        pool = elites.vectors
        rank = np.minimum(rng.geometric(2.0 / len(pool), size=m) - 1, len(pool) - 1)
        parents = pool[rank]
        away = _difference(moves, pool[rng.integers(len(pool), size=m)], parents)
        widths = 0.5 * np.abs(away) + 0.01 * rng.choice([0.1, 1.0, 5.0], size=(m, 1, 1))
        fresh = rng.random(m) < search.fresh
    found = parents + widths * rng.standard_normal(shape)
    keeps = rng.random(shape) < 0.3
    found = np.where(keeps, parents, found)
    found = np.where(moves.periodic, np.mod(found, 1.0), np.clip(found, 0.0, 1.0))
    found[fresh] = even[fresh]
    if seeds is not None:
        found[: len(seeds)] = seeds[:m]
    return np.asarray(found)


def _difference(moves: Moves, a: Reals, b: Reals) -> Reals:
    """a - b, the short way round along periodic numbers."""
    plain = a - b
    return np.where(moves.periodic, np.mod(plain + 0.5, 1.0) - 0.5, plain)


def _best(trials: Trials, count: int) -> Trials:
    """The best trials: those that reached the goal first, by the number of their moves, then by score."""
    order = np.lexsort(
        (trials.places.time, trials.score, np.where(trials.reached > 0, trials.reached, 10**6))
    )
    order = order[:count]
    return Trials(
        trials.vectors[order], trials.score[order], trials.reached[order], trials.places.take(order),
        trials.work[order],
    )  # fmt: skip


def _joined(a: Trials, b: Trials) -> Trials:
    q, v, time = (np.concatenate(both) for both in zip(a.places[:3], b.places[:3], strict=True))
    places = Places(q, v, time, a.places.memory[:0])
    return Trials(
        np.concatenate([a.vectors, b.vectors]), np.concatenate([a.score, b.score]),
        np.concatenate([a.reached, b.reached]), places, np.concatenate([a.work, b.work]),
    )  # fmt: skip

"""Searches for new plans: trees, and shooting about their best ways, until the budget or the time is spent.

Where the goal speaks of several objects, plans are also searched object by object: the first parts of the
goal are reached and laid out, and the search goes on from there, for these and more.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from rungwise.kernel import Reals
from rungwise.planning.motion.objective import Aim
from rungwise.planning.motion.propagate import GOES_ON, Places, Predictor
from rungwise.planning.search.goals import goals_of
from rungwise.planning.search.layout import Course, lay_out
from rungwise.planning.search.problem import Found, Work, laid
from rungwise.planning.search.shooting import UNFIT, Search, run_moves, shoot
from rungwise.planning.search.steering import Steering
from rungwise.planning.search.tree import grow

DEPTHS, ROUNDS, IDLE = 8, 8, 8
"""Trees that have each one move more than the last, before trees of few moves follow again; how often each
grows; and trees, or turns of other
searches, in a row without a single step after which no more follow."""
GENERATIONS, WAYS, PROMISING = 6, 12, 1.5
"""Generations of shooting about a tree's ways, how many of these, and how much more than the best of all the
best of so many moves may lack."""
COMPOSED, VARIED, POLISH = 48, 3, 0.05
"""Plans composed of pushes that were seen that are run; of how many the last push is varied, and how far."""
LAST = Search(population=32, generations=5)
"""How the last push is varied."""
STEERING, MANY = 40, 6
"""Rounds of a tree that steers; and how many inputs make it come before trees that draw all of them."""
LAID = 4
"""Plans of one search that are laid out at most."""


class Begun(NamedTuple):
    """Where a search begins: one place, and inputs (u,) there."""

    places: Places
    levels: Reals


def search(work: Work, predictor: Predictor) -> Found | None:
    """A new plan; with few moves first."""
    idle = 0
    while work.budget.left and idle < IDLE:
        spent = work.budget.spent.total()
        found = search_once(work, predictor)
        if found is not None:
            return found
        idle = idle + 1 if work.budget.spent.total() == spent else 0
    return None


def lead_on(work: Work, predictor: Predictor, head: Course) -> Course | None:
    """A course, led on by new moves to the goal; None where none were found."""
    begun = Begun(head.places[-1], head.levels)
    deepest = min(3, work.task.moves[1])
    for tried, own in enumerate(_plans(work, predictor, begun, work.whole, deepest)):
        tail = lay_out(work.moves, work.transit, predictor, begun.places, own, work.seed, begun.levels)
        if tail.reached:
            return Course(
                head.segments + tail.segments, head.labels + tail.labels, head.counts + tail.counts,
                head.places + tail.places, tail.levels, head.work + tail.work, tail.outcome,
            )  # fmt: skip
        if tried + 1 == LAID:
            break
    return None


def search_once(work: Work, predictor: Predictor) -> Found | None:
    """A new plan by the next tree."""
    number, (groups, _) = work.trees[str(predictor.stage)], work.groups
    work.trees[str(predictor.stage)] += 1
    several = len(groups) > 1 and len(groups) <= work.task.moves[1]
    by_objects = several and number % 2 == 0
    number = number // 2 if several else number
    return (_by_objects if by_objects else _at_once)(work, predictor, number % DEPTHS)


def _at_once(work: Work, predictor: Predictor, number: int) -> Found | None:
    """A plan by a tree for the whole goal, the deeper the greater its number."""
    least, most = work.task.moves
    begun = Begun(work.start, work.task.before)
    return _laid_out(
        work, predictor, _plans(work, predictor, begun, work.whole, min(max(3, least) + number, most))
    )


def _by_objects(work: Work, predictor: Predictor, number: int) -> Found | None:
    """A plan that brings one object after the other to its part of the goal, in an order that is drawn."""
    groups, kept = work.groups
    most = work.task.moves[1]
    head, begun = np.zeros((0, work.moves.size)), Begun(work.start, work.task.before)
    done = list(kept)
    order = work.rng.permutation(len(groups))
    for turn, k in enumerate(order):
        done.append(groups[k])
        left = len(order) - turn - 1
        deepest = min(3 + number, most - len(head) - left)
        if left == 0:
            aim = Aim(work.lack, groups[k].bodies, partial=False)
            plans = _plans(work, predictor, begun, aim, deepest)
            return _laid_out(work, predictor, (np.concatenate([head, own]) for own in plans))
        aim = work.part(np.concatenate([group.parts for group in done]), groups[k].bodies)
        found = _led_to(work, predictor, head, begun, aim, deepest)
        if found is None:
            return None
        head, begun = found
    return None


def _led_to(
    work: Work, predictor: Predictor, head: Reals, begun: Begun, aim: Aim, deepest: int
) -> tuple[Reals, Begun] | None:
    """Moves (k, d), the first of them `head`, that come to a part of the goal when laid out; and their
    ends."""
    for tried, own in enumerate(_plans(work, predictor, begun, aim, deepest)):
        vectors = np.concatenate([head, own])
        course = laid(work, predictor, vectors)
        if _goes_on(course, len(vectors)) and aim.lack(course.places[-1])[0] == 0.0:
            return vectors, Begun(course.places[-1], course.levels)
        if tried + 1 == LAID:
            break
    return None


def _goes_on(course: Course, count: int) -> bool:
    """Whether all moves were made, and more may follow."""
    return not course.blocked and len(course.places) == count and course.outcome in GOES_ON


def _plans(work: Work, predictor: Predictor, begun: Begun, aim: Aim, deepest: int) -> Iterator[Reals]:
    """Plans (k, d) that come to their aim where robots are placed by hand: by a tree; by `PLANNERS`; by
    steering, first of all where there are many inputs; and by shooting about the tree's best ways, for each
    number of moves that nearly lack least."""
    pushes = work.pushes(predictor.stage)
    steered = _steered(work, predictor, begun, aim)
    if len(work.task.free) >= MANY:
        yield from steered
    tree, way = grow(
        work.moves, predictor, begun.places, begun.levels, aim, deepest, ROUNDS, work.rng, pushes.note
    )
    if len(way):
        yield way
    _note(work, aim, tree.lack, tree.q)
    for planner in PLANNERS:
        yield from planner(work, predictor, begun, aim, deepest)
    yield from steered
    for count in range(1, deepest + 1):
        if tree.least(count) <= PROMISING * float(tree.lack.min()) and work.budget.left:
            seeds = tree.ways(count, WAYS)
            yield from _about(work, predictor, begun, aim, seeds, Search(generations=GENERATIONS))


def _composed(work: Work, predictor: Predictor, begun: Begun, aim: Aim, deepest: int) -> Iterator[Reals]:
    """Plans of pushes that were seen, where one object is to be brought to its goal."""
    bodies = aim.bodies or work.groups[0][0].bodies if len(work.groups[0]) else ()
    if len(bodies) != 1 or len(work.task.free) or not len(work.goals):
        return
    for count in range(1, deepest + 1):
        seeds = work.pushes(predictor.stage).plans(
            bodies[0], begun.places.q[0], work.goals, count, COMPOSED, work.rng
        )
        if len(seeds) and work.budget.left:
            yield from _finished(work, predictor, begun, aim, seeds)


def _steered(work: Work, predictor: Predictor, begun: Begun, aim: Aim) -> Iterator[Reals]:
    """Plans that steer objects to places at the goal by the inputs that no carrier uses."""
    if work.task.carriers or aim.partial or not len(goals_of(work)):
        return
    number = work.trees[str(predictor.stage)]
    rng = np.random.default_rng([work.seed, number])
    derived = work.derived if number % 2 else None  # derivatives lead long turns into dead ends
    steering = Steering(work.task, goals_of(work), derived)
    tree, way = grow(
        work.moves,
        predictor,
        begun.places,
        begun.levels,
        aim,
        work.task.moves[1],
        STEERING,
        rng,
        None,
        steering,
    )
    _note(work, aim, tree.lack, tree.q)
    if len(way):
        yield way


def _finished(work: Work, predictor: Predictor, begun: Begun, aim: Aim, seeds: Reals) -> Iterator[Reals]:
    """Of these plans (r, k, d) those that come to their aim, and the best of the others with the last move
    varied."""
    trials = run_moves(work.moves, predictor, begun.places, seeds, aim, begun.levels)
    _note(work, aim, trials.score, trials.places.q)
    order = np.argsort(trials.score, kind="stable")
    for k in order[trials.reached[order] > 0]:
        yield trials.vectors[k, : trials.reached[k]]
    for k in order[trials.score[order] < UNFIT][:VARIED]:
        head, last = trials.vectors[k, :-1], trials.vectors[k, -1:]
        places = begun.places
        if len(head):
            places = run_moves(work.moves, predictor, places, head[None], aim, begun.levels).places
            places = places._replace(memory=places.memory[:0])
        own = Begun(places, begun.levels)
        for found in _about(work, predictor, own, aim, last[None], LAST, POLISH):
            yield np.concatenate([head, found])


def _about(
    work: Work, predictor: Predictor, begun: Begun, aim: Aim, seeds: Reals, how: Search, spread: float = 0.3
) -> Iterator[Reals]:
    """Plans near these (r, k, d)."""
    trials = shoot(
        work.moves, predictor, begun.places, seeds.shape[1], aim, work.rng, how, seeds=seeds,
        spread=spread, before=begun.levels,
    )  # fmt: skip
    _note(work, aim, trials.score, trials.places.q)
    for vectors, reached in zip(trials.vectors, trials.reached, strict=True):
        if reached:
            yield vectors[:reached]


def _note(work: Work, aim: Aim, lacks: Reals, q: Reals) -> None:
    """Remember how near plans came to the whole goal (m,), and where the nearest ended (m, n)."""
    if not aim.partial:
        best = int(lacks.argmin())
        work.came_near(float(lacks[best]), q[best])


def _laid_out(work: Work, predictor: Predictor, candidates: Iterator[Reals]) -> Found | None:
    """The first of a few plans (k, d) that can be laid out to the goal."""
    for tried, vectors in enumerate(candidates):
        course = laid(work, predictor, vectors)
        if course.reached:
            return Found(course, vectors[: len(course.counts)])
        work.unlaid += 1
        if tried + 1 == LAID:
            break
    return None


PLANNERS: tuple[Callable[[Work, Predictor, Begun, Aim, int], Iterator[Reals]], ...] = (_composed,)
"""What yields plans besides trees and shooting, in the order in which they are tried: plans (k, d) of at most
so many moves that come to the aim from where a search begins."""

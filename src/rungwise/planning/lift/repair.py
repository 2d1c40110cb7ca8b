"""A plan on one stage: lifted from the stage before, repaired, or found anew."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from rungwise.deadline import TimeOver
from rungwise.kernel import Reals
from rungwise.models.ladder import Rung
from rungwise.outcome import Code
from rungwise.planning.modes.hands.gaits import by_hand, hand_in
from rungwise.planning.modes.planner import anew_on, mode_planner
from rungwise.planning.motion.budget import Stage
from rungwise.planning.motion.objective import Aim
from rungwise.planning.motion.propagate import GOES_ON, Places, Predictor
from rungwise.planning.plan import HELD
from rungwise.planning.search.layout import Course, counts_of, is_by_modes
from rungwise.planning.search.problem import Found, Work, laid
from rungwise.planning.search.search import Begun, lead_on
from rungwise.planning.search.shooting import Search, shoot
from rungwise.simulation.inputs import Segment

SLOWER = (2.0, 4.0, 8.0)
"""How many times as slowly a schedule of servos' targets is run that fails as it is."""
REGRASPED = 0.7
"""Part of what is left in which a hand grasps anew."""
CONTINUED = (0.01, 0.1, 0.4, 1.0)
"""Parts of a rung's inertia through which a plan is led to it."""


class Lifted(NamedTuple):
    """What came of a stage: the course on it and its moves (k, d), None if there is none; and how it came
    about."""

    found: Found | None
    how: str


@dataclass(frozen=True)
class Before:
    """The plan to lift: moves (k, d), none where it is known by its schedule alone; where they ended (k, n),
    the rung on which it was found, and its schedule, if it has one."""

    vectors: Reals
    waypoints: Reals
    model: Rung
    segments: tuple[Segment, ...] = ()
    labels: tuple[str, ...] = ()

    @property
    def is_by_modes(self) -> bool:
        """Whether it is a plan by contact modes."""
        return is_by_modes(self.labels)

    @property
    def counts(self) -> tuple[int, ...]:
        """How many segments belong to each move."""
        return counts_of(self.labels)


class Repair(NamedTuple):
    """A way to mend a plan that does not hold on a stage, in words; whether it is one for plans of moves, and
    for plans by contact modes."""

    made: Callable[[Work, Predictor, Before], Found | None]
    words: str
    of_moves: bool = True
    of_modes: bool = False


def on_stage(work: Work, stage: Stage, before: Before | None, anew: bool = True) -> Lifted:
    """The plan on this stage: the same one if it holds, repaired, or with `anew` a new one."""
    predictor = work.predictor(stage)
    if before is not None:
        found = _held(work, predictor, before)
        if found is not None:
            return Lifted(found, HELD)
        for repair in REPAIRS:
            fits = repair.of_modes if before.is_by_modes else repair.of_moves
            found = repair.made(work, predictor, before) if fits and work.budget.left else None
            if found is not None:
                return Lifted(found, repair.words)
    found = anew_on(work, predictor) if anew else None
    if found is not None:
        return Lifted(found, "planned" if before is None else "planned anew")
    return Lifted(None, "nothing found")


def _held(work: Work, predictor: Predictor, before: Before) -> Found | None:
    """The same plan: its schedule as it is, or its moves laid out anew."""
    course = _replayed(work, work.predictor(predictor.stage, quick=False), before)
    if (course is None or not course.reached) and not before.is_by_modes:
        course = laid(work, predictor, before.vectors)
    reached = course is not None and course.reached
    return Found(course, before.vectors[: len(course.counts)]) if course is not None and reached else None


def _more_slowly(work: Work, predictor: Predictor, before: Before) -> Found | None:
    """The schedule as it is, but more slowly, which changes little where inertia counts for nothing; where
    servos lead all fingers, and it comes from another rung: errors of steps are not less then."""
    planner = None if before.model == predictor.stage.model else mode_planner(work, predictor)
    if planner is None or any(not finger.carrier.by_place for finger in planner.scene.fingers):
        return None
    for factor in SLOWER:
        slowed = tuple(replace(each, duration=factor * each.duration) for each in before.segments)
        course = _replayed(work, predictor, replace(before, segments=slowed))
        if course is not None and course.reached:
            return Found(course, before.vectors[: len(course.counts)])
    return None


def _leg_by_leg(work: Work, predictor: Predictor, before: Before) -> Found | None:
    """The legs of a plan by contact modes, each made again from where the object is; harder and more slowly
    where they fail, and joined by others where they cannot be made."""
    planner = mode_planner(work, predictor)
    if planner is None:
        return None
    try:
        return planner.led_again(before.vectors) or planner.led_on(before.vectors)
    except TimeOver:
        return None  # what is left of the time may still do for another repair


def _regrasped(work: Work, predictor: Predictor, before: Before) -> Found | None:
    """The plan by cycles of a hand as far as it leads on this stage, and others, each proposed from where the
    object really is."""
    hand = None if before.is_by_modes else hand_in(work)
    if hand is None:
        return None
    try:
        with work.budget.part(REGRASPED):
            return by_hand(work, predictor, hand, before.vectors)
    except TimeOver:
        return None  # what is left of the time may still do for another repair


def _within_the_reserve(work: Work, predictor: Predictor, before: Before) -> Found | None:
    """The schedule as it is, if it comes to the goal as it is given, though not with the task's reserve."""
    course = _replayed(work, work.predictor(predictor.stage, reserve=False, quick=False), before)
    if course is None or not course.reached:
        return None
    return Found(course, before.vectors[: len(course.counts)])


def _replayed(work: Work, predictor: Predictor, before: Before) -> Course | None:
    """The schedule as it is, run move by move; None where there is none."""
    if not before.segments or len(before.vectors) not in (0, len(before.counts)):
        return None
    names, now, done = work.task.scene.template.inputs, work.start, 0
    level = dict(zip(names, work.task.before.tolist(), strict=True))
    places, counts, drives, outcome = list[Places](), list[int](), 0.0, Code.MISSED
    for count in before.counts:
        own = before.segments[done : done + count]
        levels = [list((level := level | dict(segment.inputs)).values()) for segment in own]
        run = predictor.run(
            now, np.array([levels]), np.array([[segment.duration for segment in own]]),
            ramps=tuple(segment.ramp for segment in own), until=tuple(segment.until for segment in own),
            patient=before.is_by_modes,
        )  # fmt: skip
        outcome, now, done, drives = (
            Code(int(run.outcome[0])),
            run.places,
            done + count,
            drives + float(run.work[0]),
        )
        places.append(now)
        counts.append(count)
        if outcome not in GOES_ON:
            break
    return Course(
        before.segments[:done], before.labels[:done], tuple(counts), tuple(places),
        np.array(list(level.values())), drives, outcome,
    )  # fmt: skip


def _led_on(work: Work, predictor: Predictor, before: Before) -> Found | None:
    """A schedule without moves, or half of it and so on, with moves after it that come to the goal."""
    if len(before.vectors):
        return None
    kept = len(before.segments)
    while kept and work.budget.left:
        own = replace(before, segments=before.segments[:kept], labels=before.labels[:kept])
        head = _replayed(work, predictor, own)
        if head is not None and head.outcome in GOES_ON:
            course = lead_on(work, predictor, head)
            if course is not None:
                return Found(course, before.vectors)
        kept //= 2
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
        away = work.whole if last else Aim(work.away(aim))
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
            work.moves, predictor, start.places, tail.shape[1], work.whole, work.rng,
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


def _after(work: Work, predictor: Predictor, vectors: Reals) -> Begun | None:
    """Where these moves end; None where they cannot be made."""
    if not len(vectors):
        return Begun(work.start, work.task.before)
    course = laid(work, predictor, vectors)
    if course.blocked or len(course.places) < len(vectors):
        return None
    return Begun(course.places[-1], course.levels)


REPAIRS = (
    Repair(_more_slowly, "held more slowly", of_moves=False, of_modes=True),
    Repair(_leg_by_leg, "planned again leg by leg", of_moves=False, of_modes=True),
    Repair(_regrasped, "regrasped"),
    Repair(_by_moves, "repaired move by move"),
    Repair(_by_suffix, "repaired at its end"),
    Repair(_by_continuation, "repaired by growing inertia"),
    Repair(_within_the_reserve, "held within the reserve", of_modes=True),
    Repair(_led_on, "continued with new moves"),
)
"""In the order in which they are tried."""

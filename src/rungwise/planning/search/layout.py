"""From vectors of moves to a schedule: each move in turn, with the robots' ways between them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TypeAlias

import numpy as np

from rungwise.kernel import Reals
from rungwise.outcome import Code
from rungwise.planning.motion.budget import Budget
from rungwise.planning.motion.moves import Moves
from rungwise.planning.motion.propagate import GOES_ON, Ends, Places, Predictor
from rungwise.planning.motion.settle import rested
from rungwise.planning.motion.transit import Transit
from rungwise.simulation.inputs import Segment

_Row: TypeAlias = "tuple[Reals, float, bool]"
"""A segment: inputs (u,), its duration, and whether it ramps."""
ENDS, WAIT = ("back", "hold"), "wait"
"""Labels of the segments with which moves end, and of the wait until objects rest that may follow."""
TOUCH, FOLLOW = "touch", "follow"
"""Labels of segments with which fingers come to an object and lead it, in plans by contact modes."""
LATER = 0.05
"""Part of its last move by which a plan goes on after it came to the goal: a run ends with the goal, and at
another accuracy or on another rung it comes there sooner or later."""


def is_by_modes(labels: Sequence[str]) -> bool:
    """Whether a plan with these labels is one by contact modes."""
    return TOUCH in labels or FOLLOW in labels


def counts_of(labels: Sequence[str]) -> tuple[int, ...]:
    """How many of the segments with these labels belong to each move."""
    begins = [
        k + 1
        for k, (label, following) in enumerate(pairwise(labels))
        if label in (*ENDS, WAIT) and following != WAIT
    ]
    return tuple(b - a for a, b in pairwise([0, *begins, len(labels)]))


@dataclass(frozen=True)
class Course:
    """A plan laid out on a stage: segments with labels, how many belong to each move, places at the ends of
    moves, inputs (u,) after them, the work of drives, and the outcome; `blocked` says what stood in
    the way."""

    segments: tuple[Segment, ...]
    labels: tuple[str, ...]
    counts: tuple[int, ...]
    places: tuple[Places, ...]
    levels: Reals
    work: float
    outcome: Code
    blocked: str = ""

    @property
    def reached(self) -> bool:
        return self.outcome == Code.GOAL


def lay_out(
    moves: Moves, transit: Transit, predictor: Predictor, start: Places, vectors: Reals, seed: int,
    before: Reals | None = None, draws_back: bool = False,
) -> Course:  # fmt: skip
    """Lay out the moves (k, d) from the start (one place), after inputs `before` (u,) if not those of the
    instance: led, run, and led again, until the goal is reached or a move cannot be made. With `draws_back`,
    robots draw back also from the push that comes to the goal."""
    names = moves.task.scene.template.inputs
    levels = (moves.task.before if before is None else before)[None]
    segments, labels, counts, places = list[Segment](), list[str](), list[int](), list[Places]()
    outcome, now, work = Code.MISSED, start, 0.0
    for number, vector in enumerate(vectors):
        legs, begun = _led(moves, transit, now, vector[None], levels[0], seed + number, predictor.budget)
        if legs is None:
            return Course(
                tuple(segments), tuple(labels), tuple(counts), tuple(places), levels[0], work, outcome,
                f"move {number}: no path for {', '.join(c.body for c in moves.task.carriers)} to its place",
            )  # fmt: skip
        own = moves.segments_of(vector[None], begun, levels)
        rows = [
            *legs,
            *((own.levels[0, s], own.durations[0, s], own.ramps[s]) for s in range(len(own.ramps))),
        ]
        if not moves.task.allows(np.array([row[0] for row in rows])).all():
            return Course(
                tuple(segments), tuple(labels), tuple(counts), tuple(places), levels[0], work, outcome,
                f"move {number}: leaves the bounds of the inputs",
            )  # fmt: skip
        run = predictor.run(
            now, np.array([[row[0] for row in rows]]), np.array([[row[1] for row in rows]]),
            ramps=tuple(row[2] for row in rows), patient=True,
        )  # fmt: skip
        run, after, waits, left = rested(moves, predictor, run, own.levels[:, -1])
        if left.durations[0] > 0.0:
            rows.append((left.levels[0], float(left.durations[0]), moves.task.by_place))
        if waits[0] > 0.0:
            rows.append((after[0], (1.0 + LATER) * float(waits[0]), False))
        outcome, work = Code(int(run.outcome[0])), work + float(run.work[0])
        kept = _kept(rows, run, now, levels[0])
        if draws_back and moves.task.carriers and outcome == Code.GOAL and run.switches[0] == len(rows) - 2:
            kept = [*kept, (kept[-1][0] + rows[-1][0] - rows[-2][0], *rows[-1][1:])]
        segments += [
            Segment(dict(zip(names, row.tolist(), strict=True)), float(took), None, ramp)
            for row, took, ramp in kept
        ]
        labels += (["transit"] * len(legs) + _labels(moves) + [WAIT, WAIT])[: len(kept)]
        counts.append(len(kept))
        places.append(run.places)
        levels = after
        if outcome not in GOES_ON:
            break
        now = run.places
    return Course(tuple(segments), tuple(labels), tuple(counts), tuple(places), levels[0], work, outcome)


def _labels(moves: Moves) -> list[str]:
    after = ["push", "back"] if moves.task.carriers else ["hold"]
    return ["change"] * (moves.segments - len(after)) + after


def _led(
    moves: Moves, transit: Transit, now: Places, vector: Reals, before: Reals, seed: int, budget: Budget
) -> tuple[list[_Row] | None, Places]:
    """Segments that lead the carriers to where a move begins, None where there is no way."""
    begun, fits = moves.begin(vector, now)
    if not moves.task.carriers:
        return [], begun
    way = transit.way(now.q[0], begun.q[0], seed, budget.is_in_time) if fits[0] else None
    if way is None:
        return None, begun
    legs = []
    for a, b in pairwise(way):
        took = transit.time(a, b)
        if took > 0.0:
            levels = before.copy()
            for carrier in moves.task.carriers:
                ends = b[None, list(carrier.places)]
                speed = (ends - a[list(carrier.places)]) / took
                levels[list(carrier.columns)] = carrier.levels(speed, ends)[0]
            legs.append((levels, took, moves.task.by_place))
    return legs, begun


def _kept(rows: list[_Row], run: Ends, now: Places, before: Reals) -> list[_Row]:
    """The segments up to where the run came to the goal, and a little longer; `before`: inputs (u,)."""
    if run.outcome[0] != Code.GOAL:
        return rows
    ended, gone = min(int(run.switches[0]), len(rows) - 1), float(run.places.time[0] - now.time[0])
    levels, took, ramp = rows[ended]
    last = gone - sum(row[1] for row in rows[:ended]) + LATER * gone
    if not ramp:
        return [*rows[:ended], (levels, last, False)]
    if last >= took:
        return [*rows[: ended + 1], (levels, last - took, False)]
    begun = rows[ended - 1][0] if ended else before
    return [*rows[:ended], (begun + last / took * (levels - begun), last, True)]

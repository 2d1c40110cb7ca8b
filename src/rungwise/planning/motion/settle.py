"""Moves that go on until what they moved is at rest, so that the next one begins where its robots are led to.

Objects coast after fast pushes, and fall where robots let go of them; robots take their time to the next
place. Searches that place robots by hand must not place them beside what still moves, nor beside what only
robots hold: these draw off first.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rungwise.kernel import Ints, Reals
from rungwise.outcome import Code
from rungwise.planning.motion.moves import Moves, Segments
from rungwise.planning.motion.propagate import GOES_ON, Ends, Places, Predictor

SLOWLY = 5.0
"""How many times as long as on their ways robots take to draw off: springs follow their targets late."""


HELD = 0.01
"""Part by which robots stand still for longer than a goal must hold: a part of it may begin to hold a little
later."""


class Left(NamedTuple):
    """Inputs (m, u) with which robots draw off from what they touch, and for how long (m,)."""

    levels: Reals
    durations: Reals


class Rested(NamedTuple):
    """How m moves ended, inputs (m, u) there, how long (m,) robots waited for objects to rest, and how they
    drew off before."""

    ends: Ends
    levels: Reals
    waits: Reals
    left: Left


def run_to_rest(moves: Moves, predictor: Predictor, places: Places, segments: Segments) -> Rested:
    """Run the segments of m moves from the places, and on until objects rest."""
    ends = predictor.run(places, segments.levels, segments.durations, ramps=segments.ramps)
    return rested(moves, predictor, ends, segments.levels[:, -1])


def rested(moves: Moves, predictor: Predictor, ends: Ends, levels: Reals) -> Rested:
    """What comes of runs that ended so, after inputs `levels` (m, u), when robots draw off from objects that
    they may hold, and stand still until objects rest or the longest wait is over, and as long as a goal must
    hold, where it does. Where that takes too many steps, nothing is waited for."""
    task = moves.task
    left, waits = Left(levels.copy(), np.zeros(len(levels))), np.zeros(len(levels))
    if not task.carriers:
        return held_out(moves, predictor, Rested(ends, levels, waits, left))
    rows = _drawn_off(moves, ends, left)
    if len(rows):
        more = predictor.run(
            ends.places.take(rows), left.levels[rows, None], left.durations[rows, None],
            ramps=(task.by_place,),
        )  # fmt: skip
        ends, levels = _put(ends, rows, more, np.arange(len(rows))), left.levels
    rows = np.flatnonzero(np.isin(ends.outcome, GOES_ON) & task.moving(ends.places.v))
    if not len(rows):
        return held_out(moves, predictor, Rested(ends, levels, waits, left))
    held = task.held(levels[rows])
    more = predictor.run(
        ends.places.take(rows), held[:, None], np.full((len(rows), 1), task.patience), until=(task.at_rest,),
        patient=True,
    )  # fmt: skip
    settled = np.flatnonzero(more.outcome != Code.NOT_CONVERGED)
    rows, levels = rows[settled], levels.copy()
    waits[rows] = more.places.time[settled] - ends.places.time[rows]
    levels[rows] = held[settled]
    return held_out(moves, predictor, Rested(_put(ends, rows, more, settled), levels, waits, left))


def held_out(moves: Moves, predictor: Predictor, so_far: Rested) -> Rested:
    """The same, where robots stand still for as long as the goal must hold, if it does, and if it is reached
    so."""
    rows = np.flatnonzero(np.isin(so_far.ends.outcome, GOES_ON))
    rows, more, held = _held(moves, predictor, so_far.ends.places, so_far.levels, rows)
    reached = np.flatnonzero(more.outcome == Code.GOAL) if more is not None else rows[:0]
    if more is None or not len(reached):
        return so_far
    rows, waits, levels = rows[reached], so_far.waits.copy(), so_far.levels.copy()
    waits[rows] += more.places.time[reached] - so_far.ends.places.time[rows]
    levels[rows] = held[reached]
    return so_far._replace(ends=_put(so_far.ends, rows, more, reached), levels=levels, waits=waits)


def comes_to_hold(moves: Moves, predictor: Predictor, places: Places, levels: Reals) -> NDArray[np.bool_]:
    """Whether a goal that must hold for a time is reached where robots stand still at m places, after inputs
    `levels` (m, u)."""
    found = np.zeros(len(places.q), bool)
    rows, more, _ = _held(moves, predictor, places, levels, np.arange(len(places.q)))
    if more is not None:
        found[rows] = more.outcome == Code.GOAL
    return found


def _held(
    moves: Moves, predictor: Predictor, places: Places, levels: Reals, rows: Ints
) -> tuple[Ints, Ends | None, Reals]:
    """Those of the rows where the goal holds and must go on to hold, what comes of standing still there, and
    the inputs (r, u) meanwhile."""
    rows = rows[moves.hopes(places.q[rows], places.v[rows])]
    held = moves.task.held(levels[rows])
    if not len(rows):
        return rows, None, held
    lasting = np.full((len(rows), 1), (1.0 + HELD) * moves.task.lasting)
    return rows, predictor.run(places.take(rows), held[:, None], lasting), held


def _drawn_off(moves: Moves, ends: Ends, left: Left) -> Ints:
    """The runs (r,) in which robots draw off, written into `left`: where they touch something, and objects
    would fall without them."""
    task = moves.task
    if task.slides or not moves.forgets:
        return np.zeros(0, np.int64)
    on, rows = np.flatnonzero(np.isin(ends.outcome, GOES_ON)), list[int]()
    for row in on[moves.transit.touches(ends.places.q[on])]:
        q = ends.places.q[row]
        place = moves.transit.away(q)
        took = SLOWLY * moves.transit.time(q, place)
        if took > 0.0:
            rows.append(int(row))
            left.durations[row] = took
            for carrier in task.carriers:
                aim = place[None, list(carrier.places)]
                speed = (aim - q[None, list(carrier.places)]) / took
                left.levels[row, list(carrier.columns)] = carrier.levels(speed, aim)[0]
    return np.array(rows, np.int64)


def _put(ends: Ends, rows: Ints, more: Ends, settled: Ints) -> Ends:
    """The ends with these rows from others, that are of later runs."""
    places = Places(*(old.copy() for old in ends.places))
    for old, new in zip(places, more.places, strict=True):
        old[rows] = new[settled]
    outcome, work, switches = ends.outcome.copy(), ends.work.copy(), ends.switches.copy()
    outcome[rows] = more.outcome[settled]
    work[rows] += more.work[settled]
    switches[rows] += more.switches[settled]
    return ends._replace(outcome=outcome, places=places, work=work, switches=switches)

"""Moves that go on until what they moved is at rest, so that the next one begins where its robots are led to.

Objects coast after fast pushes, and fall where robots let go of them; robots take their time to the next
place. Searches that place robots by hand must not place them beside what still moves.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rungwise.kernel import Ints, Reals
from rungwise.outcome import Code
from rungwise.planning.moves import Moves, Segments
from rungwise.planning.predict import GOES_ON, Ends, Places, Predictor
from rungwise.planning.task import Task


class Rested(NamedTuple):
    """How m moves ended, inputs (m, u) there, and how long (m,) robots waited for objects to rest."""

    ends: Ends
    levels: Reals
    waits: Reals


def run_to_rest(moves: Moves, predictor: Predictor, places: Places, segments: Segments) -> Rested:
    """Run the segments of m moves from the places, and on until objects rest."""
    ends = predictor.run(places, segments.levels, segments.durations, ramps=segments.ramps)
    return rested(moves.task, predictor, ends, segments.levels[:, -1])


def rested(task: Task, predictor: Predictor, ends: Ends, levels: Reals) -> Rested:
    """What comes of runs that ended so, after inputs `levels` (m, u), when robots hold still until objects
    rest or the longest wait is over. Where that takes too many steps, nothing is waited for."""
    waits = np.zeros(len(ends.outcome))
    if not task.carriers:
        return Rested(ends, levels, waits)
    rows = np.flatnonzero(np.isin(ends.outcome, GOES_ON) & task.moving(ends.places.v))
    if not len(rows):
        return Rested(ends, levels, waits)
    held = task.held(levels[rows])
    more = predictor.run(
        ends.places.take(rows), held[:, None], np.full((len(rows), 1), task.patience), until=(task.at_rest,)
    )
    settled = np.flatnonzero(more.outcome != Code.NOT_CONVERGED)
    rows, levels = rows[settled], levels.copy()
    waits[rows] = more.places.time[settled] - ends.places.time[rows]
    levels[rows] = held[settled]
    return Rested(_put(ends, rows, more, settled), levels, waits)


def _put(ends: Ends, rows: Ints, more: Ends, settled: Ints) -> Ends:
    """The ends with these rows from others, that are of later runs."""
    places = Places(*(old.copy() for old in ends.places))
    for old, new in zip(places, more.places, strict=True):
        old[rows] = new[settled]
    outcome, work = ends.outcome.copy(), ends.work.copy()
    outcome[rows] = more.outcome[settled]
    work[rows] += more.work[settled]
    return ends._replace(outcome=outcome, places=places, work=work)

"""A part of a plan over time: inputs, and where bodies are expected on the way."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from rungwise.kernel import Ints, Reals
from rungwise.outcome import Code
from rungwise.planning.execution.remaining_legs import inputs_of
from rungwise.planning.motion.propagate import Places, Predictor
from rungwise.planning.search.layout import WAIT
from rungwise.planning.task.task import Task
from rungwise.simulation.inputs import Segment


class Timed(NamedTuple):
    """Segments that are followed: inputs (s + 1, u) before the first and at the end of each, whether they
    ramp to it (s,), times (s + 1,) of these ends, to which leg each segment belongs (s,), its label, and the
    inputs (u,) after all; places (p, n) at times (p,) as far as they are known, p >= 1; how
    the planner's run of them ended."""

    rows: Reals
    ramps: tuple[bool, ...]
    ends: Reals
    legs: Ints
    labels: tuple[str, ...]
    after: Reals
    path: Reals
    times: Reals
    outcome: Code = Code.MISSED

    @property
    def duration(self) -> float:
        """How long they take."""
        return float(self.ends[-1])

    def segment(self, time: float) -> int:
        """The number of the segment at a time, that of the last one after all."""
        return int(np.clip(np.searchsorted(self.ends, time, side="right") - 1, 0, len(self.legs) - 1))

    def at(self, time: float) -> Reals:
        """Inputs (u,) at a time."""
        return self.after if time >= self.duration else self._at(self.segment(time), time)

    def mean(self, begin: float, end: float) -> Reals:
        """The mean of inputs (u,) over a time that has a length, so that drives at given speeds go as far as
        planned."""
        return np.asarray((self._summed(end) - self._summed(begin)) / (end - begin))

    def expected(self, time: float) -> Reals:
        """Where bodies (n,) are expected; where they were last expected, after what is known."""
        k = int(np.searchsorted(self.times, time, side="right")) - 1
        if k < 0 or k + 1 >= len(self.times):
            return np.array(self.path[max(k, 0)])
        part = (time - self.times[k]) / (self.times[k + 1] - self.times[k])
        return np.asarray(self.path[k] + part * (self.path[k + 1] - self.path[k]))

    def is_known(self, time: float) -> bool:
        """Whether it is known where bodies are at a time."""
        return time <= float(self.times[-1])

    def left(self, time: float, names: Sequence[str]) -> tuple[list[Segment], tuple[str, ...], Ints]:
        """The segments that are left at a time, of inputs with these names, their labels and legs."""
        first, found = self.segment(time), list[Segment]()
        for k in range(first, len(self.legs)):
            lasts = float(self.ends[k + 1] - max(time, self.ends[k]))
            inputs = dict(zip(names, self.rows[k + 1].tolist(), strict=True))
            found.append(Segment(inputs, lasts, None, self.ramps[k]))
        return found, self.labels[first:], self.legs[first:]

    def _at(self, k: int, time: float) -> Reals:
        if not self.ramps[k]:
            return np.array(self.rows[k + 1])
        part = np.clip((time - self.ends[k]) / max(self.ends[k + 1] - self.ends[k], 1e-300), 0.0, 1.0)
        return np.asarray(self.rows[k] + part * (self.rows[k + 1] - self.rows[k]))

    def _summed(self, time: float) -> Reals:
        """The integral of inputs (u,) up to a time; after the end inputs stay as they are."""
        total = np.zeros(self.rows.shape[1])
        for k in range(len(self.legs)):
            until = min(time, float(self.ends[k + 1]))
            if until <= self.ends[k]:
                return total
            total += 0.5 * (until - self.ends[k]) * (self._at(k, float(self.ends[k])) + self._at(k, until))
        return total + max(time - self.duration, 0.0) * self.after


def timed(
    nominal: Predictor, task: Task, start: Places, levels: Reals, segments: Sequence[Segment],
    labels: Sequence[str], legs: Ints,
) -> Timed:  # fmt: skip
    """Segments that name all inputs, after inputs (u,), as a run of the planner's from a place expects them:
    guarded ones as long as they take there. Robots stand still after them."""
    rows, durations = inputs_of(segments), np.array([each.duration for each in segments])
    ends = nominal.run(
        start, rows[None], durations[None], ramps=tuple(each.ramp for each in segments),
        until=tuple(each.until for each in segments), patient=True,
    )  # fmt: skip
    one: Ints = np.zeros(1, np.int64)
    known = [start, *(ends.at(k, one) for k in range(int(ends.switches[0])))]
    lasted = np.diff([float(place.time[0]) for place in known])
    guarded = [k for k in range(len(lasted)) if segments[k].until]
    durations[guarded] = lasted[guarded]
    times = np.concatenate([[0.0], np.cumsum(durations)])
    return Timed(
        np.vstack([levels, rows]), tuple(each.ramp for each in segments), times, legs, tuple(labels),
        task.held(rows[-1:])[0], np.array([place.q[0] for place in known]), times[: len(known)],
        Code(int(ends.outcome[0])),
    )  # fmt: skip


def still(task: Task, levels: Reals, q: Reals) -> Timed:
    """Robots stand still, after inputs (u,), with bodies where they are (n,)."""
    held = task.held(levels[None])[0]
    return Timed(
        np.array([held, held]), (False,), np.array([0.0, np.inf]), np.zeros(1, np.int64), (WAIT,), held,
        q[None], np.array([np.inf]),
    )  # fmt: skip

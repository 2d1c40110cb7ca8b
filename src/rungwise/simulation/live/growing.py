"""Schedules that grow: runs are told their inputs step by step."""

from __future__ import annotations

import math

import numpy as np

from rungwise.scene.contract import AnyScene
from rungwise.simulation.inputs import Segment, compile_segments
from rungwise.simulation.watched.inputs import Inputs

FOR_GOOD = Segment(duration=math.inf)
"""What follows the last segment that was told: inputs stay as they are."""
ROOM = 64
"""Segments that a schedule has room for at first."""


class Growing:
    """A schedule to which segments are added one by one, in room that doubles; behind them inputs stay as
    they are.

    whole: the schedule as kernels take it, with all its room; last: its last segment alone, and what follows.
    Both are written where a segment is added or shortened; `whole` is another where it had no room left.
    """

    def __init__(self, scene: AnyScene) -> None:
        self._names, self.count = scene.template.inputs, 0
        self._made = compile_segments(scene, [FOR_GOOD])
        self.whole, self.last = self._with_room(ROOM), self._with_room(2)

    def add(self, segment: Segment) -> None:
        if self.count + 1 == len(self.whole.durations):
            self._grow()
        levels = [segment.inputs.get(name, math.nan) for name in self._names]
        for inputs, k in ((self.whole, self.count), (self.last, 0)):
            inputs.durations[k], inputs.ramps[k], inputs.levels[k] = segment.duration, segment.ramp, levels
        self.count += 1

    def shorten(self, duration: float) -> None:
        """The last segment has lasted only so long."""
        self.whole.durations[self.count - 1] = self.last.durations[0] = duration

    def _with_room(self, room: int) -> Inputs:
        """An empty schedule with room for so many segments."""
        made = self._made
        return Inputs(
            speeds=made.speeds, numbers=made.numbers, timed=made.timed, rests=made.rests,
            columns=made.columns, durations=np.full(room, math.inf),
            levels=np.full((room, len(self._names)), math.nan), ramps=np.zeros(room, np.int64),
            code=made.code, constants=made.constants, table=np.zeros((room, 2), np.int64),
        )  # fmt: skip

    def _grow(self) -> None:
        before, self.whole = self.whole, self._with_room(2 * len(self.whole.durations))
        for name in ("durations", "levels", "ramps"):
            getattr(self.whole, name)[: self.count] = getattr(before, name)[: self.count]

"""Inputs over time in a run: the segment that is on, and the values of its inputs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from rungwise.kernel import Reals
from rungwise.simulation.inputs import Segment

NEARLY = 1e-12
"""Part of a segment's duration that rounding of its end amounts to."""


@dataclass
class Clock:
    """Which segment of a schedule, that began at `began`, is on; `names` are those of the inputs, and
    `parameters` those of what programs read."""

    segments: Sequence[Segment]
    began: float
    names: tuple[str, ...]
    columns: tuple[int, ...] = ()
    segment: int = 0
    _before: dict[str, float] = field(default_factory=dict)
    _opened: float = field(init=False)

    def __post_init__(self) -> None:
        self._opened = self.began

    @property
    def end(self) -> float:
        """When the schedule is over at the latest."""
        return self._opened + sum(segment.duration for segment in self.segments[self.segment :])

    @property
    def is_over(self) -> bool:
        """Whether no segment is on."""
        return self.segment >= len(self.segments)

    def memory(self) -> Reals:
        """The segment, when it began, and the inputs' values then (2 + u,)."""
        before = [self._before.get(name, np.nan) for name in self.names]
        return np.array([float(self.segment), self._opened, *before])

    def recall(self, values: Reals) -> None:
        """Go on from such a memory."""
        self.segment, self._opened = int(values[0]), float(values[1])
        self._before = {name: float(x) for name, x in zip(self.names, values[2:], strict=True) if x == x}

    def enter(self, number: int, time: float) -> None:
        """Begin segment `number` at a time."""
        self.segment, self._opened, self._before = number, time, {}

    def left(self, time: float) -> float:
        """What is left of the segment."""
        if self.segment >= len(self.segments):
            return np.inf
        return self._opened + self.segments[self.segment].duration - time

    def tell(self, time: float, told: Reals) -> None:
        """Write the inputs' values at a time, and the time, into `told` (p + 1,)."""
        told[-1] = time
        if self.segment >= len(self.segments):
            return
        on = self.segments[self.segment]
        for name, value in on.inputs.items():
            column = self.columns[self.names.index(name)]
            before = self._before.setdefault(name, float(told[column]))
            part = (time - self._opened) / on.duration if on.ramp and on.duration > 0.0 else 1.0
            told[column] = before + min(max(part, 0.0), 1.0) * (value - before)

    def go_on(self, time: float, told: Reals, holds: Callable[[int], bool]) -> bool:
        """Go to the segment that is on at a time; `holds` says whether the condition of segment k does. False
        where a segment is spent and its condition does not hold."""
        while not self.is_over:
            on = self.segments[self.segment]
            spent = self.left(time) <= NEARLY * max(on.duration, abs(time))
            ends = on.until is not None and holds(self.segment)
            if spent and on.until is not None and not ends:
                return False
            if not spent and not ends:
                return True
            if spent:
                self.tell(time, told)
            self._opened, self._before = time, {}
            self.segment += 1
        return True

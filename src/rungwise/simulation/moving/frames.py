"""What a run keeps to be looked at: frames, every so many steps."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from rungwise.kernel import Reals

WORK = ("drive_work", "load_work", "contact_work", "support_work", "joint_work")


class Frame(NamedTuple):
    """A state of a run: time, q (n_q,), v (n_v,), memory, residual, energy, the work of all steps, and gaps
    and normal forces (c,) of the scene's pairs of bodies."""

    time: float
    q: Reals
    v: Reals
    memory: Reals
    residual: float
    energy: float
    work: Reals
    gap: Reals
    force: Reals


def worked(clock: np.void) -> Reals:
    """The work (5,) of all steps, as of `WORK`."""
    return np.array([float(clock[name]) for name in WORK])


FAR = 1 << 30
"""More steps than a turn takes."""


@dataclass
class Recorder:
    """Keeps at most `most` frames, none if that is 0, every `stride` steps; the stride doubles when they are
    full."""

    most: int
    stride: int
    frames: list[Any] = field(default_factory=list)
    _since: int = 0

    @property
    def due(self) -> int:
        """Steps until the next frame."""
        return max(1, self.stride - self._since) if self.most else FAR

    def since(self, steps: int) -> None:
        """So many steps were taken since this was told last."""
        self._since += steps

    def take(self, time: float, frame: Callable[[], Any], last: bool = False) -> None:
        """Keep the state of this time, if it is its turn or the last."""
        if self.most == 0:
            return
        if not last and self.frames and self._since < self.stride:
            return
        if self.frames and self.frames[-1].time == time:
            self.frames.pop()
        if len(self.frames) >= self.most:
            del self.frames[1::2]
            self.stride *= 2
        self._since = 0
        self.frames.append(frame())

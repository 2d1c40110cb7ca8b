"""What a run keeps to be looked at: frames, every so many steps."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, overload

import numpy as np

from rungwise.kernel import Reals
from rungwise.simulation.stepping.record import HEAD, WORK, allocate_recorded


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


class Row(NamedTuple):
    """A frame as it was recorded: its memory, residual, work of all steps (see `WORK`), and what the world
    adds."""

    memory: Reals
    residual: float
    work: Reals
    rest: Reals

    @classmethod
    def of(cls, numbers: Reals) -> Row:
        end = int(numbers[0])
        return cls(numbers[HEAD:end], float(numbers[1]), numbers[2:HEAD], numbers[end:])


def worked(clock: np.void) -> Reals:
    """The work (5,) of all steps, as of `WORK`."""
    return np.array([float(clock[name]) for name in WORK])


class Frames(Sequence[Any]):
    """Frames, each made of its row when it is first asked for."""

    def __init__(self, rows: Sequence[Reals], made: Callable[[Row], Any]) -> None:
        self._rows, self._made = tuple(rows), made
        self._known: dict[int, Any] = {}

    def __len__(self) -> int:
        return len(self._rows)

    @overload
    def __getitem__(self, at: int) -> Any: ...
    @overload
    def __getitem__(self, at: slice) -> tuple[Any, ...]: ...
    def __getitem__(self, at: int | slice) -> Any:
        if isinstance(at, slice):
            return tuple(self[k] for k in range(*at.indices(len(self))))
        k = range(len(self))[at]
        if k not in self._known:
            self._known[k] = self._made(Row.of(self._rows[k]))
        return self._known[k]

    def __reduce__(self) -> tuple[Any, ...]:
        """Frames that are made, for another process or a file."""
        return tuple, (list(self),)


ROOM, AT_ONCE = 1 << 20, 1 << 10
"""Numbers of frames, and frames, that there is room for before they are taken out."""


class Recorder:
    """Keeps at most `most` frames, none if that is 0, of every `stride` steps; when they are full every other
    one is dropped, and they are twice as many steps apart. `time` is where in a row its time is; `recorded`
    are those that were not taken out yet."""

    def __init__(self, most: int, stride: int, time: int) -> None:
        self._most, self._time, self._rows, self._taken = most, time, list[Reals](), 0
        self.recorded = allocate_recorded(most, stride, ROOM if most else 0, AT_ONCE if most else 0)

    def rows(self) -> list[Reals]:
        """The frames as they were recorded (see `Row`)."""
        note, ends = self.recorded.note[0], self.recorded.ends.tolist()
        for k in range(int(self._taken), int(note.frames)):
            row = self.recorded.rows[ends[k] : ends[k + 1]]
            if self._rows and self._rows[-1][self._time] == row[self._time]:
                self._rows.pop()
            self._rows.append(row)
        self._taken = int(note.frames)
        return self._rows

    def make_room(self) -> None:
        """Make room for a frame: drop every other frame, or go on in other memory, in more where one frame
        does not fit."""
        note, rows = self.recorded.note[0], self.rows()
        if len(rows) >= self._most:
            self._rows = [row.copy() for row in rows[::2]]
            note.stride *= 2
        size = len(self.recorded.rows) * (1 if note.frames else 2)
        other = allocate_recorded(self._most, int(note.stride), size, AT_ONCE)
        other.note[0].since, other.note[0].room = note.since, self._most - len(self._rows)
        self.recorded, self._taken = other, 0

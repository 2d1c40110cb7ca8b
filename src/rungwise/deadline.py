"""When a call ends: looked at between steps, between parts of a proof, and within compiled loops."""

from __future__ import annotations

import math
import os
import threading
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Any, TypeVar

import numpy as np

from rungwise.compilation.progress import compiling
from rungwise.errors import InputError
from rungwise.kernel import Ints

STEPPING, PROVING = "within a step", "in the search for a proof"
T = TypeVar("T")


class TimeOver(Exception):
    """The time that a call has is over; what was found before counts. The text says what was being done."""


class LimitError(InputError):
    """The time of a call was over before it had anything to return; one line says what it had not done."""


def clock() -> float:
    """Seconds of the monotonic clock, less those in which this process compiled kernels: a limit is for the
    work that a call is asked for, and the first call on a machine would else return with nothing."""
    return time.monotonic() - compiling.waited


class Deadline:
    """The end of a call by `clock`, `limit` seconds from now; never without a limit.

    halt (1,) is set when it has come, within the context of `running`: compiled loops read it."""

    def __init__(self, limit: float | None = None) -> None:
        self.limit = limit
        self.ends = math.inf if limit is None else clock() + limit
        self.halt = np.zeros(1, np.int64)

    def __getstate__(self) -> dict[str, Any]:
        """For another process, whose own compilation stops its clock: when it ends by the monotonic clock."""
        return self.__dict__ | {"ends": self.ends + compiling.waited}

    def __setstate__(self, kept: dict[str, Any]) -> None:
        self.__dict__.update(kept | {"ends": kept["ends"] - compiling.waited})

    @classmethod
    def at(cls, ends: float) -> Deadline:
        """A deadline at this time of `clock`."""
        made = cls()
        made.ends = ends
        return made

    @property
    def is_over(self) -> bool:
        return self.ends < math.inf and not clock() < self.ends

    def is_over_for(self, time_s: float) -> bool:
        """Whether it came so long ago."""
        return self.ends < math.inf and clock() >= self.ends + time_s

    def look(self) -> None:
        """Raises TimeOver where it has come."""
        if self.is_over:
            raise TimeOver(STEPPING)

    def look_in_proof(self) -> None:
        """The same within the search for a proof."""
        if self.is_over:
            raise TimeOver(PROVING)

    def before(self, parts: Iterable[T]) -> Iterator[T]:
        """The parts, one after another. Raises TimeOver where it has come before one."""
        for part in parts:
            self.look()
            yield part

    @property
    def seconds(self) -> float | None:
        """The time that is left; None without a limit."""
        return None if self.ends == math.inf else max(0.0, self.ends - clock())

    @property
    def words(self) -> str:
        """That it has come."""
        return "the time is over" if self.limit is None else f"{self.limit:g} s are over"

    def share(self, parts: int) -> float | None:
        """What each of so many parts of the work may take of the time that is left; None without a limit."""
        left = self.seconds
        return None if left is None else left / parts

    @contextmanager
    def needed_for(self, what: str) -> Iterator[None]:
        """Where the deadline comes within the context, LimitError is raised: without this there is nothing to
        return."""
        try:
            yield
        except TimeOver:
            if not self.is_over:
                raise  # not by this limit
            raise LimitError(f"limit: the time was over before {what}; give more time") from None

    def running(self, *cells: Ints) -> Running:
        """Within the context `halt`, and each of these cells (1,), is set when the time is over."""
        return Running(self, [self.halt, *cells])


class Running:
    """The context of `Deadline.running`: a class, since steps that are taken one by one each enter it."""

    __slots__ = ("_cells", "_deadline")

    def __init__(self, deadline: Deadline, cells: list[Ints]) -> None:
        self._deadline, self._cells = deadline, cells

    def __enter__(self) -> Deadline:
        if self._deadline.is_over:
            _fill(self._cells, 1)
        with _IN_TURN:
            _RUNNING[id(self)] = self._cells
        if self._deadline.ends < math.inf:
            _ALARMS.add(self._deadline.ends, self._cells)
        return self._deadline

    def __exit__(self, *_: object) -> None:
        if self._deadline.ends < math.inf:
            _ALARMS.remove(self._cells)
        with _IN_TURN:
            del _RUNNING[id(self)]
            _fill(self._cells, 0)


class Alarms:
    """Sets cells at times of `clock`. One thread does so for the whole process, and sleeps until
    the first of the times: to start a thread takes as long as a short run."""

    def __init__(self) -> None:
        self._turn = threading.Condition()
        self._waiting: dict[int, tuple[float, list[Ints]]] = {}
        self._wakes = math.inf
        self._thread: threading.Thread | None = None

    def add(self, ends: float, cells: list[Ints]) -> None:
        with self._turn:
            self._waiting[id(cells)] = ends, cells
            if self._thread is None:
                self._thread = threading.Thread(target=self._watch, name="rungwise alarms", daemon=True)
                self._thread.start()
            if ends < self._wakes:
                self._wakes = ends
                self._turn.notify()

    def remove(self, cells: list[Ints]) -> None:
        """The cells are not set any more once this has returned."""
        with self._turn:
            self._waiting.pop(id(cells), None)

    def _watch(self) -> None:
        with self._turn:
            while True:
                now = clock()
                for key, (ends, cells) in list(self._waiting.items()):
                    if now >= ends:
                        _fill(cells, 1)
                        del self._waiting[key]
                self._wakes = min((ends for ends, _ in self._waiting.values()), default=math.inf)
                self._turn.wait(None if self._wakes == math.inf else self._wakes - now)


_ALARMS = Alarms()
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_ALARMS.__init__)  # type: ignore[misc]


@contextmanager
def set_at(ends: float, cells: list[Ints]) -> Iterator[None]:
    """Within the context each of these cells (1,) is set when this time of `clock` has come."""
    _ALARMS.add(ends, cells)
    try:
        yield
    finally:
        _ALARMS.remove(cells)


_RUNNING: dict[int, list[Ints]] = {}
_IN_TURN = threading.Lock()


def end_all() -> None:
    """Set all cells of `running`, with a limit or without: for a thread that has heard of an interrupt, which
    Python raises only when compiled loops return."""
    with _IN_TURN:
        for cells in _RUNNING.values():
            _fill(cells, 1)


def _fill(cells: list[Ints], value: int) -> None:
    for cell in cells:
        cell[0] = value


def go_on(halt: Ints) -> None:
    """Raises TimeOver where halt (1,) is set."""
    if halt[0] != 0:
        raise TimeOver(STEPPING)


def seconds(limit: float | None) -> float | None:
    """A limit, checked. Raises InputError."""
    if limit is None:
        return None
    if isinstance(limit, bool) or not isinstance(limit, int | float | np.number) or not limit >= 0.0:
        raise InputError(f"limit: must be a number of seconds, at least 0, not {limit!r}")
    return float(limit)


NEVER = Deadline()
"""A deadline that does not come."""

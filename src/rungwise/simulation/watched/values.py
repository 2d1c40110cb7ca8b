"""The values that conditions and schedules of a run read, and its place in the schedule."""

from __future__ import annotations

from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from rungwise.block import Block
from rungwise.kernel import Ints, Reals, RecordArray, record_type
from rungwise.scene.language.expression import SLOTS, STACK

Conditions: TypeAlias = tuple[Ints, Reals, Ints]
"""Programs of the scene's conditions: code, constants and table."""

PLACE = ("segment varies", "opened switched switch")
"""Integers and reals of a run's clock: the schedule began at `opened`, its `segment` at `switched`, and ends
at `switch` at the latest; `varies`: whether numbers change in it."""
CONTROL = record_type("ends", "step longest duration tolerance error jam")
"""ends: the verdict with which the run ends with its schedule, 0 where it does not; step: first step;
longest: longest step (the same for fixed steps); tolerance: the goal's; error: allowed per step, 0 for steps
of fixed length; jam: greatest motion in a step without solution that counts as a jam."""


class Slots(NamedTuple):
    """Where among the values the time is, which places follow; where speeds begin; where poses, which gaps
    follow; where forces; and where times since when parts of conditions have held."""

    time: int
    speeds: int
    poses: int
    forces: int
    dates: int


TIME, SPEEDS, POSES, FORCES, DATES = 0, 1, 2, 3, 4
"""Places in `Watched.slots`."""


class Watched(Block):
    """clock (1,): the time, and the place in the schedule (see `PLACE`); values (w,): what expressions read
    (see `Template`), and `dates` (slots,), part of them: since when parts of conditions have held (see
    `Lasting`); levels (u,): inputs before the present segment.

    slots (5,): see `Slots`; begun, ended (w,): values at the start and the end of a step; undefined (1,): the
    place of a number that is not finite now, or -1; stack (k,) is scratch.
    """

    clock: RecordArray
    values: Reals
    dates: Reals
    levels: Reals
    slots: Ints
    begun: Reals
    ended: Reals
    undefined: Ints
    stack: Reals


def allocate_watched(clock: NDArray[np.void], values: Reals, levels: Reals, slots: Slots) -> Watched:
    """With the arrays of a run that hold what it hands on."""
    w = len(values)
    return Watched(
        clock=clock, values=values, dates=values[slots.dates :][:SLOTS], levels=levels,
        slots=np.array(slots, np.int64),
        begun=np.zeros(w), ended=np.zeros(w), undefined=np.full(1, -1, np.int64), stack=np.zeros(STACK),
    )  # fmt: skip

"""A scene with its literal numbers as records, and with programs for the others."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rungwise.block import Block
from rungwise.kernel import Ints, Reals
from rungwise.scene.language.expression import SLOTS, Programs
from rungwise.scene.language.names import Names
from rungwise.scene.language.units import Conversion


class Numbers(Block):
    """Programs, and the slots that their values go to, for kernels."""

    code: Ints
    constants: Reals
    table: Ints
    targets: Ints


class Followed(NamedTuple):
    """What follows time and inputs: speeds that are prescribed, and all other numbers; whether any of these
    reads the time, and whether a condition does."""

    speeds: Numbers
    numbers: Numbers
    reads_time: bool
    awaits_time: bool


class Bounds(Block):
    """Slots of numbers, and the bounds that they must keep, for kernels."""

    slots: Ints
    low: Reals
    high: Reals
    kinds: Ints


@dataclass(frozen=True)
class Checks:
    """Bounds that bound numbers must keep; `paths` name the fields."""

    bounds: Bounds
    paths: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Template:
    """A scene ready to be bound: `buffer` holds the literals, programs write the expressions to `targets`.

    The values that programs read are laid out as parameters, t, q, v, gaps, normal forces and impulses of
    contacts, times since when parts of conditions have held (see `Lasting`), how far each body goes in a
    nominal step, and the goal's tolerance. `conditions` are goal, unsafe, doomed, and where some part
    must hold for a time, for each slot a program of that part and one of its time. `speeds` (of drives)
    and `timed` (all others) are the programs that read t (then `reads_time`) or inputs; `readers` are the
    paths of the numbers that follow each input. With `awaits_time` a condition reads t;
    `units` says which parameters are converted where they are read."""

    counts: tuple[int, ...]
    buffer: NDArray[np.float64]
    numbers: Programs
    targets: NDArray[np.int64]
    timed: Programs
    timed_targets: NDArray[np.int64]
    speeds: Programs
    speeds_targets: NDArray[np.int64]
    conditions: Programs
    checks: Checks
    parameters: tuple[str, ...]
    inputs: tuple[str, ...]
    readers: Mapping[str, tuple[str, ...]]
    reads_time: bool
    awaits_time: bool
    bodies: tuple[str, ...]
    coordinates: tuple[str, ...]
    contacts: tuple[tuple[str, str], ...]
    joints: tuple[str, ...]
    units: Mapping[str, Conversion]

    def names(self) -> Names:
        """The names that expressions may use."""
        return Names(self.parameters, self.coordinates, self.contacts, bodies=self.bodies, units=self.units)

    @property
    def velocities(self) -> tuple[str, ...]:
        """The coordinates' own names: in the plane v is the rate of q."""
        return self.coordinates

    @property
    def value_count(self) -> int:
        moving = 2 * len(self.coordinates) + 3 * len(self.contacts)
        return len(self.parameters) + 2 + moving + SLOTS + len(self.bodies)

    def fixed_numbers(self) -> Numbers:
        """Programs of the numbers that the parameters determine."""
        return block_of(self.numbers, self.targets)

    def timed_numbers(self) -> Numbers:
        """Programs of the numbers that depend on time or inputs, too, but for speeds of drives."""
        return block_of(self.timed, self.timed_targets)

    def timed_speeds(self) -> Numbers:
        """Programs of the speeds of drives that depend on time or inputs."""
        return block_of(self.speeds, self.speeds_targets)


def block_of(programs: Programs, targets: NDArray[np.int64]) -> Numbers:
    """Programs and their targets as kernels take them."""
    return Numbers(code=programs.code, constants=programs.constants, table=programs.table, targets=targets)

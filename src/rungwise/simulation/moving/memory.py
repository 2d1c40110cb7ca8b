"""What a run hands on from step to step beside q and v, as one array."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rungwise.kernel import Ints, Reals
from rungwise.scene.contract import AnyScene
from rungwise.simulation.moving.values import slots_of
from rungwise.simulation.state import StateError
from rungwise.simulation.stepping.plain import kept_arrays
from rungwise.simulation.stepping.stepper import Stepper
from rungwise.simulation.watched.values import PLACE


class Parts(NamedTuple):
    """Where in a memory (w,) what lies: the place in the schedule (see `PLACE`), the inputs before its
    segment, the greatest margins of goal and danger; of the values that conditions read those before all
    gaps, of each pair of bodies that they ask for its place among all and its gap, force and impulse
    (k, 4), and those from the times since when parts have held; and the core's."""

    place: slice
    levels: slice
    margins: slice
    values: slice
    pairs: slice
    rest: slice
    core: slice


PLACES = " ".join(PLACE).split()
"""Fields of the clock that are the place in the schedule."""


def first_value(scene: AnyScene) -> int:
    """Where in memories of this scene's runs values begin."""
    return len(PLACES) + len(scene.template.inputs) + 2


def memory_parts(scene: AnyScene, memory: Reals) -> Parts:
    """Where in a memory of a run of this scene what lies. Raises StateError where it is none."""
    template, slots, first = scene.template, slots_of(scene.template), first_value(scene)
    gaps = first + slots.forces - len(template.contacts)
    if not (gaps < len(memory) and 0 <= memory[gaps] <= len(template.contacts)):
        raise StateError("state.memory: is of another scene")
    of_pairs, rest = 4 * int(memory[gaps]), template.value_count - slots.dates
    ends = np.cumsum([0, len(PLACES), len(template.inputs), 2, gaps - first, 1, of_pairs, rest]).tolist()
    return Parts(
        slice(ends[0], ends[1]), slice(ends[1], ends[2]), slice(ends[2], ends[3]), slice(ends[3], ends[4]),
        slice(ends[5], ends[6]), slice(ends[6], ends[7]), slice(ends[7], None),
    )  # fmt: skip


def values_in(scene: AnyScene, memory: Reals) -> Reals:
    """The values (v,) that conditions read, in the order of all; 0 of pairs that no condition asked for."""
    template, slots, parts = scene.template, slots_of(scene.template), memory_parts(scene, memory)
    found, count = np.zeros(template.value_count), len(template.contacts)
    before = memory[parts.values]
    found[: len(before)], found[slots.dates :] = before, memory[parts.rest]
    pairs = memory[parts.pairs].reshape(-1, 4)
    for which in range(3):
        found[len(before) + which * count + pairs[:, 0].astype(np.int64)] = pairs[:, 1 + which]
    return found


def restored(values: Reals, part: NDArray[Any]) -> NDArray[Any]:
    """A row of numbers as an array like this one."""
    return values.view(part.dtype).reshape(part.shape)


ROOM = 1 << 12
"""Numbers that a memory has room for at first."""


def written(put: Callable[[Reals, Ints], int]) -> Reals:
    """What a kernel writes into as much room as it needs; it returns how much, -1 where it is short."""
    room = ROOM
    while True:
        out = np.empty(room)
        end = put(out, out.view(np.int64))
        if end >= 0:
            return out[:end].copy()
        room *= 2


def recall(stepper: Stepper, values: Reals) -> None:
    """Go on as the run with this memory would. Raises ValueError where it is of another system."""
    arrays = kept_arrays(stepper.setting, stepper.system)
    if len(values) != sum(part.size for part in arrays):
        raise ValueError("the memory is of another system")
    at = 0
    for part in arrays:
        part[...] = restored(values[at : at + part.size], part)
        at += part.size


def begin_anew(stepper: Stepper) -> None:
    """Keep of a run's memory only what contacts carry over to another run."""
    stepper.scratch.limited_force[:] = stepper.scratch.limited_mode[:] = 0
    stepper.state.impulse[:] = 0.0
    stepper.clock["leapt"] = 0.0
    if not stepper.rung.compliant:
        stepper.state.deformation[:] = 0.0

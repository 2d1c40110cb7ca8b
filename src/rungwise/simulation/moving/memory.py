"""What a run hands on from step to step beside q and v, as one array."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rungwise.kernel import Ints, Reals
from rungwise.scene.contract import AnyScene
from rungwise.simulation.stepping.plain import kept_arrays
from rungwise.simulation.stepping.stepper import Stepper
from rungwise.simulation.watched.values import PLACE


class Parts(NamedTuple):
    """Where in a memory (w,) what lies: the place in the schedule (see `PLACE`), the inputs before its
    segment, the greatest margins of goal and danger, values that conditions read, and the core's."""

    place: slice
    levels: slice
    margins: slice
    values: slice
    core: slice


PLACES = " ".join(PLACE).split()
"""Fields of the clock that are the place in the schedule."""


def memory_parts(scene: AnyScene) -> Parts:
    """Where in memories of this scene's runs what lies."""
    ends = np.cumsum([0, len(PLACES), len(scene.template.inputs), 2, scene.template.value_count]).tolist()
    return Parts(*map(slice, ends, [*ends[1:], None]))


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

"""What a run hands on from step to step beside q and v, as one array."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rungwise.kernel import Reals
from rungwise.scene.contract import AnyScene
from rungwise.simulation.core.stepper import Stepper
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


def _arrays(stepper: Stepper) -> list[NDArray[Any]]:
    """All that the core keeps of a run, and what its system keeps."""
    state, scratch, system = stepper.state, stepper.scratch, stepper.system
    return [
        state.clock.view(np.float64), scratch.limited_force, scratch.limited_mode, stepper.terms.fall,
        state.modes, state.deformation, state.force, state.impulse,
        *getattr(system, "kept", ()),
    ]  # fmt: skip


def flattened(parts: Iterable[NDArray[Any]]) -> list[Reals]:
    """Arrays of eight bytes per entry as rows of numbers."""
    return [np.ascontiguousarray(part).view(np.float64).ravel() for part in parts]


def restored(values: Reals, part: NDArray[Any]) -> NDArray[Any]:
    """A row of numbers as an array like this one."""
    return values.view(part.dtype).reshape(part.shape)


def remembered(stepper: Stepper) -> Reals:
    """The memory (w,) of a run of a system that keeps features in fixed slots."""
    return np.concatenate(flattened(_arrays(stepper)))


def recall(stepper: Stepper, values: Reals) -> None:
    """Go on as the run with this memory would. Raises ValueError where it is of another system."""
    arrays = _arrays(stepper)
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

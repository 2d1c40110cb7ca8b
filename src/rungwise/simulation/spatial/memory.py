"""What a run in space hands on from step to step beside q and v, as one array."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rungwise.kernel import Reals
from rungwise.scene.space import SpaceScene
from rungwise.simulation.core.march import March
from rungwise.system.spatial.space import Space


class Parts(NamedTuple):
    """Where in a memory (w,) what lies: of the schedule's clock, the run's own numbers, values that
    conditions read, and the core's."""

    clock: slice
    own: slice
    values: slice
    core: slice


OWN = 4
"""Numbers of a run: length of the next step, margins of goal and danger, energy gained."""


def memory_parts(scene: SpaceScene) -> Parts:
    """Where in memories of this scene's runs what lies."""
    clock = 2 + len(scene.template.inputs)
    values = clock + OWN + scene.template.value_count
    return Parts(slice(clock), slice(clock, clock + OWN), slice(clock + OWN, values), slice(values, None))


def _parts(march: March, space: Space) -> list[NDArray[Any]]:
    state, scratch, kept = march.state, march.scratch, space.kept
    return [
        state.clock.view(np.float64), state.deformation, state.modes, state.force, state.impulse,
        scratch.limited_force, scratch.limited_mode, march.terms.fall, kept.geoms, kept.place, kept.along,
        kept.world, kept.used,
    ]  # fmt: skip


def remembered(march: March, space: Space) -> Reals:
    """The memory (w,) of a run."""
    parts = [np.ascontiguousarray(part).view(np.float64).ravel() for part in _parts(march, space)]
    return np.concatenate([[space.margin], *parts])


def recall(march: March, space: Space, values: Reals) -> None:
    """Go on as the run with this memory would. Raises ValueError where it is of another model."""
    parts, at = _parts(march, space), 1
    if sum(part.size for part in parts) + at != values.size:
        raise ValueError("the memory is of another model")
    space.look_within(float(values[0]))
    for part in parts:
        part[...] = values[at : at + part.size].view(part.dtype).reshape(part.shape)
        at += part.size

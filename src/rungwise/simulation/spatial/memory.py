"""What a run in space hands on from step to step beside q and v, as one array."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from rungwise.kernel import Reals
from rungwise.simulation.core.march import March
from rungwise.system.spatial.space import Space


def _parts(march: March, space: Space) -> list[NDArray[Any]]:
    state, scratch, kept = march.state, march.scratch, space.kept
    return [
        state.clock.view(np.float64), state.deformation, state.modes, state.force, state.impulse,
        scratch.limited_force, scratch.limited_mode, march.terms.fall, kept.geoms, kept.place, kept.along,
        kept.world, kept.used,
    ]  # fmt: skip


def remembered(march: March, space: Space) -> Reals:
    """The memory (w,) of a run."""
    return np.concatenate(
        [np.ascontiguousarray(part).view(np.float64).ravel() for part in _parts(march, space)]
    )


def recall(march: March, space: Space, values: Reals) -> None:
    """Go on as the run with this memory would. Raises ValueError where it is of another model."""
    parts, at = _parts(march, space), 0
    if sum(part.size for part in parts) != values.size:
        raise ValueError("the memory is of another model")
    for part in parts:
        part[...] = values[at : at + part.size].view(part.dtype).reshape(part.shape)
        at += part.size

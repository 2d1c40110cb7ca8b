"""What the core and the features of a run in space hand on from step to step, as one array."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rungwise.kernel import Reals
from rungwise.simulation.core.stepper import Stepper
from rungwise.simulation.moving.memory import flattened, restored
from rungwise.system.spatial.features import FREE
from rungwise.system.spatial.space import Space

HEAD = 7
"""Numbers before all others: margin of contacts, how far the last step leapt, limited rows, slots of the
state and of features, and how many of them are in use."""


class _Arrays(NamedTuple):
    """Arrays of a run: whole ones, and rows by slot of the state and of features."""

    whole: list[NDArray[Any]]
    state: list[NDArray[Any]]
    features: list[NDArray[Any]]


def _arrays(stepper: Stepper, space: Space) -> _Arrays:
    state, scratch, kept = stepper.state, stepper.scratch, space.kept
    return _Arrays(
        [
            space.activation, state.clock.view(np.float64), scratch.limited_force, scratch.limited_mode,
            stepper.terms.fall, kept.used,
        ],
        [state.modes, state.deformation, state.force, state.impulse],
        [kept.geoms, kept.place, kept.along, kept.world],
    )  # fmt: skip


def remembered(stepper: Stepper, space: Space) -> Reals:
    """The memory (w,) of a run: only slots in use are kept, so that w differs from state to state."""
    arrays, state = _arrays(stepper, space), stepper.state
    moved = [(each != 0.0).any(axis=1) for each in (state.deformation, state.force, state.impulse)]
    active = np.flatnonzero((state.modes != 0) | moved[0] | moved[1] | moved[2])
    known = np.flatnonzero(space.kept.geoms[:, 0] >= 0)
    head = np.array([space.margin, stepper.leapt, *_sizes(stepper, space), len(active), len(known)])
    parts = [
        *arrays.whole,
        *(each[active] for each in arrays.state),
        *(each[known] for each in arrays.features),
    ]
    return np.concatenate([head, active, known, *flattened(parts)])


def activations(core: Reals, count: int) -> Reals:
    """The activations (k,) in such a memory."""
    first = HEAD + int(core[5:HEAD].sum())
    return core[first : first + count].copy()


def _sizes(stepper: Stepper, space: Space) -> list[int]:
    return [len(stepper.scratch.limited_force), len(stepper.state.modes), len(space.kept.geoms)]


def recall(stepper: Stepper, space: Space, values: Reals) -> None:
    """Go on as the run with this memory would; what follows it in the array is not read. Raises ValueError
    where it is of another model."""
    arrays = _arrays(stepper, space)
    if len(values) < HEAD or values[2:5].tolist() != _sizes(stepper, space):
        raise ValueError("the memory is of another model")
    space.look_within(float(values[0]))
    stepper.leapt = float(values[1])
    counts, at = values[5:HEAD].astype(np.int64), HEAD
    active = values[at : at + counts[0]].astype(np.int64)
    known = values[at + counts[0] : at + counts.sum()].astype(np.int64)
    at += int(counts.sum())
    for part in arrays.whole:
        part[...] = restored(values[at : at + part.size], part)
        at += part.size
    for part in arrays.state:
        part[...] = 0
    space.kept.geoms[:] = FREE
    for rows, parts in ((active, arrays.state), (known, arrays.features)):
        for part in parts:
            size = len(rows) * part[0].size
            part[rows] = values[at : at + size].view(part.dtype).reshape(len(rows), *part.shape[1:])
            at += size

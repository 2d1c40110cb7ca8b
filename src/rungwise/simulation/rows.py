"""States given as arrays, and the sizes by which margins are measured."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from rungwise.kernel import Reals
from rungwise.scene.language.terms import Dimension
from rungwise.scene.scene import FARTHEST
from rungwise.simulation.state import State, StateError

States: TypeAlias = "State | Sequence[State] | Reals"
"""One state, many, or an array: places (m, n_q) of all coordinates, at rest, or places and velocities
(m, n_q + n_v), at t = 0; in the plane n_v = n_q."""
LARGEST = 700.0
"""Largest logarithm of a scale, whatever the powers: its exponential is finite."""


def rows_of(states: NDArray[Any], n_q: int, n_v: int) -> Reals:
    """Places and velocities (m, n_q + n_v) from an array of places (m, n_q), at rest, or of both. Raises
    StateError."""
    if states.dtype.kind not in "iuf":
        raise StateError(f"states: must be an array of real numbers, not of {states.dtype}")
    if states.ndim != 2 or states.shape[1] not in (n_q, n_q + n_v):
        raise StateError(f"states: must have the shape (m, {n_q}) or (m, {n_q + n_v}), not {states.shape}")
    rows = np.zeros((len(states), n_q + n_v))
    rows[:, : states.shape[1]] = states
    return rows


def finite_rows(states: NDArray[Any], n_q: int, n_v: int) -> Reals:
    """The same, where every number is finite and within bounds. Raises StateError."""
    rows = rows_of(states, n_q, n_v)
    for wrong, words in (
        (~np.isfinite(rows), "is not finite"),
        (np.abs(rows[:, :n_q]) > FARTHEST, f"is not within -{FARTHEST:g}..{FARTHEST:g}"),
    ):
        if wrong.any():
            raise StateError(f"states: row {int(np.flatnonzero(wrong.any(axis=1))[0])} {words}")
    return rows


def scale_of(dimension: Dimension | None, length: float, time: float, mass: float, gravity: float) -> float:
    """The size of a scene in a dimension, 1 where there is none: its length, its duration, and the weight of
    its heaviest body, or without gravity the force that brings it so far in that time."""
    if dimension is None:
        return 1.0
    force = mass * (gravity if gravity > 0.0 else length / time / time)
    sizes = [size if 0.0 < size < math.inf else 1.0 for size in (length, time, force)]
    logarithms = np.array(dimension) * np.log(sizes)
    if np.abs(logarithms).sum() < LARGEST:
        return float(np.prod(np.array(sizes) ** np.array(dimension)))
    return math.exp(float(np.clip(logarithms.sum(), -LARGEST, LARGEST)))

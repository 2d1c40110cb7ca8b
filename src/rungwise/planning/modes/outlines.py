"""Places on outlines, and on surfaces, that lie opposite of others, or face alike."""

from __future__ import annotations

import numpy as np

from rungwise.kernel import Reals
from rungwise.planning.modes.frames import AROUND
from rungwise.world.carriers import Outline

ALIKE = 0.9
"""Cosine of the angle between normals up to which places on the outline face alike."""


def opposite(outline: Outline, parts: Reals, size: float) -> Reals:
    """Parts (m,) of the outline of an object of this size that face others (m,) across it, nearest to their
    normals' line."""
    every = np.arange(0.5, AROUND) / AROUND
    points, normals = outline(parts)
    others, facing = outline(every)
    across = _wedge(others[None] - points[:, None], normals[:, None])
    faces = (facing[None] * normals[:, None]).sum(axis=2)
    return np.asarray(every[(across + (1.0 + faces) * size).argmin(axis=1)])


def alike(outline: Outline, parts: Reals, rng: np.random.Generator) -> Reals:
    """Parts (m,) of the outline that face where others (m,) do, nearly, drawn among those; the same parts
    where nothing else does."""
    every = np.arange(0.5, AROUND) / AROUND
    normals, facing = outline(parts)[1], outline(every)[1]
    drawn = rng.random((len(parts), AROUND)) * (normals @ facing.T > ALIKE)
    best = drawn.argmax(axis=1)
    return np.where(drawn[np.arange(len(parts)), best] > 0.0, every[best], parts)


def _wedge(ways: Reals, along: Reals) -> Reals:
    """How far ways (..., d) lead off directions (..., d) of length 1."""
    if ways.shape[-1] == 2:
        return np.abs(ways[..., 0] * along[..., 1] - ways[..., 1] * along[..., 0])
    return np.asarray(np.linalg.norm(np.cross(ways, along), axis=-1))

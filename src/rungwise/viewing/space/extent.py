"""Scales of pictures in space: the box that is looked at, and the force that sets the arrows."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from rungwise.viewing.space.film import Film, Solid
from rungwise.viewing.space.shapes import ball, triangles, turned

MOMENTS = 60
"""Frames of a film whose bodies are surrounded: bodies do not leave and come back between them unseen."""
AROUND = 2.5
"""Fixed bodies are in the box unless they would make it so many times as large."""
AWAY = 8.0
"""A body that gets so many times as far as all bodies together reach at first has left, as one thrown has."""
USUAL = 0.95
"""Part of the forces that are no larger than the one of an arrow of nominal length."""
Box = tuple[NDArray[np.float64], NDArray[np.float64]]


def box(films: Sequence[Film]) -> Box:
    """Lower and upper corner (3,) of all bodies in all frames, planes aside.

    Fixed bodies that are much larger than the motion are left out, as walls and floors are, and so are moving
    ones that leave, unless all do.
    """
    every = [found for film in films for found in _moving(film)]
    first = _joined([begins for begins, _ in every])
    near = [whole for _, whole in every if first is not None and _size(whole) <= AWAY * _size(first)]
    seen = _joined(near or [whole for _, whole in every])
    fixed = [found for film in films for found in _boxes(film, False, np.zeros(1, np.int64))]
    whole = _joined([*fixed, *([] if seen is None else [seen])])
    if whole is None:
        return -np.ones(3), np.ones(3)
    return whole if seen is None or _size(whole) <= AROUND * _size(seen) else seen


def _moving(film: Film) -> list[tuple[Box, Box]]:
    """Boxes of each moving body, at first and in all frames."""
    frames = np.unique(np.linspace(0, len(film.time) - 1, MOMENTS).astype(np.int64))
    return list(zip(_boxes(film, True, frames[:1]), _boxes(film, True, frames), strict=True))


def largest_force(films: Sequence[Film]) -> float:
    """Force of an arrow of nominal length; 1 where there is none."""
    sizes = np.concatenate([np.linalg.norm(film.touches.force, axis=1) for film in films])
    sizes = sizes[sizes > 0.0]
    return float(np.quantile(sizes, USUAL)) if len(sizes) else 1.0


def _size(found: Box) -> float:
    return float(np.linalg.norm(found[1] - found[0]))


def _joined(boxes: Sequence[Box]) -> Box | None:
    if not boxes:
        return None
    return np.min([low for low, _ in boxes], axis=0), np.max([high for _, high in boxes], axis=0)


def _boxes(film: Film, moving: bool, frames: NDArray[np.int64]) -> list[Box]:
    """Boxes of the bodies that move, or of the others, in these frames."""
    found = []
    for body in np.flatnonzero(film.moving() == moving):
        reaching = [_reaching(solid) for solid in film.solids if solid.body == body]
        points = np.concatenate([np.zeros((0, 3)), *reaching])
        if len(points):
            turns, places = turned(film.turns[frames, body]), film.places[frames, body]
            world = np.einsum("fij,kj->fki", turns, points) + places[:, None]
            found.append((world.min(axis=(0, 1)), world.max(axis=(0, 1))))
    return found


def _reaching(solid: Solid) -> NDArray[np.float64]:
    """The vertices (k, 3) of a solid that reach furthest in many directions, in its body's frame."""
    vertices, _ = triangles(solid)
    if not len(vertices):
        return np.zeros((0, 3))
    furthest = np.unique((vertices @ ball()[0].T).argmax(axis=0))
    points: NDArray[np.float64] = vertices[furthest] @ turned(solid.turn).T + solid.place
    return points

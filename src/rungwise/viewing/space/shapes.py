"""Triangles of solids: what a page and a live view draw."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rungwise.viewing.space.film import Solid

AROUND = 32
"""Triangles around a round solid: its outline then is within half a percent of its radius."""
Triangles = tuple[NDArray[np.float64], NDArray[np.int64]]


def triangles(solid: Solid) -> Triangles:
    """Vertices (k, 3) in the solid's own frame, and faces (f, 3), counter-clockwise seen from outside.

    A plane has none."""
    vertices, faces = shape(solid)
    return vertices * scale(solid), faces


def scale(solid: Solid) -> NDArray[np.float64]:
    """Factors (3,) along x, y, z from the solid's `shape` to its size."""
    radius, half, _ = solid.size
    match solid.kind:
        case "sphere":
            return np.full(3, radius)
        case "cylinder":
            return np.array([radius, radius, half])
        case "ellipsoid" | "box":
            return solid.size
    return np.ones(3)


def shape(solid: Solid) -> Triangles:
    """Triangles of the solid at size 1; of capsules and meshes, which no factors make from one another, at
    their own."""
    match solid.kind:
        case "sphere" | "ellipsoid":
            return ball()
        case "cylinder":
            return _revolved(np.array([[0.0, -1.0], [1.0, -1.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]))
        case "capsule":
            radius, half = solid.size[:2]
            end = np.array([0.0, half])
            lower, upper = radius * _arc(-90.0, 0.0) - end, radius * _arc(0.0, 90.0) + end
            return _revolved(np.concatenate([lower, [[radius, 0.0]], upper]))
        case "box":
            return _box()
        case "mesh":
            return solid.vertices, solid.faces
    return np.zeros((0, 3)), np.zeros((0, 3), np.int64)


def ball() -> Triangles:
    """A ball of radius 1."""
    return _revolved(_arc(-90.0, 90.0))


def _arc(first: float, last: float) -> NDArray[np.float64]:
    """Points (k, 2), distance from the axis and height, of a circle of radius 1 between two latitudes."""
    count = round(abs(last - first) / 360.0 * AROUND) + 1
    angles = np.radians(np.linspace(first, last, count))
    points = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    points[np.abs(np.abs(angles) - np.pi / 2) < 1e-9, 0] = 0.0
    return points


def _revolved(profile: NDArray[np.float64]) -> Triangles:
    """A profile (k, 2), distance from the axis and height, from its lower end on the axis to its upper one,
    turned about z."""
    angles = 2.0 * np.pi / AROUND * np.arange(AROUND)
    ring = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    rings = [np.column_stack([r * ring, np.full(AROUND, z)]) for r, z in profile[1:-1]]
    lower, upper = (np.array([[0.0, 0.0, z]]) for z in profile[[0, -1], 1])
    here, next_ = np.arange(AROUND), np.roll(np.arange(AROUND), -1)
    bottom, top = len(rings) * AROUND, len(rings) * AROUND + 1
    faces = [np.column_stack([np.full(AROUND, bottom), next_, here])]
    for k in range(len(rings) - 1):
        a, b = k * AROUND, (k + 1) * AROUND
        faces.append(np.column_stack([here + a, next_ + a, next_ + b]))
        faces.append(np.column_stack([here + a, next_ + b, here + b]))
    last = (len(rings) - 1) * AROUND
    faces.append(np.column_stack([np.full(AROUND, top), here + last, next_ + last]))
    return np.concatenate([*rings, lower, upper]), np.concatenate(faces)


def _box() -> Triangles:
    vertices = np.array([[x, y, z] for z in (-1, 1) for y in (-1, 1) for x in (-1, 1)], np.float64)
    sides = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    return vertices, np.array([face for a, b, c, d in sides for face in ((a, b, c), (a, c, d))], np.int64)


def turned(turn: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rotation matrices (…, 3, 3) of quaternions w x y z (…, 4)."""
    w, x, y, z = np.moveaxis(turn / np.linalg.norm(turn, axis=-1, keepdims=True), -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)

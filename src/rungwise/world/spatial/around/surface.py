"""Places on the surface of a body in space, drawn evenly over its geoms, with their normals."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from rungwise.kernel import Reals
from rungwise.scene.space.laws import touching
from rungwise.world.carriers import turn_of

if TYPE_CHECKING:
    import mujoco

PLACES = 960
"""Places that are kept on the surface of a body; of each geom so many are drawn in proportion to its area."""
EDGED = 0.5
"""Cosine of the angle between the normals of two places between which there is an edge."""
INSIDE = 1e-6
"""Part of the size by which a place is inside of another geom of its body, so that it is none."""
SPHERE, CAPSULE, ELLIPSOID, BOX, MESH = 2, 3, 4, 6, 7
"""MuJoCo's numbers of geoms; all others are taken for cylinders."""


@dataclass(frozen=True)
class Surface:
    """Places (n, 3) on a body's surface in its frame, and outward normals (n, 3) there."""

    places: Reals
    normals: Reals

    def __call__(self, part: Reals) -> tuple[Reals, Reals]:
        """Points (m, 3) and outward normals (m, 3) at parts 0..1 (m,): the places in turn."""
        rows = np.minimum(np.mod(part, 1.0) * len(self.places), len(self.places) - 1).astype(np.int64)
        return self.places[rows], self.normals[rows]

    def part_of(self, point: Reals) -> tuple[float, float]:
        """The part of the place next to a point (3,), and how far, 0..1, it is from edges: over how far the
        place farthest from edges is."""
        k = int(((self.places - point) ** 2).sum(axis=1).argmin())
        return (k + 0.5) / len(self.places), float(self._inside[k])

    @cached_property
    def _inside(self) -> Reals:
        """See `part_of` (n,)."""
        away = np.linalg.norm(self.places[:, None] - self.places, axis=2)
        away[self.normals @ self.normals.T > EDGED] = np.inf
        near = away.min(axis=1)
        beside = np.abs(((self.places[away.argmin(axis=1)] - self.places) * self.normals).sum(axis=1))
        across = np.sqrt(np.maximum(near**2 - beside**2, 0.0))
        across[~np.isfinite(near)] = 1.0
        return np.asarray(np.minimum(across / across.max(), 1.0))


def surface(model: mujoco.MjModel, body: int) -> Surface:
    """The surface of a body. Raises ValueError for one without geoms that touch and end somewhere."""
    solid = (model.geom_bodyid == body) & touching(model) & (model.geom_rbound > 0.0)
    geoms = np.flatnonzero(solid).tolist()
    if not geoms:
        raise ValueError("the body has no surface to push at")
    rng, areas, found = np.random.default_rng(0), list[float](), list[tuple[Reals, Reals]]()
    for g in geoms:
        area, draw = _shape(model, g)
        places, normals = draw(rng, PLACES)
        turn, at = turn_of(model.geom_quat[g]), model.geom_pos[g]
        areas.append(area)
        found.append((places @ turn.T + at, normals @ turn.T))
    shares = np.array(areas) / sum(areas)
    picked = rng.choice(len(geoms), size=PLACES, p=shares)
    places, normals = (
        np.array([found[g][side][k] for k, g in enumerate(picked.tolist())]) for side in range(2)
    )
    covered = np.zeros(PLACES, bool)
    for k, g in enumerate(geoms):
        if len(geoms) > 1:
            covered |= (picked != k) & _is_inside(model, g, places)
    return Surface(places[~covered], normals[~covered])


Draw = Callable[[np.random.Generator, int], tuple[Reals, Reals]]
"""Draws places (m, 3) and normals (m, 3)."""


def _shape(model: mujoco.MjModel, g: int) -> tuple[float, Draw]:
    """The area of a geom, and what draws places on it, in its own frame."""
    kind, size = int(model.geom_type[g]), model.geom_size[g].copy()
    if kind == BOX:
        return _triangles(*_box(size))
    if kind == MESH:
        return _triangles(*_hull(model, g))
    if kind in (SPHERE, ELLIPSOID):
        radii = np.full(3, size[0]) if kind == SPHERE else size
        mean = float(((radii[[0, 0, 1]] * radii[[1, 2, 2]]) ** 1.6).mean() ** (1.0 / 1.6))
        return 4.0 * math.pi * mean, lambda rng, m: _on_ball(rng, m, radii)
    radius, half = float(size[0]), float(size[1])
    side = 4.0 * math.pi * radius * half
    if kind == CAPSULE:
        return side + 4.0 * math.pi * radius**2, lambda rng, m: _on_tube(rng, m, radius, half, rounded=True)
    return side + 2.0 * math.pi * radius**2, lambda rng, m: _on_tube(rng, m, radius, half, rounded=False)


def _on_ball(rng: np.random.Generator, m: int, radii: Reals) -> tuple[Reals, Reals]:
    unit = rng.normal(size=(m, 3))
    unit /= np.linalg.norm(unit, axis=1)[:, None]
    normals = unit / radii
    return unit * radii, normals / np.linalg.norm(normals, axis=1)[:, None]


def _on_tube(
    rng: np.random.Generator, m: int, radius: float, half: float, *, rounded: bool
) -> tuple[Reals, Reals]:
    """On a cylinder, or a capsule, along z."""
    angle, height = rng.uniform(0.0, 2.0 * math.pi, m), rng.uniform(-half, half, m)
    normals = np.stack([np.cos(angle), np.sin(angle), np.zeros(m)], axis=1)
    places = radius * normals + np.stack([np.zeros(m), np.zeros(m), height], axis=1)
    ends = 2.0 * radius if rounded else radius
    at_end = rng.random(m) < ends / (2.0 * half + ends)
    if rounded:
        unit, _ = _on_ball(rng, m, np.ones(3))
        places[at_end] = (radius * unit + half * np.sign(unit[:, 2:]) * [0.0, 0.0, 1.0])[at_end]
        normals[at_end] = unit[at_end]
        return places, normals
    up = rng.choice([-1.0, 1.0], m)
    out = radius * np.sqrt(rng.random(m))
    flat = np.stack([out * np.cos(angle), out * np.sin(angle), half * up], axis=1)
    places[at_end], normals[at_end] = flat[at_end], (up[:, None] * [0.0, 0.0, 1.0])[at_end]
    return places, normals


def _box(half: Reals) -> tuple[Reals, Reals]:
    """Corners (t, 3, 3) of the triangles of a box, and their normals (t, 3)."""
    corners, normals = list[Reals](), list[Reals]()
    for axis in range(3):
        for sign in (-1.0, 1.0):
            normal, (u, v) = np.zeros(3), [k for k in range(3) if k != axis]
            normal[axis] = sign
            ends = []
            for a, b in ((-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)):
                corner = normal * half
                corner[u], corner[v] = a * half[u], b * half[v]
                ends.append(corner)
            corners += [np.array([ends[0], ends[1], ends[2]]), np.array([ends[0], ends[2], ends[3]])]
            normals += [normal, normal]
    return np.array(corners), np.array(normals)


def _hull(model: mujoco.MjModel, g: int) -> tuple[Reals, Reals]:
    """The same of the convex hull of a mesh, which is what touches."""
    from scipy.spatial import ConvexHull

    mesh = int(model.geom_dataid[g])
    first = int(model.mesh_vertadr[mesh])
    vertices = np.array(model.mesh_vert[first : first + int(model.mesh_vertnum[mesh])], float)
    hull = ConvexHull(vertices)
    return vertices[hull.simplices], hull.equations[:, :3]


def _triangles(corners: Reals, normals: Reals) -> tuple[float, Draw]:
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    areas = 0.5 * np.linalg.norm(across, axis=1)

    def draw(rng: np.random.Generator, m: int) -> tuple[Reals, Reals]:
        rows = rng.choice(len(areas), size=m, p=areas / areas.sum())
        u, v = rng.random((2, m, 1))
        over = u + v > 1.0
        u, v = np.where(over, 1.0 - u, u), np.where(over, 1.0 - v, v)
        a, b, c = corners[rows].transpose(1, 0, 2)
        return a + u * (b - a) + v * (c - a), normals[rows]

    return float(areas.sum()), draw


def _is_inside(model: mujoco.MjModel, g: int, places: Reals) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    """Which places (n, 3) of a body's frame are within one of its geoms, or on its surface (n,)."""
    turn, size, kind = turn_of(model.geom_quat[g]), model.geom_size[g], int(model.geom_type[g])
    own = (places - model.geom_pos[g]) @ turn
    slack = INSIDE * float(model.geom_rbound[g])
    if kind == BOX:
        return np.asarray((np.abs(own) <= size + slack).all(axis=1))
    if kind == MESH:
        corners, normals = _hull(model, g)
        far = (normals * corners[:, 0]).sum(axis=1)
        return np.asarray((own @ normals.T <= far + slack).all(axis=1))
    if kind in (SPHERE, ELLIPSOID):
        radii = np.full(3, size[0]) if kind == SPHERE else size
        return np.asarray(np.linalg.norm(own / radii, axis=1) <= 1.0 + INSIDE)
    beyond = np.maximum(np.abs(own[:, 2]) - size[1], 0.0)
    out = np.linalg.norm(own[:, :2], axis=1)
    if kind == CAPSULE:
        return np.asarray(np.hypot(out, beyond) <= size[0] + slack)
    return np.asarray((out <= size[0] + slack) & (beyond <= slack))

"""Closed meshes whose volumes are known: prisms over outlines, shells of revolution, and what they lack of
their hulls."""

from __future__ import annotations

from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import shapely

from rungwise.kernel import Ints, Reals


class Mesh(NamedTuple):
    """Vertices (k, 3) and faces (f, 3), anticlockwise from outside."""

    vertices: Reals
    faces: Ints

    def moved(self, turn: Reals, scale: float, place: Reals) -> Mesh:
        return Mesh(scale * self.vertices @ turn.T + place, self.faces)

    def beside(self, other: Mesh) -> Mesh:
        faces = np.concatenate([self.faces, other.faces + len(self.vertices)])
        return Mesh(np.concatenate([self.vertices, other.vertices]), faces)

    def inside_out(self) -> Mesh:
        return Mesh(self.vertices, self.faces[:, ::-1])

    def written(self, name: str) -> str:
        """As an asset of MJCF."""
        vertex, face = (" ".join(map(repr, each.ravel().tolist())) for each in self)
        return f'<mesh name="{name}" vertex="{vertex}" face="{face}"/>'


def prism(outline: Any, height: float) -> Mesh:
    """The solid over a polygon of shapely's."""
    triangles = shapely.constrained_delaunay_triangles(shapely.orient_polygons(outline)).geoms
    ends = [shapely.get_coordinates(shapely.orient_polygons(each).exterior)[:3] for each in triangles]
    places, number = np.unique(np.round(np.concatenate(ends), 12), axis=0, return_inverse=True)
    top, count = number.ravel().reshape(-1, 3), len(places)
    sides = {(int(t[i]), int(t[(i + 1) % 3])) for t in top for i in range(3)}
    rim = [(a, b) for a, b in sides if (b, a) not in sides]
    walls = [each for a, b in rim for each in ((a, b, b + count), (a, b + count, a + count))]
    vertices = [np.column_stack([places, np.full(count, z)]) for z in (0.0, height)]
    return Mesh(np.concatenate(vertices), np.concatenate([top[:, ::-1], top + count, np.array(walls)]))


def box(x: float, y: float, z: float) -> Mesh:
    """A box of these edges, from z = 0 up."""
    return prism(shapely.box(-x / 2, -y / 2, x / 2, y / 2), z)


def u_shape() -> Mesh:
    """Two walls on a floor; 5/9 of the hull are not in it."""
    outline = [(-1.5, 0), (1.5, 0), (1.5, 3), (1, 3), (1, 0.5), (-1, 0.5), (-1, 3), (-1.5, 3)]
    lying = prism(shapely.Polygon(outline), 1.0)
    return Mesh(lying.vertices @ np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]]), lying.faces)


def plate_with_hole(side: float, hole: float, height: float) -> Mesh:
    outer, inner = (shapely.box(-x / 2, -x / 2, x / 2, x / 2) for x in (side, hole))
    return prism(outer.difference(inner), height)


def ring(count: int = 12) -> Mesh:
    """A ring of radii 2 and 3 around z, as a prism over regular polygons of so many corners."""
    angle = 2.0 * np.pi * np.arange(count) / count
    way = np.column_stack([np.cos(angle), np.sin(angle)])
    return prism(shapely.Polygon(3.0 * way, [2.0 * way]), 1.0)


def bowl(rings: int = 5, count: int = 16) -> Mesh:
    """A half of a hollow ball, radii 3 and 2.5, open upwards."""
    rise = np.linspace(0.0, np.pi / 2.0, rings)
    outline = [
        (r * np.sin(a), -r * np.cos(a)) for r, every in ((3.0, rise), (2.5, rise[::-1])) for a in every
    ]
    angle = 2.0 * np.pi * np.arange(count) / count
    vertices = [(x * np.cos(a), x * np.sin(a), z) for x, z in outline for a in angle]
    rows = np.arange(len(vertices)).reshape(-1, count)
    faces = []
    for low, high in pairwise(rows):
        for i in range(count):
            j = (i + 1) % count
            faces += [(low[i], low[j], high[j]), (low[i], high[j], high[i])]
    return _without_thin(np.array(vertices), np.array(faces))


def _without_thin(vertices: Reals, faces: Ints) -> Mesh:
    """The faces that have an area, of vertices that are apart."""
    places, number = np.unique(np.round(vertices, 12), axis=0, return_inverse=True)
    own = number.ravel()[faces]
    return Mesh(places, own[(own != np.roll(own, 1, axis=1)).all(axis=1)])


def l_shape() -> Mesh:
    """2/7 of the hull are not in it."""
    return prism(shapely.Polygon([(0, 0), (3, 0), (3, 1), (1, 1), (1, 3), (0, 3)]), 1.0)


def cross() -> Mesh:
    """2/7 of the hull are not in it."""
    return prism(shapely.box(-3, -1, 3, 1).union(shapely.box(-1, -3, 1, 3)), 1.0)


CONCAVE = {
    "L": (l_shape, 2.0 / 7.0),
    "U": (u_shape, 5.0 / 9.0),
    "cross": (cross, 2.0 / 7.0),
    "ring": (ring, 4.0 / 9.0),
    "hole": (lambda: plate_with_hole(10.0, 1.0, 1.0), 0.01),
}
"""Meshes that are not convex, and what part of their hulls they leave out."""

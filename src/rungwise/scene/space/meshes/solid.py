"""What a triangle mesh encloses: whether that is convex, and if not, the connected parts that it consists of.

A mesh is *convex* if no point of its surface is deeper below that of its convex hull than `LEVEL` times the
hull's size, the edge of a cube of the same volume. The volume that the mesh leaves out does not tell this: a
hole for a peg is a hundredth of a large plate. The volume is what is told to people.

Faces are joined over edges that exactly two of them have into *parts*; where that leaves edges open, vertices
at one place are welded before. A part that encloses a negative volume, as faces turned inward do, is a void
in another one around it; where the largest does, the whole mesh is turned inside out. Parts within a convex
part are of no account.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import breadth_first_order, connected_components
from scipy.spatial import ConvexHull, QhullError

from rungwise.kernel import Ints, Reals

LEVEL = 0.02
"""Depth of a surface below the hull's, over the hull's size, up to which a mesh is convex: the roundings of a
scan, and of parts whose faces were thinned out. Below what `accuracy` asks of pieces."""
ROUNDED = 1e-6
"""Distance over a mesh's size that is rounding: a few roundings of single precision, in which MuJoCo keeps
meshes."""
POINTS, GRID = 20_000, (2, 8)
"""Points at which the depth of a surface is measured, and the least and greatest number of parts of an edge
between them: faces may dip between corners that do not, where parts cross each other."""
BLOCK = 1 << 22
"""Distances from planes that are held in memory at a time."""


class Hull(NamedTuple):
    """Planes (p, 4) of a convex hull, with outward normals, and its volume and area."""

    planes: Reals
    volume: float
    area: float

    def depths(self, points: Reals) -> Reals:
        """How deep points (k, 3) are below the surface; negative outside."""
        found, step = np.empty(len(points)), max(1, BLOCK // len(self.planes))
        for begin in range(0, len(points), step):
            own = slice(begin, begin + step)
            found[own] = -(points[own] @ self.planes[:, :3].T + self.planes[:, 3]).max(axis=1)
        return found


@dataclass(frozen=True, eq=False)
class Part:
    """A closed surface: vertices (k, 3), faces (f, 3) anticlockwise from outside, with the faces of its voids
    among them; `is_plain`: exactly two faces at each edge, and no voids."""

    vertices: Reals
    faces: Ints
    hull: Hull
    volume: float
    is_convex: bool
    is_plain: bool


@dataclass(frozen=True, eq=False)
class Solid:
    """What a mesh encloses: whether it is convex; the share of its hull's volume that it leaves out, a lower
    bound of it if parts overlap (`is_least`); its parts; and why it has no volume, in words, or empty."""

    is_convex: bool
    share: float
    is_least: bool
    parts: tuple[Part, ...]
    fault: str = ""


def solid(vertices: Reals, faces: Ints) -> Solid:
    """What vertices (k, 3) and faces (f, 3) enclose."""
    vertices, faces = np.asarray(vertices, float), np.asarray(faces, np.int64)
    if (_edges(faces)[1] % 2).any():
        vertices, faces = _welded(vertices, faces)
    hull = hull_of(vertices)
    if hull is None:
        return Solid(True, 0.0, False, ())  # flat: MuJoCo refuses it, or gives it no thickness
    size = hull.volume ** (1.0 / 3.0)
    edges, sides = _edges(faces)
    open_edges = int((sides % 2 == 1).sum())
    if open_edges:
        area = float(_areas(vertices, faces).sum())
        is_shell = _depth(vertices, faces, hull) <= LEVEL * size and area >= (1.0 - LEVEL) * hull.area
        return Solid(is_shell, 0.0, False, (), f"its surface is open at {open_edges} edges")
    every = _parts(vertices, faces, edges, sides)
    if every is None:
        return Solid(False, 0.0, False, (), "its faces have no outside")
    parts = _outer(every, ROUNDED * size)
    filled = sum(part.volume for part in parts)
    if filled <= ROUNDED * hull.volume:
        return Solid(False, 1.0, False, (), "it encloses no volume")
    return Solid(_is_convex(parts, hull, size), max(0.0, 1.0 - filled / hull.volume), _overlap(parts), parts)


def hull_of(points: Reals) -> Hull | None:
    """The convex hull of points (k, 3); None if they are in one plane."""
    try:
        found = ConvexHull(points)
    except (QhullError, ValueError):
        return None
    return Hull(found.equations, float(found.volume), float(found.area))


def _welded(vertices: Reals, faces: Ints) -> tuple[Reals, Ints]:
    """Vertices that differ, and faces of three of them."""
    places, number = np.unique(vertices, axis=0, return_inverse=True)
    own = number.ravel()[faces]
    thin = (own == np.roll(own, 1, axis=1)).any(axis=1)
    return places, own[~thin]


def _edges(faces: Ints) -> tuple[Ints, Ints]:
    """For each side (3 f,) of the faces the number of its edge, and for each edge how many faces have it."""
    ends = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    _, edges, sides = np.unique(ends, axis=0, return_inverse=True, return_counts=True)
    return edges.ravel(), sides


def _parts(vertices: Reals, faces: Ints, edges: Ints, sides: Ints) -> list[Part] | None:
    """The parts of closed faces; None where faces cannot be turned to have an outside."""
    pairs = _neighbours(edges, sides)
    _, label = connected_components(_graph(pairs, len(faces)), directed=False)
    lonely = sides[edges].reshape(-1, 3) > 2
    groups = [np.flatnonzero(label == k) for k in range(label.max() + 1)]
    if any(lonely[own].any() and (_edges(faces[own])[1] % 2).any() for own in groups):
        groups = [np.arange(len(faces))]
    found = [_turned(faces, own, pairs) for own in groups]
    if any(own is None for own in found):
        return None
    turned = [own for own in found if own is not None]
    volumes = np.array([_volume(vertices, own) for own, _ in turned])
    if volumes[np.abs(volumes).argmax()] < 0.0:
        volumes, turned = -volumes, [(own[:, ::-1], told) for own, told in turned]
    for k, (own, told) in enumerate(turned):
        if volumes[k] < 0.0 and not told:  # which side was meant cannot be known
            volumes[k], turned[k] = -volumes[k], (own[:, ::-1], told)
    return _with_voids(vertices, [own for own, _ in turned], volumes)


def _neighbours(edges: Ints, sides: Ints) -> Ints:
    """Sides (n, 2) that meet at an edge of exactly two faces."""
    order = np.argsort(edges, kind="stable")
    order = order[sides[edges[order]] == 2]
    return np.asarray(order.reshape(-1, 2))


def _graph(pairs: Ints, count: int) -> coo_array:
    first, second = pairs.T // 3
    return coo_array((np.ones(len(pairs), np.int8), (first, second)), shape=(count, count))


def _turned(faces: Ints, own: Ints, pairs: Ints) -> tuple[Ints, bool] | None:
    """Faces of a part, turned so that neighbours agree, and whether they did; None if they cannot."""
    begin, end = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    inside = np.isin(pairs[:, 0] // 3, own)
    one, other = pairs[inside].T
    agree = begin[one] == end[other]
    if agree.all():
        return faces[own], True
    number = np.full(len(faces), -1)
    number[own] = np.arange(len(own))
    a, b = number[one // 3], number[other // 3]
    differs = np.where(agree, 0, 1)
    flip = np.zeros(len(own), np.int64)
    links = coo_array((np.ones(len(a)), (a, b)), shape=(len(own), len(own))).tocsr()
    relation = {(int(i), int(j)): int(d) for i, j, d in zip(a, b, differs, strict=True)}
    order, before = breadth_first_order(links + links.T, 0, directed=False)
    for face in order[1:].tolist():
        last = int(before[face])
        flip[face] = flip[last] ^ relation.get((last, face), relation.get((face, last), 0))
    if ((flip[a] ^ flip[b]) != differs).any():
        return None
    return np.where(flip[:, None] == 1, faces[own][:, ::-1], faces[own]), False


def _with_voids(vertices: Reals, surfaces: list[Ints], volumes: Reals) -> list[Part]:
    """Parts from surfaces; a void belongs to the smallest surface in whose hull it lies, and is a part that
    was turned inside out if there is none."""
    hulls = [hull_of(vertices[np.unique(faces)]) for faces in surfaces]
    order = np.argsort(volumes, kind="stable").tolist()
    voids: dict[int, list[int]] = {k: [] for k in order if volumes[k] > 0.0}
    for k in np.flatnonzero(volumes < 0.0).tolist():
        corners = vertices[np.unique(surfaces[k])]
        around = [j for j in order if volumes[j] > 0.0 and _is_around(hulls[j], corners)]
        if around:
            voids[around[0]].append(k)
        else:
            voids[k], surfaces[k], volumes[k] = [], surfaces[k][:, ::-1], -volumes[k]
    return [
        _part(vertices, [surfaces[j] for j in (k, *inner)], hull, float(volumes[[k, *inner]].sum()))
        for k, inner in voids.items()
        if (hull := hulls[k]) is not None
    ]


def _is_around(hull: Hull | None, points: Reals) -> bool:
    return hull is not None and bool((hull.depths(points) >= 0.0).all())


def _part(vertices: Reals, surfaces: list[Ints], hull: Hull, volume: float) -> Part:
    used, own = np.unique(np.concatenate(surfaces), return_inverse=True)
    corners, faces = vertices[used], own.reshape(-1, 3)
    is_plain = len(surfaces) == 1 and bool((_edges(faces)[1] == 2).all())
    depth = _depth(corners, faces, hull)
    is_convex = len(surfaces) == 1 and depth <= LEVEL * hull.volume ** (1.0 / 3.0)
    return Part(corners, faces, hull, volume, is_convex, is_plain)


def _outer(parts: list[Part], rounded: float) -> tuple[Part, ...]:
    """The parts that do not lie within a convex one, the largest first."""
    kept: list[Part] = []
    for part in sorted(parts, key=lambda each: -each.volume):
        if not any(
            other.is_convex and (other.hull.depths(part.vertices) >= -rounded).all() for other in kept
        ):
            kept.append(part)
    return tuple(kept)


def _is_convex(parts: tuple[Part, ...], hull: Hull, size: float) -> bool:
    """Whether no point of the surface of all parts together is deep; points within a convex part are none of
    the surface."""
    if len(parts) == 1 and not parts[0].is_convex:
        return False
    for part in parts:
        points = _points(part.vertices, part.faces)
        deep = points[hull.depths(points) > LEVEL * size]
        for other in parts:
            if other is not part and other.is_convex and len(deep):
                deep = deep[other.hull.depths(deep) < -ROUNDED * size]
        if len(deep):
            return False
    return True


def _overlap(parts: tuple[Part, ...]) -> bool:
    """Whether boxes about any two parts overlap."""
    boxes = [(part.vertices.min(axis=0), part.vertices.max(axis=0)) for part in parts]
    return any(
        bool((np.minimum(high, top) > np.maximum(low, bottom)).all())
        for k, (low, high) in enumerate(boxes)
        for bottom, top in boxes[:k]
    )


def _depth(vertices: Reals, faces: Ints, hull: Hull) -> float:
    return float(hull.depths(_points(vertices, faces)).max())


def _points(vertices: Reals, faces: Ints) -> Reals:
    """Points of a surface: of each face a grid, with its corners, and at least the middles of its edges."""
    room = POINTS / max(len(faces), 1)
    count = int(np.clip(np.sqrt(2.0 * room) - 1.0, *GRID))
    grid = [(i, j, count - i - j) for i in range(count + 1) for j in range(count + 1 - i)]
    places = np.array(grid) / count @ vertices[faces]
    return np.asarray(places.reshape(-1, 3))


def _areas(vertices: Reals, faces: Ints) -> Reals:
    a, b, c = np.moveaxis(vertices[faces], 1, 0)
    return 0.5 * np.asarray(np.linalg.norm(np.cross(b - a, c - a), axis=1))


def _volume(vertices: Reals, faces: Ints) -> float:
    """The volume that faces enclose, by the divergence theorem."""
    corners = vertices[faces] - vertices[faces[0, 0]]
    return float(np.linalg.det(corners).sum() / 6.0)

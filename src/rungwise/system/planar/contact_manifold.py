"""Gap between two rounded convex polygons, as at most two points with the features that carry them.

The core polygons are separated by the best edge of either (separating axes). Where the deepest vertex of
the other lies over that edge, the gap is their distance; a second point is the other end of the stretch along
which the two facing edges overlap. Each point is a vertex of one body over an edge of the other, whichever
body is taken as reference, so a feature keeps its identity. Where no vertex lies over an edge, two vertices
are closest. Features name existing vertices, even where coordinates are not finite.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from rungwise.block import Block
from rungwise.kernel import Ints, Reals, Record, inner_kernel, kernel
from rungwise.scene.template.records import HALFPLANE, Records
from rungwise.system.entries import CROWDED

GAP, NORMAL_X, NORMAL_Y, POINT_X, POINT_Y = 0, 1, 2, 3, 4
"""Columns of a point: gap, unit normal from body b to body a, and place (midway between the two surfaces)."""

ABSENT = -1
UNKNOWN = -1.0
"""Reach of a list of near pairs that is not made yet."""
VERTICES = 1 << 20
"""Feature of a vertex over an edge: edge VERTICES + vertex; features of two vertices are VERTICES^2 and
more."""
LIFTED, LANDED = 1, 2
"""One body of a contact is raised above the other, off the plane; or was a look ago, and is no more."""
TIE = 1e-9
"""Distance that counts as zero, over the length of an edge or overlap. Chosen by trial, to a decade, far
above rounding."""
_OPPOSED = -0.995
"""Cosine between the normals of faces that count as parallel: within 0.1 rad, chosen by trial."""


class Manifolds(Block):
    """Contact points of all pairs of shapes, and what belongs to their features from step to step. Each pair
    owns two slots.

    points       (2 pairs, 5)  gap, normal and place
    features     (2 pairs,)    what touches, or ABSENT
    deformation  (2 pairs, d)  of the contact there, 0 when its feature changes
    modes        (2 pairs,)    of the contact there, 0 (open) when its feature changes
    force        (2 pairs, d)  of the contact there in the last step
    gaps         (contacts,)   least gap of all pairs of the contact
    lifted       (contacts,)   whether one body is raised above the other, or was a look ago; empty where
                               none may be
    fresh        (2,)          features of a pair while it is looked at

    Of many bodies, those that may come near before some has moved by half the reach of the list (else empty):
    near         (pairs,)      pairs, in their order, how many of which `listed` (1,) says
    within       (1,)          circles that were farther apart were left out
    seen         (bodies, 2)   centres then
    far          (contacts,)   lower bound of the gaps of pairs that were left out
    turn         (1,)          counts how often slots of pairs that are not listed may have changed
    shown        (1,)          its value when gaps of all contacts were written last
    cleared      (1,)          its value when forces of all slots were set to zero last
    heard        (2,)          its value when forces that conditions read were written last, and how often
                               more those of all contacts will be
    """

    points: Reals
    features: Ints
    deformation: Reals
    modes: Ints
    force: Reals
    gaps: Reals
    lifted: Ints
    fresh: Ints
    near: Ints
    listed: Ints
    within: Reals
    seen: Reals
    far: Reals
    turn: Ints
    shown: Ints
    cleared: Ints
    heard: Ints


class Found(NamedTuple):
    """Contact points (2, 5) of two shapes, and what touches there, features (2,)."""

    points: Reals
    features: Ints


class Sides(NamedTuple):
    """Two shapes that face each other: the one whose edge or vertex is named first, and the other; `sign` is
    +1 where the first belongs to body b, -1 otherwise; the outlines (vertices, 4) of all shapes."""

    shape: Record
    other: Record
    sign: float
    outline: Reals


Separation: TypeAlias = tuple[float, int, int]
"""The best separating edge of a shape: least height of a vertex of the other over it, the edge (-1 if there
is none), and that vertex."""
Faces: TypeAlias = tuple[int, int, int, int, int, int]
"""Two faces that may lie on each other: the best edge, and the edge that faces it; the first and last vertex
of the facing face, and of the best edge's."""


def allocate_manifolds(records: Records, **shared: NDArray[Any]) -> Manifolds:
    """Manifolds without points; fields that other blocks have, too, are given."""
    slots, crowded = 2 * len(records.pairs), len(records.coordinates) >= CROWDED
    own: dict[str, NDArray[Any]] = {
        "points": np.zeros((slots, 5)),
        "features": np.full(slots, ABSENT, np.int64),
        "deformation": np.zeros((slots, 2)),
        "modes": np.zeros(slots, np.int64),
        "force": np.zeros((slots, 2)),
        "gaps": np.zeros(len(records.contacts)),
        "lifted": np.zeros(len(records.contacts) if records.contacts["lifts"].any() else 0, np.int64),
        "fresh": np.zeros(2, np.int64),
        "near": np.zeros(len(records.pairs) if crowded else 0, np.int64),
        "listed": np.zeros(1, np.int64),
        "within": np.full(1, UNKNOWN),
        "seen": np.zeros((len(records.bodies) if crowded else 0, 2)),
        "far": np.zeros(len(records.contacts) if crowded else 0),
        "turn": np.ones(1, np.int64),
        "shown": np.zeros(1, np.int64),
        "cleared": np.zeros(1, np.int64),
        "heard": np.zeros(2, np.int64),
    }
    return Manifolds(**(own | shared))


@kernel
def manifold(a: Record, b: Record, outline: Reals, found: Found) -> int:
    """Find the points of shapes a and b; returns how many there are."""
    found.features[0] = found.features[1] = ABSENT
    of_a, of_b = _best_edge(a, b, outline), _best_edge(b, a, outline)
    if of_a[1] < 0 and of_b[1] < 0:
        return closest_vertices(Sides(b, a, 1.0, outline), found)
    if of_a[0] >= of_b[0]:
        return _from_edge(Sides(a, b, -1.0, outline), of_a, found)
    return _from_edge(Sides(b, a, 1.0, outline), of_b, found)


@kernel
def _best_edge(shape: Record, other: Record, outline: Reals) -> tuple[float, int, int]:
    """The `Separation` of `shape` from `other`."""
    best, best_edge, best_vertex = -math.inf, -1, -1
    if other.kind == HALFPLANE:
        return best, best_edge, best_vertex
    first, count = shape.first, shape.end - shape.first
    if count == 1:
        return best, best_edge, best_vertex
    if shape.kind == HALFPLANE:
        count = 1
    for i in range(first, first + count):
        least, deepest = deepest_vertex(i, other, outline)
        if least > best:
            best, best_edge, best_vertex = least, i, deepest
    return best, best_edge, best_vertex


@inner_kernel
def deepest_vertex(edge: int, other: Record, outline: Reals) -> tuple[float, int]:
    """Least height of a vertex of `other` over the edge, and the vertex."""
    least, deepest = math.inf, other.first
    for j in range(other.first, other.end):
        d = height(edge, j, outline)
        if d < least:
            least, deepest = d, j
    return least, deepest


@kernel
def _from_edge(sides: Sides, best: Separation, found: Found) -> int:
    """Points on the best edge of the shape: ends of the stretch where it faces the nearest edge of the
    other."""
    shape, other, outline = sides.shape, sides.other, sides.outline
    (gap, edge, vertex), (points, features) = best, found
    apart = gap > 0.0 or not (has_area(shape) or has_area(other))
    if other.end - other.first == 1:
        if apart and shape.kind != HALFPLANE and not _is_over(shape, edge, vertex, outline):
            return closest_vertices(sides, found)
        features[0] = put(edge, vertex, sides, points[0])
        return 1
    facing = more_opposed(edge, vertex_before(other, vertex), vertex, outline)
    faces = edge, facing, facing, next_vertex(other, facing), edge, next_vertex(shape, edge)
    over = _ends_over(shape, faces, outline)
    near = over
    if gap > 0.0:
        start = over[2] and _is_over(other, facing, faces[4], outline)
        near = over[0], over[1], start, over[3] and _is_over(other, facing, faces[5], outline)
    first, least = lowest_end(near, faces, outline)
    if first >= 0 and (gap <= 0.0 or least <= gap + TIE * span(edge, vertex, outline)):
        features[0] = put_end(first, faces, sides, points[0])
        _, nearest = end_of(first, faces)
    elif apart:
        closest_vertices(sides, found)
        if not are_parallel(edge, facing, outline):
            return 1
        first, nearest = -1, vertex
    else:
        features[0] = put(edge, vertex, sides, points[0])
        return 1
    second = other_end(first, nearest, over, faces, outline)
    if second < 0:
        return 1
    features[1] = put_end(second, faces, sides, points[1])
    if gap > 0.0 and points[1, GAP] < points[0, GAP] - TIE * span(edge, vertex, outline):
        features[1] = ABSENT
        return 1
    return 2


@inner_kernel
def lowest_end(among: tuple[bool, bool, bool, bool], faces: Faces, outline: Reals) -> tuple[int, float]:
    """The candidate of `end_of` with the least height, and the height; -1 and inf if there is none."""
    lowest, least = -1, math.inf
    for k in range(4):
        if among[k]:
            edge, vertex = end_of(k, faces)
            distance = height(edge, vertex, outline)
            if distance < least:
                lowest, least = k, distance
    return lowest, least


@kernel
def other_end(
    first: int, nearest: int, over: tuple[bool, bool, bool, bool], faces: Faces, outline: Reals
) -> int:
    """The candidate, but for `first`, that is farthest along the edge from the vertex `nearest`; -1 if there
    is none."""
    edge, second, farthest = faces[0], -1, 0.0
    for k in range(4):
        if over[k] and k != first:
            _, j = end_of(k, faces)
            away = abs(along(edge, j, outline) - along(edge, nearest, outline))
            if away > farthest:
                second, farthest = k, away
    return second


@kernel
def has_area(shape: Record) -> bool:
    """Whether the core has an inside. If neither core has an inside, edges alone do not separate shapes on
    one line."""
    return shape.kind == HALFPLANE or shape.end - shape.first > 2


@kernel
def are_parallel(edge: int, facing: int, outline: Reals) -> bool:
    """Whether the edges may come to lie flat on each other.

    Were the end of one edge held outside the other at any angle, a vertex that slides off the edge would be
    kicked.
    """
    return outline[edge, 2] * outline[facing, 2] + outline[edge, 3] * outline[facing, 3] < _OPPOSED


@kernel
def span(edge: int, vertex: int, outline: Reals) -> float:
    """A length to measure ties by: the distance of the vertex from the edge's start."""
    return math.hypot(outline[vertex, 0] - outline[edge, 0], outline[vertex, 1] - outline[edge, 1])


@kernel
def _ends_over(shape: Record, faces: Faces, outline: Reals) -> tuple[bool, bool, bool, bool]:
    """Which candidates of `end_of` are over the other's edge."""
    edge, facing, first, last, _, end = faces
    if shape.kind == HALFPLANE:
        return True, True, False, False
    if not are_parallel(edge, facing, outline):
        first_over, last_over = _is_over(shape, edge, first, outline), _is_over(shape, edge, last, outline)
        return first_over, last_over, False, False
    far, near = along(edge, first, outline), along(edge, last, outline)
    return ends_of_overlap(0.0, along(edge, end, outline), near, far)


@kernel
def ends_of_overlap(start: float, end: float, near: float, far: float) -> tuple[bool, bool, bool, bool]:
    """Which of far, near, start and end bound the stretch common to start..end and near..far; of two places
    that rounding alone parts, both do.

    All are places along one axis. Were each face's ends looked for along the other face, both vertices at one
    end of faces that a hair of tilt and of depth parts could be over, and none at the other end.
    """
    slack = TIE * (end - start)
    if max(start, near) > min(end, far) + slack:
        return False, False, False, False
    return far <= end + slack, near >= start - slack, near <= start + slack, far >= end - slack


@inner_kernel
def end_of(k: int, faces: Faces) -> tuple[int, int]:
    """Candidate k = 0..3: (edge, vertex). Ends of the facing face, then of the best edge's."""
    return (faces[0] if k < 2 else faces[1]), faces[2 + k]


@kernel
def _is_over(shape: Record, edge: int, vertex: int, outline: Reals) -> bool:
    """Whether the vertex projects onto the edge; ends of aligned edges, which rounding moves, are over it."""
    place, length = along(edge, vertex, outline), along(edge, next_vertex(shape, edge), outline)
    return place >= -TIE * length and place <= length + TIE * length


@inner_kernel
def next_vertex(shape: Record, vertex: int) -> int:
    """The vertex after this one; edges begin at the vertex whose number they bear."""
    return vertex + 1 if vertex + 1 < shape.end else shape.first


@inner_kernel
def vertex_before(shape: Record, vertex: int) -> int:
    """The vertex before this one, at which the edge to it begins."""
    return vertex - 1 if vertex > shape.first else shape.end - 1


@inner_kernel
def along(edge: int, vertex: int, outline: Reals) -> float:
    """Place of the vertex along the edge, from its start."""
    dx, dy = outline[vertex, 0] - outline[edge, 0], outline[vertex, 1] - outline[edge, 1]
    return outline[edge, 2] * dy - outline[edge, 3] * dx


@inner_kernel
def height(edge: int, vertex: int, outline: Reals) -> float:
    """Distance of the vertex from the line of the edge, positive outside."""
    dx, dy = outline[vertex, 0] - outline[edge, 0], outline[vertex, 1] - outline[edge, 1]
    return outline[edge, 2] * dx + outline[edge, 3] * dy


@kernel
def more_opposed(edge: int, before: int, after: int, outline: Reals) -> int:
    """The one of two edges whose normal is more opposed to that of `edge`; `after` if they are alike."""
    nx, ny = outline[edge, 2], outline[edge, 3]
    if nx * outline[before, 2] + ny * outline[before, 3] < nx * outline[after, 2] + ny * outline[after, 3]:
        return before
    return after


@kernel
def put_end(k: int, faces: Faces, sides: Sides, point: Reals) -> int:
    """Write the point of candidate k; returns its feature."""
    edge, vertex = end_of(k, faces)
    if k < 2:
        return put(edge, vertex, sides, point)
    return put(edge, vertex, Sides(sides.other, sides.shape, -sides.sign, sides.outline), point)


@inner_kernel
def put(edge: int, vertex: int, sides: Sides, point: Reals) -> int:
    """Write the point of a vertex of the other shape over an edge of the first; returns its feature."""
    outline = sides.outline
    nx, ny = outline[edge, 2], outline[edge, 3]
    gap = height(edge, vertex, outline) - sides.shape.radius - sides.other.radius
    back = sides.other.radius + 0.5 * gap
    point[GAP] = gap
    point[NORMAL_X], point[NORMAL_Y] = sides.sign * nx, sides.sign * ny
    point[POINT_X], point[POINT_Y] = outline[vertex, 0] - back * nx, outline[vertex, 1] - back * ny
    return edge * VERTICES + vertex


@kernel
def closest_vertices(sides: Sides, found: Found) -> int:
    """The two vertices nearest to each other."""
    (shape, other, sign, outline), (points, features) = sides, found
    least, first, second = math.inf, shape.first, other.first
    for i in range(shape.first, shape.end):
        for j in range(other.first, other.end):
            dx, dy = outline[j, 0] - outline[i, 0], outline[j, 1] - outline[i, 1]
            d = dx * dx + dy * dy
            if d < least:
                least, first, second = d, i, j
    least = math.sqrt(least)
    nx, ny = 0.0, 1.0
    if least > 0.0:
        nx, ny = (
            (outline[second, 0] - outline[first, 0]) / least,
            (outline[second, 1] - outline[first, 1]) / least,
        )
    gap = least - shape.radius - other.radius
    back = other.radius + 0.5 * gap
    points[0, GAP] = gap
    points[0, NORMAL_X], points[0, NORMAL_Y] = sign * nx, sign * ny
    points[0, POINT_X], points[0, POINT_Y] = outline[second, 0] - back * nx, outline[second, 1] - back * ny
    features[0] = (VERTICES + first) * VERTICES + second
    if sign < 0.0:
        features[0] = (VERTICES + second) * VERTICES + first
    return 1

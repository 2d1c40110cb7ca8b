"""Gap between two rounded convex polygons, as at most two points with the features that carry them.

The core polygons are separated by the best edge of either (separating axes). Where the deepest vertex of
the other lies over that edge, the gap is their distance; a second point is the other end of the stretch along
which the two facing edges overlap. Each point is a vertex of one body over an edge of the other, whichever
body is taken as reference, so a feature keeps its identity. Where no vertex lies over an edge, two vertices
are closest. Features name existing vertices, even where coordinates are not finite.

Shapes that lie flush are pieces of one outline (`chains`). A point of the outline belongs to the pair of the
shape with its vertex and the shape with the part of the face below that vertex, so that pairs share the
points of a shape in one piece.
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
from rungwise.system.planar.chains import (
    FLUSH,
    PLAIN,
    Chains,
    face_of,
    facing_edge,
    is_admitted,
    is_corner,
    is_over,
    is_own,
    least_of_face,
)
from rungwise.system.planar.edges import TIE, along, are_parallel, height, span

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
def manifold(a: Record, b: Record, outline: Reals, chains: Chains, found: Found) -> int:
    """Find the points of shapes a and b; returns how many there are."""
    found.features[0] = found.features[1] = ABSENT
    of_a, of_b = _best_edge(a, b, outline), _best_edge(b, a, outline)
    if of_a[1] < 0 and of_b[1] < 0:
        return _closest_vertices(Sides(b, a, 1.0, outline), chains, found)
    apart = max(of_a[0], of_b[0])
    if chains.joined[0] != 0:
        inside = max(_inside(a, b, outline, chains), _inside(b, a, outline, chains))
        of_a = _best_of_outline(a, b, inside, outline, chains)
        of_b = _best_of_outline(b, a, inside, outline, chains)
        if of_a[1] < 0 and of_b[1] < 0:
            return 0
    slack = FLUSH * min(a.reach, b.reach)
    elsewhere = chains.joined[0] != 0 and apart > slack
    if of_a[0] >= of_b[0] - slack:
        count = _from_edge(Sides(a, b, -1.0, outline), of_a, elsewhere, chains, found)
    else:
        count = _from_edge(Sides(b, a, 1.0, outline), of_b, elsewhere, chains, found)
    return _drop_overlaps(count, -slack - a.radius - b.radius, found) if elsewhere else count


@inner_kernel
def _edge_count(shape: Record, other: Record) -> int:
    """How many edges of `shape` may separate it from `other`."""
    if other.kind == HALFPLANE or shape.end - shape.first == 1:
        return 0
    return 1 if shape.kind == HALFPLANE else shape.end - shape.first


@kernel
def _best_edge(shape: Record, other: Record, outline: Reals) -> tuple[float, int, int]:
    """The `Separation` of `shape` from `other`, the two by themselves."""
    best, best_edge, best_vertex = -math.inf, -1, -1
    for i in range(shape.first, shape.first + _edge_count(shape, other)):
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
def _inside(shape: Record, other: Record, outline: Reals, chains: Chains) -> float:
    """Gap to the best separating edge of `shape` that the outline rules out."""
    best = -math.inf
    for i in range(shape.first, shape.first + _edge_count(shape, other)):
        least, deepest = deepest_vertex(i, other, outline)
        if not is_admitted(i, deepest, shape, other, outline, chains):
            best = max(best, least)
    return best


@kernel
def _best_of_outline(
    shape: Record, other: Record, inside: float, outline: Reals, chains: Chains
) -> tuple[float, int, int]:
    """The `Separation` of `shape` from the piece of `other`, by an edge that the outline admits.

    Where an edge that the outline rules out separates better (its gap is `inside`), the overlapping shape has
    come through the neighbour, and an edge below which it is deeper than the middle lies on the far side.
    """
    best, best_edge, best_vertex = -math.inf, -1, -1
    for i in range(shape.first, shape.first + _edge_count(shape, other)):
        least, deepest = deepest_vertex(i, other, outline)
        if not is_admitted(i, deepest, shape, other, outline, chains):
            continue
        if least < min(inside, 0.0) and shape.kind != HALFPLANE and least < _middle(i, shape, outline):
            continue
        if chains.corner[deepest] != PLAIN:
            least = min(least, least_of_face(i, deepest, outline, chains))
        if least > best:
            best, best_edge, best_vertex = least, i, deepest
    return best, best_edge, best_vertex


@kernel
def _middle(i: int, shape: Record, outline: Reals) -> float:
    """Height of the mean of the vertices over edge i of the shape."""
    total = 0.0
    for j in range(shape.first, shape.end):
        total += height(i, j, outline)
    return total / (shape.end - shape.first)


@kernel
def _from_edge(sides: Sides, best: Separation, elsewhere: bool, chains: Chains, found: Found) -> int:
    """Points on the best edge of the shape: ends of the stretch where its whole face and the one that faces
    it lie beside each other. Of shapes that are apart by an edge between pieces, what overlaps beyond the
    ends of faces touches `elsewhere`."""
    shape, other, outline = sides.shape, sides.other, sides.outline
    (gap, edge, vertex), (points, features) = best, found
    apart = gap > 0.0 or not (has_area(shape) or has_area(other))
    plane = shape.kind == HALFPLANE
    if other.end - other.first == 1:
        if (apart or elsewhere) and not plane and not is_over(edge, vertex, outline, chains):
            return _closest_vertices(sides, chains, found) if apart else 0
        if _is_beyond_seam(edge, vertex, plane, outline, chains):
            return 0
        features[0] = put(edge, vertex, sides, points[0])
        return 1
    facing = facing_edge(edge, vertex, outline, chains)
    first, last = face_of(facing, chains)
    start, end = face_of(edge, chains)
    faces = edge, facing, first, last, start, end
    over = _ends_over(plane, faces, outline, chains)
    nearest = vertex
    if chains.joined[0] != 0:
        nearest = first if height(edge, first, outline) <= height(edge, last, outline) else last
        gap = height(edge, nearest, outline)
    near = over
    if gap > 0.0:
        at_start = over[2] and is_over(facing, start, outline, chains)
        near = over[0], over[1], at_start, over[3] and is_over(facing, end, outline, chains)
    deepest, least = lowest_end(near, faces, outline)
    if deepest >= 0 and (gap <= 0.0 or least <= gap + TIE * span(edge, nearest, outline)):
        count = _put_own_end(deepest, faces, sides, chains, found, 0)
        _, nearest = end_of(deepest, faces)
        least -= shape.radius + other.radius
    elif apart:
        count = _closest_vertices(sides, chains, found)
        deepest, least = -1, points[0, GAP]
        if not are_parallel(edge, facing, outline):
            return count
    else:
        ours = other.first <= nearest < other.end
        if elsewhere or not ours or _is_beyond_seam(edge, nearest, plane, outline, chains):
            return 0
        features[0] = put(edge, nearest, sides, points[0])
        return 1
    second = other_end(deepest, nearest, over, faces, outline)
    if second < 0:
        return count
    both = _put_own_end(second, faces, sides, chains, found, count)
    if gap > 0.0 and both > count and points[count, GAP] < least - TIE * span(edge, nearest, outline):
        features[count] = ABSENT
        return count
    return both


@kernel
def _drop_overlaps(count: int, least: float, found: Found) -> int:
    """Leave out points with gaps below `least`: between shapes that are apart these points belong to
    others."""
    points, features = found
    kept = 0
    for k in range(count):
        if points[k, GAP] >= least:
            for i in range(points.shape[1]):
                points[kept, i] = points[k, i]
            features[kept] = features[k]
            kept += 1
    for k in range(kept, 2):
        features[k] = ABSENT
    return kept


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
def _ends_over(plane: bool, faces: Faces, outline: Reals, chains: Chains) -> tuple[bool, bool, bool, bool]:
    """Which candidates of `end_of` are over the other's whole face."""
    edge, facing, first, last, start, end = faces
    if plane:
        return True, True, False, False
    if not are_parallel(edge, facing, outline):
        return is_over(edge, first, outline, chains), is_over(edge, last, outline, chains), False, False
    low, high = along(edge, start, outline), along(edge, end, outline)
    return ends_of_overlap(low, high, along(edge, last, outline), along(edge, first, outline))


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
def _is_beyond_seam(edge: int, vertex: int, plane: bool, outline: Reals, chains: Chains) -> bool:
    return not plane and not is_own(edge, vertex, outline, chains)


@kernel
def _put_own_end(k: int, faces: Faces, sides: Sides, chains: Chains, found: Found, at: int) -> int:
    """Write candidate k as point number `at` if it belongs to these two shapes; returns the number after."""
    shape, other, sign, outline = sides
    edge, vertex = end_of(k, faces)
    if k >= 2:
        shape, other, sign = other, shape, -sign
    if chains.joined[0] != 0:
        ours = other.first <= vertex < other.end and shape.first <= edge < shape.end
        if not ours or _is_beyond_seam(edge, vertex, sides.shape.kind == HALFPLANE, outline, chains):
            return at
    found.features[at] = put(edge, vertex, Sides(shape, other, sign, outline), found.points[at])
    return at + 1


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
def _put_closest(sides: Sides, found: Found) -> int:
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


@kernel
def _closest_vertices(sides: Sides, chains: Chains, found: Found) -> int:
    """The two vertices nearest to each other, where they are corners of the common pieces and face each
    other."""
    _put_closest(sides, found)
    (points, features), outline = found, sides.outline
    of_b, of_a = features[0] // VERTICES - VERTICES, features[0] % VERTICES
    nx, ny = points[0, NORMAL_X], points[0, NORMAL_Y]
    if is_corner(of_b, nx, ny, outline, chains) and is_corner(of_a, -nx, -ny, outline, chains):
        return 1
    features[0] = ABSENT
    return 0

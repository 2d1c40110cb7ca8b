"""Contact points of shapes with seams: the points of the common pieces, each in one pair.

Faces linked over seams are one face, whose ends are the outer ones; the corners between are no vertices, and
edges that neighbours cover separate nothing. A point of the common piece belongs to the pair of the shape
with its vertex and the shape with the part of the face below that vertex, so that pairs share the points of a
piece without seams.
"""

from __future__ import annotations

import math

from rungwise.kernel import Reals, Record, kernel
from rungwise.scene.template.records import HALFPLANE
from rungwise.system.planar.contact_manifold import (
    ABSENT,
    GAP,
    NORMAL_X,
    NORMAL_Y,
    TIE,
    VERTICES,
    Faces,
    Found,
    Separation,
    Sides,
    along,
    are_parallel,
    closest_vertices,
    deepest_vertex,
    end_of,
    ends_of_overlap,
    has_area,
    height,
    lowest_end,
    more_opposed,
    other_end,
    put,
    put_end,
    span,
)
from rungwise.system.planar.seams import DEAD, FLUSH, NONE, PLAIN, REFLEX, Seams, outer_ends


@kernel
def joined_manifold(a: Record, b: Record, outline: Reals, seams: Seams, found: Found) -> int:
    """Find the points of shapes a and b; returns how many belong to them."""
    found.features[0] = found.features[1] = ABSENT
    apart_a, inside_a = _separation(a, b, outline, seams)
    apart_b, inside_b = _separation(b, a, outline, seams)
    inside = max(inside_a, inside_b)
    of_a = _best_edge(a, b, inside, outline, seams)
    of_b = _best_edge(b, a, inside, outline, seams)
    if of_a[1] < 0 and of_b[1] < 0:
        return 0
    if of_a[0] >= of_b[0]:
        count = _from_edge(Sides(a, b, -1.0, outline), of_a, seams, found)
    else:
        count = _from_edge(Sides(b, a, 1.0, outline), of_b, seams, found)
    slack = FLUSH * min(a.reach, b.reach)
    if max(apart_a, apart_b) > slack:
        count = _drop_overlaps(count, -slack - a.radius - b.radius, found)
    return count


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


@kernel
def _edge_count(shape: Record, other: Record) -> int:
    """How many edges of `shape` may separate it from `other`."""
    if other.kind == HALFPLANE or shape.end - shape.first == 1:
        return 0
    return 1 if shape.kind == HALFPLANE else shape.end - shape.first


@kernel
def _separation(shape: Record, other: Record, outline: Reals, seams: Seams) -> tuple[float, float]:
    """Gap to the best separating edge of `shape`, and to the best edge that the seams rule out."""
    best, best_inside = -math.inf, -math.inf
    for i in range(shape.first, shape.first + _edge_count(shape, other)):
        least, deepest = deepest_vertex(i, other, outline)
        best = max(best, least)
        if not _is_admitted(i, deepest, shape, other, outline, seams):
            best_inside = max(best_inside, least)
    return best, best_inside


@kernel
def _is_admitted(i: int, deepest: int, shape: Record, other: Record, outline: Reals, seams: Seams) -> bool:
    """Whether edge i and its normal at the deepest vertex of `other` belong to the outside of the pieces."""
    if seams.corner[deepest] == REFLEX:
        return False
    return shape.kind == HALFPLANE or _is_exposed(i, deepest, other, outline, seams)


@kernel
def _best_edge(
    shape: Record, other: Record, inside: float, outline: Reals, seams: Seams
) -> tuple[float, int, int]:
    """The `Separation` of `shape` from the piece of `other`, by an edge that seams admit.

    Where an edge that seams rule out separates better (its gap is `inside`), the overlapping shape has come
    through the neighbour, and an edge below which it is deeper than the middle lies on the far side.
    """
    best, best_edge, best_vertex = -math.inf, -1, -1
    for i in range(shape.first, shape.first + _edge_count(shape, other)):
        least, deepest = deepest_vertex(i, other, outline)
        if not _is_admitted(i, deepest, shape, other, outline, seams):
            continue
        if least < min(inside, 0.0) and shape.kind != HALFPLANE and least < _middle(i, shape, outline):
            continue
        if seams.corner[deepest] != PLAIN:
            least = min(least, _least_along(i, deepest, outline, seams))
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
def _least_along(edge: int, vertex: int, outline: Reals, seams: Seams) -> float:
    """Least height over the edge of the faces that meet at a corner of neighbours."""
    least = math.inf
    for k in range(2):
        start, end = outer_ends(seams.cone[vertex, k], seams)
        least = min(least, height(edge, start, outline), height(edge, end, outline))
    return least


@kernel
def _is_exposed(i: int, deepest: int, other: Record, outline: Reals, seams: Seams) -> bool:
    """Whether edge i and the edge that faces it lie beside each other where both are exposed."""
    first = last = along(i, deepest, outline)
    if other.end - other.first > 1:
        facing = _facing_edge(i, deepest, outline, seams)
        if are_parallel(i, facing, outline):
            ends = along(i, facing, outline), along(i, seams.ends[facing], outline)
            first, last = min(ends[0], ends[1]), max(ends[0], ends[1])
            ends = along(facing, i, outline), along(facing, seams.ends[i], outline)
            if not _reaches(facing, min(ends[0], ends[1]), max(ends[0], ends[1]), seams):
                return False
    return _reaches(i, first, last, seams)


@kernel
def _reaches(i: int, first: float, last: float, seams: Seams) -> bool:
    """Whether the stretch from `first` to `last` along edge i is not beside or beyond its covered parts."""
    low, high = seams.exposed[i, 0], seams.exposed[i, 1]
    return low < high and not ((low > 0.0 and last <= low) or first >= high)


@kernel
def _facing_edge(edge: int, vertex: int, outline: Reals, seams: Seams) -> int:
    """The edge at the vertex, or at its corner of the common piece, that is most opposed to `edge`."""
    return more_opposed(edge, seams.cone[vertex, 0], seams.cone[vertex, 1], outline)


@kernel
def _from_edge(sides: Sides, best: Separation, seams: Seams, found: Found) -> int:
    """Points on the best edge as on a lone shape, but on the whole faces of the edge and the facing edge."""
    shape, other, outline = sides.shape, sides.other, sides.outline
    (gap, edge, vertex), (points, features) = best, found
    apart = gap > 0.0 or not (has_area(shape) or has_area(other))
    plane = shape.kind == HALFPLANE
    single = other.end - other.first == 1
    facing = vertex if single else _facing_edge(edge, vertex, outline, seams)
    first, last = (vertex, vertex) if single else outer_ends(facing, seams)
    start, end = outer_ends(edge, seams)
    faces = edge, facing, first, last, start, end
    over = _ends_over(plane, single, faces, outline, seams)
    nearest = first if height(edge, first, outline) <= height(edge, last, outline) else last
    gap = height(edge, nearest, outline)
    near = over
    if gap > 0.0:
        at_start = over[2] and _is_over(facing, start, outline, seams)
        near = over[0], over[1], at_start, over[3] and _is_over(facing, end, outline, seams)
    deepest, least = lowest_end(near, faces, outline)
    if deepest >= 0 and (gap <= 0.0 or least <= gap + TIE * span(edge, nearest, outline)):
        count = _put_own_end(deepest, faces, sides, seams, found, 0)
        _, nearest = end_of(deepest, faces)
        least -= shape.radius + other.radius
    elif apart:
        count = _closest_vertices(sides, seams, found)
        deepest, least = -1, points[0, GAP]
        if not are_parallel(edge, facing, outline):
            return count
    else:
        if not (other.first <= nearest < other.end) or _is_beyond_seam(edge, nearest, plane, outline, seams):
            return 0
        features[0] = put(edge, nearest, sides, points[0])
        return 1
    second = other_end(deepest, nearest, over, faces, outline)
    if second < 0:
        return count
    both = _put_own_end(second, faces, sides, seams, found, count)
    if gap > 0.0 and both > count and points[count, GAP] < least - TIE * span(edge, nearest, outline):
        features[count] = ABSENT
        return count
    return both


@kernel
def _ends_over(
    plane: bool, single: bool, faces: Faces, outline: Reals, seams: Seams
) -> tuple[bool, bool, bool, bool]:
    """Which candidates of `end_of` are over the other's whole face."""
    edge, facing, first, last, start, end = faces
    if plane:
        return True, not single, False, False
    if single or not are_parallel(edge, facing, outline):
        last_over = not single and _is_over(edge, last, outline, seams)
        return _is_over(edge, first, outline, seams), last_over, False, False
    low, high = along(edge, start, outline), along(edge, end, outline)
    return ends_of_overlap(low, high, along(edge, last, outline), along(edge, first, outline))


@kernel
def _is_over(edge: int, vertex: int, outline: Reals, seams: Seams) -> bool:
    """Whether the vertex projects onto the whole face of the edge, with rounding at its ends."""
    start, end = outer_ends(edge, seams)
    low, high, place = along(edge, start, outline), along(edge, end, outline), along(edge, vertex, outline)
    slack = TIE * (high - low)
    return place >= low - slack and place <= high + slack


@kernel
def _is_own(edge: int, vertex: int, outline: Reals, seams: Seams) -> bool:
    """Whether the vertex is over this part of the whole face. At a seam it is over just one of the two
    parts."""
    before, after = seams.before[edge], seams.after[edge]
    if before != NONE and along(before, vertex, outline) < along(before, edge, outline):
        return False
    return not (after != NONE and not along(edge, vertex, outline) < along(edge, after, outline))


@kernel
def _is_beyond_seam(edge: int, vertex: int, plane: bool, outline: Reals, seams: Seams) -> bool:
    return not plane and not _is_own(edge, vertex, outline, seams)


@kernel
def _put_own_end(k: int, faces: Faces, sides: Sides, seams: Seams, found: Found, at: int) -> int:
    """Write candidate k as point number `at` if it belongs to these two shapes; returns the number after."""
    e, j = end_of(k, faces)
    own, against = (sides.other, sides.shape) if k < 2 else (sides.shape, sides.other)
    if not (own.first <= j < own.end and against.first <= e < against.end):
        return at
    if _is_beyond_seam(e, j, sides.shape.kind == HALFPLANE, sides.outline, seams):
        return at
    found.features[at] = put_end(k, faces, sides, found.points[at])
    return at + 1


@kernel
def _closest_vertices(sides: Sides, seams: Seams, found: Found) -> int:
    """The two vertices nearest to each other, where they are corners of the common pieces and face each
    other."""
    closest_vertices(sides, found)
    (points, features), outline = found, sides.outline
    second, first = features[0] // VERTICES - VERTICES, features[0] % VERTICES
    nx, ny = points[0, NORMAL_X], points[0, NORMAL_Y]
    if _is_corner(first, nx, ny, outline, seams) and _is_corner(second, -nx, -ny, outline, seams):
        return 1
    features[0] = ABSENT
    return 0


@kernel
def _is_corner(vertex: int, nx: float, ny: float, outline: Reals, seams: Seams) -> bool:
    """Whether the vertex, or its twin that owns it, may touch something in this direction."""
    kind = seams.corner[vertex]
    if kind in (DEAD, REFLEX) or seams.owner[vertex] != vertex:
        return False
    return kind == PLAIN or _is_in_cone(vertex, nx, ny, outline, seams)


@kernel
def _is_in_cone(vertex: int, nx: float, ny: float, outline: Reals, seams: Seams) -> bool:
    """Whether the direction lies between the normals of the two exposed edges that meet in the corner."""
    low, high = seams.cone[vertex, 0], seams.cone[vertex, 1]
    return (
        outline[low, 2] * ny - outline[low, 3] * nx >= -TIE
        and nx * outline[high, 3] - ny * outline[high, 2] >= -TIE
    )

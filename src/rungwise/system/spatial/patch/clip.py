"""Where the nearest features of two convex geoms lie over each other, seen along the normal.

A feature is what of a geom's surface faces the other one: a point, a segment, a convex polygon, a disc, or a
plane. Contacts are the corners of the region that two features share: corners of one within the other, and
where their outlines cross. Each has the gap between the features there, measured along the normal.
"""

from __future__ import annotations

import math

import numpy as np

from rungwise.block import Block
from rungwise.kernel import Ints, Reals, kernel
from rungwise.system.spatial.patch.shapes import (
    BOX,
    CAPSULE,
    CYLINDER,
    MESH,
    PLANE,
    Frames,
    Shapes,
    support,
)

FACING = 0.1
"""Sine of the angle between a side, an edge or a face and the plane across the normal up to which all of it
counts as facing the other geom: beyond, its far end is a tenth of its length away."""
MOST = 4
"""Places that are kept: so many hold a body on a face."""
LEVEL = 1e-12
"""Sine of the angle up to which a disc is level: no gap tells which point of its rim is the nearest."""
ONE = 1e-6
"""Places nearer to each other than this part of the smaller geom's size are one, a hundredth of the overlap
that a rigid step may have."""
EDGE = 1e-9
"""Part of the smaller geom's size by which a corner may be beyond an outline and count as within it, by
rounding."""
EVEN = 1e-5
"""Part of the smaller geom's size by which depths are told apart where places are chosen, a tenth of the
overlap that a rigid step may have: the choice does not change with what hardly matters."""
ARCS = 16
"""Parts of a rim in each of which it crosses another one once at most."""
STEPS = 50
"""Steps to a crossing, of which some eight are needed."""
FARTHER = 1e-6
"""Part by which a place must be farther away than another to be chosen instead, for the same reason."""
DISC, HALF_SPACE = -1, 0
"""In place of the number of a feature's corners: of a disc corners are its centre, two radii across each
other, and the one towards the other geom; of a half space the level of its plane."""


class Patch(Block):
    """Features (k, 3) of both geoms, and the places (t, 7) that they share: two coordinates across the
    normal, heights of both features along it, a number, and how far their own normals lean along both
    coordinates; keep (4,): those that are kept; axes (3, 3): the directions of the two coordinates and the
    normal; origin (3,)."""

    one: Reals
    other: Reals
    places: Reals
    keep: Ints
    axes: Reals
    origin: Reals


def allocate_patch(shapes: Shapes) -> Patch:
    """With room for the faces of these shapes."""
    most = int(np.diff(shapes.face_at).max(initial=4)) + 4
    return Patch(
        one=np.zeros((most, 3)), other=np.zeros((most, 3)), places=np.zeros((4 * most + 16, 7)),
        keep=np.zeros(4, np.int64), axes=np.zeros((3, 3)), origin=np.zeros(3),
    )  # fmt: skip


@kernel
def clip(a: int, b: int, n: Reals, shapes: Shapes, frames: Frames, patch: Patch) -> int:
    """Fill in the places that the features of two geoms share, seen along the unit normal n (3,) from a to b;
    returns how many there are."""
    size = min(shapes.inner[a], shapes.inner[b])
    _look_along(n, frames.place[b] if shapes.kind[a] == PLANE else frames.place[a], patch)
    first, one_round = _feature(a, 1.0, shapes, frames, patch, patch.one)
    second, other_round = _feature(b, -1.0, shapes, frames, patch, patch.other)
    one, other, tol = patch.one, patch.other, ONE * size
    if first == 2 and second == 2:
        return _lines(one, other, one_round, other_round, tol, patch.places)
    count = 0
    for side in range(2):
        own, mine = (one, first) if side == 0 else (other, second)
        cover, theirs = (other, second) if side == 0 else (one, first)
        if theirs == 1 or theirs == 2:
            continue
        for i in range(1 + MOST if mine == DISC else mine):
            x, y, z = _corner(own, mine, i)
            if _is_within(cover, theirs, x, y, EDGE * size):
                h = _height(cover, theirs, x, y)
                low, high = (z, h) if side == 0 else (h, z)
                count = _put(patch.places, count, x, y, low, high, 10 * i + side, tol)
    if first == DISC and second == DISC:
        count = _cross_discs(one, other, tol, patch.places, count)
    elif first == DISC and second > 1:
        count = _cross_disc(one, other, second, 0, tol, patch.places, count)
    elif second == DISC and first > 1:
        count = _cross_disc(other, one, first, 1, tol, patch.places, count)
    elif first > 1 and second > 1:
        count = _cross(one, first, other, second, tol, patch.places, count)
    return count


@kernel
def _look_along(n: Reals, origin: Reals, patch: Patch) -> None:
    """Axes with the normal as the third, and their origin."""
    axes, k = patch.axes, 0
    for i in range(1, 3):
        if abs(n[i]) < abs(n[k]):
            k = i
    for i in range(3):
        axes[2, i], axes[0, i], patch.origin[i] = n[i], (1.0 if i == k else 0.0) - n[k] * n[i], origin[i]
    length = math.sqrt(axes[0, 0] ** 2 + axes[0, 1] ** 2 + axes[0, 2] ** 2)
    for i in range(3):
        axes[0, i] /= length
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        axes[1, i] = n[j] * axes[0, k] - n[k] * axes[0, j]


@kernel
def _seen(patch: Patch, x: float, y: float, z: float, is_way: bool, into: Reals) -> None:
    """A point or a way in the axes of the normal."""
    if not is_way:
        x, y, z = x - patch.origin[0], y - patch.origin[1], z - patch.origin[2]
    for i in range(3):
        into[i] = patch.axes[i, 0] * x + patch.axes[i, 1] * y + patch.axes[i, 2] * z


@kernel
def _feature(
    g: int, sign: float, shapes: Shapes, frames: Frames, patch: Patch, into: Reals
) -> tuple[int, float]:
    """Fill in the feature of a geom that faces along the normal, or against it; returns the number of its
    corners, and the radius of a side that a segment is the top of."""
    kind, size, place, u, n = shapes.kind[g], shapes.size[g], frames.place[g], frames.axes[g], patch.axes[2]
    x, y, z = sign * n[0], sign * n[1], sign * n[2]
    p = u[0] * x + u[3] * y + u[6] * z
    q = u[1] * x + u[4] * y + u[7] * z
    r = u[2] * x + u[5] * y + u[8] * z
    if kind == PLANE:
        _seen(patch, place[0], place[1], place[2], False, into[0])
        return HALF_SPACE, 0.0
    across = math.sqrt(p * p + q * q)
    if kind in (CAPSULE, CYLINDER) and abs(r) < FACING:
        part = size[0] if kind == CAPSULE else size[0] / across
        for i in range(2):
            end = size[1] if i else -size[1]
            c = (size[0] * r if kind == CAPSULE else 0.0) + end
            _put_local(part * p, part * q, c, place, u, False, patch, into[i])
        return 2, size[0]
    if kind == CYLINDER and across < FACING:
        along, aside = (p / across, q / across) if across > LEVEL else (1.0, 0.0)
        _put_local(0.0, 0.0, math.copysign(size[1], r), place, u, False, patch, into[0])
        _put_local(size[0], 0.0, 0.0, place, u, True, patch, into[1])
        _put_local(0.0, size[0], 0.0, place, u, True, patch, into[2])
        _put_local(size[0] * along, size[0] * aside, 0.0, place, u, True, patch, into[3])
        return DISC, 0.0
    if kind in (BOX, MESH):
        return _facet(g, p, q, r, shapes, frames, patch, into), 0.0
    a, b, c, _ = support(g, x, y, z, shapes, frames)
    round_ = shapes.round[g]
    _seen(patch, a + round_ * x, b + round_ * y, c + round_ * z, False, into[0])
    return 1, 0.0


@kernel
def _put_local(
    a: float, b: float, c: float, place: Reals, u: Reals, is_way: bool, patch: Patch, into: Reals
) -> None:
    """A point or a way of a geom's frame in the axes of the normal."""
    x = u[0] * a + u[1] * b + u[2] * c
    y = u[3] * a + u[4] * b + u[5] * c
    z = u[6] * a + u[7] * b + u[8] * c
    if not is_way:
        x, y, z = x + place[0], y + place[1], z + place[2]
    _seen(patch, x, y, z, is_way, into)


@kernel
def _facet(
    g: int, p: float, q: float, r: float, shapes: Shapes, frames: Frames, patch: Patch, into: Reals
) -> int:
    """The face, edge or corner of a polytope that faces along (p, q, r) in its frame."""
    corners, place, u = shapes.corners, frames.place[g], frames.axes[g]
    most, face = -2.0, 0
    for f in range(shapes.face_first[g], shapes.face_end[g]):
        along = shapes.normals[f, 0] * p + shapes.normals[f, 1] * q + shapes.normals[f, 2] * r
        if along > most:
            most, face = along, f
    if most > math.sqrt(1.0 - FACING * FACING):
        begin, count = shapes.face_at[face], shapes.face_at[face + 1] - shapes.face_at[face]
        for i in range(count):
            c = corners[shapes.face_corners[begin + i]]
            _put_local(c[0], c[1], c[2], place, u, False, patch, into[i])
        return int(count)
    top, corner = -math.inf, shapes.first[g]
    for k in range(shapes.first[g], shapes.end[g]):
        along = corners[k, 0] * p + corners[k, 1] * q + corners[k, 2] * r
        if along > top:
            top, corner = along, k
    least, edge = FACING, -1
    for e in range(shapes.edge_first[g], shapes.edge_end[g]):
        i, j = shapes.edges[e, 0], shapes.edges[e, 1]
        if i == corner or j == corner:
            x, y = corners[j, 0] - corners[i, 0], corners[j, 1] - corners[i, 1]
            z = corners[j, 2] - corners[i, 2]
            off = abs(x * p + y * q + z * r) / math.sqrt(x * x + y * y + z * z)
            if off < least:
                least, edge = off, e
    if edge < 0:
        _put_local(
            corners[corner, 0], corners[corner, 1], corners[corner, 2], place, u, False, patch, into[0]
        )
        return 1
    for i in range(2):
        c = corners[shapes.edges[edge, i]]
        _put_local(c[0], c[1], c[2], place, u, False, patch, into[i])
    return 2


@kernel
def _corner(own: Reals, count: int, i: int) -> tuple[float, float, float]:
    """Corner i of a feature; of a disc the ends of two diameters, and the point nearest to the other geom."""
    if count != DISC:
        return own[i, 0], own[i, 1], own[i, 2]
    k, sign = (3, 1.0) if i == MOST else (1 + i % 2, 1.0 if i < 2 else -1.0)
    return own[0, 0] + sign * own[k, 0], own[0, 1] + sign * own[k, 1], own[0, 2] + sign * own[k, 2]


@kernel
def _on_disc(disc: Reals, x: float, y: float) -> tuple[float, float]:
    """Coordinates of a place along the two radii of a disc, in these."""
    x, y = x - disc[0, 0], y - disc[0, 1]
    a, b, c, d = disc[1, 0], disc[2, 0], disc[1, 1], disc[2, 1]
    whole = a * d - b * c
    return (x * d - y * b) / whole, (a * y - c * x) / whole


@kernel
def _radius(disc: Reals) -> float:
    return math.sqrt(disc[1, 0] ** 2 + disc[1, 1] ** 2 + disc[1, 2] ** 2)


@kernel
def _is_within(cover: Reals, count: int, x: float, y: float, tol: float) -> bool:
    """Whether a place is on a plane, disc or polygon, whose corners may go round either way."""
    if count == HALF_SPACE:
        return True
    if count == DISC:
        a, b = _on_disc(cover, x, y)
        radius = _radius(cover)
        return math.sqrt(a * a + b * b) * radius <= radius + tol
    is_left, is_right = True, True
    for i in range(count):
        j = (i + 1) % count
        ex, ey = cover[j, 0] - cover[i, 0], cover[j, 1] - cover[i, 1]
        aside, length = ex * (y - cover[i, 1]) - ey * (x - cover[i, 0]), math.sqrt(ex * ex + ey * ey)
        is_left &= aside >= -tol * length
        is_right &= aside <= tol * length
    return is_left or is_right


@kernel
def _height(cover: Reals, count: int, x: float, y: float) -> float:
    """Height of a plane, disc or polygon over a place."""
    if count == HALF_SPACE:
        return float(cover[0, 2])
    if count == DISC:
        a, b = _on_disc(cover, x, y)
        return float(cover[0, 2] + a * cover[1, 2] + b * cover[2, 2])
    best, j, k = 0.0, 1, 2
    for m in range(2, count):
        area = abs(
            (cover[m - 1, 0] - cover[0, 0]) * (cover[m, 1] - cover[0, 1])
            - (cover[m - 1, 1] - cover[0, 1]) * (cover[m, 0] - cover[0, 0])
        )
        if area > best:
            best, j, k = area, m - 1, m
    ax, ay, bx, by = (
        cover[j, 0] - cover[0, 0],
        cover[j, 1] - cover[0, 1],
        cover[k, 0] - cover[0, 0],
        cover[k, 1] - cover[0, 1],
    )
    d = ax * by - ay * bx
    if d == 0.0:
        return float(cover[0, 2])
    x, y = x - cover[0, 0], y - cover[0, 1]
    s, t = (x * by - y * bx) / d, (ax * y - ay * x) / d
    return float(cover[0, 2] + s * (cover[j, 2] - cover[0, 2]) + t * (cover[k, 2] - cover[0, 2]))


@kernel
def _put(
    places: Reals, count: int, x: float, y: float, low: float, high: float, name: float, tol: float
) -> int:
    """Add a place, unless it is there already; returns how many there are."""
    for i in range(count):
        if abs(places[i, 0] - x) + abs(places[i, 1] - y) < tol:
            return count
    if count < places.shape[0]:
        own = places[count]
        own[0], own[1], own[2], own[3], own[4], own[5], own[6] = x, y, low, high, name, 0.0, 0.0
        count += 1
    return count


@kernel
def _lines(one: Reals, other: Reals, one_round: float, other_round: float, tol: float, places: Reals) -> int:
    """Of two segments the ends beside the other one, and where they cross. Round sides fall away from each
    other: beside their crossing the way from one axis to the other is the normal."""
    count, radii = 0, one_round + other_round
    ax, ay, bx, by = (
        one[1, 0] - one[0, 0],
        one[1, 1] - one[0, 1],
        other[1, 0] - other[0, 0],
        other[1, 1] - other[0, 1],
    )
    la, lb, cross = math.sqrt(ax * ax + ay * ay), math.sqrt(bx * bx + by * by), ax * by - ay * bx
    if abs(cross) > 1e-9 * la * lb:
        px, py = other[0, 0] - one[0, 0], other[0, 1] - one[0, 1]
        t, u = (px * by - py * bx) / cross, (px * ay - py * ax) / cross
        if -1e-9 <= t <= 1.0 + 1e-9 and -1e-9 <= u <= 1.0 + 1e-9:
            low, high = one[0, 2] + t * (one[1, 2] - one[0, 2]), other[0, 2] + u * (other[1, 2] - other[0, 2])
            count = _put(places, count, one[0, 0] + t * ax, one[0, 1] + t * ay, low, high, 1, tol)
    if abs(cross) >= FACING * la * lb:
        return count
    for side in range(2):
        own, beside, length = (one, other, lb) if side == 0 else (other, one, la)
        dx, dy = beside[1, 0] - beside[0, 0], beside[1, 1] - beside[0, 1]
        for i in range(2):
            t = ((own[i, 0] - beside[0, 0]) * dx + (own[i, 1] - beside[0, 1]) * dy) / (length * length)
            if t < -tol / length or t > 1.0 + tol / length:
                continue
            x, y, h = (
                beside[0, 0] + t * dx,
                beside[0, 1] + t * dy,
                beside[0, 2] + t * (beside[1, 2] - beside[0, 2]),
            )
            u, v, low = x - own[i, 0], y - own[i, 1], own[i, 2] if side == 0 else h
            off, gap = math.sqrt(u * u + v * v), h - own[i, 2] if side == 0 else own[i, 2] - h
            if radii == 0.0 and off > tol:
                continue
            lean = 0.0
            if gap + radii > off:  # else the axes have passed each other
                lean = 1.0 / math.sqrt(off * off + (gap + radii) ** 2)
                gap = 1.0 / lean - radii
            u, v = lean * u, lean * v
            part = (one_round if side == 0 else other_round) + 0.5 * gap
            upright = math.sqrt(1.0 - u * u - v * v)
            middle, before = low - one_round + (one_round + 0.5 * gap) * upright, count
            # Two ends beside each other are one place.
            count = _put(
                places, count, own[i, 0] + part * u, own[i, 1] + part * v, middle - 0.5 * gap,
                middle + 0.5 * gap, 10 + 2 * side + i, max(tol, off),
            )  # fmt: skip
            if count > before:
                sign = 1.0 if side == 0 else -1.0
                places[before, 5], places[before, 6] = sign * u, sign * v
    return count


@kernel
def _cross(one: Reals, first: int, other: Reals, second: int, tol: float, places: Reals, count: int) -> int:
    """Add where the outlines of two segments or polygons cross."""
    for i in range(first if first > 2 else 1):
        for j in range(second if second > 2 else 1):
            p, q, r, s = one[i], one[(i + 1) % first], other[j], other[(j + 1) % second]
            ax, ay, bx, by = q[0] - p[0], q[1] - p[1], s[0] - r[0], s[1] - r[1]
            cross = ax * by - ay * bx
            if abs(cross) <= 1e-9 * math.sqrt((ax * ax + ay * ay) * (bx * bx + by * by)):
                continue
            px, py = r[0] - p[0], r[1] - p[1]
            t, u = (px * by - py * bx) / cross, (px * ay - py * ax) / cross
            if 0.0 <= t <= 1.0 and 0.0 <= u <= 1.0:
                low, high = p[2] + t * (q[2] - p[2]), r[2] + u * (s[2] - r[2])
                count = _put(places, count, p[0] + t * ax, p[1] + t * ay, low, high, 1000 + 64 * i + j, tol)
    return count


@kernel
def _cross_disc(disc: Reals, lines: Reals, n: int, side: int, tol: float, places: Reals, count: int) -> int:
    """Add where the rim of a disc crosses a segment or the outline of a polygon of n corners; side: 0 if the
    disc is below."""
    for i in range(n if n > 2 else 1):
        p, q = lines[i], lines[(i + 1) % n]
        a, b = _on_disc(disc, p[0], p[1])
        c, d = _on_disc(disc, q[0], q[1])
        c, d = c - a, d - b
        square, half, rest = c * c + d * d, a * c + b * d, a * a + b * b - 1.0
        root = half * half - square * rest
        if root <= 0.0 or square == 0.0:
            continue
        root = math.sqrt(root)
        for k in range(2):
            t = (-half - root if k == 0 else -half + root) / square
            if 0.0 <= t <= 1.0:
                x, y, z = p[0] + t * (q[0] - p[0]), p[1] + t * (q[1] - p[1]), p[2] + t * (q[2] - p[2])
                h = _height(disc, DISC, x, y)
                low, high = (h, z) if side == 0 else (z, h)
                count = _put(places, count, x, y, low, high, 2000 + 2 * i + k, tol)
    return count


@kernel
def _cross_discs(one: Reals, other: Reals, tol: float, places: Reals, count: int) -> int:
    """Add where two rims cross, of which each is an ellipse if it is tilted: at four places at most. They are
    sought from the direction between the centres on, in which rims that only just cross do so."""
    x, y = _on_disc(one, other[0, 0], other[0, 1])
    start = math.atan2(y, x)
    low, before = start, _beyond(one, other, start)
    for k in range(1, ARCS + 1):
        high = start + k * 2.0 * math.pi / ARCS
        after = _beyond(one, other, high)
        if (before > 0.0) != (after > 0.0):
            angle = _crossing(one, other, low, high, before, after)
            u, v = _on_rim(one, angle)
            first, second = _height(one, DISC, u, v), _height(other, DISC, u, v)
            count = _put(places, count, u, v, first, second, 3000 + k, tol)
        low, before = high, after
    return count


@kernel
def _on_rim(disc: Reals, angle: float) -> tuple[float, float]:
    c, s = math.cos(angle), math.sin(angle)
    return disc[0, 0] + c * disc[1, 0] + s * disc[2, 0], disc[0, 1] + c * disc[1, 1] + s * disc[2, 1]


@kernel
def _beyond(one: Reals, other: Reals, angle: float) -> float:
    """How far a point of a rim is beyond another one, over the radius of this."""
    x, y = _on_rim(one, angle)
    a, b = _on_disc(other, x, y)
    return math.sqrt(a * a + b * b) - 1.0


@kernel
def _crossing(one: Reals, other: Reals, low: float, high: float, before: float, after: float) -> float:
    """The angle at which a rim crosses another one, between two on either side of it: by the false position,
    where an end that stays again counts half (Illinois)."""
    angle, kept = low, 0
    for _ in range(STEPS):
        angle = low - before * (high - low) / (after - before)
        found = _beyond(one, other, angle)
        if abs(found) <= LEVEL:
            break
        if (found > 0.0) == (before > 0.0):
            low, before = angle, found
            after, kept = after if kept != 1 else 0.5 * after, 1
        else:
            high, after = angle, found
            before, kept = before if kept != -1 else 0.5 * before, -1
    return angle


@kernel
def keep(count: int, size: float, patch: Patch) -> int:
    """Choose at most four places: the deepest, the one farthest from it, and on either side the one farthest
    from the line through both; returns how many."""
    places, kept = patch.places, patch.keep
    if count <= MOST:
        for i in range(count):
            kept[i] = i
        return count
    first, deepest = 0, 0
    for i in range(1, count):
        if _gap(i, places) < _gap(first, places) - EVEN * size:
            first = i
        if _gap(i, places) < _gap(deepest, places):
            deepest = i
    second, far = first, 0.0
    for i in range(count):
        if _away(first, i, places) > far * (1.0 + FARTHER):
            second, far = i, _away(first, i, places)
    dx, dy = places[second, 0] - places[first, 0], places[second, 1] - places[first, 1]
    third, fourth, most, least = -1, -1, ONE * size * far, -ONE * size * far
    for i in range(count):
        aside = dx * (places[i, 1] - places[first, 1]) - dy * (places[i, 0] - places[first, 0])
        if aside > most * (1.0 + FARTHER):
            third, most = i, aside
        if aside < least * (1.0 + FARTHER):
            fourth, least = i, aside
    kept[0], kept[1], chosen = first, second, 2
    for extra in (third, fourth):
        if extra >= 0:
            kept[chosen] = extra
            chosen += 1
    _admit(deepest, chosen, size, patch)
    return chosen


@kernel
def _admit(deepest: int, chosen: int, size: float, patch: Patch) -> None:
    """Put the deepest place in that of the nearest of the chosen ones, unless one of these is as deep but for
    rounding."""
    near = 0
    for i in range(chosen):
        if _gap(patch.keep[i], patch.places) <= _gap(deepest, patch.places) + EDGE * size:
            return
        if _away(patch.keep[i], deepest, patch.places) < _away(patch.keep[near], deepest, patch.places):
            near = i
    patch.keep[near] = deepest


@kernel
def _gap(i: int, places: Reals) -> float:
    return float(places[i, 3] - places[i, 2])


@kernel
def _away(i: int, j: int, places: Reals) -> float:
    return math.sqrt((places[j, 0] - places[i, 0]) ** 2 + (places[j, 1] - places[i, 1]) ** 2)

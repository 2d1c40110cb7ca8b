"""Contacts with height fields: columns under the triangles of a field are convex, and each meets a geom.

A contact of a column is one of the whole field unless the geom is nearer to a triangle beside it, as the
normal shows. Then the contacts of the triangle alone are those along its own normal: where the field is level
or hollow, and a face of the geom lies on it, they are those of its plane. Contacts with the same normal are
reduced to four, as on one face.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from rungwise.block import Block
from rungwise.kernel import Ints, Reals, kernel
from rungwise.system.spatial.patch.clip import EVEN, FARTHER, ONE
from rungwise.system.spatial.patch.pairs import FULL, Found, Scratch, copy_contact, meet, meet_along
from rungwise.system.spatial.patch.shapes import FIELD, Frames, Point, Shapes, extent

if TYPE_CHECKING:
    import mujoco

AWAY = 1e-9
"""Sine of the angle up to which a triangle beside an edge counts as level with a plane across the normal."""
SAME = 1e-10
"""What the cosine of the angle between normals that count as one may lack: 1e-5 rad."""
EQUAL = 1e-15
"""What it may lack between a normal and that of its triangle, by rounding."""


class Fields(Block):
    """Height fields of geoms: rows, columns (g,), the first (g,) of their heights (k,), and how far they
    reach down (g,); the corners of a triangle (3, 2) as column and row, are scratch."""

    rows: Ints
    columns: Ints
    first: Ints
    heights: Reals
    depth: Reals
    corner: Ints


def fields(model: mujoco.MjModel) -> Fields:
    m = model
    rows, columns, first = np.zeros((3, m.ngeom), np.int64)
    depth, heights = np.zeros(m.ngeom), [np.zeros(0)]
    for g in np.flatnonzero(m.geom_type == FIELD).tolist():
        k = int(m.geom_dataid[g])
        rows[g], columns[g], first[g] = m.hfield_nrow[k], m.hfield_ncol[k], sum(map(len, heights))
        begin, depth[g] = int(m.hfield_adr[k]), m.hfield_size[k, 3]
        own = np.array(m.hfield_data[begin : begin + int(rows[g] * columns[g])], float)
        heights.append(own * m.hfield_size[k, 2])
    return Fields(
        rows=rows, columns=columns, first=first, heights=np.concatenate(heights), depth=depth,
        corner=np.zeros((3, 2), np.int64),
    )  # fmt: skip


@kernel
def meet_field(
    g: int, h: int, within: float, shapes: Shapes, fields: Fields, frames: Frames, scratch: Scratch,
    found: Found, count: int,
) -> int:  # fmt: skip
    """Add the contacts of height field g and another geom that are nearer than `within` to `count` others;
    returns how many there are then, or `FULL`."""
    prism, begin, size = shapes.kind.shape[0] - 1, count, shapes.size[g]
    for k in range(3):
        frames.place[prism, k] = frames.place[g, k]
    for k in range(9):
        frames.axes[prism, k] = frames.axes[g, k]
    x_low, x_high = _span(g, h, 0, within, shapes, frames)
    y_low, y_high = _span(g, h, 1, within, shapes, frames)
    low, _ = _span(g, h, 2, within, shapes, frames)
    wide, long = 2.0 * size[0] / (fields.columns[g] - 1), 2.0 * size[1] / (fields.rows[g] - 1)
    shapes.inner[prism] = 0.5 * min(wide, long)
    first, last = (
        max(0, int((x_low + size[0]) / wide)),
        int(min(fields.columns[g] - 2.0, (x_high + size[0]) / wide)),
    )
    start, stop = (
        max(0, int((y_low + size[1]) / long)),
        int(min(fields.rows[g] - 2.0, (y_high + size[1]) / long)),
    )
    if x_high < -size[0] or y_high < -size[1]:
        return count
    for row in range(start, stop + 1):
        for column in range(first, last + 1):
            for half in range(2):
                _choose(row, column, half, fields.corner)
                if _put_prism(g, prism, wide, long, shapes, fields) < low:
                    continue
                before = count
                count = meet(prism, h, within, shapes, frames, scratch, found, count)
                if count == FULL:
                    return FULL
                count = _sift(g, prism, before, count, wide, long, shapes, fields, frames, found)
                if count > before:
                    continue
                _put_top(prism, shapes, frames, scratch.room.n)
                count = meet_along(prism, h, within, shapes, frames, scratch, found, count)
                if count == FULL:
                    return FULL
    count = _thin(begin, count, shapes.inner[prism], found)
    for c in range(begin, count):
        found.geoms[c, 0] = g
    return count


@kernel
def _span(g: int, h: int, axis: int, within: float, shapes: Shapes, frames: Frames) -> tuple[float, float]:
    """Between which coordinates along an axis of g geom h is, and `within` more."""
    u, middle = frames.axes[g], 0.0
    x, y, z = u[axis], u[3 + axis], u[6 + axis]
    for k in range(3):
        middle += u[3 * k + axis] * (frames.place[h, k] - frames.place[g, k])
    less, more = extent(h, -x, -y, -z, shapes, frames), extent(h, x, y, z, shapes, frames)
    return middle - less - within, middle + more + within


@kernel
def _choose(row: int, column: int, half: int, corner: Ints) -> None:
    """The corners of one of the two triangles of a cell, anticlockwise from above, halved as MuJoCo does."""
    corner[0, 0], corner[0, 1] = column + half, row + half
    corner[1, 0], corner[1, 1] = column + 1 - half, row + half
    corner[2, 0], corner[2, 1] = column + half, row + 1 - half


@kernel
def _vertex(g: int, column: int, row: int, wide: float, long: float, shapes: Shapes, fields: Fields) -> Point:
    """A point of the grid, in the frame of the field."""
    z = fields.heights[fields.first[g] + row * fields.columns[g] + column]
    return column * wide - shapes.size[g, 0], row * long - shapes.size[g, 1], z


@kernel
def _put_prism(g: int, prism: int, wide: float, long: float, shapes: Shapes, fields: Fields) -> float:
    """Let the prism be the column under the chosen triangle; returns its greatest height."""
    begin, face, corners, normals = (
        shapes.first[prism],
        shapes.face_first[prism],
        shapes.corners,
        shapes.normals,
    )
    high = -math.inf
    for i in range(3):
        x, y, z = _vertex(g, fields.corner[i, 0], fields.corner[i, 1], wide, long, shapes, fields)
        corners[begin + i, 0], corners[begin + i, 1], corners[begin + i, 2] = x, y, -fields.depth[g]
        corners[begin + 3 + i, 0], corners[begin + 3 + i, 1], corners[begin + 3 + i, 2] = x, y, z
        high = max(high, z)
    p, q, r = corners[begin + 3], corners[begin + 4], corners[begin + 5]
    ax, ay, az, bx, by, bz = q[0] - p[0], q[1] - p[1], q[2] - p[2], r[0] - p[0], r[1] - p[1], r[2] - p[2]
    x, y, z = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    length = math.sqrt(x * x + y * y + z * z)
    normals[face + 1, 0], normals[face + 1, 1], normals[face + 1, 2] = x / length, y / length, z / length
    for i in range(3):
        one, other = corners[begin + i], corners[begin + (i + 1) % 3]
        x, y = other[1] - one[1], one[0] - other[0]
        length = math.sqrt(x * x + y * y)
        normals[face + 2 + i, 0], normals[face + 2 + i, 1] = x / length, y / length
        normals[face + 2 + i, 2] = 0.0
    return high


@kernel
def _put_top(prism: int, shapes: Shapes, frames: Frames, n: Reals) -> None:
    """The normal of the triangle in the world."""
    top, u = shapes.normals[shapes.face_first[prism] + 1], frames.axes[prism]
    for k in range(3):
        n[k] = u[3 * k] * top[0] + u[3 * k + 1] * top[1] + u[3 * k + 2] * top[2]


@kernel
def _sift(
    g: int, prism: int, before: int, count: int, wide: float, long: float, shapes: Shapes, fields: Fields,
    frames: Frames, found: Found,
) -> int:  # fmt: skip
    """Of the contacts of a column from `before` to `count` keep those of the whole field; returns how many
    there are then."""
    kept = before
    for c in range(before, count):
        if _is_of_field(g, prism, c, wide, long, shapes, fields, frames, found):
            copy_contact(c, kept, found)
            kept += 1
    return kept


@kernel
def _is_of_field(
    g: int, prism: int, c: int, wide: float, long: float, shapes: Shapes, fields: Fields, frames: Frames,
    found: Found,
) -> bool:  # fmt: skip
    """Whether no triangle beside that of a contact is nearer to the geom there."""
    u, top = frames.axes[g], shapes.normals[shapes.face_first[prism] + 1]
    x, y, z = found.normal[c, 0], found.normal[c, 1], found.normal[c, 2]
    p, q, r = u[0] * x + u[3] * y + u[6] * z, u[1] * x + u[4] * y + u[7] * z, u[2] * x + u[5] * y + u[8] * z
    if p * top[0] + q * top[1] + r * top[2] > 1.0 - EQUAL:
        return True
    half = 0.5 * found.gap[c]
    i = found.place[c, 0] - half * x - frames.place[g, 0]
    j = found.place[c, 1] - half * y - frames.place[g, 1]
    k = found.place[c, 2] - half * z - frames.place[g, 2]
    a, b = u[0] * i + u[3] * j + u[6] * k, u[1] * i + u[4] * j + u[7] * k
    h = u[2] * i + u[5] * j + u[8] * k
    # Beyond a corner or an edge of the grid that the point is on there are those of triangles beside it.
    column, row = (a + shapes.size[g, 0]) / wide, (b + shapes.size[g, 1]) / long
    for d in range(-1, 3):
        for e in range(-1, 3):
            m, n = math.floor(column) + d, math.floor(row) + e
            if m < 0 or n < 0 or m >= fields.columns[g] or n >= fields.rows[g]:
                continue
            if not _is_beside(column - m, row - n):
                continue
            s, t, v = _vertex(g, m, n, wide, long, shapes, fields)
            s, t, v = s - a, t - b, v - h
            if p * s + q * t + r * v > AWAY * math.sqrt(s * s + t * t + v * v) + ONE * shapes.inner[prism]:
                return False
    return True


@kernel
def _is_beside(column: float, row: float) -> bool:
    """Whether a point so many columns and rows from a corner of the grid is in a triangle of that corner, or
    on its outline."""
    inside = max(abs(column), abs(row), abs(column + row))
    return inside <= 1.0 + ONE


@kernel
def _thin(begin: int, count: int, size: float, found: Found) -> int:
    """Of contacts from `begin` to `count` keep four of each normal, or fewer; returns how many there are
    then."""
    kept, left = begin, begin
    while left < count:
        n, end = found.normal[left], left + 1
        for c in range(left + 1, count):
            if n[0] * found.normal[c, 0] + n[1] * found.normal[c, 1] + n[2] * found.normal[c, 2] > 1.0 - SAME:
                _swap(c, end, found)
                end += 1
        chosen = _widest(left, end, size, found)
        for c in range(chosen):
            copy_contact(left + c, kept, found)
            kept += 1
        left = end
    return kept


@kernel
def _widest(begin: int, end: int, size: float, found: Found) -> int:
    """Move to the front of contacts with one normal the deepest, of these the one farthest from the middle of
    all; the one farthest from it; and on either side the one farthest from the line through both. Returns
    how many these are."""
    place, gap, n = found.place, found.gap, found.normal[begin]
    least, x, y, z, count = math.inf, 0.0, 0.0, 0.0, end - begin
    for c in range(begin, end):
        least = min(least, gap[c])
        x, y, z = x + place[c, 0] / count, y + place[c, 1] / count, z + place[c, 2] / count
    best, far = begin, -1.0
    for c in range(begin, end):
        away = (place[c, 0] - x) ** 2 + (place[c, 1] - y) ** 2 + (place[c, 2] - z) ** 2
        if gap[c] <= least + EVEN * size and away > far * (1.0 + FARTHER):
            best, far = c, away
    _swap(begin, best, found)
    best, far = begin, ONE * size
    for c in range(begin + 1, end):
        away = math.sqrt(
            _way(begin, c, 0, place) ** 2 + _way(begin, c, 1, place) ** 2 + _way(begin, c, 2, place) ** 2
        )
        if away > far * (1.0 + FARTHER):
            best, far = c, away
    if best == begin:
        return 1
    _swap(begin + 1, best, found)
    chosen = begin + 2
    for side in range(2):
        best, most = -1, ONE * size * far
        for c in range(chosen, end):
            a, b, d = _way(begin, c, 0, place), _way(begin, c, 1, place), _way(begin, c, 2, place)
            u, v, w = (
                _way(begin, begin + 1, 0, place),
                _way(begin, begin + 1, 1, place),
                _way(begin, begin + 1, 2, place),
            )
            aside = n[0] * (v * d - w * b) + n[1] * (w * a - u * d) + n[2] * (u * b - v * a)
            aside = aside if side == 0 else -aside
            if aside > most * (1.0 + FARTHER):
                best, most = c, aside
        if best >= 0:
            _swap(chosen, best, found)
            chosen += 1
    return chosen - begin


@kernel
def _way(one: int, other: int, axis: int, place: Reals) -> float:
    return float(place[other, axis] - place[one, axis])


@kernel
def _swap(one: int, other: int, found: Found) -> None:
    for k in range(3):
        found.place[one, k], found.place[other, k] = found.place[other, k], found.place[one, k]
        found.normal[one, k], found.normal[other, k] = found.normal[other, k], found.normal[one, k]
    found.gap[one], found.gap[other] = found.gap[other], found.gap[one]

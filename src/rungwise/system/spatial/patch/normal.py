"""Signed distance and normal of two convex geoms: the maximum over unit normals n of their distance along n.

The distance along any normal is exact, cheap, and a lower bound; its maximum is global where the geoms are
apart, and the nearest local one where they overlap. Where features lie over each other the maximum is at a
normal of a face, across two axes or edges, or between two centres: these *candidates* come first. If none of
them is the maximum, the proximal point method leads from the best one to it: with b moved away along n until
cores are `APART` of each other, GJK maximises the distance less a multiple of the square of the turn of n,
which is well-conditioned whether geoms touch, overlap, or have a gap of 1e-9. In the end Newton's method
improves it to the last digits (`ascent`). No polytope is expanded.
"""

from __future__ import annotations

import math

import numpy as np

from rungwise.block import Block
from rungwise.kernel import Reals, kernel
from rungwise.system.spatial.patch.ascent import Active, allocate_active, ascend
from rungwise.system.spatial.patch.gjk import REACHED, ROUGHLY, Simplex, allocate_simplex, nearest
from rungwise.system.spatial.patch.shapes import (
    BOX,
    CAPSULE,
    CYLINDER,
    ELLIPSOID,
    MESH,
    SPHERE,
    Frames,
    Shapes,
    separation,
)

APART = 0.05
"""How far cores are apart for GJK, over the smaller geom's half width."""
GAIN = 1e-9
"""A normal takes the place of another only if geoms are farther apart along it, by this part of the smaller
one's half width: a thousand roundings, a ten-thousandth of the overlap that a rigid step may have."""
DEEP = 1e-2
"""Overlap over the smaller geom's half width from which on a candidate is not taken without a search: another
normal may be the shorter way out."""
STEPS = 12
"""Proximal steps; one or two are common."""
SMALLER = (1.0, 0.98, 0.9, 0.7, 0.4)
"""Sizes at which overlapping geoms are looked at for a first normal."""


class Room(Block):
    """Normal n (3,), a trial one (3,), one kept aside (3,), the nearest points (2, 3), and scratch."""

    n: Reals
    trial: Reals
    aside: Reals
    ends: Reals
    simplex: Simplex
    active: Active


def allocate_room() -> Room:
    return Room(
        n=np.zeros(3), trial=np.zeros(3), aside=np.zeros(3), ends=np.zeros((2, 3)),
        simplex=allocate_simplex(), active=allocate_active(),
    )  # fmt: skip


@kernel
def guess(a: int, b: int, within: float, shapes: Shapes, frames: Frames, room: Room) -> float:
    """The distance along the best candidate, which is put into room.n. It stops where the geoms are farther
    apart than `within`."""
    n, aside, pa, pb = room.n, room.aside, frames.place[a], frames.place[b]
    aside[0], aside[1], aside[2] = 1.0, 0.0, 0.0
    s = separation(a, b, 1.0, 0.0, 0.0, shapes, frames)
    s = _try(a, b, pb[0] - pa[0], pb[1] - pa[1], pb[2] - pa[2], aside, s, shapes, frames)
    one, other = shapes.kind[a], shapes.kind[b]
    if (one == MESH or other == MESH) and s <= within:
        s = _first(a, b, aside, s, shapes, frames, room)
    for k in range(3):
        n[k] = aside[k]
    if s > within or (one == SPHERE and other == SPHERE):
        return s
    # Normals of faces and axes are exact: the way between middles or cores only counts if it is better. All
    # axes of round geoms are among them, as no other way is near the shortest one where middles are as one.
    rough, s = s, -math.inf
    for side in range(2):
        g, h, sign = (a, b, 1.0) if side == 0 else (b, a, -1.0)
        kind = shapes.kind[g]
        if kind not in (SPHERE, MESH):
            u = frames.axes[g]
            for k in range(3):
                s = _both(a, b, u[k], u[3 + k], u[6 + k], n, s, shapes, frames)
        if kind in (CYLINDER, CAPSULE):
            s = _around(a, b, g, h, sign, n, s, shapes, frames)
        elif kind == MESH:
            s = _facing(a, b, g, sign, aside, n, s, shapes, frames)
        if s > within:
            return s
    if one in (BOX, CYLINDER, CAPSULE) and other in (BOX, CYLINDER, CAPSULE):
        s = _across(a, b, n, s, shapes, frames)
    if rough > s + GAIN * min(shapes.inner[a], shapes.inner[b]):
        s = rough
        for k in range(3):
            n[k] = aside[k]
    return s


@kernel
def _try(
    a: int, b: int, x: float, y: float, z: float, n: Reals, s: float, shapes: Shapes, frames: Frames
) -> float:
    """Take a normal if the geoms are farther apart along it; returns how far they are."""
    length = math.sqrt(x * x + y * y + z * z)
    if length < 1e-9 * min(shapes.inner[a], shapes.inner[b]):
        return s
    x, y, z = x / length, y / length, z / length
    found = separation(a, b, x, y, z, shapes, frames)
    if found > s + GAIN * min(shapes.inner[a], shapes.inner[b]):
        n[0], n[1], n[2] = x, y, z
        return found
    return s


@kernel
def _both(
    a: int, b: int, x: float, y: float, z: float, n: Reals, s: float, shapes: Shapes, frames: Frames
) -> float:
    """Try an axis that is long enough in the sense in which b is farther from a."""
    pa, pb = frames.place[a], frames.place[b]
    sign = 1.0 if x * (pb[0] - pa[0]) + y * (pb[1] - pa[1]) + z * (pb[2] - pa[2]) >= 0.0 else -1.0
    s = _try(a, b, sign * x, sign * y, sign * z, n, s, shapes, frames)
    if shapes.kind[a] == MESH or shapes.kind[b] == MESH:  # a mesh may reach farther on one side
        s = _try(a, b, -sign * x, -sign * y, -sign * z, n, s, shapes, frames)
    return s


@kernel
def _around(
    a: int, b: int, g: int, h: int, sign: float, n: Reals, s: float, shapes: Shapes, frames: Frames
) -> float:
    """Try the way from the axis of a cylinder or capsule g to the place of h, and that from the nearest point
    of its rim or its core."""
    u, pg, ph, size = frames.axes[g], frames.place[g], frames.place[h], shapes.size[g]
    x, y, z = ph[0] - pg[0], ph[1] - pg[1], ph[2] - pg[2]
    along = x * u[2] + y * u[5] + z * u[8]
    x, y, z = x - along * u[2], y - along * u[5], z - along * u[8]
    s = _try(a, b, sign * x, sign * y, sign * z, n, s, shapes, frames)
    across = math.sqrt(x * x + y * y + z * z)
    if shapes.kind[h] == SPHERE and abs(along) > size[1]:
        part = 1.0 - size[0] / across if shapes.kind[g] == CYLINDER and across > 0.0 else 1.0
        along = sign * (along - math.copysign(size[1], along))
        x, y, z = (
            sign * part * x + along * u[2],
            sign * part * y + along * u[5],
            sign * part * z + along * u[8],
        )
        s = _try(a, b, x, y, z, n, s, shapes, frames)
    return s


@kernel
def _across(a: int, b: int, n: Reals, s: float, shapes: Shapes, frames: Frames) -> float:
    """Try what is across an axis of either geom."""
    ua, ub = frames.axes[a], frames.axes[b]
    for i in range(0 if shapes.kind[a] == BOX else 2, 3):
        for j in range(0 if shapes.kind[b] == BOX else 2, 3):
            x = ua[3 + i] * ub[6 + j] - ua[6 + i] * ub[3 + j]
            y = ua[6 + i] * ub[j] - ua[i] * ub[6 + j]
            z = ua[i] * ub[3 + j] - ua[3 + i] * ub[j]
            if x * x + y * y + z * z > 1e-6:  # of nearly parallel axes it is as noisy as they are near
                s = _both(a, b, x, y, z, n, s, shapes, frames)
    return s


@kernel
def _facing(
    a: int, b: int, g: int, sign: float, to: Reals, n: Reals, s: float, shapes: Shapes, frames: Frames
) -> float:
    """Try the normal of that face of a mesh that is the nearest to a direction (3,)."""
    u, best, most = frames.axes[g], -1, -2.0
    p = sign * (u[0] * to[0] + u[3] * to[1] + u[6] * to[2])
    q = sign * (u[1] * to[0] + u[4] * to[1] + u[7] * to[2])
    r = sign * (u[2] * to[0] + u[5] * to[1] + u[8] * to[2])
    for f in range(shapes.face_first[g], shapes.face_end[g]):
        along = shapes.normals[f, 0] * p + shapes.normals[f, 1] * q + shapes.normals[f, 2] * r
        if along > most:
            most, best = along, f
    if best < 0:
        return s
    return _face(a, b, g, best, sign, n, s, shapes, frames)


@kernel
def _face(
    a: int, b: int, g: int, f: int, sign: float, n: Reals, s: float, shapes: Shapes, frames: Frames
) -> float:
    """Try the normal of a face of a mesh."""
    u, p, q, r = frames.axes[g], shapes.normals[f, 0], shapes.normals[f, 1], shapes.normals[f, 2]
    x, y, z = u[0] * p + u[1] * q + u[2] * r, u[3] * p + u[4] * q + u[5] * r, u[6] * p + u[7] * q + u[8] * r
    return _try(a, b, sign * x, sign * y, sign * z, n, s, shapes, frames)


@kernel
def _first(a: int, b: int, n: Reals, s: float, shapes: Shapes, frames: Frames, room: Room) -> float:
    """Try the way between the cores, made smaller until they are apart."""
    least, way = 1e-6 * min(shapes.inner[a], shapes.inner[b]), room.simplex.way
    for part in SMALLER:
        if nearest(a, b, 0.0, part, n, ROUGHLY, shapes, frames, room.simplex) > least:
            return _try(a, b, way[0], way[1], way[2], n, s, shapes, frames)
    return s


@kernel
def search(a: int, b: int, s: float, shapes: Shapes, frames: Frames, room: Room) -> float:
    """The distance of two geoms, with the normal in room.n and the nearest points in room.ends, from a normal
    room.n along which they are s apart."""
    n, aside, size = room.n, room.aside, min(shapes.inner[a], shapes.inner[b])
    if s >= 0.0:
        return _climb(a, b, n, s, shapes, frames, room)
    for k in range(3):
        aside[k] = n[k]
    other = _first(a, b, aside, -math.inf, shapes, frames, room)
    for side in range(2):
        g, sign = (a, 1.0) if side == 0 else (b, -1.0)
        if shapes.kind[g] == MESH:
            for f in range(shapes.face_first[g], shapes.face_end[g]):
                s = _face(a, b, g, f, sign, n, s, shapes, frames)
    turn = (n[0] - aside[0]) ** 2 + (n[1] - aside[1]) ** 2 + (n[2] - aside[2]) ** 2
    if not (other > -math.inf and turn > 1e-10):
        return _climb(a, b, n, s, shapes, frames, room)
    other = _climb(a, b, aside, other, shapes, frames, room)
    s = _climb(a, b, n, s, shapes, frames, room)
    if other > s + GAIN * size:
        for k in range(3):
            n[k] = aside[k]
        s = _climb(a, b, n, other, shapes, frames, room)
    return s


@kernel
def _climb(a: int, b: int, n: Reals, s: float, shapes: Shapes, frames: Frames, room: Room) -> float:
    """Lead n (3,), along which the geoms are s apart, to the next maximum of that distance; puts the nearest
    points into room.ends."""
    size, radii = min(shapes.inner[a], shapes.inner[b]), shapes.round[a] + shapes.round[b]
    trial, way, simplex = room.trial, room.simplex.way, room.simplex
    reached = ROUGHLY if _is_curved(shapes.kind[a]) or _is_curved(shapes.kind[b]) else REACHED
    for _ in range(STEPS):
        shift = max(0.0, APART * size - (s + radii))
        length = nearest(a, b, shift, 1.0, n, reached, shapes, frames, simplex)
        if length == 0.0:
            break
        for k in range(3):
            trial[k] = way[k] / length
        found = separation(a, b, trial[0], trial[1], trial[2], shapes, frames)
        _put_ends(a, b, shift, n, trial, shapes, room)
        is_better = found > s + GAIN * size
        if found > s:
            for k in range(3):
                n[k] = trial[k]
            s = found
        if ascend(a, b, trial, simplex, shapes, frames, room.active):
            found = separation(a, b, trial[0], trial[1], trial[2], shapes, frames)
            if found > s - GAIN * size:
                for k in range(3):
                    n[k] = trial[k]
                _put_active_ends(a, b, n, shapes, room)
                return found
        if reached == REACHED and (shift == 0.0 or not is_better):
            break
        reached = REACHED
    return s


@kernel
def _is_curved(kind: int) -> bool:
    return kind in (CYLINDER, ELLIPSOID)


@kernel
def _put_ends(a: int, b: int, shift: float, n: Reals, to: Reals, shapes: Shapes, room: Room) -> None:
    """The nearest points that a simplex tells, where b was moved by `shift` along n."""
    simplex, ends = room.simplex, room.ends
    for k in range(3):
        place = 0.0
        for i in range(simplex.count[0]):
            place += simplex.weights[i] * simplex.points[i, k]
        ends[0, k] = place + shapes.round[a] * to[k]
        ends[1, k] = place + simplex.way[k] - shift * n[k] - shapes.round[b] * to[k]


@kernel
def _put_active_ends(a: int, b: int, n: Reals, shapes: Shapes, room: Room) -> None:
    """The nearest points that active pieces tell."""
    active, ends = room.active, room.ends
    for k in range(3):
        ends[0, k], ends[1, k] = shapes.round[a] * n[k], -shapes.round[b] * n[k]
        for i in range(3):
            if active.weights[i] != 0.0:
                ends[0, k] += active.weights[i] * active.start[i, k]
                ends[1, k] += active.weights[i] * active.end[i, k]

"""The nearest points of two convex cores: the algorithm of Gilbert, Johnson and Keerthi (1988).

It walks over simplices of differences of support points, b's less a's, towards the one that is nearest to the
origin. Distances of sub-simplices are compared only where nothing else tells, as that loses half of the
digits.
"""

from __future__ import annotations

import math

import numpy as np

from rungwise.block import Block
from rungwise.kernel import Ints, Reals, kernel
from rungwise.system.spatial.patch.shapes import Frames, Shapes, support

MOST = 100
"""Iterations; polytopes take some ten."""
STALLS = 2
"""Iterations after which the distance may not have fallen, by rounding."""
REACHED, ROUGHLY = 1e-14, 1e-4
"""Part of the square of the distance that it may still fall by: to the last digits, which curved cores are
slow to reach, and so that Newton's method leads on from there."""
FLAT = 1e-28
"""Square of the sine of the angle below which a triangle is a segment."""


class Simplex(Block):
    """Differences (4, 3) of support points, of a's the points (4, 3), pieces (4, 2) of a and b, and weights
    (4,) of the nearest point, of `count` (1,) corners; spare (2, 4) and way (3,) are scratch; way is the
    vector between the nearest points."""

    corners: Reals
    points: Reals
    pieces: Ints
    weights: Reals
    count: Ints
    spare: Reals
    way: Reals


def allocate_simplex() -> Simplex:
    return Simplex(
        corners=np.zeros((4, 3)), points=np.zeros((4, 3)), pieces=np.zeros((4, 2), np.int64),
        weights=np.zeros(4), count=np.zeros(1, np.int64), spare=np.zeros((2, 4)), way=np.zeros(3),
    )  # fmt: skip


@kernel
def nearest(
    a: int, b: int, shift: float, part: float, n: Reals, reached: float, shapes: Shapes, frames: Frames,
    simplex: Simplex,
) -> float:  # fmt: skip
    """Distance of the cores of a, and of b moved by `shift` along n (3,), both made smaller about their
    places to `part`; 0 where they overlap. It begins along n, and ends where the square of the distance may
    fall by no more than the part `reached`."""
    corners, points, pieces, weights = simplex.corners, simplex.points, simplex.pieces, simplex.weights
    way, best, lam = simplex.way, simplex.spare[0], simplex.spare[1]
    t0, t1, t2 = shift * n[0], shift * n[1], shift * n[2]
    if part != 1.0:
        pa, pb = frames.place[a], frames.place[b]
        t0 += (1.0 / part - 1.0) * (pb[0] - pa[0])
        t1 += (1.0 / part - 1.0) * (pb[1] - pa[1])
        t2 += (1.0 / part - 1.0) * (pb[2] - pa[2])
    count, square, stalls = 0, math.inf, 0
    v0, v1, v2 = n[0], n[1], n[2]
    simplex.count[0] = 0
    for iteration in range(MOST):
        a0, a1, a2, one = support(a, v0, v1, v2, shapes, frames)
        b0, b1, b2, other = support(b, -v0, -v1, -v2, shapes, frames)
        w0, w1, w2 = b0 - a0 + t0, b1 - a1 + t1, b2 - a2 + t2
        if iteration > 0 and square - (v0 * w0 + v1 * w1 + v2 * w2) <= reached * square:
            break
        again = False
        for i in range(count):
            again |= corners[i, 0] == w0 and corners[i, 1] == w1 and corners[i, 2] == w2
        if again:
            break
        corners[count, 0], corners[count, 1], corners[count, 2] = w0, w1, w2
        points[count, 0], points[count, 1], points[count, 2] = a0, a1, a2
        pieces[count, 0], pieces[count, 1] = one, other
        count += 1
        if count == 4 and _holds_origin(corners):
            return 0.0
        _weigh(corners, count, lam, best)
        u0, u1, u2 = 0.0, 0.0, 0.0
        for i in range(count):
            u0 += best[i] * corners[i, 0]
            u1 += best[i] * corners[i, 1]
            u2 += best[i] * corners[i, 2]
        found = u0 * u0 + u1 * u1 + u2 * u2
        if found <= 0.0:
            return 0.0
        if found >= square * (1.0 - 1e-15):
            stalls += 1
            if found > square * (1.0 + 1e-12) or stalls > STALLS:
                break
        square, kept = found, 0
        v0, v1, v2 = u0, u1, u2
        for i in range(count):
            if best[i] > 0.0:
                for k in range(3):
                    corners[kept, k], points[kept, k] = corners[i, k], points[i, k]
                pieces[kept, 0], pieces[kept, 1] = pieces[i, 0], pieces[i, 1]
                weights[kept] = best[i]
                kept += 1
        count = kept
        simplex.count[0] = kept
    way[0], way[1], way[2] = v0, v1, v2
    return math.sqrt(v0 * v0 + v1 * v1 + v2 * v2)


@kernel
def _segment(w: Reals, i: int, j: int, lam: Reals) -> float:
    """Square of the distance of a side from the origin; weights of the nearest point in lam."""
    whole, along = 0.0, 0.0
    for k in range(3):
        e = w[j, k] - w[i, k]
        whole += e * e
        along -= e * w[i, k]
    t = 0.0 if whole <= 0.0 else min(1.0, max(0.0, along / whole))
    for k in range(4):
        lam[k] = 0.0
    lam[i], lam[j] = 1.0 - t, t
    square = 0.0
    for k in range(3):
        v = w[i, k] + t * (w[j, k] - w[i, k])
        square += v * v
    return square


@kernel
def _triangle(w: Reals, i: int, j: int, k: int, o: int, lam: Reals) -> tuple[float, bool]:
    """Square of the distance from the origin of a triangle whose last corner is the newest, and whether it is
    that to the foot of the perpendicular, with corner o, if any, beyond; weights in lam."""
    ax, ay, az = w[j, 0] - w[i, 0], w[j, 1] - w[i, 1], w[j, 2] - w[i, 2]
    bx, by, bz = w[k, 0] - w[i, 0], w[k, 1] - w[i, 1], w[k, 2] - w[i, 2]
    cx, cy, cz = bx - ax, by - ay, bz - az
    if cx * cx + cy * cy + cz * cz < bx * bx + by * by + bz * bz:  # short sides lose fewer digits
        cx, cy, cz = w[k, 0] - w[j, 0], w[k, 1] - w[j, 1], w[k, 2] - w[j, 2]
        nx, ny, nz = ay * cz - az * cy, az * cx - ax * cz, ax * cy - ay * cx
    else:
        nx, ny, nz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    square = nx * nx + ny * ny + nz * nz
    if square > FLAT * (ax * ax + ay * ay + az * az) * (bx * bx + by * by + bz * bz):
        h = (nx * w[i, 0] + ny * w[i, 1] + nz * w[i, 2]) / square
        px, py, pz = h * nx - w[i, 0], h * ny - w[i, 1], h * nz - w[i, 2]
        v = (nx * (ay * pz - az * py) + ny * (az * px - ax * pz) + nz * (ax * py - ay * px)) / square
        u = (nx * (py * bz - pz * by) + ny * (pz * bx - px * bz) + nz * (px * by - py * bx)) / square
        if u >= 0.0 and v >= 0.0 and u + v <= 1.0:
            for each in range(4):
                lam[each] = 0.0
            lam[i], lam[j], lam[k] = 1.0 - u - v, u, v
            is_beyond = o < 0
            if not is_beyond:
                side = nx * (w[o, 0] - w[i, 0]) + ny * (w[o, 1] - w[i, 1]) + nz * (w[o, 2] - w[i, 2])
                is_beyond = side * h >= 0.0
            return h * h * square, is_beyond
    first, second = _segment(w, i, k, lam), _segment(w, j, k, lam)
    if first < second:
        return _segment(w, i, k, lam), False
    return second, False


@kernel
def _weigh(w: Reals, count: int, lam: Reals, best: Reals) -> None:
    """Weights of the point of a simplex that is nearest to the origin, in best (4,); its newest corner is the
    last."""
    if count == 1:
        for k in range(4):
            best[k] = 0.0
        best[0] = 1.0
    elif count == 2:
        _segment(w, 0, 1, best)
    elif count == 3:
        _triangle(w, 0, 1, 2, -1, best)
    else:
        least = math.inf
        for f in range(3):
            square, is_beyond = _triangle(w, (f + 1) % 3, (f + 2) % 3, 3, f, lam)
            if is_beyond or square < least:
                least = square
                for k in range(4):
                    best[k] = lam[k]
            if is_beyond:
                return


@kernel
def _holds_origin(w: Reals) -> bool:
    """Whether the origin is inside a tetrahedron."""
    for f in range(4):
        i, j, k = (f + 1) % 4, (f + 2) % 4, (f + 3) % 4
        ax, ay, az = w[j, 0] - w[i, 0], w[j, 1] - w[i, 1], w[j, 2] - w[i, 2]
        bx, by, bz = w[k, 0] - w[i, 0], w[k, 1] - w[i, 1], w[k, 2] - w[i, 2]
        nx, ny, nz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
        corner = nx * (w[f, 0] - w[i, 0]) + ny * (w[f, 1] - w[i, 1]) + nz * (w[f, 2] - w[i, 2])
        origin = -(nx * w[i, 0] + ny * w[i, 1] + nz * w[i, 2])
        if corner * origin <= 0.0 or abs(origin) > abs(corner):  # of a flat one signs are rounding
            return False
    return True

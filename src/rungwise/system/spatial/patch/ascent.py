"""The normal along which two cores are farthest apart, to the last digits.

Along a unit normal n the distance of two cores is the least of smooth functions, one for each pair of their
pieces. At its maximum as many of them are equal as have weights in the nearest points. Newton's method on
these conditions (sequential quadratic programming for a minimax problem) starts from a simplex of GJK, whose
corners tell the pieces and their weights.
"""

from __future__ import annotations

import math

import numpy as np

from rungwise.block import Block
from rungwise.kernel import Ints, Reals, kernel
from rungwise.system.spatial.patch.gjk import Simplex
from rungwise.system.spatial.patch.shapes import Frames, Shapes, bend_of, point_of, support

STEPS = 30
"""Newton steps, of which some five are needed; pieces that join or leave take more."""
FARTHEST = 0.3
"""Turn of the normal in a step, in rad, up to which distances are nearly quadratic."""
DONE = 1e-14
"""Turn of the normal that is rounding."""
BELOW = 1e-10
"""Part of the smaller geom's size by which a piece that is not active may be nearer, by rounding."""
LEFT = 1e-8
"""Part of the smaller geom's size by which the nearest points may be beside each other: Newton's method
leaves far less, unless a disc lies across the normal, whose points its rim does not tell."""


class Active(Block):
    """Pieces (3, 2) of both geoms that are active, their weights (3,), distances (3,), and slopes (3, 2) in
    the plane across the normal; from (3, 3), to (3, 3): the points; n (3,); e, f (3,) span that plane."""

    pieces: Ints
    weights: Reals
    apart: Reals
    slopes: Reals
    start: Reals
    end: Reals
    n: Reals
    e: Reals
    f: Reals


def allocate_active() -> Active:
    return Active(
        pieces=np.zeros((3, 2), np.int64), weights=np.zeros(3), apart=np.zeros(3), slopes=np.zeros((3, 2)),
        start=np.zeros((3, 3)), end=np.zeros((3, 3)), n=np.zeros(3), e=np.zeros(3), f=np.zeros(3),
    )  # fmt: skip


@kernel
def ascend(
    a: int, b: int, n: Reals, simplex: Simplex, shapes: Shapes, frames: Frames, active: Active
) -> bool:
    """Lead a unit normal n (3,) to the next maximum of the distance of cores, from the pieces of a simplex.
    Returns whether that is one; n stays as it is where it is not."""
    pieces, weights, apart, slopes = active.pieces, active.weights, active.apart, active.slopes
    e, f, now = active.e, active.f, active.n
    count = _gather(simplex, pieces, weights)
    size, steady = min(shapes.inner[a], shapes.inner[b]), False
    for k in range(3):
        now[k] = n[k]
    for _ in range(STEPS):
        _span(now, e, f)
        if count == 1:
            weights[0] = 1.0
        ee, ef, ff = _look(a, b, count, shapes, frames, active)
        t0, t1 = 0.0, 0.0
        if count == 1:
            d = ee * ff - ef * ef
            if d == 0.0:
                return False
            t0, t1 = (ff * slopes[0, 0] - ef * slopes[0, 1]) / d, (ee * slopes[0, 1] - ef * slopes[0, 0]) / d
        elif count == 2:
            c0, c1 = slopes[0, 0] - slopes[1, 0], slopes[0, 1] - slopes[1, 1]
            square, lift = c0 * c0 + c1 * c1, apart[1] - apart[0]
            bent = ee * c1 * c1 - 2.0 * ef * c0 * c1 + ff * c0 * c0
            if square == 0.0 or bent == 0.0:
                return False
            t0, t1 = lift * c0 / square, lift * c1 / square
            left = -c1 * (slopes[0, 0] - ee * t0 - ef * t1) + c0 * (slopes[0, 1] - ef * t0 - ff * t1)
            t0, t1 = t0 - c1 * left / bent, t1 + c0 * left / bent
            over0, over1 = ee * t0 + ef * t1 - slopes[1, 0], ef * t0 + ff * t1 - slopes[1, 1]
            weights[0] = (c0 * over0 + c1 * over1) / square
            weights[1] = 1.0 - weights[0]
        else:
            c0, c1 = slopes[0, 0] - slopes[2, 0], slopes[0, 1] - slopes[2, 1]
            d0, d1 = slopes[1, 0] - slopes[2, 0], slopes[1, 1] - slopes[2, 1]
            d = c0 * d1 - c1 * d0
            if d == 0.0:
                return False
            one, other = apart[2] - apart[0], apart[2] - apart[1]
            t0, t1 = (d1 * one - c1 * other) / d, (c0 * other - d0 * one) / d
            over0, over1 = ee * t0 + ef * t1 - slopes[2, 0], ef * t0 + ff * t1 - slopes[2, 1]
            weights[0] = (d1 * over0 - d0 * over1) / d
            weights[1] = (c0 * over1 - c1 * over0) / d
            weights[2] = 1.0 - weights[0] - weights[1]
        kept = _drop(count, pieces, weights)
        if kept < count:
            count = kept
            continue
        turn = math.sqrt(t0 * t0 + t1 * t1)
        if not turn < math.inf:
            return False
        if turn > FARTHEST:
            t0, t1 = t0 * FARTHEST / turn, t1 * FARTHEST / turn
        for k in range(3):
            now[k] += t0 * e[k] + t1 * f[k]
        length = math.sqrt(now[0] * now[0] + now[1] * now[1] + now[2] * now[2])
        for k in range(3):
            now[k] /= length
        a0, a1, a2, one_piece = support(a, now[0], now[1], now[2], shapes, frames)
        b0, b1, b2, other_piece = support(b, -now[0], -now[1], -now[2], shapes, frames)
        is_new = True
        for i in range(count):
            is_new &= pieces[i, 0] != one_piece or pieces[i, 1] != other_piece
        if is_new:
            least = math.inf
            for i in range(count):
                least = min(least, _apart(a, b, i, now, shapes, frames, pieces))
            found = now[0] * (b0 - a0) + now[1] * (b1 - a1) + now[2] * (b2 - a2)
            if found < least - BELOW * size:
                if count == 3:
                    return False
                pieces[count, 0], pieces[count, 1], weights[count] = one_piece, other_piece, 0.0
                count += 1
                continue
        if steady or turn < DONE:
            for k in range(3):
                n[k] = now[k]
            _span(now, e, f)
            ee, ef, ff = _look(a, b, count, shapes, frames, active)
            for i in range(count, 3):
                weights[i] = 0.0
            return _meet(count, weights, slopes) <= LEFT * size and _is_greatest(count, ee, ef, ff, slopes)
        steady = turn < 1e-9
    return False


@kernel
def _gather(simplex: Simplex, pieces: Ints, weights: Reals) -> int:
    """The pairs of pieces of a simplex, at most three, and the sums of their weights; returns how many."""
    count = 0
    for i in range(simplex.count[0]):
        at = count
        for j in range(count):
            if pieces[j, 0] == simplex.pieces[i, 0] and pieces[j, 1] == simplex.pieces[i, 1]:
                at = j
        if at == 3:
            continue
        if at == count:
            pieces[at, 0], pieces[at, 1] = simplex.pieces[i, 0], simplex.pieces[i, 1]
            weights[at] = 0.0
            count += 1
        weights[at] += simplex.weights[i]
    return count


@kernel
def _span(n: Reals, e: Reals, f: Reals) -> None:
    """Two unit vectors across n and each other."""
    k = 0
    for i in range(1, 3):
        if abs(n[i]) < abs(n[k]):
            k = i
    for i in range(3):
        e[i] = (1.0 if i == k else 0.0) - n[k] * n[i]
    length = math.sqrt(e[0] * e[0] + e[1] * e[1] + e[2] * e[2])
    for i in range(3):
        e[i] /= length
    f[0], f[1], f[2] = n[1] * e[2] - n[2] * e[1], n[2] * e[0] - n[0] * e[2], n[0] * e[1] - n[1] * e[0]


@kernel
def _look(
    a: int, b: int, count: int, shapes: Shapes, frames: Frames, active: Active
) -> tuple[float, float, float]:
    """Fill in distances, slopes and points of the active pieces; the weighted sum of how fast the slopes
    fall."""
    n, e, f, ee, ef, ff = active.n, active.e, active.f, 0.0, 0.0, 0.0
    for i in range(count):
        a0, a1, a2 = point_of(a, active.pieces[i, 0], n[0], n[1], n[2], shapes, frames)
        b0, b1, b2 = point_of(b, active.pieces[i, 1], -n[0], -n[1], -n[2], shapes, frames)
        active.start[i, 0], active.start[i, 1], active.start[i, 2] = a0, a1, a2
        active.end[i, 0], active.end[i, 1], active.end[i, 2] = b0, b1, b2
        w0, w1, w2 = b0 - a0, b1 - a1, b2 - a2
        active.apart[i] = n[0] * w0 + n[1] * w1 + n[2] * w2
        active.slopes[i, 0] = e[0] * w0 + e[1] * w1 + e[2] * w2
        active.slopes[i, 1] = f[0] * w0 + f[1] * w1 + f[2] * w2
        own = active.weights[i] * active.apart[i]
        ee, ff = ee + own, ff + own
    # All pieces of a curved core bend alike where no two of its rims are active.
    p, q, r = bend_of(a, n[0], n[1], n[2], e, f, shapes, frames)
    u, v, w = bend_of(b, n[0], n[1], n[2], e, f, shapes, frames)
    return ee + p + u, ef + q + v, ff + r + w


@kernel
def _drop(count: int, pieces: Ints, weights: Reals) -> int:
    """Leave out the pair of pieces whose weight is the most negative; returns how many are left."""
    least = 0
    for i in range(1, count):
        if weights[i] < weights[least]:
            least = i
    if count == 1 or weights[least] >= -1e-12:
        return count
    last = count - 1
    for k in range(2):
        pieces[least, k] = pieces[last, k]
    weights[least] = max(weights[last], 0.0)
    return last


@kernel
def _apart(a: int, b: int, i: int, n: Reals, shapes: Shapes, frames: Frames, pieces: Ints) -> float:
    a0, a1, a2 = point_of(a, pieces[i, 0], n[0], n[1], n[2], shapes, frames)
    b0, b1, b2 = point_of(b, pieces[i, 1], -n[0], -n[1], -n[2], shapes, frames)
    return float(n[0] * (b0 - a0) + n[1] * (b1 - a1) + n[2] * (b2 - a2))


@kernel
def _meet(count: int, weights: Reals, slopes: Reals) -> float:
    """How far the nearest points are beside each other, seen along the normal."""
    x, y = 0.0, 0.0
    for i in range(count):
        x, y = x + weights[i] * slopes[i, 0], y + weights[i] * slopes[i, 1]
    return math.sqrt(x * x + y * y)


@kernel
def _is_greatest(count: int, ee: float, ef: float, ff: float, slopes: Reals) -> bool:
    """Whether distances fall in all directions in which active ones stay equal."""
    if count == 1:
        return ee > 0.0 and ee * ff - ef * ef >= 0.0
    if count == 2:
        c0, c1 = slopes[0, 0] - slopes[1, 0], slopes[0, 1] - slopes[1, 1]
        return bool(ee * c1 * c1 - 2.0 * ef * c0 * c1 + ff * c0 * c0 > 0.0)
    return True

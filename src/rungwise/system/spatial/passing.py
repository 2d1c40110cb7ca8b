"""Whether bodies in space may have gone through each other on the way of a step, seen at neither of its ends.

Convex geoms apart have a separating axis: the normal of their contact. On the way this axis may be carried
along with either body or stay as it is: the distance of the geoms along it is then a minimum of smooth
functions of time, each at least its chord less 1/8 of its greatest second derivative. Where that bound does
not exclude a passage the way is taken in parts, each with axes of its own: conservative advancement (Mirtich,
Impulse-based dynamic simulation, 1996) with axes instead of distances, as in the plane
(`planar.state.passing`).
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from rungwise.block import Block
from rungwise.kernel import Ints, Reals, inner_kernel, kernel
from rungwise.system.moving import SLIP
from rungwise.system.spatial.features import ContactSet
from rungwise.system.spatial.patch.shapes import (
    CAPSULE,
    CYLINDER,
    FIELD,
    MESH,
    Frames,
    Shapes,
    separation,
)
from rungwise.system.spatial.reach import rate_of

if TYPE_CHECKING:
    import mujoco


class Rates(Block):
    """What velocities do to each body at every state, per unit of each velocity: speed (b, n), a bound of the
    speed of its points; turn (b, n), of its rate of turning; swing (b, n), of speeds that turn with it. Each
    is kept in the stretches moved (b, 2)."""

    moved: Ints
    speed: Reals
    turn: Reals
    swing: Reals


def rates(model: mujoco.MjModel, moved: Ints, speed: Reals) -> Rates:
    """What velocities do to each body, `speed` for its points (`reach.kept_reaches`).

    A point's acceleration at steady velocities is at most the rate of turning times the swing: an axis turns
    with those before it, and a slide's way counts twice, as Coriolis' acceleration does.
    """
    import mujoco

    kinds = mujoco.mjtJoint
    turn, swing = np.zeros_like(speed), np.zeros_like(speed)
    for j in range(model.njnt):
        at, kind = int(model.jnt_dofadr[j]), int(model.jnt_type[j])
        own = np.flatnonzero((moved[:, 0] <= at) & (at < moved[:, 1]))
        own = own[speed[own, at - moved[own, 0]] > 0.0]
        if kind == kinds.mjJNT_SLIDE:
            swing[own, at - moved[own, 0]] = 2.0
            continue
        if kind == kinds.mjJNT_FREE:
            at += 3
        for axis in range(at, at + (1 if kind == kinds.mjJNT_HINGE else 3)):
            turn[own, axis - moved[own, 0]] = 1.0
            swing[own, axis - moved[own, 0]] = speed[own, axis - moved[own, 0]]
    return Rates(moved=moved, speed=speed, turn=turn, swing=swing)


@kernel
def may_pass(seen: ContactSet, shapes: Shapes, rates: Rates, v: Reals, part: float, deep: float) -> bool:
    """Whether any geoms whose contacts are `seen` may be farther inside each other than is allowed on a way
    that takes the time `part`, for all that their speeds say: by `SLIP` of their widths, and where things
    overlapped by `deep` before the step by as much again, up to as much as is allowed anyhow."""
    c, near = 0, False
    while c < seen.count[0] and not near:
        first, c = c, _end_of_pair(c, seen)
        near = _is_near(first, c, seen, shapes, rates, v, part, deep)
    return near


@kernel
def is_clear(
    seen: ContactSet,
    shapes: Shapes,
    rates: Rates,
    v: Reals,
    part: float,
    deep: float,
    begin: Frames,
    end: Frames,
) -> bool:
    """Whether none may be, for where they are at the end of the way as well."""
    c, clear = 0, True
    while c < seen.count[0] and clear:
        first, c = c, _end_of_pair(c, seen)
        if _is_near(first, c, seen, shapes, rates, v, part, deep):
            clear = _keeps_apart(first, c, seen, shapes, rates, v, part, deep, begin, end)
    return clear


@kernel
def _end_of_pair(first: int, seen: ContactSet) -> int:
    """The contact after the last one of the geoms of a contact."""
    c = first
    while (
        c < seen.count[0]
        and seen.geom[c, 0] == seen.geom[first, 0]
        and seen.geom[c, 1] == seen.geom[first, 1]
    ):
        c += 1
    return c


@kernel
def _is_near(
    first: int, end: int, seen: ContactSet, shapes: Shapes, rates: Rates, v: Reals, part: float, deep: float
) -> bool:
    a, b, gap = seen.geom[first, 0], seen.geom[first, 1], math.inf
    for c in range(first, end):
        gap = min(gap, seen.dist[c])
    moved = part * (
        rate_of(rates.speed, rates.moved, shapes.body[a], v)
        + rate_of(rates.speed, rates.moved, shapes.body[b], v)
    )
    return seen.address[first] >= 0 and moved > gap + _allowed(a, b, deep, shapes)


@kernel
def _allowed(a: int, b: int, deep: float, shapes: Shapes) -> float:
    slip = SLIP * (shapes.width[a] + shapes.width[b])
    return float(slip + min(deep, slip))


@kernel
def _keeps_apart(
    first: int,
    last: int,
    seen: ContactSet,
    shapes: Shapes,
    rates: Rates,
    v: Reals,
    part: float,
    deep: float,
    begin: Frames,
    end: Frames,
) -> bool:
    a, b, apart = seen.geom[first, 0], seen.geom[first, 1], False
    least = -_allowed(a, b, deep, shapes)
    for c in range(first, last):
        if shapes.kind[a] != FIELD and shapes.kind[b] != FIELD and not apart:
            apart = _least_distance(c, seen, shapes, rates, v, part, begin, end) >= least
    return apart


@kernel
def _least_distance(
    c: int, seen: ContactSet, shapes: Shapes, rates: Rates, v: Reals, part: float, begin: Frames, end: Frames
) -> float:
    """Lower bound of the distance of two geoms on a part of the way, negative where they overlap: along the
    normal of contact c at its begin, at rest or carried with one of them."""
    a, b = seen.geom[c, 0], seen.geom[c, 1]
    x, y, z = seen.frame[c, 0], seen.frame[c, 1], seen.frame[c, 2]
    first = separation(a, b, x, y, z, shapes, begin)
    turn_a, turn_b = (
        part * _rate(a, rates.turn, rates, shapes, v),
        part * _rate(b, rates.turn, rates, shapes, v),
    )
    bend = turn_a * part * _rate(a, rates.swing, rates, shapes, v)
    bend += turn_b * part * _rate(b, rates.swing, rates, shapes, v)
    speed = part * (
        rate_of(rates.speed, rates.moved, shapes.body[a], v)
        + rate_of(rates.speed, rates.moved, shapes.body[b], v)
    )
    apart = speed + _farthest(a, b, shapes, begin)
    best = -math.inf
    for k in range(3):
        turn = 0.0 if k == 0 else turn_a if k == 1 else turn_b
        if k > 0 and turn == 0.0:
            continue
        g = a if k == 1 else b
        nx, ny, nz = (x, y, z) if k == 0 else _carried(g, x, y, z, begin, end)
        last = separation(a, b, nx, ny, nz, shapes, end)
        bent = bend + 2.0 * turn * turn * apart + 2.0 * turn * speed
        best = max(best, min(first, last) - bent / 8.0)
    return best


@inner_kernel
def _rate(g: int, bounds: Reals, rates: Rates, shapes: Shapes, v: Reals) -> float:
    """A bound of what velocities do to the body of geom g."""
    return rate_of(bounds, rates.moved, shapes.body[g], v)


@kernel
def _carried(g: int, x: float, y: float, z: float, begin: Frames, end: Frames) -> tuple[float, float, float]:
    """An axis that turns with geom g from the begin to the end."""
    u, out = begin.axes[g], end.axes[g]
    p = u[0] * x + u[3] * y + u[6] * z
    q = u[1] * x + u[4] * y + u[7] * z
    r = u[2] * x + u[5] * y + u[8] * z
    return (
        out[0] * p + out[1] * q + out[2] * r,
        out[3] * p + out[4] * q + out[5] * r,
        out[6] * p + out[7] * q + out[8] * r,
    )


@kernel
def _farthest(a: int, b: int, shapes: Shapes, frames: Frames) -> float:
    """Bound of the distance of any two points of the geoms."""
    total = 0.0
    for i in range(3):
        total += (frames.place[a, i] - frames.place[b, i]) ** 2
    return math.sqrt(total) + _radius(a, shapes) + _radius(b, shapes)


@kernel
def _radius(g: int, shapes: Shapes) -> float:
    """Bound of the distance of a geom's points from its place."""
    kind, size, far = shapes.kind[g], shapes.size[g], 0.0
    if kind == MESH:
        for k in range(shapes.first[g], shapes.end[g]):
            far = max(far, shapes.corners[k, 0] ** 2 + shapes.corners[k, 1] ** 2 + shapes.corners[k, 2] ** 2)
        return math.sqrt(far)
    if kind in (CAPSULE, CYLINDER):
        return float(size[0] + size[1])
    return float(size[0] + size[1] + size[2])

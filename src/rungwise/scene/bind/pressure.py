"""Pressure under a body that lies on a support: its centre, and how great a torque friction may have.

Friction of the coefficient mu under the load N has at most the force mu N, and in a turn about the centre of
pressure p the torque mu N c, c the mean distance of the load from p. Source: Goyal, Ruina, Papadopoulos, Wear
143 (1991) 307-330; the ellipsoid between the two is that of Lee and Cutkosky, J. Eng. Ind. 113 (1991)
320-327.
"""

from __future__ import annotations

import math

from rungwise.kernel import Record, RecordArray, kernel
from rungwise.scene.bind.solids import moments
from rungwise.scene.template.faults import BOUND, NO_AREA, NO_WEIGHT, OVERHANGS
from rungwise.scene.template.records import HALFPLANE, POINTS, UNIFORM

_NODES = (0.1834346424956498, 0.5255324099163290, 0.7966664774136267, 0.9602898564975363)
_WEIGHTS = (0.3626837833783620, 0.3137066458778873, 0.2223810344533745, 0.1012285362903763)
"""Gauss-Legendre quadrature of 8 points on -1..1, by symmetry."""
_PANELS = 8
"""Panels of an arc, with its nearest point to p at an end of one: there the integrand may have a kink."""

FAINT = 1e-138
"""Force whose square, with its rounding, is no number of double precision: friction so faint is none."""
TRIES = 100
"""Directions that are tried to show that a centre of pressure is outside."""
_BESIDE = 1e-9
"""Distance from the hull, over its extent, that counts as rounding."""


@kernel
def press(
    support: Record, body: Record, shapes: RecordArray, vertices: RecordArray, spots: RecordArray
) -> int:
    """Fill in the greatest friction force, the centre of pressure from the centre of mass, and the ratio."""
    support.row = -1
    support.force = support.friction * (support.gravity * body.mass if support.weighed else support.load)
    if support.force < FAINT:
        support.force = 0.0
    if support.centre_given or support.pressure == POINTS:
        support.centre_x -= body.centre_x
        support.centre_y -= body.centre_y
    if support.centre_given and _overhangs(support, body, shapes, vertices, spots):
        return OVERHANGS
    if support.pressure == POINTS:
        return _rest_on_points(support, body, spots)
    if support.pressure == UNIFORM:
        return _rest_evenly(support, body, shapes, vertices)
    return BOUND


@kernel
def _overhangs(
    support: Record, body: Record, shapes: RecordArray, vertices: RecordArray, spots: RecordArray
) -> bool:
    """Whether the centre of pressure is shown to be outside the convex hull of the points that carry the body
    or, without such points, of its shapes, where these have an extent.

    The way is Gilbert's (SIAM J. Control 4 (1966) 61-80): from a point of the hull towards the centre, to the
    farthest point of the hull in that direction, and to the point on the way there that is nearest.
    """
    extent, x, y = 0.0, 0.0, 0.0
    for k in range(4):
        to_x, to_y = (1.0 - k, 0.0) if k % 2 == 0 else (0.0, 2.0 - k)
        far_x, far_y = _farthest(to_x, to_y, support, body, shapes, vertices, spots)
        extent += to_x * far_x + to_y * far_y
        x, y = x + 0.25 * far_x, y + 0.25 * far_y
    if not 0.0 < extent < math.inf:
        return False
    for _ in range(TRIES):
        to_x, to_y = support.centre_x - x, support.centre_y - y
        away = math.hypot(to_x, to_y)
        if away <= _BESIDE * extent:
            return False
        to_x, to_y = to_x / away, to_y / away
        far_x, far_y = _farthest(to_x, to_y, support, body, shapes, vertices, spots)
        if to_x * (support.centre_x - far_x) + to_y * (support.centre_y - far_y) > _BESIDE * extent:
            return True
        step_x, step_y = far_x - x, far_y - y
        length = step_x * step_x + step_y * step_y
        part = away * (to_x * step_x + to_y * step_y) / length if length > 0.0 else 0.0
        x, y = x + min(max(part, 0.0), 1.0) * step_x, y + min(max(part, 0.0), 1.0) * step_y
    return False


@kernel
def _farthest(
    to_x: float,
    to_y: float,
    support: Record,
    body: Record,
    shapes: RecordArray,
    vertices: RecordArray,
    spots: RecordArray,
) -> tuple[float, float]:
    """The point, from the centre of mass, of all that may carry the body that is farthest in a direction."""
    most, x, y = -math.inf, 0.0, 0.0
    if support.pressure == POINTS:
        for k in range(support.first, support.end):
            at_x, at_y = spots[k].x - body.centre_x, spots[k].y - body.centre_y
            if spots[k].weight > 0.0 and to_x * at_x + to_y * at_y > most:
                most, x, y = to_x * at_x + to_y * at_y, at_x, at_y
        return x, y
    for s in range(body.first_shape, body.end_shape):
        radius = shapes[s].radius
        for i in range(shapes[s].first, shapes[s].end):
            at_x, at_y = vertices[i].x + radius * to_x, vertices[i].y + radius * to_y
            if to_x * at_x + to_y * at_y > most:
                most, x, y = to_x * at_x + to_y * at_y, at_x, at_y
    return x, y


@kernel
def _rest_on_points(support: Record, body: Record, spots: RecordArray) -> int:
    weight, x, y = 0.0, 0.0, 0.0
    for k in range(support.first, support.end):
        weight += spots[k].weight
        x += spots[k].weight * (spots[k].x - body.centre_x)
        y += spots[k].weight * (spots[k].y - body.centre_y)
    if not weight > 0.0:
        return NO_WEIGHT
    if not support.centre_given:
        support.centre_x, support.centre_y = x / weight, y / weight
    support.ratio = 0.0
    for k in range(support.first, support.end):
        x = spots[k].x - body.centre_x - support.centre_x
        y = spots[k].y - body.centre_y - support.centre_y
        support.ratio += spots[k].weight / weight * math.hypot(x, y)
    return BOUND


@kernel
def _rest_evenly(support: Record, body: Record, shapes: RecordArray, vertices: RecordArray) -> int:
    area = x = y = total = 0.0
    for s in range(body.first_shape, body.end_shape):
        own, own_x, own_y, _ = moments(shapes[s], vertices)
        area, x, y = area + own, x + own_x, y + own_y
    if not area > 0.0:
        return NO_AREA
    if not support.centre_given:
        support.centre_x, support.centre_y = x / area, y / area
    for s in range(body.first_shape, body.end_shape):
        total += total_distance(shapes[s], vertices, support.centre_x, support.centre_y)
    support.ratio = total / area
    return BOUND


@kernel
def total_distance(shape: Record, vertices: RecordArray, x: float, y: float) -> float:
    """Integral of the distance from (x, y) over the area of a shape: of r^3 / 3 by the angle about (x, y),
    along the outline. Edges are in closed form; the arcs of a rounded shape are integrated numerically."""
    total = 0.0
    if shape.kind == HALFPLANE:
        return total
    first, n, radius = shape.first, shape.end - shape.first, shape.radius
    for k in range(n):
        a = vertices[first + k]
        if n == 1:
            if radius > 0.0:
                total += _along_arc(a.x - x, a.y - y, radius, _nearest(a.x - x, a.y - y), 2.0 * math.pi)
            continue
        before = vertices[first + (k + n - 1) % n]
        ahead = -a.normal_y * (a.x - x) + a.normal_x * (a.y - y)
        away = a.normal_x * (a.x - x) + a.normal_y * (a.y - y) + radius
        total += _to_end(away, ahead + a.length) - _to_end(away, ahead)
        if radius > 0.0:
            begin = math.atan2(before.normal_y, before.normal_x)
            sine = before.normal_x * a.normal_y - before.normal_y * a.normal_x
            turn = math.atan2(abs(sine), before.normal_x * a.normal_x + before.normal_y * a.normal_y)
            kink = (_nearest(a.x - x, a.y - y) - begin) % (2.0 * math.pi)
            kink = kink if kink < turn else 0.0
            total += _along_arc(a.x - x, a.y - y, radius, begin, kink)
            total += _along_arc(a.x - x, a.y - y, radius, begin + kink, turn - kink)
    return total


@kernel
def _to_end(away: float, ahead: float) -> float:
    """Integral of the distance from a point over the triangle with a right angle at the foot of the point on
    a line `away`, up to `ahead` of the foot; negative where the outline turns the other way about it."""
    if away == 0.0:
        return 0.0
    slope = math.asinh(ahead / abs(away))
    return away * (ahead * math.hypot(away, ahead) + away * away * slope) / 6.0


@kernel
def _nearest(x: float, y: float) -> float:
    """Angle of the point of a circle about (x, y) that is nearest to the origin, or farthest within it."""
    return math.atan2(-y, -x)


@kernel
def _along_arc(x: float, y: float, radius: float, begin: float, turn: float) -> float:
    """Integral of the distance from the origin over the sectors from there to an arc about (x, y)."""
    total, half = 0.0, 0.5 * turn / _PANELS
    for panel in range(_PANELS):
        middle = begin + (2 * panel + 1) * half
        for k in range(8):
            node = _NODES[k // 2] if k % 2 == 0 else -_NODES[k // 2]
            c, s = math.cos(middle + half * node), math.sin(middle + half * node)
            r = math.hypot(x + radius * c, y + radius * s)
            total += _WEIGHTS[k // 2] * half * radius * r * (x * c + y * s + radius) / 3.0
    return total

"""Which face keeps two shapes apart, where a corner leaves it to the motion.

Beside the corner of a step or of a gap a body is "above this face *or* before that one". The face from which
the body is farther now need not be the face that stops it: a box that slides towards a tile level with its
own is held off the side of that tile, though it will slide over its top. So, where the motion takes bodies
across the face that separates them now, the bodies are followed to where they touch (conservative
advancement, Mirtich, Impulse-based dynamic simulation, 1996), and the face between them there is taken, if
they are on its outer side now, too. Source: Nguyen and Trinkle, Modeling Non-Convex Configuration Space Using
Linear Complementarity Problems (2010).
"""

from __future__ import annotations

import math

import numpy as np

from rungwise.block import Block
from rungwise.kernel import Ints, Reals, Record, RecordArray, kernel
from rungwise.scene.template.records import HALFPLANE, Records
from rungwise.system.planar.chains import (
    FLUSH,
)
from rungwise.system.planar.contact_manifold import (
    ABSENT,
    GAP,
    NORMAL_X,
    NORMAL_Y,
    POINT_X,
    POINT_Y,
    VERTICES,
    Found,
    Manifolds,
    Sides,
    manifold,
    put,
)
from rungwise.system.planar.edges import (
    along,
)
from rungwise.system.planar.place import Placement, X, Y, allocate_placement, coordinate_count, lever, turns
from rungwise.system.planar.seams import Seams

LOOKS = 8
"""Places at which a pair is looked at on its way to where it touches; the last one counts."""
NUDGE = 1e-6
"""How far bodies are followed into each other, over the sum of their widths, to see how they touch."""
LEAN = 2.0
"""How much lower an overhanging edge may be, over the compression of the contacts that carry the body."""
SOFT = 0.02
"""Depth below a face, over the sum of widths, from which no body goes over the face, however soft its
contacts."""
SAME = 1e-6
"""Sine between normals of one face."""


class Course(Block):
    """The course of the bodies: the data for looking ahead.

    horizon     (1,)            time to look ahead; none where it is 0
    known       (1,)            whether `speed` is filled for this look
    speed       (bodies, 3)     velocity of the centre, and rate of turning
    placed                      bodies placed ahead
    points (2, 5), features (2,) of a pair placed ahead
    """

    horizon: Reals
    known: Ints
    speed: Reals
    placed: Placement
    points: Reals
    features: Ints


def allocate_course(records: Records) -> Course:
    """A course that leads nowhere."""
    return Course(
        horizon=np.zeros(1),
        known=np.zeros(1, np.int64),
        speed=np.zeros((len(records.bodies), 3)),
        placed=allocate_placement(records),
        points=np.zeros((2, 5)),
        features=np.zeros(2, np.int64),
    )


@kernel
def set_course(bodies: RecordArray, pose: Reals, v: Reals, course: Course) -> None:
    """The course of placed bodies that move with `v` (n,), if it is not known yet."""
    if course.known[0] != 0:
        return
    course.known[0] = 1
    for b in range(bodies.shape[0]):
        course.speed[b, 0] = course.speed[b, 1] = course.speed[b, 2] = 0.0
        for j in range(coordinate_count(bodies[b])):
            i = bodies[b].coordinate + j
            vx, vy = lever(bodies[b], pose[b], j, pose[b, X], pose[b, Y])
            course.speed[b, 0] += vx * v[i]
            course.speed[b, 1] += vy * v[i]
            if turns(bodies[b], i):
                course.speed[b, 2] += v[i]


@kernel
def sunk(a: int, b: int, records: Records, manifolds: Manifolds) -> float:
    """Sum, for bodies a and b, of the greatest compression of a contact that the body has."""
    features, deformation = manifolds.features, manifolds.deformation
    of_a, of_b = 0.0, 0.0
    for slot in range(features.shape[0]):
        if features[slot] != ABSENT and deformation[slot, 0] != 0.0:
            contact = records.contacts[records.pairs[slot // 2].contact]
            deep = abs(deformation[slot, 0])
            if a in (contact.body_a, contact.body_b):
                of_a = max(of_a, deep)
            if b in (contact.body_a, contact.body_b):
                of_b = max(of_b, deep)
    return of_a + of_b


@kernel
def touching_face(
    pair: int,
    seamed: bool,
    count: int,
    records: Records,
    placed: Placement,
    manifolds: Manifolds,
    seams: Seams,
    course: Course,
) -> None:
    """Put the face by which the shapes of a pair will touch in the place of the one that separates them now,
    in `count` points with the fresh features. By as much as contacts are compressed, and a little more,
    shapes may be below a face that they go over."""
    a, b = records.shapes[records.pairs[pair].shape_a], records.shapes[records.pairs[pair].shape_b]
    points, ahead = manifolds.points[2 * pair : 2 * pair + 2], Found(course.points, course.features)
    compressed = sunk(a.body, b.body, records, manifolds)
    thick = a.width + b.width
    slack = FLUSH * max(a.reach, b.reach) + min(SOFT * thick, LEAN * compressed)
    nudge = max(NUDGE * thick, 4.0 * slack)
    time = _lost(a, b, placed.pose, points, count, slack, nudge, course)
    if not time <= course.horizon[0]:
        return
    nx, ny, missed = points[0, NORMAL_X], points[0, NORMAL_Y], False
    for _ in range(LOOKS):
        _place_ahead(a, b, records, placed, time, seamed, course)
        chains = seams.outlines if seamed else seams.alone
        count = manifold(a, b, course.placed.outline, chains, ahead)
        if count == 0:
            return
        if _is_one_face(nx, ny, course.points[0]):
            break
        nx, ny = course.points[0, NORMAL_X], course.points[0, NORMAL_Y]
        left = _lost(a, b, course.placed.pose, course.points, count, slack, nudge, course)
        time += left
        if not time <= course.horizon[0]:
            missed = left >= 0.0
            break
    _take_face(a, b, placed.outline, count, slack, missed, course, Found(points, manifolds.fresh))


@kernel
def _is_one_face(nx: float, ny: float, point: Reals) -> bool:
    """Whether the point's normal is (nx, ny)."""
    mx, my = point[NORMAL_X], point[NORMAL_Y]
    return abs(nx * my - ny * mx) <= SAME and nx * mx + ny * my > 0.0


@kernel
def crosses(
    a: Record,
    b: Record,
    placed: Placement,
    seams: Seams,
    found: Found,
    count: int,
    course: Course,
) -> bool:
    """Whether the motion takes the shapes across the face or corner between them, except where a vertex meets
    the edge below it: something else may then keep them apart."""
    if a.kind == HALFPLANE or b.kind == HALFPLANE:
        return False
    points = found.points
    nudge, soonest, first = NUDGE * (a.width + b.width), course.horizon[0], -1
    for k in range(count):
        rate = _rate(a, b, placed.pose, points[k], course)
        if rate * course.horizon[0] < -nudge and max(points[k, GAP], 0.0) < -rate * soonest:
            soonest, first = max(points[k, GAP], 0.0) / -rate, k
    return first >= 0 and not _is_met(found.features[first], a, b, placed, seams, soonest, course)


@kernel
def _is_met(
    feature: int, a: Record, b: Record, placed: Placement, seams: Seams, time: float, course: Course
) -> bool:
    """Whether the feature's vertex will be over its edge, and not near its ends, after a time."""
    edge, vertex = feature // VERTICES, feature % VERTICES
    if edge >= VERTICES:
        return False
    pose, outline = placed.pose, placed.outline
    own, other = (a, b) if a.first <= edge < a.end else (b, a)
    x, y = outline[vertex, 0], outline[vertex, 1]
    ux, uy = _velocity(other.body, x, y, pose, course)
    vx, vy = _velocity(own.body, x, y, pose, course)
    slip = outline[edge, 2] * (uy - vy) - outline[edge, 3] * (ux - vx)
    place, margin = along(edge, vertex, outline) + time * slip, SOFT * (a.width + b.width)
    return margin < place < along(edge, seams.outlines.ends[edge], outline) - margin


@kernel
def _rate(a: Record, b: Record, pose: Reals, point: Reals, course: Course) -> float:
    """Rate of the gap at a point."""
    ax, ay = _velocity(a.body, point[POINT_X], point[POINT_Y], pose, course)
    bx, by = _velocity(b.body, point[POINT_X], point[POINT_Y], pose, course)
    rate: float = point[NORMAL_X] * (ax - bx) + point[NORMAL_Y] * (ay - by)
    return rate


@kernel
def _lost(
    a: Record, b: Record, pose: Reals, points: Reals, count: int, slack: float, nudge: float, course: Course
) -> float:
    """Time until the shapes are through a point by `nudge`; inf if they are not, nan if they overlap."""
    soonest = math.inf
    for k in range(count):
        gap, rate = points[k, GAP], _rate(a, b, pose, points[k], course)
        if gap < -slack:
            return math.nan
        if rate < 0.0:
            soonest = min(soonest, (gap + nudge) / -rate)
    return soonest


@kernel
def _velocity(b: int, x: float, y: float, pose: Reals, course: Course) -> tuple[float, float]:
    """Velocity of the body's point (x, y)."""
    turn = course.speed[b, 2]
    return course.speed[b, 0] - turn * (y - pose[b, Y]), course.speed[b, 1] + turn * (x - pose[b, X])


@kernel
def _place_ahead(
    a: Record, b: Record, records: Records, placed: Placement, time: float, seamed: bool, course: Course
) -> None:
    """Place two shapes, or all whose faces may go on in theirs, where they will be after a time."""
    pose, outline, ahead = placed.pose, placed.outline, course.placed
    for s in range(records.shapes.shape[0]):
        shape = records.shapes[s]
        if not (seamed or shape.first == a.first or shape.first == b.first):
            continue
        body = shape.body
        x, y, turn = pose[body, X], pose[body, Y], time * course.speed[body, 2]
        cosine, sine = math.cos(turn), math.sin(turn)
        far_x, far_y = x + time * course.speed[body, 0], y + time * course.speed[body, 1]
        ahead.pose[body, X], ahead.pose[body, Y] = far_x, far_y
        for i in range(shape.first, shape.end):
            dx, dy = outline[i, 0] - x, outline[i, 1] - y
            ahead.outline[i, 0] = far_x + cosine * dx - sine * dy
            ahead.outline[i, 1] = far_y + sine * dx + cosine * dy
            ahead.outline[i, 2] = cosine * outline[i, 2] - sine * outline[i, 3]
            ahead.outline[i, 3] = sine * outline[i, 2] + cosine * outline[i, 3]


@kernel
def _take_face(
    a: Record, b: Record, outline: Reals, count: int, slack: float, missed: bool, course: Course, found: Found
) -> None:
    """Take over the face found ahead, where the other shape is on its outer side now; between two corners,
    only where they will pass and not meet."""
    points, features = found
    for k in range(count):
        edge, vertex = course.features[k] // VERTICES, course.features[k] % VERTICES
        if edge >= VERTICES and not missed:
            return
        if edge >= VERTICES:
            _put_vertices(a, b, vertex, edge - VERTICES, outline, course, course.points[k])
        elif a.first <= edge < a.end:
            put(edge, vertex, Sides(a, b, -1.0, outline), course.points[k])
        else:
            put(edge, vertex, Sides(b, a, 1.0, outline), course.points[k])
        if course.points[k, GAP] < -slack:
            return
    if _is_one_face(points[0, NORMAL_X], points[0, NORMAL_Y], course.points[0]):
        return
    for k in range(2):
        features[k] = course.features[k] if k < count else ABSENT
        for i in range(points.shape[1]):
            points[k, i] = course.points[k, i]


@kernel
def _put_vertices(a: Record, b: Record, i: int, j: int, outline: Reals, course: Course, point: Reals) -> None:
    """Write the point of vertices i of a and j of b that are to touch with the normal that `point` has.

    The normal need not go through both vertices: the point lies on the normal from the vertex of the body
    that turns faster, so that its turning changes the gap no more than it should.
    """
    nx, ny = point[NORMAL_X], point[NORMAL_Y]
    dx, dy = outline[i, 0] - outline[j, 0], outline[i, 1] - outline[j, 1]
    point[GAP] = nx * dx + ny * dy - a.radius - b.radius
    turn_a, turn_b = abs(course.speed[a.body, 2]), abs(course.speed[b.body, 2])
    if turn_a > turn_b or (turn_a == turn_b and a.radius >= b.radius):
        back = a.radius + 0.5 * point[GAP]
        point[POINT_X], point[POINT_Y] = outline[i, 0] - back * nx, outline[i, 1] - back * ny
    else:
        back = b.radius + 0.5 * point[GAP]
        point[POINT_X], point[POINT_Y] = outline[j, 0] + back * nx, outline[j, 1] + back * ny

"""Binding: parameter values -> numbers of the records, then all that follows from them.

One kernel for one run and for each sample of a batch. Solids come first, then motions and joints, whose
frames are those of the centres of mass.
"""

from __future__ import annotations

import math

from rungwise.kernel import Reals, Record, RecordArray, kernel
from rungwise.scene.bind.pressure import press
from rungwise.scene.bind.solids import mass, outline, width
from rungwise.scene.fields.laws.contact import refused
from rungwise.scene.template.faults import (
    BOUND,
    NO_AXIS,
    NO_INERTIA,
    NO_JOINT_AXIS,
    NO_MASS,
    NOT_POSITIVE,
    OUT_OF_RANGE,
    OUT_OF_TRAVEL,
    REFUSED,
)
from rungwise.scene.template.numbers import evaluate_numbers, out_of_bounds
from rungwise.scene.template.records import FREE, HALFPLANE, HINGE, SERVO, SLIDE, SPEED, Records
from rungwise.scene.template.template import Bounds, Numbers


@kernel
def bind(
    numbers: Numbers, bounds: Bounds, values: Reals, stack: Reals, buffer: Reals, records: Records
) -> tuple[int, int]:
    """Numbers into `buffer`, checked, then all that follows from them into `records`, which are views of it.
    Returns (fault, index)."""
    evaluate_numbers(numbers, values, stack, buffer)
    wrong = out_of_bounds(bounds, buffer)
    if wrong >= 0:
        return OUT_OF_RANGE, wrong
    contacts = records.contacts
    for k in range(contacts.shape[0]):
        c = contacts[k]
        definite = c.coupling_stiffness**2 < c.stiffness * c.tangential_stiffness
        if not (definite and c.coupling_damping**2 <= c.damping * c.tangential_damping):
            return NOT_POSITIVE, k
        law = refused(c)
        if law >= 0:
            return REFUSED + law, k
    fault, place = _derive(records)
    if fault == BOUND:
        fault, place = _supports(records)
    return _joints(records) if fault == BOUND else (fault, place)


@kernel
def _derive(records: Records) -> tuple[int, int]:
    """Solids, and motions of bodies. Returns (fault, index)."""
    bodies, coordinates = records.bodies, records.coordinates
    shapes, vertices = records.shapes, records.vertices
    for s in range(shapes.shape[0]):
        fault = outline(shapes[s], vertices)
        if fault != BOUND:
            return fault, s
    for b in range(bodies.shape[0]):
        mass(bodies[b], shapes, vertices)
        fault = _motion(bodies[b], coordinates)
        if fault != BOUND:
            return fault, b
        _centre_frame(bodies[b], shapes, vertices)
    for i in range(coordinates.shape[0]):
        value = coordinates[i].start + origin(bodies[coordinates[i].body], i)
        if not coordinates[i].lower <= value <= coordinates[i].upper:
            return OUT_OF_TRAVEL, i
        if coordinates[i].drive == SERVO:
            # Without gains it has no force to limit; a row with a limit alone would be dry friction.
            gains = coordinates[i].stiffness + coordinates[i].drive_damping
            coordinates[i].limited = gains > 0.0 and math.isfinite(coordinates[i].limit)
    return BOUND, 0


@kernel
def origin(body: Record, i: int) -> float:
    """Value of the body's coordinate i at its pose: 0 except for free bodies."""
    if body.motion != FREE:
        return 0.0
    if i == body.coordinate:
        return body.x
    return body.y if i == body.coordinate + 1 else body.angle


@kernel
def _motion(body: Record, coordinates: RecordArray) -> int:
    """Fill in unit axis, generalised inertia and metric of the body's coordinates."""
    i = body.coordinate
    if body.motion == SLIDE:
        norm = math.hypot(body.axis_x, body.axis_y)
        if not norm > 0.0:
            return NO_AXIS
        body.axis_x, body.axis_y = body.axis_x / norm, body.axis_y / norm
        return _inertia(body, coordinates[i], 1.0)
    if body.motion == HINGE:
        c, s = math.cos(body.angle), math.sin(body.angle)
        x = body.x + c * body.centre_x - s * body.centre_y - body.pivot_x
        y = body.y + s * body.centre_x + c * body.centre_y - body.pivot_y
        return _inertia(body, coordinates[i], body.gyration2 + x * x + y * y)
    if body.motion == FREE:
        fault = _inertia(body, coordinates[i], 1.0)
        if fault == BOUND:
            fault = _inertia(body, coordinates[i + 1], 1.0)
        if fault == BOUND:
            fault = _inertia(body, coordinates[i + 2], body.gyration2)
        return fault
    return BOUND


@kernel
def _inertia(body: Record, coordinate: Record, metric: float) -> int:
    coordinate.metric = metric
    coordinate.lever = math.sqrt(metric)
    coordinate.mass = body.mass * metric
    if coordinate.drive == SPEED or coordinate.mass > 0.0:
        return BOUND
    return NO_MASS if not body.mass > 0.0 else NO_INERTIA


@kernel
def _centre_frame(body: Record, shapes: RecordArray, vertices: RecordArray) -> None:
    """Move the body's frame to its centre of mass."""
    c, s = math.cos(body.angle), math.sin(body.angle)
    body.x += c * body.centre_x - s * body.centre_y
    body.y += s * body.centre_x + c * body.centre_y
    for i in range(body.first_shape, body.end_shape):
        reach = 0.0
        for k in range(shapes[i].first, shapes[i].end):
            vertices[k].x -= body.centre_x
            vertices[k].y -= body.centre_y
            reach = max(reach, math.hypot(vertices[k].x, vertices[k].y))
        shapes[i].reach = math.inf if shapes[i].kind == HALFPLANE else reach + shapes[i].radius
        shapes[i].width = width(shapes[i], vertices)


@kernel
def _supports(records: Records) -> tuple[int, int]:
    """Friction of each support. Returns (fault, index)."""
    supports = records.supports
    for k in range(supports.shape[0]):
        body = records.bodies[supports[k].body]
        fault = press(supports[k], body, records.shapes, records.vertices, records.spots)
        if fault != BOUND:
            return fault, k
    return BOUND, 0


@kernel
def _joints(records: Records) -> tuple[int, int]:
    """Anchors and axis of each joint in the frames of its bodies. Returns (fault, index)."""
    bodies, shapes, joints, measures = records.bodies, records.shapes, records.joints, records.measures
    for k in range(joints.shape[0]):
        joint = joints[k]
        a, b = bodies[joint.body_a], bodies[joint.body_b]
        norm = math.hypot(joint.axis_x, joint.axis_y)
        if not norm > 0.0:
            return NO_JOINT_AXIS, k
        joint.axis_x, joint.axis_y = _turned(-a.angle, joint.axis_x / norm, joint.axis_y / norm)
        joint.a_x, joint.a_y = _turned(-a.angle, joint.at_x - a.x, joint.at_y - a.y)
        joint.b_x, joint.b_y = _turned(-b.angle, joint.at_x - b.x, joint.at_y - b.y)
        joint.angle = b.angle - a.angle
        joint.lever = max(_longest(a, shapes), _longest(b, shapes))
        if not joint.lever > 0.0:
            joint.lever = max(math.hypot(joint.a_x, joint.a_y), math.hypot(joint.b_x, joint.b_y))
        if not joint.lever > 0.0:
            joint.lever = math.sqrt(max(a.gyration2, b.gyration2))
        if not joint.lever > 0.0:
            # Nothing that could turn has a size: every row of the angle is zero.
            joint.lever = 1.0
    for m in range(measures.shape[0]):
        if measures[m].drive == SERVO:
            measures[m].limited = math.isfinite(measures[m].limit)
    return BOUND, 0


@kernel
def _turned(angle: float, x: float, y: float) -> tuple[float, float]:
    c, s = math.cos(angle), math.sin(angle)
    return c * x - s * y, s * x + c * y


@kernel
def _longest(body: Record, shapes: RecordArray) -> float:
    longest = 0.0
    for i in range(body.first_shape, body.end_shape):
        if math.isfinite(shapes[i].reach):
            longest = max(longest, shapes[i].reach)
    return longest

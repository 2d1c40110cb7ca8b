"""Binding: parameter values -> numbers of the records, then outlines, mass, centre, inertia and normals.

One kernel for one run and for each sample of a batch.
"""

from __future__ import annotations

import math

from rungwise.kernel import Ints, Reals, Record, RecordArray, kernel
from rungwise.scene.expression import evaluate
from rungwise.scene.records import BOX, CAPSULE, FREE, HALFPLANE, HINGE, SERVO, SLIDE, SPEED
from rungwise.scene.template import MAY_BE_INFINITE, STRICT

(
    BOUND,
    OUT_OF_RANGE,
    NOT_CONVEX,
    NO_NORMAL,
    NO_AXIS,
    NO_MASS,
    NO_INERTIA,
    OUT_OF_TRAVEL,
    NO_JOINT_AXIS,
    NOT_POSITIVE,
) = range(10)
FAULTS = {
    NOT_CONVEX: "the outline is not a convex polygon with distinct vertices",
    NO_NORMAL: "the normal has no length",
    NO_AXIS: "the axis has no length",
    NO_MASS: "a body that forces move needs a mass greater than 0 (give mass, or a shape with area)",
    NO_INERTIA: "a body that turns freely needs an inertia greater than 0"
    " (give inertia, or a shape with area)",
    NO_JOINT_AXIS: "the axis has no length",
    NOT_POSITIVE: "coupling must be below the root of normal times tangential (stiffness, and damping)",
    OUT_OF_TRAVEL: "the start lies outside lower..upper",
}
"""Fault of a binding -> its text; the second number of a fault is the index of check, shape, body,
coordinate, joint or contact."""


@kernel
def bind(
    code: Ints,
    constants: Reals,
    table: Ints,
    targets: Ints,
    slots: Ints,
    low: Reals,
    high: Reals,
    kinds: Ints,
    values: Reals,
    stack: Reals,
    buffer: Reals,
    bodies: RecordArray,
    coordinates: RecordArray,
    shapes: RecordArray,
    vertices: RecordArray,
    contacts: RecordArray,
    joints: RecordArray,
    measures: RecordArray,
) -> tuple[int, int]:
    """Write numbers into `buffer`, check them, then fill in all that follows. Returns (fault, index)."""
    evaluate_numbers(code, constants, table, targets, values, stack, buffer)
    wrong = _check(slots, low, high, kinds, buffer)
    if wrong >= 0:
        return OUT_OF_RANGE, wrong
    for k in range(contacts.shape[0]):
        c = contacts[k]
        definite = c.coupling_stiffness**2 < c.stiffness * c.tangential_stiffness
        if not (definite and c.coupling_damping**2 <= c.damping * c.tangential_damping):
            return NOT_POSITIVE, k
    fault, place = _derive(bodies, coordinates, shapes, vertices)
    return _joints(joints, measures, bodies, shapes) if fault == BOUND else (fault, place)


@kernel
def evaluate_numbers(
    code: Ints, constants: Reals, table: Ints, targets: Ints, values: Reals, stack: Reals, buffer: Reals
) -> int:
    """Run every program and store its value at its target; returns the first target whose value is not
    finite, or -1."""
    wrong = -1
    for i in range(targets.shape[0]):
        value = evaluate(code, constants, table[i, 0], table[i, 1], values, stack)
        buffer[targets[i]] = value
        if wrong < 0 and not math.isfinite(value):
            wrong = targets[i]
    return wrong


@kernel
def _check(slots: Ints, low: Reals, high: Reals, kinds: Ints, buffer: Reals) -> int:
    """Index of the first number outside its bounds, or -1."""
    for i in range(slots.shape[0]):
        x = buffer[slots[i]]
        if math.isnan(x) or (math.isinf(x) and kinds[i] & MAY_BE_INFINITE == 0):
            return i
        if x < low[i] or x > high[i] or (x == low[i] and kinds[i] & STRICT != 0):
            return i
    return -1


@kernel
def _derive(
    bodies: RecordArray, coordinates: RecordArray, shapes: RecordArray, vertices: RecordArray
) -> tuple[int, int]:
    """Fill in all records that follow from the numbers. Returns (fault, index)."""
    for s in range(shapes.shape[0]):
        fault = _outline(shapes[s], vertices)
        if fault != BOUND:
            return fault, s
    for b in range(bodies.shape[0]):
        _mass(bodies[b], shapes, vertices)
        fault = _motion(bodies[b], coordinates)
        if fault != BOUND:
            return fault, b
        _centre_frame(bodies[b], shapes, vertices)
    for i in range(coordinates.shape[0]):
        value = coordinates[i].start + origin(bodies[coordinates[i].body], i)
        if not coordinates[i].lower <= value <= coordinates[i].upper:
            return OUT_OF_TRAVEL, i
        if coordinates[i].drive == SERVO:
            coordinates[i].limited = math.isfinite(coordinates[i].limit)
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
def _outline(shape: Record, vertices: RecordArray) -> int:
    """Fill in vertices in the body frame, counter-clockwise, with their edges' normals and lengths."""
    first, n = shape.first, shape.end - shape.first
    if shape.kind == HALFPLANE:
        return _halfplane(shape, vertices)
    if shape.kind == BOX or shape.kind == CAPSULE:
        for k in range(n):
            vertices[first + k].x = 0.5 * shape.size_x * (1.0 if k == 1 or k == 2 else -1.0)
            vertices[first + k].y = 0.5 * shape.size_y * (1.0 if k >= 2 else -1.0)
    _place(shape, vertices)
    if n == 1:
        return BOUND
    if _twice_area(first, n, vertices) < 0.0:
        for k in range(1, (n + 1) // 2):
            a, b = first + k, first + n - k
            x, y = vertices[a].x, vertices[a].y
            vertices[a].x, vertices[a].y = vertices[b].x, vertices[b].y
            vertices[b].x, vertices[b].y = x, y
    for k in range(n):
        a, b = first + k, first + (k + 1) % n
        dx, dy = vertices[b].x - vertices[a].x, vertices[b].y - vertices[a].y
        length = math.hypot(dx, dy)
        if not length > 0.0:
            return NOT_CONVEX
        vertices[a].length = length
        vertices[a].normal_x, vertices[a].normal_y = dy / length, -dx / length
    return _convexity(first, n, vertices)


@kernel
def _convexity(first: int, n: int, vertices: RecordArray) -> int:
    """Fault unless each turn is to the left, and all turns together are one full turn."""
    total = 0.0
    for k in range(n):
        a, b = vertices[first + (k + n - 1) % n], vertices[first + k]
        sine = a.normal_x * b.normal_y - a.normal_y * b.normal_x
        cosine = a.normal_x * b.normal_x + a.normal_y * b.normal_y
        if n > 2 and sine < 1e-9:
            return NOT_CONVEX
        total += math.atan2(abs(sine), cosine)
    return BOUND if abs(total - 2.0 * math.pi) < 1e-6 else NOT_CONVEX


@kernel
def _place(shape: Record, vertices: RecordArray) -> None:
    c, s = math.cos(shape.angle), math.sin(shape.angle)
    for k in range(shape.first, shape.end):
        x, y = vertices[k].x, vertices[k].y
        vertices[k].x = shape.at_x + c * x - s * y
        vertices[k].y = shape.at_y + s * x + c * y


@kernel
def _halfplane(shape: Record, vertices: RecordArray) -> int:
    """Fill in one edge from `at`, of unit length, with the solid on its left."""
    a, b = shape.first, shape.first + 1
    nx, ny = vertices[b].x, vertices[b].y
    norm = math.hypot(nx, ny)
    if not norm > 0.0:
        return NO_NORMAL
    nx, ny = nx / norm, ny / norm
    vertices[a].x, vertices[a].y = shape.at_x, shape.at_y
    vertices[b].x, vertices[b].y = shape.at_x - ny, shape.at_y + nx
    vertices[a].normal_x, vertices[a].normal_y, vertices[a].length = nx, ny, 1.0
    vertices[b].normal_x, vertices[b].normal_y, vertices[b].length = nx, ny, 1.0
    return BOUND


@kernel
def _twice_area(first: int, n: int, vertices: RecordArray) -> float:
    total = 0.0
    for k in range(n):
        a, b = vertices[first + k], vertices[first + (k + 1) % n]
        total += a.x * b.y - a.y * b.x
    return total


@kernel
def _mass(body: Record, shapes: RecordArray, vertices: RecordArray) -> None:
    """Fill in mass, centre (body frame) and inertia about the centre, from outline and density where not
    given.

    A rounded polygon is its core, a strip along each edge and a sector at each vertex; the moments of each
    part are exact. The moments of a body are the sums over its shapes.
    """
    area = first_x = first_y = second = 0.0
    for s in range(body.first_shape, body.end_shape):
        a, mx, my, m2 = _moments(shapes[s], vertices)
        area, first_x, first_y, second = area + a, first_x + mx, first_y + my, second + m2
    if not body.centre_given:
        body.centre_x, body.centre_y = 0.0, 0.0
        if area > 0.0:
            body.centre_x, body.centre_y = first_x / area, first_y / area
        elif body.end_shape - body.first_shape == 1 and shapes[body.first_shape].kind != HALFPLANE:
            body.centre_x, body.centre_y = _mean(shapes[body.first_shape], vertices)
    if not body.mass_given:
        body.mass = body.density * area
    body.gyration2 = 0.0
    if area > 0.0:
        x, y = body.centre_x, body.centre_y
        about_centre = second - 2.0 * (x * first_x + y * first_y) + area * (x * x + y * y)
        body.gyration2 = about_centre / area
    if body.inertia_given and body.mass > 0.0:
        body.gyration2 = body.inertia / body.mass
    elif not body.inertia_given:
        body.inertia = body.mass * body.gyration2


@kernel
def _mean(shape: Record, vertices: RecordArray) -> tuple[float, float]:
    x = y = 0.0
    n = shape.end - shape.first
    for k in range(shape.first, shape.end):
        x, y = x + vertices[k].x / n, y + vertices[k].y / n
    return x, y


@kernel
def _moments(shape: Record, vertices: RecordArray) -> tuple[float, float, float, float]:
    """Area, first moments and polar second moment about the body's origin."""
    area = mx = my = second = 0.0
    if shape.kind == HALFPLANE:
        return area, mx, my, second
    first, n, r = shape.first, shape.end - shape.first, shape.radius
    for k in range(n):
        a, b = vertices[first + k], vertices[first + (k + 1) % n]
        cross = a.x * b.y - a.y * b.x
        area += 0.5 * cross
        mx += cross * (a.x + b.x) / 6.0
        my += cross * (a.y + b.y) / 6.0
        second += cross * (a.x * a.x + a.x * b.x + b.x * b.x + a.y * a.y + a.y * b.y + b.y * b.y) / 12.0
    for k in range(n):
        a = vertices[first + k]
        turn = 2.0 * math.pi
        bx, by = 0.0, 0.0
        if n > 1:
            b, p = vertices[first + (k + 1) % n], vertices[first + (k + n - 1) % n]
            strip = a.length * r
            x = 0.5 * (a.x + b.x + r * a.normal_x)
            y = 0.5 * (a.y + b.y + r * a.normal_y)
            area += strip
            mx += strip * x
            my += strip * y
            second += strip * (x * x + y * y + (a.length * a.length + r * r) / 12.0)
            sine = p.normal_x * a.normal_y - p.normal_y * a.normal_x
            turn = math.atan2(abs(sine), p.normal_x * a.normal_x + p.normal_y * a.normal_y)
            bx, by = _bisector(p, a)
        sector = 0.5 * r * r * turn
        arm = 4.0 * r * math.sin(0.5 * turn) / (3.0 * turn)
        area += sector
        mx += sector * (a.x + arm * bx)
        my += sector * (a.y + arm * by)
        second += sector * (a.x * a.x + a.y * a.y + 2.0 * arm * (a.x * bx + a.y * by) + 0.5 * r * r)
    return area, mx, my, second


@kernel
def _bisector(before: Record, after: Record) -> tuple[float, float]:
    """Unit vector midway between the normals of two successive edges (a half turn to the left included)."""
    x, y = before.normal_x + after.normal_x, before.normal_y + after.normal_y
    norm = math.hypot(x, y)
    if norm < 1e-9:
        return -before.normal_y, before.normal_x
    return x / norm, y / norm


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
        shapes[i].width = _width(shapes[i], vertices)


@kernel
def _width(shape: Record, vertices: RecordArray) -> float:
    """Least distance of two parallel lines that enclose a shape: one of them lies along an edge."""
    if shape.kind == HALFPLANE:
        return math.inf
    least = 0.0 if shape.end - shape.first < 3 else math.inf
    for i in range(shape.first, shape.end):
        edge, depth = vertices[i], 0.0
        for k in range(shape.first, shape.end):
            dx, dy = vertices[k].x - edge.x, vertices[k].y - edge.y
            depth = max(depth, -edge.normal_x * dx - edge.normal_y * dy)
        least = min(least, depth)
    return least + 2.0 * shape.radius


@kernel
def _joints(
    joints: RecordArray, measures: RecordArray, bodies: RecordArray, shapes: RecordArray
) -> tuple[int, int]:
    """Fill in anchors and axis of each joint in the frames of its bodies. Returns (fault, index)."""
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

"""Solids of a bound scene: outlines of shapes, with normals and lengths of edges; mass, centre and inertia
of bodies."""

from __future__ import annotations

import math

from rungwise.kernel import Record, RecordArray, kernel
from rungwise.scene.template.faults import BOUND, NO_NORMAL, NOT_CONVEX
from rungwise.scene.template.records import BOX, CAPSULE, HALFPLANE


@kernel
def outline(shape: Record, vertices: RecordArray) -> int:
    """Vertices in the body frame, counter-clockwise, with their edges' normals and lengths."""
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
    """Each turn is to the left, and together they are one full turn."""
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
    """One edge from `at`, of unit length, with the solid on its left."""
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
def mass(body: Record, shapes: RecordArray, vertices: RecordArray) -> None:
    """Mass, centre (body frame) and inertia about it, from outline and density where not given.

    A rounded polygon is its core, a strip along each edge and a sector at each vertex; the moments of each
    are exact. A body of several shapes is their sum.
    """
    area = first_x = first_y = second = 0.0
    for s in range(body.first_shape, body.end_shape):
        a, mx, my, m2 = moments(shapes[s], vertices)
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
def moments(shape: Record, vertices: RecordArray) -> tuple[float, float, float, float]:
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
    if r == 0.0:
        return area, mx, my, second
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
def width(shape: Record, vertices: RecordArray) -> float:
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

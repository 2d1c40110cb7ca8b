"""Where bodies are: coordinates -> poses and world outlines."""

from __future__ import annotations

import math

from rungwise.kernel import Reals, Record, RecordArray, inner_kernel, kernel
from rungwise.scene.records import FIXED, FREE, HINGE, SLIDE

X, Y, COS, SIN = 0, 1, 2, 3
"""Columns of `pose` (bodies, 4); `outline` (vertices, 4) holds x, y and the normal of the edge from there."""


@kernel
def place(
    bodies: RecordArray,
    shapes: RecordArray,
    vertices: RecordArray,
    q: Reals,
    pose: Reals,
    outline: Reals,
    fixed_too: bool,
) -> None:
    """Fill `pose` and `outline` at q; rows of bodies without coordinates only if `fixed_too`."""
    for b in range(bodies.shape[0]):
        body = bodies[b]
        if body.motion == FIXED and not fixed_too:
            continue
        place_body(b, bodies, shapes, vertices, q, pose, outline)


@inner_kernel
def place_body(
    b: int,
    bodies: RecordArray,
    shapes: RecordArray,
    vertices: RecordArray,
    q: Reals,
    pose: Reals,
    outline: Reals,
) -> None:
    """Fill the rows of one body."""
    body = bodies[b]
    _pose(body, q, pose[b])
    x, y, c, s = pose[b, X], pose[b, Y], pose[b, COS], pose[b, SIN]
    first, last = shapes[body.first_shape].first, shapes[body.end_shape - 1].end
    for k in range(first, last):
        vertex = vertices[k]
        outline[k, 0] = x + c * vertex.x - s * vertex.y
        outline[k, 1] = y + s * vertex.x + c * vertex.y
        outline[k, 2] = c * vertex.normal_x - s * vertex.normal_y
        outline[k, 3] = s * vertex.normal_x + c * vertex.normal_y


@kernel
def _pose(body: Record, q: Reals, pose: Reals) -> None:
    i = body.coordinate
    x, y, angle = body.x, body.y, body.angle
    if body.motion == SLIDE:
        x += body.axis_x * q[i]
        y += body.axis_y * q[i]
    elif body.motion == HINGE:
        c, s = math.cos(q[i]), math.sin(q[i])
        dx, dy = x - body.pivot_x, y - body.pivot_y
        x, y = body.pivot_x + c * dx - s * dy, body.pivot_y + s * dx + c * dy
        angle += q[i]
    elif body.motion == FREE:
        x, y, angle = q[i], q[i + 1], q[i + 2]
    pose[X], pose[Y] = x, y
    if angle == 0.0:
        pose[COS], pose[SIN] = 1.0, 0.0
    else:
        pose[COS], pose[SIN] = math.cos(angle), math.sin(angle)


@kernel
def start(bodies: RecordArray, coordinates: RecordArray, q: Reals, v: Reals) -> None:
    """Fill in the initial q and v: `start` is a displacement from the pose."""
    for i in range(coordinates.shape[0]):
        q[i] = coordinates[i].start
        v[i] = coordinates[i].speed
    for b in range(bodies.shape[0]):
        if bodies[b].motion == FREE:
            i = bodies[b].coordinate
            q[i] += bodies[b].x
            q[i + 1] += bodies[b].y
            q[i + 2] += bodies[b].angle


@inner_kernel
def lever(body: Record, pose: Reals, i: int, x: float, y: float) -> tuple[float, float]:
    """Velocity of the body's point (x, y) per unit speed of its i-th coordinate."""
    if body.motion == SLIDE:
        return body.axis_x, body.axis_y
    if body.motion == HINGE:
        return -(y - body.pivot_y), x - body.pivot_x
    if i == 0:
        return 1.0, 0.0
    if i == 1:
        return 0.0, 1.0
    return -(y - pose[Y]), x - pose[X]


@inner_kernel
def turns(body: Record, i: int) -> bool:
    """Whether the body's coordinate i is an angle."""
    return bool(body.motion == HINGE or i == body.coordinate + 2)


@inner_kernel
def coordinate_count(body: Record) -> int:
    """How many coordinates the body has."""
    if body.motion == FREE:
        return 3
    return 0 if body.motion == FIXED else 1

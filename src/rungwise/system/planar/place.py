"""Where bodies are: coordinates -> poses and world outlines."""

from __future__ import annotations

import math

import numpy as np

from rungwise.block import Block
from rungwise.kernel import Reals, Record, inner_kernel, kernel
from rungwise.scene.template.records import FIXED, FREE, HINGE, SLIDE, Records

X, Y, COS, SIN = 0, 1, 2, 3
"""Columns of `Placement.pose`."""


class Placement(Block):
    """Where bodies are.

    pose     (bodies, 4)    centre, cosine and sine of the angle
    outline  (vertices, 4)  x, y and the normal of the edge that starts there, in the world
    """

    pose: Reals
    outline: Reals


def allocate_placement(records: Records) -> Placement:
    """The placement of a scene, yet to be filled."""
    return Placement(pose=np.zeros((len(records.bodies), 4)), outline=np.zeros((len(records.vertices), 4)))


@kernel
def place(records: Records, q: Reals, placed: Placement, fixed_too: bool) -> None:
    """Fill `placed` at q (n,); bodies without coordinates only if `fixed_too`."""
    for b in range(records.bodies.shape[0]):
        if records.bodies[b].motion == FIXED and not fixed_too:
            continue
        place_body(b, records, q, placed)


@inner_kernel
def place_body(b: int, records: Records, q: Reals, placed: Placement) -> None:
    """Fill the rows of one body."""
    body, pose, outline = records.bodies[b], placed.pose, placed.outline
    _pose(body, q, pose[b])
    x, y, c, s = pose[b, X], pose[b, Y], pose[b, COS], pose[b, SIN]
    first, last = records.shapes[body.first_shape].first, records.shapes[body.end_shape - 1].end
    for k in range(first, last):
        vertex = records.vertices[k]
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
def start(records: Records, q: Reals, v: Reals) -> None:
    """Initial q and v (n,): `start` is a displacement from the pose."""
    bodies, coordinates = records.bodies, records.coordinates
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

"""Rows of W^T: rates of gap and tangential displacement per unit of each coordinate's speed."""

from __future__ import annotations

from rungwise.kernel import Reals, Record, RecordArray, inner_kernel, kernel
from rungwise.system.planar.manifold import NORMAL_X, NORMAL_Y, POINT_X, POINT_Y
from rungwise.system.planar.place import coordinate_count, lever


@inner_kernel
def contact_rows(
    a: int, b: int, bodies: RecordArray, pose: Reals, point: Reals, rows: Reals, first: int
) -> None:
    """Write rows `first` (normal) and `first + 1` (tangent: the normal turned clockwise) of a contact point
    between bodies a and b.

    The force on body a is positive along these rows, the force on body b negative.
    """
    rows[first, :] = 0.0
    rows[first + 1, :] = 0.0
    _add(bodies[a], pose[a], point, 1.0, rows, first)
    _add(bodies[b], pose[b], point, -1.0, rows, first)


@kernel
def _add(body: Record, pose: Reals, point: Reals, sign: float, rows: Reals, first: int) -> None:
    nx, ny = point[NORMAL_X], point[NORMAL_Y]
    for i in range(coordinate_count(body)):
        vx, vy = lever(body, pose, i, point[POINT_X], point[POINT_Y])
        column = body.coordinate + i
        rows[first, column] += sign * (nx * vx + ny * vy)
        rows[first + 1, column] += sign * (ny * vx - nx * vy)

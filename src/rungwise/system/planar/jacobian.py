"""Rows of W^T: rates of gap and tangential displacement per unit of each coordinate's speed."""

from __future__ import annotations

from rungwise.contact.step import place_in
from rungwise.kernel import Reals, Record, RecordArray, inner_kernel
from rungwise.system.entries import Entries, clear_rows, is_crowded, set_spans
from rungwise.system.planar.contact_manifold import NORMAL_X, NORMAL_Y, POINT_X, POINT_Y
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
    add_rows(bodies[a], pose[a], point, 1.0, rows, first, 0)
    add_rows(bodies[b], pose[b], point, -1.0, rows, first, 0)


@inner_kernel
def enter_rows(
    a: int, b: int, bodies: RecordArray, pose: Reals, point: Reals, rows: Reals, k: int, entries: Entries
) -> None:
    """Write the rows of contact k, whose entries are told, as `contact_rows`."""
    set_bodies(a, b, bodies, k, entries)
    clear_rows(entries, k, 2, rows)
    i, j = bodies[a].coordinate, bodies[b].coordinate
    add_rows(bodies[a], pose[a], point, 1.0, rows, 2 * k, i - place_in(entries.rows, k, i))
    add_rows(bodies[b], pose[b], point, -1.0, rows, 2 * k, j - place_in(entries.rows, k, j))


@inner_kernel
def set_bodies(a: int, b: int, bodies: RecordArray, k: int, entries: Entries) -> None:
    """Let contact k have entries for the coordinates of two bodies."""
    if is_crowded(entries):
        i, j = bodies[a].coordinate, bodies[b].coordinate
        set_spans(entries.rows, k, i, i + coordinate_count(bodies[a]), j, j + coordinate_count(bodies[b]))


@inner_kernel
def add_rows(
    body: Record, pose: Reals, point: Reals, sign: float, rows: Reals, first: int, shift: int
) -> None:
    """Add what the motion of one body adds to rows `first` and `first + 1`, which keep its coordinates
    `shift` columns before their own."""
    nx, ny = point[NORMAL_X], point[NORMAL_Y]
    for i in range(coordinate_count(body)):
        vx, vy = lever(body, pose, i, point[POINT_X], point[POINT_Y])
        column = body.coordinate + i - shift
        rows[first, column] += sign * (nx * vx + ny * vy)
        rows[first + 1, column] += sign * (ny * vx - nx * vy)

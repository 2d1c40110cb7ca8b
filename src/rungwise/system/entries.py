"""Where rows and matrices of many bodies have entries: a contact touches two bodies, of however many."""

from __future__ import annotations

import numpy as np

from rungwise.block import Block
from rungwise.contact.step import NO_SPANS, NO_STRETCHES, Widths, span
from rungwise.kernel import Ints, Reals, inner_kernel, kernel

CROWDED = 60
"""Velocities from which on a step is taken by its entries, which is faster then, and takes less memory."""


class Entries(Block):
    """Columns outside of which all is zero (see `contact.step.spans`); arrays are empty where few bodies
    move, or no one says so.

    rows (c, 4): spans of the rows of each contact; matrices (n, 2): the stretch of each row of inertia,
    metric, stiffness and damping; columns (c, 4) and couplings (n, 2): the same of W and H of the problem
    that was assembled last; place (n + 1,): how many coordinates before each are free there.
    """

    rows: Ints
    matrices: Ints
    columns: Ints
    couplings: Ints
    place: Ints


def allocate_entries(coordinates: int, contacts: int, widths: Widths | None) -> Entries:
    """Entries in no column, or, without `widths`, empty ones."""
    n, c = coordinates, contacts
    return Entries(
        rows=np.zeros((c, 4), np.int64) if widths else NO_SPANS.copy(),
        matrices=np.zeros((n, 2), np.int64) if widths else NO_STRETCHES.copy(),
        columns=np.zeros((c, 4), np.int64) if widths else NO_SPANS.copy(),
        couplings=np.zeros((n, 2), np.int64) if widths else NO_STRETCHES.copy(),
        place=np.zeros(n + 1 if widths else 0, np.int64),
    )


@inner_kernel
def is_crowded(entries: Entries) -> bool:
    return bool(entries.place.shape[0] > 0)


@inner_kernel
def is_free(entries: Entries, i: int) -> bool:
    """Whether coordinate i is free, where entries are known."""
    return bool(entries.place[i + 1] > entries.place[i])


@inner_kernel
def set_spans(table: Ints, k: int, first: int, end: int, second: int, last: int) -> None:
    """Set the spans of contact k, of which the lesser comes first."""
    if second < first:
        first, end, second, last = second, last, first, end
    table[k, 0], table[k, 1], table[k, 2], table[k, 3] = first, end, second, last


@inner_kernel
def clear_rows(entries: Entries, k: int, directions: int, rows: Reals) -> None:
    """Let the rows of contact k, which has so many directions and knows its spans, be zero."""
    n = rows.shape[1]
    for side in range(2):
        first, end, shift = span(entries.rows, k, side, n)
        for r in range(directions * k, directions * k + directions):
            for j in range(first, end):
                rows[r, j - shift] = 0.0


@inner_kernel
def rate(entries: Entries, rows: Reals, r: int, directions: int, v: Reals) -> float:
    """Row r times v, where the row belongs to a contact of so many directions."""
    total = 0.0
    for side in range(2):
        first, end, shift = span(entries.rows, r // directions, side, len(v))
        for j in range(first, end):
            total += rows[r, j - shift] * v[j]
    return total


@kernel
def number_free(entries: Entries, free: Ints, n: int) -> None:
    """Set the place of each coordinate among the n that are `free`."""
    place, at = entries.place, 0
    for i in range(place.shape[0]):
        place[i] = at
        if at < n and free[at] == i:
            at += 1

"""Where rows and matrices of many bodies have entries: a contact touches two bodies, of however many."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np

from rungwise.block import Block
from rungwise.kernel import Ints, Reals, inner_kernel, kernel

CROWDED = 60
"""Velocities from which on a step is taken by its entries, which is faster then."""

Spans: TypeAlias = tuple[int, int, int, int]
"""Two stretches of columns, first..end and first..end, the first before the second."""


class Entries(Block):
    """Columns outside of which all is zero; arrays are empty where few bodies move, or no one says so.

    rows (c, 4): spans of the rows of each contact; matrices (n, 2): the stretch of each row of inertia,
    metric, stiffness and damping; columns (c, 4) and couplings (n, 2): the same of W and H of the problem
    that was assembled last; place (n + 1,): how many coordinates before each are free there.
    """

    rows: Ints
    matrices: Ints
    columns: Ints
    couplings: Ints
    place: Ints


def allocate_entries(coordinates: int, contacts: int, crowded: bool) -> Entries:
    """Entries that fill all columns, or, unless `crowded`, empty ones."""
    n, c = (coordinates, contacts) if crowded else (0, 0)
    return Entries(
        rows=np.zeros((c, 4), np.int64),
        matrices=np.tile(np.array([0, n]), (n, 1)),
        columns=np.zeros((c, 4), np.int64),
        couplings=np.zeros((n, 2), np.int64),
        place=np.zeros(n + 1 if crowded else 0, np.int64),
    )


@inner_kernel
def is_crowded(entries: Entries) -> bool:
    return bool(entries.place.shape[0] > 0)


@inner_kernel
def is_free(entries: Entries, i: int) -> bool:
    """Whether coordinate i is free, where entries are known."""
    return bool(entries.place[i + 1] > entries.place[i])


@inner_kernel
def spans(table: Ints, k: int) -> Spans:
    """The spans of contact k."""
    return table[k, 0], table[k, 1], table[k, 2], table[k, 3]


@inner_kernel
def stretch(entries: Entries, i: int, n: int) -> tuple[int, int]:
    """First column and end of what row i of a matrix of n columns has."""
    if is_crowded(entries):
        return entries.matrices[i, 0], entries.matrices[i, 1]
    return 0, n


@inner_kernel
def set_spans(table: Ints, k: int, first: int, end: int, second: int, last: int) -> None:
    """Set the spans of contact k, of which the lesser comes first."""
    if second < first:
        first, end, second, last = second, last, first, end
    table[k, 0], table[k, 1], table[k, 2], table[k, 3] = first, end, second, last


@inner_kernel
def fill_span(entries: Entries, k: int, n: int) -> None:
    """Let contact k have entries anywhere."""
    if is_crowded(entries):
        set_spans(entries.rows, k, 0, n, n, n)


@inner_kernel
def clear_spans(columns: Ints, k: int, directions: int, rows: Reals) -> None:
    """Let the rows of contact k be zero in its two spans of `columns` (k, 4)."""
    first, end, second, last = spans(columns, k)
    for r in range(directions * k, directions * k + directions):
        for i in range(first, end):
            rows[r, i] = 0.0
        for i in range(second, last):
            rows[r, i] = 0.0


@inner_kernel
def clear_rows(entries: Entries, k: int, directions: int, rows: Reals) -> None:
    """Let the rows of contact k, which has so many directions, be zero."""
    if is_crowded(entries):
        clear_spans(entries.rows, k, directions, rows)
    else:
        for r in range(directions * k, directions * k + directions):
            rows[r, :] = 0.0


@inner_kernel
def rate(entries: Entries, rows: Reals, r: int, directions: int, v: Reals) -> float:
    """rows[r] . v, where row r belongs to a contact of so many directions."""
    total = 0.0
    if is_crowded(entries):
        a, b, c, d = spans(entries.rows, r // directions)
        for i in range(a, b):
            total += rows[r, i] * v[i]
        for i in range(c, d):
            total += rows[r, i] * v[i]
    else:
        for i in range(v.shape[0]):
            total += rows[r, i] * v[i]
    return total


@kernel
def number_free(entries: Entries, free: Ints, n: int) -> None:
    """Set the place of each coordinate among the n that are `free`."""
    place, at = entries.place, 0
    for i in range(place.shape[0]):
        place[i] = at
        if at < n and free[at] == i:
            at += 1

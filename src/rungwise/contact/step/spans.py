"""Where rows of contacts and of matrices have entries, which alone are kept.

The rows of a contact have entries in two spans of columns, and keep the second behind the first; a row of a
matrix has entries in one stretch of columns, and keeps them from its first on. Tables say which: spans (c,
4), first..end and first..end of each contact, the first before the second; stretches (n, 2). A table that is
empty stands for all columns: rows and matrices are dense then.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rungwise.kernel import Ints, Reals, inner_kernel


class Widths(NamedTuple):
    """Columns at most in which the rows of a contact, and a row of a matrix, have entries."""

    rows: int
    matrices: int


NO_SPANS, NO_STRETCHES = np.empty((0, 4), np.int64), np.empty((0, 2), np.int64)
"""Entries may be in any column."""


@inner_kernel
def span(spans: Ints, k: int, side: int, n: int) -> tuple[int, int, int]:
    """First column and end of one of the two spans of contact k, among n columns, and how far from its
    column each entry is kept."""
    if len(spans) == 0:
        return (0, n, 0) if side == 0 else (n, n, 0)
    if side == 0:
        return spans[k, 0], spans[k, 1], spans[k, 0]
    return spans[k, 2], spans[k, 3], spans[k, 2] - (spans[k, 1] - spans[k, 0])


@inner_kernel
def place_in(spans: Ints, k: int, j: int) -> int:
    """Where the rows of contact k keep column j, which is in a span of theirs."""
    if len(spans) == 0:
        return j
    return j - spans[k, 0] if j < spans[k, 1] else j - spans[k, 2] + spans[k, 1] - spans[k, 0]


@inner_kernel
def has_column(spans: Ints, k: int, j: int) -> bool:
    """Whether the rows of contact k have an entry in column j."""
    return bool(len(spans) == 0 or spans[k, 0] <= j < spans[k, 1] or spans[k, 2] <= j < spans[k, 3])


@inner_kernel
def stretch(stretches: Ints, i: int, n: int) -> tuple[int, int]:
    """First column, which is kept first, and end of what row i of a matrix of n columns has."""
    return (stretches[i, 0], stretches[i, 1]) if len(stretches) > 0 else (0, n)


@inner_kernel
def diagonal(matrix: Reals, stretches: Ints, i: int) -> float:
    """Entry (i, i) of a matrix."""
    return matrix[i, i - stretches[i, 0]] if len(stretches) > 0 else matrix[i, i]


@inner_kernel
def entry(matrix: Reals, stretches: Ints, i: int, j: int) -> float:
    """Entry (i, j) of a matrix."""
    first, end = stretch(stretches, i, matrix.shape[1])
    return matrix[i, j - first] if first <= j < end else 0.0


def whole_rows(rows: Reals, spans: Ints, d: int, n: int) -> Reals:
    """Rows (r, n) of contacts of d directions, from what is kept of them (r, w)."""
    if len(spans) == 0:
        return rows[:, :n].copy()
    whole = np.zeros((len(rows), n))
    for k in range(len(rows) // d):
        for side in range(2):
            first, end, shift = span(spans, k, side, n)
            whole[k * d : k * d + d, first:end] = rows[k * d : k * d + d, first - shift : end - shift]
    return whole


def whole_matrix(matrix: Reals, stretches: Ints, n: int) -> Reals:
    """Rows (r, n) of a matrix, from what is kept of them (r, w)."""
    if len(stretches) == 0:
        return matrix[:, :n].copy()
    whole = np.zeros((len(matrix), n))
    for i in range(len(matrix)):
        first, end = stretch(stretches, i, n)
        whole[i, first:end] = matrix[i, : end - first]
    return whole

"""The inverse of a matrix that falls apart into small blocks, and its products with sparse columns.

The inertia of bodies is such a matrix: each body has a block of its own.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rungwise.contact.prepare.components import join, number
from rungwise.contact.problem import Array
from rungwise.kernel import Ints, Reals, kernel

_LARGEST = 12
Sparse = tuple[Ints, Ints, Array]
"""Starts of rows (or columns), columns (or rows) and values."""


def inverse(rows: Sparse) -> Sparse | None:
    """The rows of the inverse of a matrix (n, n); None if the matrix has a large block, or is singular."""
    row_start, column, value = rows
    n = len(row_start) - 1
    label = np.arange(n)
    join(*rows, 0, 1, 0, label)
    width = np.bincount(label, minlength=number(label, n))
    largest = int(width.max(initial=0))
    if largest > _LARGEST:
        return None
    # All blocks are made as wide as the largest, with rows of the identity.
    members, first = np.argsort(label, kind="stable"), np.cumsum(width) - width
    position = np.empty(n, np.int64)
    position[members] = np.arange(n) - first[label[members]]
    dense = np.zeros((len(width), largest, largest))
    block, place = np.nonzero(np.arange(largest) >= width[:, None])
    dense[block, place, place] = 1.0
    some, row = value != 0.0, np.arange(n).repeat(np.diff(row_start))
    dense[label[row[some]], position[row[some]], position[column[some]]] = value[some]
    try:
        inverted = np.linalg.inv(dense)
    except np.linalg.LinAlgError:
        return None
    start = np.concatenate([[0], np.cumsum(width[label])])
    own = np.arange(largest) < width[label][:, None]
    others = np.minimum(first[label][:, None] + np.arange(largest), n - 1)
    return start, members[others][own], np.asarray(inverted[label, position][own], float)


def responses(rows: Sparse, inverted: Sparse, columns: Sparse) -> tuple[Sparse, Array]:
    """Columns of the inverse times the given columns, and how much a second solution changed their values."""
    n = len(rows[0]) - 1
    most = int(np.diff(inverted[0])[columns[1]].sum())
    start, row = np.empty(len(columns[0]), np.int64), np.empty(most, np.int64)
    value, change = np.empty(most), np.empty(most)
    used = respond(*rows, *inverted, *columns, start, row, value, change, np.zeros((3, n)), np.zeros(n, bool))
    return (start, row[:used], value[:used]), change[:used]


@kernel
def respond(
    own_start: Ints,
    own_column: Ints,
    own_value: Reals,
    inverse_start: Ints,
    inverse_column: Ints,
    inverse_value: Reals,
    column_start: Ints,
    column_row: Ints,
    column_value: Reals,
    start: Ints,
    row: Ints,
    value: Reals,
    change: Reals,
    scratch: Reals,
    known: NDArray[np.bool_],
) -> int:
    """Fill start, row, value and change, as `responses` returns them; returns the number of entries.

    scratch (3, n), zero, and known (n,), false, stay so.
    """
    given, found, left = scratch[0], scratch[1], scratch[2]
    used = 0
    for c in range(len(start) - 1):
        first = start[c] = used
        for k in range(column_start[c], column_start[c + 1]):
            given[column_row[k]] = column_value[k]
            for l in range(inverse_start[column_row[k]], inverse_start[column_row[k] + 1]):
                if not known[inverse_column[l]]:
                    known[inverse_column[l]], row[used] = True, inverse_column[l]
                    used += 1
        for i in row[first:used]:
            for l in range(inverse_start[i], inverse_start[i + 1]):
                found[i] += inverse_value[l] * given[inverse_column[l]]
        for i in row[first:used]:
            left[i] = -given[i]
            for l in range(own_start[i], own_start[i + 1]):
                left[i] += own_value[l] * found[own_column[l]]
        for k in range(first, used):
            i = row[k]
            change[k] = 0.0
            for l in range(inverse_start[i], inverse_start[i + 1]):
                change[k] += inverse_value[l] * left[inverse_column[l]]
            value[k] = found[i] - change[k]
        for i in row[first:used]:
            given[i] = found[i] = left[i] = 0.0
            known[i] = False
    start[len(start) - 1] = used
    return used

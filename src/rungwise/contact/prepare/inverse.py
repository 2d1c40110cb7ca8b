"""The inverse of a matrix that falls apart into small blocks, and its products with sparse columns.

The inertia of bodies is such a matrix: each body has a block of its own.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rungwise.contact.prepare.components import join, number
from rungwise.contact.prepare.units import Sparse
from rungwise.contact.problem import Array
from rungwise.kernel import Reals, kernel

_LARGEST = 12


def inverse(rows: Sparse) -> Sparse | None:
    """The rows of the inverse of a matrix (n, n); None if the matrix has a large block, or is singular."""
    row_start, column, value = rows
    n = len(row_start) - 1
    label = np.arange(n)
    join(rows, 0, 1, 0, label)
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
    return Sparse(start, members[others][own], np.asarray(inverted[label, position][own], float))


def responses(rows: Sparse, inverted: Sparse, columns: Sparse) -> tuple[Sparse, Array]:
    """Columns of the inverse times the given columns, and how much a second solution changed their values."""
    n = len(rows.start) - 1
    most = int(np.diff(inverted.start)[columns.place].sum())
    found = Sparse(np.empty(len(columns.start), np.int64), np.empty(most, np.int64), np.empty(most))
    change = np.empty(most)
    used = respond(rows, inverted, columns, found, change, np.zeros((3, n)), np.zeros(n, bool))
    return Sparse(found.start, found.place[:used], found.value[:used]), change[:used]


@kernel
def respond(
    own: Sparse,
    inverted: Sparse,
    columns: Sparse,
    response: Sparse,
    change: Reals,
    scratch: Reals,
    known: NDArray[np.bool_],
) -> int:
    """Fill the response and its change, as `responses` returns them; returns the number of entries.

    scratch (3, n), zero, and known (n,), false, stay so.
    """
    given, found, left = scratch[0], scratch[1], scratch[2]
    row, used = response.place, 0
    for c in range(len(response.start) - 1):
        first = response.start[c] = used
        for k in range(columns.start[c], columns.start[c + 1]):
            i = columns.place[k]
            given[i] = columns.value[k]
            for l in range(inverted.start[i], inverted.start[i + 1]):
                if not known[inverted.place[l]]:
                    known[inverted.place[l]], row[used] = True, inverted.place[l]
                    used += 1
        for i in row[first:used]:
            for l in range(inverted.start[i], inverted.start[i + 1]):
                found[i] += inverted.value[l] * given[inverted.place[l]]
        for i in row[first:used]:
            left[i] = -given[i]
            for l in range(own.start[i], own.start[i + 1]):
                left[i] += own.value[l] * found[own.place[l]]
        for k in range(first, used):
            i = row[k]
            change[k] = 0.0
            for l in range(inverted.start[i], inverted.start[i + 1]):
                change[k] += inverted.value[l] * left[inverted.place[l]]
            response.value[k] = found[i] - change[k]
        for i in row[first:used]:
            given[i] = found[i] = left[i] = 0.0
            known[i] = False
    response.start[len(response.start) - 1] = used
    return used

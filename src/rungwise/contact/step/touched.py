"""Which coordinates the rows of a step's problem touch, where each touches few of many."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rungwise.contact.step.problem import ContactProblem, Sizes
from rungwise.kernel import Ints, Reals, allocating_kernel, inner_kernel


class Touched(NamedTuple):
    """Coordinates that rows touch: those of contact or, after all contacts, limited row g are
    coordinate[first[g]:first[g + 1]]; outside of begin to end (n,) the rows of H are zero."""

    first: Ints
    coordinate: Ints
    begin: Ints
    end: Ints


@allocating_kernel
def touch(problem: ContactProblem, sizes: Sizes, columns: Ints, couplings: Ints) -> Touched:
    """The coordinates that the rows in use touch. Those of contact k are looked for in the columns of two
    spans, `columns` (k, 4), and the entries of a row of H in the stretch `couplings` (n, 2); everywhere where
    these are empty."""
    p, (n, contacts, limited) = problem, sizes
    d, known = p.R.shape[1], len(couplings) > 0
    room = limited * n
    for k in range(contacts):
        room += columns[k, 1] - columns[k, 0] + columns[k, 3] - columns[k, 2] if known else n
    first, coordinate = np.empty(contacts + limited + 1, np.int64), np.empty(room, np.int64)
    begin, end, meets, count = np.zeros(n, np.int64), np.full(n, n), np.zeros(n, np.bool_), 0
    for g in range(contacts + limited):
        first[g] = count
        if g >= contacts:
            count = _meet(p.S, g - contacts, g - contacts + 1, 0, n, meets, coordinate, count)
        elif known:
            for side in range(0, 4, 2):
                low, high = columns[g, side], columns[g, side + 1]
                count = _meet(p.W, g * d, g * d + d, low, high, meets, coordinate, count)
        else:
            count = _meet(p.W, g * d, g * d + d, 0, n, meets, coordinate, count)
    first[contacts + limited] = count
    for i in range(n):
        if known:
            begin[i], end[i] = couplings[i, 0], couplings[i, 1]
        else:
            _narrow(p.H, i, begin, end)
    return Touched(first, coordinate, begin, end)


@inner_kernel
def _meet(
    rows: Reals,
    first: int,
    last: int,
    low: int,
    high: int,
    meets: NDArray[np.bool_],
    coordinate: Ints,
    count: int,
) -> int:
    """Append the columns from low to high in which these rows have an entry; `meets` (n,) is false before and
    after. Returns how many coordinates there are then."""
    for r in range(first, last):
        for j in range(low, high):
            meets[j] |= rows[r, j] != 0.0
    for j in range(low, high):
        if meets[j]:
            coordinate[count] = j
            count += 1
            meets[j] = False
    return count


@inner_kernel
def _narrow(H: Reals, i: int, begin: Ints, end: Ints) -> None:
    """Leave out what is zero at both ends of row i."""
    while begin[i] < i and H[i, begin[i]] == 0.0:
        begin[i] += 1
    while end[i] > i + 1 and H[i, end[i] - 1] == 0.0:
        end[i] -= 1

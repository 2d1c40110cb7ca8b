"""Lemke's method: complementary pivoting on 0 <= z _|_ M z + q >= 0, with lexicographic ratio test.

Sources: Lemke, Management Science 11 (1965) 681-689; Cottle, Pang, Stone: The Linear Complementarity Problem
(1992), section 4.9. Promises: ends within 50 + 20 n pivots; solves copositive-plus problems that have a
solution; a ray is a hint that there is none, not a proof.
"""

from __future__ import annotations

import numpy as np

from rungwise.kernel import Ints, Reals, kernel

_PIVOT = 1e-12
"""The least coefficient to divide by, in a problem whose diagonals are about one."""
_TIE = 1e-12
"""Difference of two ratios, relative to the larger, that is rounding."""


@kernel
def lemke(
    M: Reals, q: Reals, covering: Reals, z: Reals, a: Reals, place: Ints, halt: Ints
) -> tuple[bool, int]:
    """Fill z (n,) with 0 <= z _|_ M z + q >= 0; whether it ended there, and the pivots made. It gives up when
    halt (1,) is set.

    Unknowns are w (0 .. n - 1), z (n .. 2 n - 1) and z0 (2 n) of w - M z - covering z0 = q. Scratch:
    a (n, n + 2), for each basic one the coefficients of those that are zero, and its value; place (4 n + 2,),
    of each unknown (its column, or -1 - its row where it is basic), then the unknown of each row and column.
    """
    n, row, least = len(q), -1, 0.0
    basic, idle = place[2 * n + 1 : 3 * n + 1], place[3 * n + 1 : 4 * n + 2]
    for i in range(n):
        basic[i], idle[i], place[i], place[n + i] = i, n + i, -1 - i, i
        for j in range(n):
            a[i, j] = -M[i, j]
        a[i, n], a[i, n + 1] = -covering[i], q[i]
        z[i] = q[i] / covering[i]
        if z[i] < least:
            row, least = i, z[i]
    if row < 0:
        z[:] = 0.0
        return True, 0
    idle[n], place[2 * n], column = 2 * n, n, n
    for pivots in range(1, 50 + 20 * n):
        if halt[0] != 0:
            return False, pivots
        _exchange(a, row, column)
        leaving, entering = basic[row], idle[column]
        basic[row], idle[column], place[leaving], place[entering] = entering, leaving, column, -1 - row
        if leaving == 2 * n:
            z[:] = 0.0
            for i in range(n):
                if basic[i] >= n:
                    z[basic[i] - n] = max(a[i, n + 1], 0.0)
            return True, pivots
        column = place[leaving + n if leaving < n else leaving - n]
        row = _leaving_row(a, column, basic, place, z)
        if row < 0:
            return False, pivots
    return False, 50 + 20 * n


@kernel
def _exchange(a: Reals, row: int, column: int) -> None:
    """The unknowns of this row and column change places."""
    own, inverse = a[row], 1.0 / a[row, column]
    own[column] = 1.0
    for j in range(len(own)):
        own[j] *= inverse
    for i in range(len(a)):
        factor = a[i, column]
        if i != row and factor != 0.0:
            a[i, column] = 0.0
            for j in range(len(own)):
                a[i, j] -= factor * own[j]


@kernel
def _leaving_row(a: Reals, column: int, basic: Ints, place: Ints, ratio: Reals) -> int:
    """Least ratio; among ties the artificial unknown, else the lexicographic least. -1 on a ray."""
    n, least = len(a), np.inf
    for i in range(n):
        ratio[i] = max(a[i, n + 1], 0.0) / a[i, column] if a[i, column] > _PIVOT else np.inf
        least = min(least, ratio[i])
    if least == np.inf:
        return -1
    best, slack = -1, _TIE * (1.0 + abs(least))
    for i in range(n):
        if ratio[i] <= least + slack:
            if basic[i] == 2 * n:
                return i
            if best < 0 or _precedes(a, i, best, column, place):
                best = i
    return best


@kernel
def _precedes(a: Reals, i: int, other: int, column: int, place: Ints) -> bool:
    """Whether row i of the basis' inverse, over its pivot, is lexicographically less than the other's."""
    for j in range(len(a)):
        at = place[j]
        mine = (a[i, at] if at >= 0 else 1.0 if at == -1 - i else 0.0) / a[i, column]
        its = (a[other, at] if at >= 0 else 1.0 if at == -1 - other else 0.0) / a[other, column]
        if abs(mine - its) > _TIE * (1.0 + abs(its)):
            return bool(mine < its)
    return False

"""The velocities that a large system hides: A of low rank as a product, in which linear systems are smaller.

Algorithm: elimination with the largest diagonal entry as pivot, until only rounding is left: then A = A[:, I]
A[I, I]^-1 A[I, :], I the pivots. A has such a low rank where bodies touch at more points than they need and
only forces are given. Sources: Golub and Van Loan, Matrix Computations (2013), section 4.2.8; Goreinov,
Tyrtyshnikov, Zamarashkin, Linear Algebra Appl. 261 (1997) 1-21. Promises: parts whose product is A, or none.
"""

from __future__ import annotations

from weakref import WeakKeyDictionary

import numpy as np

from rungwise.contact.prepare.product import FEW, Condensed
from rungwise.contact.prepare.system import System
from rungwise.contact.prepare.units import compressed
from rungwise.contact.problem import Array
from rungwise.kernel import Ints, Reals, kernel

_SMALL, _LARGE, _MOST = 200, 5000, 1500
_FULL = 0.01
"""Share of entries from which on arithmetic in blocks takes less time than elimination that skips zeros, in
symmetric A; chosen by trial."""
_NOTHING, _SOMETHING = 1e-11, 1e-6
"""Pivots below the first are rounding, and none may lie between the two: the rank would be a matter of taste.
In units in which A has a diagonal of about one; both chosen by trial, to a decade."""
_TINY = 1e-14
"""Entries that elimination skips, in the same units: about a hundred roundings of double precision, and a
thousandth of `_NOTHING`. Chosen by trial, to a decade."""

_known: WeakKeyDictionary[System, Condensed | None] = WeakKeyDictionary()


def parts(system: System) -> Condensed | None:
    """A's parts, from elimination or found here, once; None where there are none, or where free unknowns are
    left, whose laws have no blocks of their own."""
    if system.condensed is not None or not _SMALL < system.size <= _LARGE or system.has_free:
        return system.condensed
    if system not in _known:
        _known[system] = _found(system)
    return _known[system]


def _found(system: System) -> Condensed | None:
    A, most = system.dense(), min(_MOST, system.size // FEW)
    if len(system.form.entries.value) > _FULL * A.size and (A == A.T).all():
        pivots = _cholesky(A)
        rank = len(pivots)
    else:
        pivots = np.empty(most + 1, np.int64)
        rank = eliminate(A.copy(), pivots, _NOTHING, _SOMETHING, np.empty((2, len(A)), np.int64))
    if not 0 < rank <= most:
        return None
    chosen = np.sort(pivots[:rank])
    back, across = np.ascontiguousarray(-A[:, chosen]), np.ascontiguousarray(A[chosen].T)
    own, front = np.ascontiguousarray(A[np.ix_(chosen, chosen)]), np.zeros((len(A), 3))
    return Condensed(own, front, compressed(back), compressed(across))


def _cholesky(A: Array) -> Ints:
    """The pivots of elimination in a symmetric A (N, N), in blocks; none if the rank is unclear."""
    from scipy.linalg.lapack import dpstrf

    factor, order, rank, _ = dpstrf(A, tol=_NOTHING)
    order = order.astype(np.int64) - 1
    chosen, others = order[:rank], order[rank:]
    left = A[np.ix_(others, others)] - factor[:rank, rank:].T @ factor[:rank, rank:]
    least = float(factor.diagonal()[:rank].min(initial=np.inf)) ** 2
    is_clear = least >= _SOMETHING and np.abs(left).max(initial=0.0) <= _NOTHING
    found: Ints = chosen if is_clear else chosen[:0]
    return found


@kernel
def eliminate(A: Reals, pivots: Ints, nothing: float, something: float, scratch: Ints) -> int:
    """Eliminate in A (N, N) while there is room for pivots; returns their number, 0 if the rank is
    unclear."""
    n, left, used = len(A), scratch[0], scratch[1]
    for i in range(n):
        left[i] = i
    for rank in range(len(pivots)):
        best = 0
        for i in range(1, n):
            if A[left[i], left[i]] > A[left[best], left[best]]:
                best = i
        p = left[best]
        pivot = A[p, p] if n > 0 else 0.0
        if pivot <= nothing:
            return rank if _is_nothing(A, left, n, nothing) else 0
        if pivot < something:
            return 0
        pivots[rank] = p
        n -= 1
        left[best] = left[n]
        count = 0
        for i in range(n):
            if abs(A[p, left[i]]) > _TINY:
                used[count] = left[i]
                count += 1
        for i in range(n):
            row = left[i]
            if abs(A[row, p]) > _TINY:
                factor = A[row, p] / pivot
                for k in range(count):
                    A[row, used[k]] -= factor * A[p, used[k]]
    return len(pivots)


@kernel
def _is_nothing(A: Reals, left: Ints, n: int, nothing: float) -> bool:
    for i in range(n):
        for j in range(n):
            if not abs(A[left[i], left[j]]) <= nothing:
                return False
    return True

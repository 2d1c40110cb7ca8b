"""Linear systems with E + L A, solved in the velocities that were eliminated from A.

Algorithm: A = F - B own^-1 C with F and E + L F in the blocks of contacts, so that a system of the size of
`own` is left (the identity of Sherman, Morrison and Woodbury). Source: Golub and Van Loan, Matrix
Computations (2013), section 2.1.4. Promises: the solution unless a block is singular; where blocks are nearly
so, to fewer digits.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from scipy.linalg.lapack import dgetrf, dgetrs

from rungwise.contact.linear import factorise, substitute_many
from rungwise.contact.prepare.product import Condensed
from rungwise.contact.prepare.units import Sparse
from rungwise.contact.problem import Array
from rungwise.contact.solvers.newton.factors import (
    FULL,
    Factors,
    dense_entries,
    diagonal_factors,
    factors,
    orientation,
)
from rungwise.kernel import Ints, Reals, kernel

_SMALL, _FULL = 200, 0.4
"""Number of velocities, and share of entries, up to which zeros are skipped: else LAPACK is faster.
Chosen by trial."""
_PIVOT = 0.01
"""Pivots are on the diagonal where its entry is at least this share of the largest entry below. Bodies touch
few others, and other pivots fill the factors with two to seven times as many entries for hundreds of
bodies. Chosen by trial, to a decade."""


def solver(c: Condensed, rows: int, d: int, E: Array, L: Array) -> Factors | None:
    """Factors of E + L A; E and L (N, 3) hold the rows of their blocks. None if singular."""
    size, g = len(E), c.own.shape[0]
    M, P = np.empty((size, 3)), np.empty((size, 3))
    blocks = invert(E, L, c.front, rows, d, M, P)
    if blocks == 0:
        return None
    if sp.issparse(c.own):
        B, C = (sp.csr_array(part[::-1], shape=(size, g)) for part in (c.back, c.across))
        G = c.own - C.T @ (diagonal_blocks(P, rows, d) @ B)
        within = factors(G) if G.nnz > FULL * g * g else diagonal_factors(G, _PIVOT)
    else:
        G = c.own.copy()
        condense(P, rows, d, c.back, c.across, G, np.full(g, -1), np.empty(g, np.int64), np.empty(g))
        within = _dense_factors(G)
    if within is None:
        return None

    def solve(right: Array) -> Array:
        x, drive = np.empty(size), np.zeros(g)
        push(M, right, rows, d, c.across, x, drive)
        pull(P, within.solve(drive), rows, d, c.back, x)
        return x

    return Factors(solve, blocks * within.sign, within.entries)


def _dense_factors(G: Array) -> Factors | None:
    """Factors of G (g, g), which is spent; None if singular."""
    g = len(G)
    if g > _SMALL and np.count_nonzero(G) >= _FULL * G.size:
        factor, exchanges, fault = dgetrf(G.T, overwrite_a=True)
        if fault:
            return None
        sign = orientation(factor.diagonal(), exchanges)
        return Factors(lambda v: np.asarray(dgetrs(factor, exchanges, v, trans=1)[0]), sign, dense_entries(g))
    order = np.empty(g, np.int64)
    sign = triangular(G, order)

    def solve(v: Array) -> Array:
        substitute_many(G, g, order, v)
        return v

    return Factors(solve, sign, dense_entries(g)) if sign else None


def diagonal_blocks(values: Array, rows: int, d: int) -> sp.csr_array:
    """The matrix whose blocks of contacts, and single others, have these rows (N, 3)."""
    size, i = len(values), np.arange(len(values))
    width = np.where(i < rows, d, 1)
    column = np.where(i < rows, i - i % d, i)[:, None] + np.arange(3)
    used = np.arange(3) < width[:, None]
    start = np.concatenate([[0], np.cumsum(width)])
    return sp.csr_array((values[used], column[used], start), shape=(size, size))


@kernel
def invert(E: Reals, L: Reals, front: Reals, rows: int, d: int, M: Reals, P: Reals) -> int:
    """Fill M = (E + L F)^-1 and P = M L in blocks; returns the sign of det (E + L F)."""
    first, sign = 0, 1
    while first < len(E):
        width = d if first < rows else 1
        determinant = _invert(E, L, front, first, width, M)
        if not abs(determinant) > 0.0:
            return 0
        sign = -sign if determinant < 0.0 else sign
        for i in range(first, first + width):
            for j in range(width):
                P[i, j] = 0.0
                for k in range(width):
                    P[i, j] += M[i, k] * L[first + k, j]
        first += width
    return sign


@kernel
def triangular(G: Reals, order: Ints) -> int:
    """Replace G (g, g) by its triangular factors; returns the sign of its determinant, 0 if singular."""
    if not factorise(G, len(G), order):
        return 0
    sign = 1
    for k in range(len(G)):
        if (G[k, k] < 0.0) != (order[k] != k):
            sign = -sign
    return sign


@kernel
def condense(
    P: Reals,
    rows: int,
    d: int,
    back: Sparse,
    across: Sparse,
    G: Reals,
    place: Ints,
    used: Ints,
    sums: Reals,
) -> None:
    """Take C P B from G; place (g,), negative, used (g,) and sums (g,) are scratch, g the size of G."""
    first = 0
    while first < len(P):
        width = d if first < rows else 1
        count = _columns(back.place, back.start[first], back.start[first + width], place, used)
        for i in range(first, first + width):
            for k in range(count):
                sums[k] = 0.0
            for j in range(width):
                if P[i, j] != 0.0:
                    for k in range(back.start[first + j], back.start[first + j + 1]):
                        sums[place[back.place[k]]] += P[i, j] * back.value[k]
            for l in range(across.start[i], across.start[i + 1]):
                row = G[across.place[l]]
                for k in range(count):
                    row[used[k]] -= across.value[l] * sums[k]
        for k in range(count):
            place[used[k]] = -1
        first += width


@kernel
def _columns(column: Ints, start: int, end: int, place: Ints, used: Ints) -> int:
    """List in `used` the columns of these entries, each once, and in `place` their places; returns how
    many."""
    count = 0
    for k in range(start, end):
        if place[column[k]] < 0:
            place[column[k]], used[count] = count, column[k]
            count += 1
    return count


@kernel
def _invert(E: Reals, L: Reals, front: Reals, first: int, width: int, M: Reals) -> float:
    """Rows of M = (E + L front)^-1 in one block, by adjugates; returns the determinant of E + L front."""
    t = M[first : first + width]
    for i in range(width):
        for j in range(width):
            t[i, j] = E[first + i, j]
            for k in range(width):
                t[i, j] += L[first + i, k] * front[first + k, j]
    if width == 1:
        determinant = t[0, 0]
        t[0, 0] = 1.0
    elif width == 2:
        determinant = t[0, 0] * t[1, 1] - t[0, 1] * t[1, 0]
        t[0, 0], t[1, 1], t[0, 1], t[1, 0] = t[1, 1], t[0, 0], -t[0, 1], -t[1, 0]
    else:
        a, b, c, e, f, g, h, k, l = (
            t[0, 0], t[0, 1], t[0, 2], t[1, 0], t[1, 1], t[1, 2], t[2, 0], t[2, 1], t[2, 2],
        )  # fmt: skip
        t[0, 0], t[0, 1], t[0, 2] = f * l - g * k, c * k - b * l, b * g - c * f
        t[1, 0], t[1, 1], t[1, 2] = g * h - e * l, a * l - c * h, c * e - a * g
        t[2, 0], t[2, 1], t[2, 2] = e * k - f * h, b * h - a * k, a * f - b * e
        determinant = a * t[0, 0] + b * t[1, 0] + c * t[2, 0]
    for i in range(width):
        for j in range(width):
            t[i, j] /= determinant
    return float(determinant)


@kernel
def push(M: Reals, right: Reals, rows: int, d: int, across: Sparse, x: Reals, drive: Reals) -> None:
    """x = M right; drive = C x."""
    for i in range(len(x)):
        first, width = (i // d * d, d) if i < rows else (i, 1)
        x[i] = 0.0
        for j in range(width):
            x[i] += M[i, j] * right[first + j]
        for l in range(across.start[i], across.start[i + 1]):
            drive[across.place[l]] += across.value[l] * x[i]


@kernel
def pull(P: Reals, v: Reals, rows: int, d: int, back: Sparse, x: Reals) -> None:
    """x += P B v."""
    for i in range(len(x)):
        total = 0.0
        for k in range(back.start[i], back.start[i + 1]):
            total += back.value[k] * v[back.place[k]]
        first, width = (i // d * d, d) if i < rows else (i, 1)
        for a in range(first, first + width):
            x[a] += P[a, i - first] * total

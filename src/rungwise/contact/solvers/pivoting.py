"""Complementary pivoting for polyhedral problems: LCPs, mixed LCPs, boxes, planar friction.

Algorithm: Lemke's method with lexicographic ratio test, on the linear complementarity problem to which the
laws unfold (a planar contact has four unknowns: normal, two ways of friction, slip). Where it ends on a ray,
which says little unless the matrix is copositive, every basis of few unknowns is tried, and other covering
vectors for many. Sources: Lemke, Management Science 11 (1965) 681-689; Cottle, Pang, Stone: The Linear
Complementarity Problem (1992), chapter 4. Accepts: contacts of one or two directions and any limits, up to
`LARGEST` unknowns; A need not be symmetric or definite. Promises: ends within a stated number of pivots;
solves copositive-plus problems that have a solution, problems of up to `_ALL` unknowns with an isolated
solution, and often others; a ray is only a hint.
"""

from __future__ import annotations

import math
from functools import cache
from typing import NamedTuple
from weakref import WeakKeyDictionary

import numpy as np

from rungwise.contact.lemke import lemke
from rungwise.contact.linear import solve_in_place
from rungwise.contact.prepare.system import System
from rungwise.contact.problem import Array
from rungwise.contact.solvers.measure import natural
from rungwise.contact.solvers.work import Work
from rungwise.kernel import Ints, Reals, kernel

NAME = "pivoting"
LARGEST = 400
"""Most unknowns, unfolded; chosen by trial, for speed."""
_TRIES, _ALL = 6, 10
"""Most covering vectors; and unknowns up to which all bases are tried, 2^10 at most. Chosen by trial."""


def accepts(system: System) -> bool:
    return (system.directions < 3 or len(system.mu) == 0) and _unfolded_size(system) <= LARGEST


@np.errstate(all="ignore")  # iterates that run away are judged, not warned about
def solve(system: System, start: Array, tol: float, work: Work) -> tuple[Array, int]:
    """The best of the points x (N,) at which pivoting ended, or `start`; and the pivots made."""
    unfolded = unfold(system)
    n = len(unfolded.q)
    z = np.empty(n)
    pivots = pivot(unfolded.M, unfolded.q, coverings(n), 0.3 * tol, z, *workspace(n), work.halt)
    work.spend(pivots * 2.0 * n**2)
    x = unfolded.folded(z)
    return (x if natural(system, x) < natural(system, start) else start), pivots


class Unfolded(NamedTuple):
    """0 <= z _|_ M z + q >= 0; x is `origin` and sign_j z_j in row_j of each j, or nothing if that is < 0."""

    row: Ints
    sign: Array
    origin: Array
    M: Array
    q: Array

    def folded(self, z: Array) -> Array:
        """x (N,)."""
        x = np.empty(len(self.origin))
        fold(self.row, self.sign, self.origin, z, x)
        return x


def workspace(n: int) -> tuple[Array, Array, Ints]:
    """Scratch for `pivot` with n unknowns."""
    return np.empty(n), np.empty((n, n + 2)), np.empty(4 * n + 2, np.int64)


@cache
def coverings(n: int) -> Array:
    """Positive vectors (tries, n), the first all ones; the others differ by powers of the golden ratio."""
    each = np.arange(_TRIES)[:, None] * np.arange(1, n + 1)
    return np.where(each == 0, 1.0, 0.2 + np.modf(each * 0.6180339887498949)[0])


def _unfolded_size(system: System) -> int:
    return int(unfolded_size(len(system.mu), system.directions, system.lower, system.upper))


@kernel
def unfolded_size(contacts: int, d: int, lower: Reals, upper: Reals) -> int:
    """A planar contact makes four unknowns; two limits make two, and no limit too."""
    size = contacts * (4 if d == 2 else 1)
    for j in range(len(lower)):
        size += 2 if (lower[j] > -math.inf) == (upper[j] < math.inf) else 1
    return size


_unfolded: WeakKeyDictionary[System, Unfolded] = WeakKeyDictionary()


def unfold(system: System) -> Unfolded:
    """The linear complementarity problem of a system, made once."""
    made = _unfolded.get(system)
    if made is None:
        s, n = system, _unfolded_size(system)
        made = Unfolded(np.empty(n, np.int64), np.ones(n), np.zeros(s.size), np.zeros((n, n)), np.zeros(n))
        unfold_into(s.dense(), s.b, s.mu, s.directions, s.lower, s.upper, *made)
        _unfolded[system] = made
    return made


@kernel
def unfold_into(
    A: Reals,
    b: Reals,
    mu: Reals,
    d: int,
    lower: Reals,
    upper: Reals,
    row: Ints,
    sign: Reals,
    origin: Reals,
    M: Reals,
    q: Reals,
) -> None:
    """Fill the fields of `Unfolded`; sign is one before, origin, M and q are zero."""
    at = 0
    for k in range(len(mu)):
        row[at] = k * d
        if d == 2:
            slip = at + 3
            row[at + 1], row[at + 2], row[slip], sign[at + 2] = 2 * k + 1, 2 * k + 1, -1, -1.0
            for i in (at + 1, at + 2):
                M[i, slip], M[slip, i] = 1.0, -1.0
            M[slip, at] = mu[k]
        at += 4 if d == 2 else 1
    for j in range(len(lower)):
        i, below, above = d * len(mu) + j, lower[j] > -math.inf, upper[j] < math.inf
        row[at] = i
        sign[at] = 1.0 if below or not above else -1.0
        origin[i] = lower[j] if below else upper[j] if above else 0.0
        if below and above:
            M[at, at + 1], M[at + 1, at], q[at + 1], row[at + 1] = 1.0, -1.0, upper[j] - lower[j], -1
        elif not below and not above:
            row[at + 1], sign[at + 1] = i, -1.0
        at += 2 if below == above else 1
    for i in range(len(q)):
        if row[i] < 0:
            continue
        rate = b[row[i]]
        for j in range(len(origin)):
            rate += A[row[i], j] * origin[j]
        q[i] += sign[i] * rate
        for j in range(len(q)):
            if row[j] >= 0:
                M[i, j] += sign[i] * sign[j] * A[row[i], row[j]]


@kernel
def fold(row: Ints, sign: Reals, origin: Reals, z: Reals, x: Reals) -> None:
    """Fill x (N,); see `Unfolded`."""
    for i in range(len(x)):
        x[i] = origin[i]
    for j in range(len(z)):
        if row[j] >= 0:
            x[row[j]] += sign[j] * z[j]


@kernel
def pivot(
    M: Reals, q: Reals, coverings: Reals, tol: float, best: Reals, z: Reals, tableau: Reals, place: Ints,
    halt: Ints,
) -> int:  # fmt: skip
    """Fill `best` (n,) with 0 <= z _|_ M z + q >= 0 as far as found, to `tol`; returns the pivots.

    A sweep is enough where unknowns do not depend on each other. Where Lemke's method ends on a ray, few
    unknowns are tried in every basis, many from other vectors, until halt (1,) is set.
    """
    n, total = len(q), 0
    for i in range(n):
        best[i] = 0.0
    _sweep(M, q, z)
    if _keep_better(M, q, z, best, tol) < tol:
        return total
    least = math.inf
    for attempt in range(len(coverings)):
        ended, pivots = lemke(M, q, coverings[attempt], z, tableau, place, halt)
        total += pivots
        if ended:
            least = _keep_better(M, q, z, best, least)
        if least <= tol:
            return total
        if n <= _ALL:
            break
    for chosen in range(1 << n if n <= _ALL else 0):
        total += 1
        _solve_basis(M, q, chosen, z, tableau, place)
        least = _keep_better(M, q, z, best, least)
        if least <= tol:
            break
    return total


@kernel
def _sweep(M: Reals, q: Reals, z: Reals) -> None:
    """Fill each unknown that its own row and the unknowns before it determine; the others are zero."""
    for i in range(len(q)):
        w = q[i]
        for j in range(i):
            w += M[i, j] * z[j]
        z[i] = -w / M[i, i] if w < 0.0 < M[i, i] else 0.0


@kernel
def _keep_better(M: Reals, q: Reals, z: Reals, best: Reals, least: float) -> float:
    """The norm of min(z, M z + q), if this is less than `least`, with z kept; else `least`."""
    total = 0.0
    for i in range(len(q)):
        w = q[i]
        for j in range(len(q)):
            w += M[i, j] * z[j]
        total += min(z[i], w) ** 2
        if not total < least * least:
            return least
    for i in range(len(q)):
        best[i] = z[i]
    return math.sqrt(total)


@kernel
def _solve_basis(M: Reals, q: Reals, chosen: int, z: Reals, a: Reals, order: Ints) -> None:
    """z with M z + q = 0 in the rows whose bit is in `chosen`, and zero elsewhere."""
    n, size = len(q), 0
    for i in range(n):
        z[i] = 0.0
        if chosen >> i & 1:
            column = 0
            for j in range(n):
                if chosen >> j & 1:
                    a[size, column] = M[i, j]
                    column += 1
            a[size, column] = -q[i]
            size += 1
    solve_in_place(a, size, 1, order)
    row = 0
    for i in range(n):
        if chosen >> i & 1:
            z[i] = a[row, size]
            row += 1

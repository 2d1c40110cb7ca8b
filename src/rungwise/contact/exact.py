"""Answers made exact in every row that they have: the equations of their modes, refined in doubled precision.

Where an answer is known to a few digits, it says which piece of each law holds: a force at its limit, a rate
that is zero, friction along a slip. These are as many linear equations as there are unknowns. Iterative
refinement whose residuals and unknowns have twice the digits finds each unknown to the last digit, and not
only beside the largest: a row of small unknowns holds as well as any other. An unknown that shrinks with
every correction is zero. Where the equations do not determine all unknowns, the least change that meets them
is made.

What no row feels may have any size: it is brought within its limits (`clip`). What is rounding beside the
largest unknown, each in its own magnitude, is zero (`calm`): then rows that have no other terms hold exactly.

Sources: Higham, Accuracy and Stability of Numerical Algorithms (2002), chapter 12; Ogita, Rump,
Oishi, SIAM J. Sci. Comput. 26 (2005) 1955-1988, for the sums. Accepts: up to `LARGEST` unknowns. Promises:
nothing; the judge compares.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from rungwise.contact.judge.residuals import magnitudes_of, own_units
from rungwise.contact.prepare.magnitudes import Magnitudes, largest, magnitudes
from rungwise.contact.prepare.units import Sparse, compressed
from rungwise.contact.problem import Array, Laws, Problem
from rungwise.kernel import Reals, kernel

NOTHING = 2.0**-49
"""Share of the largest unknown that is rounding, in magnitudes: sixteen roundings of double precision."""
LARGEST = 400
"""Unknowns up to which dense steps, or a dense inverse, take little time; chosen by trial."""
_ROUNDS, _LEAST = 6, 0.1
"""Most corrections; and the least factor by which each must be smaller than the last. By trial."""
_ZERO = 2.0**-30
"""A last correction larger than this share of an unknown tells that the unknown is zero: others are known to
some fifty digits of base two by then."""
_REGULAR, _RANK = 1e-3, 1e-13
"""Largest error of an inverse, and the least singular value over the greatest, below which rows count as
dependent: about a thousand roundings of double precision."""
_NEARLY = 2.0**-40
"""Share of the largest unknown, in magnitudes, from which on an unknown is kept at first; chosen by trial."""
_SPLIT = 2.0**27 + 1.0
"""Splits a double into two halves of 26 digits (Dekker)."""


@np.errstate(all="ignore")  # what is not finite is judged
def exact(problem: Problem, x: Array) -> Array:
    """The solution (N,) of the equations of the modes of x; or x where there is none."""
    if len(x) > LARGEST:
        return x
    x = calmed(problem, x, _NEARLY)
    K, offset = equations(problem, x, problem.A @ x + problem.b)
    rows = compressed(K)
    sizes = magnitudes(rows, offset, Laws(np.zeros(0), 1, np.full(len(x), -np.inf), np.full(len(x), np.inf)))
    row, column = sizes.row, sizes.column
    inverse = _inverse(K * column / row[:, None])
    high, low, left = x.copy(), np.zeros(len(x)), np.empty(len(x))
    change, before = np.zeros(len(x)), np.inf
    for _ in range(_ROUNDS):
        remainders(rows, offset, high, low, left)
        found = inverse @ (left / row)
        size = float(np.abs(found).max(initial=0.0))
        if not size <= _LEAST * before:
            break
        change, before = column * found, size
        add(change, high, low)
    else:
        size = 0.0
    if not np.isfinite(high).all() or not size <= 2.0**-60 * float(np.abs(high / column).max(initial=0.0)):
        return x
    return np.where(np.abs(change) > _ZERO * np.abs(high), 0.0, high)


def equations(problem: Problem, x: Array, y: Array) -> tuple[Array, Array]:
    """K (N, N) and k (N,): K x + k = 0 holds in the modes of x (N,)."""
    p, d, rows = problem, problem.directions, problem.rows
    K = p.A.toarray() if sp.issparse(p.A) else p.A.copy()
    k, (rate, force) = p.b.copy(), own_units(problem, x)
    ahead = x / force - y / rate
    lower, upper = p.lower / force[rows:], p.upper / force[rows:]
    below, above = ahead[rows:] <= lower, ahead[rows:] >= upper
    for held, limit in ((below, p.lower), (above & ~below, p.upper)):
        at = rows + np.flatnonzero(held)
        K[at], k[at] = 0.0, -limit[held]
        K[at, at] = 1.0
    for first, mu in zip(range(0, rows, d), p.mu, strict=True):
        normal, along = max(float(ahead[first]), 0.0), ahead[first + 1 : first + d]
        size = float(np.linalg.norm(along))
        slides = range(first + (normal > 0.0), first + d) if size > mu * normal or normal == 0.0 else ()
        for i in slides:
            K[i], k[i], K[i, i] = 0.0, 0.0, 1.0
            if normal > 0.0:
                K[i, first] = -mu * ahead[i] / size
    return K, k


def _inverse(A: Array) -> Array:
    try:
        made = np.asarray(np.linalg.inv(A), np.float64)
        if np.abs(A @ made - np.eye(len(A))).max(initial=0.0) <= _REGULAR:
            return made
    except np.linalg.LinAlgError:
        pass
    return np.asarray(np.linalg.pinv(A, _RANK), np.float64)


@kernel
def remainders(A: Sparse, b: Reals, high: Reals, low: Reals, left: Reals) -> None:
    """left = -(A (high + low) + b), summed in doubled precision."""
    for i in range(len(b)):
        total, rest = b[i], 0.0
        for k in range(A.start[i], A.start[i + 1]):
            a, x = A.value[k], high[A.place[k]]
            product = a * x
            over = a * _SPLIT
            a_high = over - (over - a)
            over = x * _SPLIT
            x_high = over - (over - x)
            a_low, x_low = a - a_high, x - x_high
            rest += a_low * x_low - (((product - a_high * x_high) - a_low * x_high) - a_high * x_low)
            rest += a * low[A.place[k]]
            added = total + product
            part = added - total
            rest += (total - (added - part)) + (product - part)
            total = added
        left[i] = -(total + rest)


@kernel
def add(change: Reals, high: Reals, low: Reals) -> None:
    """Add a change to x = high + low, of which `low` is the rounding of `high`."""
    for i in range(len(change)):
        total = high[i] + change[i]
        part = total - high[i]
        rest = (high[i] - (total - part)) + (change[i] - part) + low[i]
        high[i] = total + rest
        low[i] = rest - (high[i] - total)


@kernel
def clip(x: Reals, laws: Laws) -> None:
    """Bring each x within its limits; a contact that pulls has no force."""
    mu, d, lower, upper = laws
    rows = d * len(mu)
    for first in range(0, rows, d):
        if x[first] < 0.0:
            for i in range(first, first + d):
                x[i] = 0.0
    for j in range(len(lower)):
        x[rows + j] = min(max(x[rows + j], lower[j]), upper[j])


def calmed(problem: Problem, x: Array, share: float = NOTHING) -> Array:
    """x (N,) without what is at most this share of the largest unknown."""
    sizes, size, x = magnitudes_of(problem), np.empty(2 * len(x)), x.copy()
    largest(problem.b, x, sizes, size)
    calm(sizes, size, problem.laws, share, x)
    return x


@kernel
def calm(sizes: Magnitudes, size: Reals, laws: Laws, share: float, x: Reals) -> None:
    """Make what is rounding zero in x (N,), where that is within limits; `size` as `largest` fills it. A
    normal force is zero only with the others of its contact."""
    mu, d, lower, upper = laws
    rows, n = d * len(mu), len(x)
    for i in range(n - 1, -1, -1):  # a normal force after the others of its contact
        within = True
        if i >= rows:
            within = lower[i - rows] <= 0.0 <= upper[i - rows]
        elif i % d == 0:
            for k in range(i + 1, i + d):
                within = within and x[k] == 0.0
        greatest = min(sizes.column[i] * size[sizes.label[n + i]], sizes.most[i])
        if within and abs(x[i]) <= share * greatest:
            x[i] = 0.0

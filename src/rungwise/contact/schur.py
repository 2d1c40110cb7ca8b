"""Free unknowns of a small dense problem eliminated, compiled as a whole.

Algorithm: with A_gg regular the free unknowns are x_g = -A_gg^-1 (A_gk x_k + b_g). A_gg is factorised in
units in which its largest entries are about one, and each solution is refined once; what the refinement
changed tells how well it is known, and what is left beside such doubt is zero. Source: Higham, Accuracy and
Stability of Numerical Algorithms (2002), chapters 7 and 12. Accepts: any dense A. Promises: nothing where
A_gg is singular or nearly so.
"""

from __future__ import annotations

import math

import numpy as np

from rungwise.contact.linear import factorise, substitute
from rungwise.contact.product import ROUNDING
from rungwise.contact.units import compress, fitted
from rungwise.kernel import Ints, Reals, allocating_kernel, kernel

REGULAR, ACCURATE, DOUBT = 1e-13, 1e-5, 1e3
"""Least pivot over the largest; largest change of solutions by refinement; doubt in them over that change."""


@allocating_kernel
def eliminate(
    A: Reals,
    b: Reals,
    kept: Ints,
    gone: Ints,
    left: Reals,
    offset: Reals,
    factor: Reals,
    unit: Reals,
    order: Ints,
    scale: Reals,
) -> bool:
    """Fill what is left, A_kk - A_kg A_gg^-1 A_gk in left (k, k) and b_k + A_kg x_g(0) in offset (k,); factor
    (g, g), unit (g,), order (g,), with which `respond` solves; and scale (g,), the units of the free unknowns
    among themselves. False where that cannot be."""
    k, g = len(kept), len(gone)
    own, response, change = np.empty((g, g)), np.empty((k, g)), np.empty((k, g))
    for i in range(g):
        for j in range(g):
            own[i, j] = A[gone[i], gone[j]]
    if not _factorise(own, factor, unit, order):
        return False
    largest, correction = 0.0, 0.0
    for j in range(k):
        for i in range(g):
            response[j, i] = A[gone[i], kept[j]]
        _refined(own, factor, unit, order, response[j], change[j])
        for i in range(g):
            largest, correction = max(largest, abs(response[j, i])), max(correction, abs(change[j, i]))
            response[j, i] -= change[j, i]
    if not correction <= ACCURATE * largest:
        return False
    start, column, value = np.empty(g + 1, np.int64), np.empty(g * g, np.int64), np.empty(g * g)
    compress(own, start, column, value)
    still, doubt = np.empty(g), np.empty(g)
    fitted(start, column, value, 0, 1, scale)
    _fill(A, kept, gone, scale, response, change, np.empty(k), left)
    _offset(A, b, kept, gone, own, factor, unit, order, scale, still, doubt, offset)
    return True


@kernel
def _factorise(own: Reals, factor: Reals, unit: Reals, order: Ints) -> bool:
    g = len(own)
    for i in range(g):
        row, column = 0.0, 0.0
        for j in range(g):
            row, column = max(row, abs(own[i, j])), max(column, abs(own[j, i]))
        if not row * column > 0.0:
            return False
        unit[i] = (row * column) ** -0.25
    for i in range(g):
        for j in range(g):
            factor[i, j] = unit[i] * own[i, j] * unit[j]
    if not factorise(factor, g, order):
        return False
    least, most = math.inf, 0.0
    for i in range(g):
        least, most = min(least, abs(factor[i, i])), max(most, abs(factor[i, i]))
    return least > REGULAR * most


@kernel
def respond(factor: Reals, unit: Reals, order: Ints, x: Reals) -> None:
    """x (g,) becomes A_gg^-1 x."""
    for i in range(len(x)):
        x[i] *= unit[i]
    substitute(factor, len(x), order, x)
    for i in range(len(x)):
        x[i] *= unit[i]


@kernel
def _refined(own: Reals, factor: Reals, unit: Reals, order: Ints, x: Reals, change: Reals) -> None:
    """x becomes A_gg^-1 x, from which `change` is to be taken."""
    for i in range(len(x)):
        change[i] = -x[i]
    respond(factor, unit, order, x)
    for i in range(len(x)):
        total = change[i]
        for j in range(len(x)):
            total += own[i, j] * x[j]
        change[i] = total
    respond(factor, unit, order, change)


@kernel
def _fill(
    A: Reals,
    kept: Ints,
    gone: Ints,
    scale: Reals,
    response: Reals,
    change: Reals,
    least: Reals,
    left: Reals,
) -> None:
    """A_kk - A_kg response, less what is nothing beside the rounding in its diagonal; scratch least (k,)."""
    k, g = len(kept), len(gone)
    for i in range(k):
        largest, terms = _largest(response[i], scale), ROUNDING * abs(A[kept[i], kept[i]])
        for m in range(g):
            noise = abs(change[i, m]) + ROUNDING * (abs(response[i, m]) + scale[m] * largest)
            terms += abs(A[kept[i], gone[m]]) * noise
        least[i] = 2.0 * math.sqrt(terms)
    for i in range(k):
        for j in range(k):
            total = A[kept[i], kept[j]]
            for m in range(g):
                total -= A[kept[i], gone[m]] * response[j, m]
            left[i, j] = total if abs(total) > least[i] * least[j] else 0.0


@kernel
def _largest(x: Reals, scale: Reals) -> float:
    """The largest entry in units of the unknowns: none is better known than that."""
    largest = 0.0
    for i in range(len(x)):
        largest = max(largest, abs(x[i]) / scale[i])
    return largest


@kernel
def _offset(
    A: Reals,
    b: Reals,
    kept: Ints,
    gone: Ints,
    own: Reals,
    factor: Reals,
    unit: Reals,
    order: Ints,
    scale: Reals,
    still: Reals,
    doubt: Reals,
    offset: Reals,
) -> None:
    """b_k + A_kg x_g(0): what should cancel, and does but for rounding, is no demand. Scratch (g,)."""
    for i in range(len(gone)):
        still[i] = -b[gone[i]]
    _refined(own, factor, unit, order, still, doubt)
    for i in range(len(gone)):
        still[i] -= doubt[i]
    for i in range(len(gone)):
        doubt[i] = b[gone[i]]
        for j in range(len(gone)):
            doubt[i] += own[i, j] * still[j]
    respond(factor, unit, order, doubt)
    largest = _largest(still, scale)
    for i in range(len(kept)):
        total, least = b[kept[i]], ROUNDING * abs(b[kept[i]])
        for j in range(len(gone)):
            entry = A[kept[i], gone[j]]
            noise = DOUBT * abs(doubt[j]) + ROUNDING * (abs(still[j]) + scale[j] * largest)
            total, least = total + entry * still[j], least + abs(entry) * noise
        offset[i] = total if abs(total) > least else 0.0


@allocating_kernel
def recover(
    A: Reals, b: Reals, kept: Ints, gone: Ints, factor: Reals, unit: Reals, order: Ints, x: Reals
) -> None:
    """Fill the free ones in x (N,), which has the others."""
    push, v = np.empty(len(gone)), np.empty(len(gone))
    for i in range(len(gone)):
        push[i] = b[gone[i]]
        for j in range(len(kept)):
            push[i] += A[gone[i], kept[j]] * x[kept[j]]
        v[i] = push[i]
    respond(factor, unit, order, v)
    for i in range(len(gone)):
        x[gone[i]] = -v[i]
    for i in range(len(gone)):
        v[i] = push[i]
        for j in range(len(gone)):
            v[i] += A[gone[i], gone[j]] * x[gone[j]]
    respond(factor, unit, order, v)
    for i in range(len(gone)):
        x[gone[i]] -= v[i]


@kernel
def demanded(
    b: Reals, rows: int, velocities: int, lower: Reals, upper: Reals, kept: Ints, offset: Reals
) -> float:
    """The largest rate demanded over that without forces, of all but fixed unknowns, of which nothing is
    demanded; infinite where there is none, or no load."""
    loads, demands, largest = 0.0, 0.0, 0.0
    for i in range(len(b)):
        if rows <= i < rows + velocities:
            loads = max(loads, abs(b[i]))
        elif i < rows or lower[i - rows] != upper[i - rows]:
            demands = max(demands, abs(b[i]))
    for i in range(len(kept)):
        if kept[i] < rows or lower[kept[i] - rows] != upper[kept[i] - rows]:
            largest = max(largest, abs(offset[i]))
    return demands / largest if loads > 0.0 and 0.0 < demands < largest else math.inf

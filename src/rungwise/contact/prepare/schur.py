"""Free unknowns of a small dense problem eliminated, compiled as a whole.

Algorithm: with A_gg regular the free unknowns are x_g = -A_gg^-1 (A_gk x_k + b_g). A_gg is factorised in
units in which its largest entries are about one, and each solution is refined once; the change by refinement
tells how well a solution is known, and remainders within this doubt are zero. Source: Higham, Accuracy and
Stability of Numerical Algorithms (2002), chapters 7 and 12. Accepts: any dense A. Promises: nothing where
A_gg is singular or nearly so.
"""

from __future__ import annotations

import math

import numpy as np

from rungwise.contact.linear import factorise, substitute, substitute_transposed
from rungwise.contact.prepare.product import ROUNDING
from rungwise.kernel import Ints, Reals, allocating_kernel, kernel

REGULAR, ACCURATE = 1e-13, 1e-5
"""Least pivot over the largest; largest change of solutions by refinement, over the largest entry. Chosen by
trial, to a decade; the first is about a thousand roundings of double precision."""
NOTHING = 4.0 * ROUNDING
"""Share of its terms up to which a sum may be rounding: each term is rounded when made and when added."""


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
) -> bool:
    """Fill the rest of the problem, A_kk - A_kg A_gg^-1 A_gk in left (k, k) and b_k + A_kg x_g(0) in offset
    (k,); and factor (g, g), unit (g,), order (g,), with which `respond` solves. False where A_gg cannot be
    solved."""
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
    push, still, weight, error = np.empty(g), np.empty(g), np.empty((k, g)), np.empty((k + 1, g))
    for i in range(g):
        push[i] = still[i] = -b[gone[i]]
    _refined(own, factor, unit, order, still, error[k])
    for i in range(g):
        still[i] -= error[k, i]
    for i in range(k):
        _weigh(A, kept[i], gone, factor, unit, order, weight[i])
        _gather(A, gone, kept[i], change[i])
        _errors(own, response[i], change[i], error[i])
    _errors(own, still, push, error[k])
    for i in range(k):
        for j in range(k):
            left[i, j] = _known(A, kept[i], gone, A[kept[i], kept[j]], -1.0, response[j], weight[i], error[j])
        offset[i] = _known(A, kept[i], gone, b[kept[i]], 1.0, still, weight[i], error[k])
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
def _weigh(A: Reals, row: int, gone: Ints, factor: Reals, unit: Reals, order: Ints, weight: Reals) -> None:
    """weight (g,) becomes |A_gg^-T A_row,g|: the effect on a row of errors in the free unknowns'
    equations."""
    for m in range(len(gone)):
        weight[m] = unit[m] * A[row, gone[m]]
    substitute_transposed(factor, len(gone), order, weight)
    for m in range(len(gone)):
        weight[m] = abs(unit[m] * weight[m])


@kernel
def _gather(A: Reals, gone: Ints, column: int, right: Reals) -> None:
    for m in range(len(gone)):
        right[m] = A[gone[m], column]


@kernel
def _errors(own: Reals, x: Reals, right: Reals, error: Reals) -> None:
    """Fill error (g,): the size of A_gg x - right, and the part that rounding hides."""
    for i in range(len(error)):
        total, terms = -right[i], abs(right[i])
        for j in range(len(error)):
            term = own[i, j] * x[j]
            total += term
            terms += abs(term)
        error[i] = abs(total) + NOTHING * terms


@kernel
def _known(
    A: Reals, row: int, gone: Ints, first: float, sign: float, x: Reals, weight: Reals, error: Reals
) -> float:
    """first + sign A_row,g x, or zero where the sum is no more than the errors of x and rounding."""
    total, terms, least = first, abs(first), 0.0
    for m in range(len(gone)):
        term = A[row, gone[m]] * x[m]
        total += sign * term
        terms += abs(term)
        least += weight[m] * error[m]
    return total if abs(total) > least + NOTHING * terms else 0.0


@allocating_kernel
def recover(
    A: Reals, b: Reals, kept: Ints, gone: Ints, factor: Reals, unit: Reals, order: Ints, x: Reals
) -> None:
    """Fill the free unknowns in x (N,), which has the others."""
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
    """The largest demanded rate over the largest rate without forces, of all but fixed unknowns, of which
    nothing is demanded; infinite where there is no demand, or no load."""
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

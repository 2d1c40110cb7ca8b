"""The steps of `newton` for small systems, compiled as a whole, and the kernels that both share."""

from __future__ import annotations

import math

from rungwise.contact.solvers.linear import factorise, substitute
from rungwise.contact.solvers.measure import rates
from rungwise.kernel import Ints, Reals, copy, kernel

HALVINGS, WINDOW = 7, 12
LEAST = 1e-9
"""Every step is damped by this much, in scaled units: where forces are not unique they still move little."""
VECTORS = 8


@kernel
def descend_dense(
    row_start: Ints,
    column: Ints,
    value: Reals,
    A: Reals,
    b: Reals,
    shift: float,
    mu: Reals,
    d: int,
    lower: Reals,
    upper: Reals,
    x: Reals,
    tol: float,
    steps: int,
    dampings: Reals,
    square: Reals,
    vectors: Reals,
    order: Ints,
) -> int:
    """Move x (N,) by Newton steps while |F| falls; returns the steps. A (N, N) is the rows once more.

    square (2, N, N), vectors (8, N) and order (N,) are scratch.
    """
    n, rows, rho = len(x), d * len(mu), 1.0 / (1.0 + shift)
    J, factors = square[0], square[1]
    y, F, trial, step, ahead = vectors[0], vectors[1], vectors[2], vectors[3], vectors[4]
    derivative = vectors[5:8].reshape(n, 3)
    rates(row_start, column, value, b, shift, x, y)
    size = earlier = alart_curnier(x, y, mu, d, lower, upper, rho, F, derivative)
    for done in range(steps):
        if size <= tol or not size < math.inf:
            return done
        if done and done % WINDOW == 0:
            if size > 0.5 * earlier:
                return done
            earlier = size
        dense_jacobian(A, derivative, rows, d, rho, 1.0 - rho * shift, J)
        newer, length = math.inf, 1.0
        for attempt in range(1 + len(dampings)):
            copy(J, factors)
            for i in range(n):
                step[i] = F[i]
                factors[i, i] += LEAST if attempt == 0 else max(LEAST, dampings[attempt - 1] * size)
            if not factorise(factors, n, order):
                continue
            substitute(factors, n, order, step)
            length = 1.0
            for _ in range(HALVINGS if attempt == 0 else 1):
                for i in range(n):
                    trial[i] = x[i] - length * step[i]
                rates(row_start, column, value, b, shift, trial, y)
                newer = alart_curnier(trial, y, mu, d, lower, upper, rho, ahead, derivative)
                if newer <= (1.0 - (1e-2 * length if attempt == 0 else 1e-4)) * size:
                    break
                length, newer = 0.5 * length, math.inf
            if newer < math.inf:
                break
        if not newer < math.inf:
            return done
        size = newer
        for i in range(n):
            x[i], F[i] = trial[i], ahead[i]
    return steps


@kernel
def alart_curnier(
    x: Reals, y: Reals, mu: Reals, d: int, lower: Reals, upper: Reals, rho: float, F: Reals, derivative: Reals
) -> float:
    """Fill F (N,) and the rows of the projections' derivative (N, 3), within each block; returns |F|."""
    rows = d * len(mu)
    for k in range(len(mu)):
        _contact(x, y, mu[k], d, k * d, rho, F, derivative)
    for j in range(len(lower)):
        i = rows + j
        ahead = x[i] - rho * y[i]
        inside = lower[j] <= ahead <= upper[j]
        F[i] = rho * y[i] if inside else x[i] - (lower[j] if ahead < lower[j] else upper[j])
        derivative[i, 0] = 1.0 if inside else 0.0
    total = 0.0
    for i in range(rows + len(lower)):
        total += F[i] * F[i]
    return math.sqrt(total)


@kernel
def _contact(
    x: Reals, y: Reals, mu: float, d: int, first: int, rho: float, F: Reals, derivative: Reals
) -> None:
    for i in range(first, first + d):
        F[i] = x[i]
        for j in range(d):
            derivative[i, j] = 0.0
    normal = x[first] - rho * y[first]
    if not normal > 0.0:
        return
    F[first] = rho * y[first]
    derivative[first, 0] = 1.0
    length = 0.0
    for i in range(first + 1, first + d):
        length += (x[i] - rho * y[i]) ** 2
    length = math.sqrt(length)
    if length <= mu * normal:
        for i in range(1, d):
            F[first + i] = rho * y[first + i]
            derivative[first + i, i] = 1.0
        return
    shrink = mu * normal / length
    for i in range(1, d):
        ahead = x[first + i] - rho * y[first + i]
        F[first + i] = x[first + i] - shrink * ahead
        derivative[first + i, 0] = mu * ahead / length
        for j in range(1, d):
            other = x[first + j] - rho * y[first + j]
            derivative[first + i, j] = -shrink * ahead * other / (length * length)
        derivative[first + i, i] += shrink


@kernel
def dense_jacobian(A: Reals, derivative: Reals, rows: int, d: int, rho: float, kept: float, J: Reals) -> None:
    """J = I - kept D + rho D A."""
    size = len(A)
    for i in range(size):
        first, width = (i // d * d, d) if i < rows else (i, 1)
        for c in range(size):
            J[i, c] = 0.0
        for j in range(width):
            weight = derivative[i, j]
            if weight != 0.0:
                for c in range(size):
                    J[i, c] += rho * weight * A[first + j, c]
                J[i, first + j] -= kept * weight
        J[i, i] += 1.0

"""The steps of `newton` for small systems, compiled as a whole, and the kernels that both share."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from rungwise.contact.prepare.units import Sparse
from rungwise.contact.problem import Array, Laws
from rungwise.contact.solvers.measure import rates
from rungwise.contact.solvers.newton.reduced import INTS, REALS, directions, factorise_reduced, solve_reduced
from rungwise.contact.solvers.settings import CHORDS, HALVINGS
from rungwise.kernel import Ints, Reals, copy, inner_kernel, kernel

WINDOW = 12
"""Steps in which |F| must halve. Chosen by trial."""
LEAST = 1e-9
"""Damping of every step, in scaled units: where forces are not unique they still move little.
Chosen by trial, to a decade."""
VECTORS = 16
"""Vectors of scratch; the last is left alone."""


class Scratch(NamedTuple):
    """Memory for steps in N unknowns: factors (N, N), vectors (16, N), order (4 N,)."""

    factors: Array
    vectors: Array
    order: Ints


def scratch_for(n: int) -> Scratch:
    return Scratch(np.empty((n, n)), np.empty((VECTORS, n)), np.empty(4 * n, np.int64))


@kernel
def descend_dense(
    entries: Sparse,
    A: Reals,
    b: Reals,
    shift: float,
    laws: Laws,
    x: Reals,
    tol: float,
    steps: int,
    dampings: Reals,
    scratch: Scratch,
) -> int:
    """Move x (N,) by Newton steps while |F| falls; returns the steps. A (N, N) is the entries once more."""
    factors, vectors, order = scratch
    n, rho = len(x), 1.0 / (1.0 + shift)
    y, F, trial, step, ahead = vectors[0], vectors[1], vectors[2], vectors[3], vectors[4]
    slope, derivative = vectors[5:8].reshape(n, 3), vectors[8:11].reshape(n, 3)
    ways, places = vectors[11:15].reshape(n, REALS), order[n:].reshape(n, INTS)
    rates(entries, b, shift, x, y)
    size = earlier = alart_curnier(x, y, laws, rho, F, slope)
    for done in range(steps):
        if size <= tol or not size < math.inf:
            return done
        if done and done % WINDOW == 0:
            if size > 0.5 * earlier:
                return done
            earlier = size
        copy(slope, derivative)
        newer, length, damping = math.inf, 1.0, LEAST
        left = directions(derivative, laws.mu, laws.d, places, ways)
        place, u = places[:left], ways[:left]
        for attempt in range(1 + len(dampings)):
            if attempt > 0:
                damping = max(LEAST, dampings[attempt - 1] * size)
            if not factorise_reduced(
                A, laws.d, place, u, rho, 1.0 - rho * shift, damping, step, factors, order
            ):
                continue
            solve_reduced(entries, F, laws.d, place, u, rho, damping, factors, order, ahead, step)
            length = 1.0
            for _ in range(HALVINGS if attempt == 0 else 1):
                for i in range(n):
                    trial[i] = x[i] - length * step[i]
                rates(entries, b, shift, trial, y)
                newer = alart_curnier(trial, y, laws, rho, ahead, slope)
                if newer <= (1.0 - (1e-2 * length if attempt == 0 else 1e-4)) * size:
                    break
                length, newer = 0.5 * length, math.inf
            if newer < math.inf:
                break
        if not newer < math.inf:
            return done
        ratio, size = newer / size, newer
        for i in range(n):
            x[i], F[i] = trial[i], ahead[i]
        # Again with the same factors, if these steps are likely to be enough.
        for _ in range(CHORDS if size * ratio**CHORDS <= tol < size else 0):
            solve_reduced(entries, F, laws.d, place, u, rho, damping, factors, order, ahead, step)
            for i in range(n):
                trial[i] = x[i] - step[i]
            rates(entries, b, shift, trial, y)
            newer = alart_curnier(trial, y, laws, rho, ahead, slope)
            if not newer < size:
                rates(entries, b, shift, x, y)
                alart_curnier(x, y, laws, rho, F, slope)
                break
            size = newer
            for i in range(n):
                x[i], F[i] = trial[i], ahead[i]
            if size <= tol:
                break
    return steps


@kernel
def alart_curnier(x: Reals, y: Reals, laws: Laws, rho: float, F: Reals, derivative: Reals) -> float:
    """Fill F (N,) and the rows of the projections' derivative (N, 3), within each block; returns |F|."""
    mu, d, lower, upper = laws
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


@inner_kernel
def _contact(
    x: Reals, y: Reals, mu: float, d: int, first: int, rho: float, F: Reals, derivative: Reals
) -> None:
    # In the plane b is a: the first tangent's values replace the values written for a second tangent.
    n, a, b = first, first + min(1, d - 1), first + d - 1
    s, t = x[a] - rho * y[a], x[b] - rho * y[b] if d == 3 else 0.0
    normal = x[n] - rho * y[n]
    closed, radius, length = normal > 0.0, mu * max(0.0, normal), math.sqrt(s * s + t * t)
    if closed and length <= radius:
        F[b], derivative[b, 0], derivative[b, 1], derivative[b, 2] = rho * y[b], 0.0, 0.0, 1.0
        F[a], derivative[a, 0], derivative[a, 1], derivative[a, 2] = rho * y[a], 0.0, 1.0, 0.0
    else:
        per = 1.0 / length if closed else 0.0
        s, t, slope, shrink = s * per, t * per, mu if closed else 0.0, radius * per
        F[b], derivative[b, 0] = x[b] - radius * t, slope * t
        derivative[b, 1], derivative[b, 2] = -shrink * s * t, shrink * s * s
        F[a], derivative[a, 0] = x[a] - radius * s, slope * s
        derivative[a, 1], derivative[a, 2] = shrink * t * t, -shrink * s * t
    F[n], derivative[n, 0] = rho * y[n] if closed else x[n], 1.0 if closed else 0.0
    derivative[n, 1] = derivative[n, 2] = 0.0

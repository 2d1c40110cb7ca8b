"""Nonsmooth Newton steps on the map of Alart and Curnier, globalised.

Algorithm: F(x) = x - Q(x - rho y) with Q the projection on the half-line of normal forces, on the disc of
radius mu max(0, x_n - rho y_n), and on the limits of other unknowns. A step of the generalised Jacobian is
shortened until |F| decreases; where the Jacobian is singular or the step leads nowhere, steps with a multiple
of |F| added to its diagonal, as if contacts yielded, are tried instead. Sources: Alart and Curnier, Comput.
Methods Appl. Mech. Eng. 92 (1991) 353-375; Qi and Sun, Math. Program. 58 (1993) 353-367.
Accepts: everything: mixed forms with singular H, nonsymmetric, dense or sparse. Promises: |F| never grows;
locally quadratic convergence, also to one of many solutions; from afar it may stall, and then ends early.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import scipy.sparse as sp
from scipy.linalg.lapack import dgesv
from scipy.sparse.linalg import splu

from rungwise.contact.mixed import Array, Matrix
from rungwise.contact.solvers.measure import rates
from rungwise.contact.system import System
from rungwise.kernel import Reals, kernel

NAME = "newton"
_STEPS = 40
_DENSE = 200
_HALVINGS, _WINDOW = 7, 5
DAMPINGS = (1e-8, 1e-4, 1e-2, 1.0, 1e2)


def accepts(_system: System) -> bool:
    return True


def solve(system: System, start: Array, tol: float) -> tuple[Array, int]:
    """The iterate x (N,) from `start` at which |F| is within tol or no longer falls, and the steps taken."""
    return descend(system, form(system), start, system.b, 0.0, tol, _STEPS)


def form(system: System) -> Matrix:
    """A as the steps want it: dense when small."""
    A = system.matrix()
    return A.toarray() if system.size <= _DENSE else sp.csr_array(A)


def descend(
    system: System,
    A: Matrix,
    start: Array,
    b: Array,
    shift: float,
    tol: float,
    steps: int,
    dampings: tuple[float, ...] = DAMPINGS,
) -> tuple[Array, int]:
    """Newton on the system A + shift with offset b; `dampings`, times |F|, are tried where its steps fail."""
    s, x = system, start
    y, F = np.empty(s.size), np.empty(s.size)
    derivative = np.zeros((s.size, 3))
    rho = 1.0 / (1.0 + shift)

    def merit(x: Array) -> float:
        rates(s.row_start, s.column, s.value, b, shift, x, y)
        return alart_curnier(x, y, s.mu, s.directions, s.lower, s.upper, rho, F, derivative)

    size = earlier = merit(x)
    for done in range(steps):
        if size <= tol or not math.isfinite(size):
            return x, done
        if done and done % _WINDOW == 0:
            if size > 0.5 * earlier:
                return x, done
            earlier = size
        J = _jacobian(system, A, derivative, rho, shift)
        found = _step(J, F.copy(), x, size, merit, dampings)
        if found is None:
            return x, done
        x, size = found
    return x, steps


def _step(
    J: Matrix,
    F: Array,
    x: Array,
    size: float,
    merit: Callable[[Array], float],
    dampings: tuple[float, ...],
) -> tuple[Array, float] | None:
    """A shorter Newton step, or a damped one, that makes |F| smaller; None when none does."""
    step = _newton(J, F)
    if step is not None:
        length = 1.0
        for _ in range(_HALVINGS):
            moved = x - length * step
            newer = merit(moved)
            if newer <= (1.0 - 1e-2 * length) * size:
                return moved, newer
            length *= 0.5
    for damping in dampings:
        step = _damped(J, F, damping * size)
        if step is None:
            continue
        moved = x - step
        newer = merit(moved)
        if newer <= (1.0 - 1e-4) * size:
            return moved, newer
    return None


def _jacobian(system: System, A: Matrix, derivative: Array, rho: float, shift: float) -> Matrix:
    """I - D + rho D (A + shift), D the derivative of the projections, in blocks."""
    s, d = system, system.directions
    if not sp.issparse(A):
        J = np.empty((s.size, s.size))
        dense_jacobian(A, derivative, s.rows, d, rho, 1.0 - rho * shift, J)
        return J
    i = np.arange(s.rows)
    row = np.concatenate([np.repeat(i, d), np.arange(s.rows, s.size)])
    column = np.concatenate(
        [(i // d * d)[:, None].repeat(d, 1).ravel() + np.tile(np.arange(d), s.rows), row[d * s.rows :]]
    )
    value = np.concatenate([derivative[: s.rows, :d].ravel(), derivative[s.rows :, 0]])
    D = sp.csr_array((value, (row, column)), shape=(s.size, s.size))
    return sp.eye_array(s.size) - (1.0 - rho * shift) * D + rho * (D @ A)


def _newton(J: Matrix, F: Array) -> Array | None:
    if sp.issparse(J):
        try:
            step = splu(sp.csc_array(J)).solve(F)
        except RuntimeError:
            return None
    else:
        _, _, step, fault = dgesv(J, F)
        if fault:
            return None
    return step if np.isfinite(step).all() else None


def _damped(J: Matrix, F: Array, damping: float) -> Array | None:
    """(J + damping)^-1 F: where contacts stick, the Newton step of a problem in which they yield a little."""
    if sp.issparse(J):
        return _newton(J + damping * sp.eye_array(len(F)), F)
    shifted = J.copy()
    shifted[np.diag_indices(len(F))] += damping
    return _newton(shifted, F)


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

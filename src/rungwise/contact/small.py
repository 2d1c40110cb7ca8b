"""Small problems in one compiled call: scaled, solved and judged as `solve` does, without Python in between.

Algorithm: the first solver of the chain that accepts the system, `gauss_seidel` or `pivoting`. Accepts: up to
`LARGEST` unknowns, all of them with limits. Promises: nothing; what is not within tolerance is left to the
chain.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

from rungwise.contact.judge import Residuals, judge_rows
from rungwise.contact.mixed import Array, Problem
from rungwise.contact.solvers import gauss_seidel, pivoting
from rungwise.contact.solvers.gauss_seidel import alternate
from rungwise.contact.solvers.measure import distance
from rungwise.contact.solvers.newton_dense import VECTORS
from rungwise.contact.units import compress, expand, fitted, measured, rescaled
from rungwise.kernel import Reals, allocating_kernel, kernel

LARGEST = 60
SWEPT, PIVOTED, REFUSED = 0, 1, 2
_NAMES = gauss_seidel.NAME, pivoting.NAME
_MARGIN = 0.3
_REST = np.zeros(LARGEST)
_COVERING = np.ones((1, 4 * LARGEST))


class Answer(NamedTuple):
    """x and y (N,), judged; the solver, and its iterations, or -1 where the start was good enough."""

    x: Array
    y: Array
    residuals: Residuals
    solver: str
    iterations: int


def solve_at_once(problem: Problem, start: Array | None, tol: float) -> Answer | None:
    """The answer from x = `start` (N,) or from rest; None where it is not within `tol`, or not tried."""
    n = len(problem.b)
    if not 0 < n <= LARGEST or problem.velocities > 0:
        return None
    A = problem.A.toarray() if sp.issparse(problem.A) else problem.A
    x, y, found = np.empty(n), np.empty(n), np.empty(7)
    given = _REST[:n] if start is None else start
    solver, iterations = solve_dense(
        A, problem.b, problem.mu, problem.directions, problem.lower, problem.upper, given, tol,
        gauss_seidel.DAMPINGS, _COVERING, x, y, found,
    )  # fmt: skip
    if solver == REFUSED:
        return None
    residuals = Residuals(*found.tolist())
    return Answer(x, y, residuals, _NAMES[solver], iterations) if residuals.worst <= tol else None


@allocating_kernel
def solve_dense(
    A: Reals,
    b: Reals,
    mu: Reals,
    d: int,
    lower: Reals,
    upper: Reals,
    start: Reals,
    tol: float,
    dampings: Reals,
    covering: Reals,
    x: Reals,
    y: Reals,
    found: Reals,
) -> tuple[int, int]:
    """Fill x, its rates y (N,) and residuals (7,); returns the solver, or REFUSED, and its iterations."""
    n, rows, done = len(b), d * len(mu), -1
    row_start, column, entry = np.empty(n + 1, np.int64), np.empty(n * n, np.int64), np.empty(n * n)
    compress(A, row_start, column, entry)
    s, force, rate, offset = np.empty(n), np.empty(n), np.empty(n), np.empty(n)
    value, lowest, highest = entry.copy(), lower.copy(), upper.copy()
    blocks, diagonal, matrix = np.zeros((len(mu), d, d)), np.zeros(len(lower)), np.zeros((n, n))
    fitted(row_start, column, value, rows, d, s)
    if not measured(s, b, lowest, highest, rows, force, rate, offset):
        return REFUSED, done
    rescaled(row_start, column, s, value, blocks, diagonal)
    solver = _chosen(d, blocks, diagonal, lowest, highest)
    if solver == REFUSED:
        return REFUSED, done
    expand(row_start, column, value, matrix)
    best, vectors = start / force, np.empty((VECTORS, n))
    if not distance(row_start, column, value, offset, 0.0, best, mu, d, lowest, highest, vectors) <= tol:
        if solver == SWEPT:
            done = alternate(
                row_start, column, value, matrix, blocks, diagonal, offset, mu, lowest, highest, best.copy(),
                best, _MARGIN * tol, dampings, np.empty((n, n)), vectors, np.empty(4 * n, np.int64),
            )  # fmt: skip
        else:
            done = _pivot(matrix, offset, mu, d, lowest, highest, _MARGIN**2 * tol, covering, best)
    for i in range(n):
        x[i] = best[i] * force[i]
    judge_rows(
        row_start, column, entry, b, np.arange(n), force, rate, mu, d, lowest, highest, lower, upper, x, y,
        vectors, found,
    )  # fmt: skip
    return solver, done


@kernel
def _chosen(d: int, blocks: Reals, diagonal: Reals, lower: Reals, upper: Reals) -> int:
    for j in range(len(lower)):
        if lower[j] == -np.inf and upper[j] == np.inf:
            return REFUSED
    if gauss_seidel.accepts_rows(d, blocks, diagonal):
        return SWEPT
    return PIVOTED if d < 3 or len(blocks) == 0 else REFUSED


@allocating_kernel
def _pivot(
    A: Reals, b: Reals, mu: Reals, d: int, lower: Reals, upper: Reals, tol: float, covering: Reals, x: Reals
) -> int:
    """Fill x (N,); returns the pivots."""
    m = pivoting.unfolded_size(len(mu), d, lower, upper)
    row, sign, origin = np.empty(m, np.int64), np.ones(m), np.zeros(len(b))
    M, q, z = np.zeros((m, m)), np.zeros(m), np.empty(m)
    pivoting.unfold_into(A, b, mu, d, lower, upper, row, sign, origin, M, q)
    done = pivoting.pivot(
        M, q, covering[:, :m], tol, z, np.empty(m), np.empty((m, m + 2)), np.empty(4 * m + 2, np.int64)
    )
    pivoting.fold(row, sign, origin, z, x)
    return done

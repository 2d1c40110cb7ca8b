"""A problem as solvers see it: free unknowns eliminated where they can be, and free of units.

With A_ff regular the free unknowns (velocities, joint forces) follow from the others, and what is left is the
Delassus form. Each contact is then measured in a unit s of its own: s^2 is one over the mean diagonal of its
block, so that its block has a unit diagonal, all its directions alike, and friction is what it was. Forces
and rates are divided by |s q|, the norm of the rates without forces: `natural_map` of the scaled system is
the residual by which answers are judged.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.linalg.lapack import dgetrf, dgetrs
from scipy.sparse.linalg import splu

from rungwise.contact.mixed import Array, Matrix, Problem
from rungwise.kernel import Ints, Reals, kernel

_REGULAR = 1e-13
_ROUNDING, _ACCURATE = 2.0**-51, 1e-5
_ROUNDS = 10
_GREATEST = 1e140
Solve = Callable[[Matrix], Any]
_LARGEST = 30_000_000
"""Entries of the dense response that elimination from a sparse form may make."""


@dataclass(frozen=True)
class System:
    """The scaled system in kept unknowns, rows in CSR; x = force x', y = rate y', elsewhere `recover`.

    row_start (N + 1,), column, value: A; blocks (k, d, d): its diagonal blocks; diagonal (m,): that of the
    others; kept (N,): places of the unknowns in the problem.
    """

    row_start: Ints
    column: Ints
    value: Array
    blocks: Array
    diagonal: Array
    b: Array
    mu: Array
    directions: int
    lower: Array
    upper: Array
    force: Array
    rate: Array
    kept: Ints
    recover: Callable[[Array], Array]

    @property
    def size(self) -> int:
        return len(self.b)

    @property
    def rows(self) -> int:
        return self.directions * len(self.mu)

    def matrix(self) -> sp.csr_array:
        return sp.csr_array((self.value, self.column, self.row_start), shape=(self.size, self.size))


def scaled(problem: Problem) -> System:
    """The system of `problem`; ValueError where its sizes are beyond the range of numbers."""
    kept, A, b, recover = _eliminated(problem)
    rows, d = problem.rows, problem.directions
    lower, upper = problem.lower[kept[rows:] - rows], problem.upper[kept[rows:] - rows]
    csr = sp.csr_array(A)
    s = units(csr, rows, d)
    bounds = np.concatenate([lower[np.isfinite(lower)], upper[np.isfinite(upper)], [0.0]])
    with np.errstate(over="ignore"):
        size = float(np.linalg.norm(s * b))
    if not size < _GREATEST or not (s < _GREATEST).all() or not (s > 1.0 / _GREATEST).all():
        raise ValueError("A: its sizes, and those of b, are beyond what double precision can scale")
    if size == 0.0:
        size = float(np.abs(bounds).max()) or 1.0
    row = np.repeat(np.arange(len(b)), np.diff(csr.indptr))
    value = s[row] * csr.data * s[csr.indices]
    force, rate = s * size, size / s
    return System(
        csr.indptr.astype(np.int64),
        csr.indices.astype(np.int64),
        value,
        _blocks(row, csr.indices, value, rows, d),
        _diagonal(row, csr.indices, value, len(b))[rows:],
        b / rate,
        problem.mu,
        d,
        lower / force[rows:],
        upper / force[rows:],
        force,
        rate,
        kept,
        recover,
    )


def _diagonal(row: Ints, column: Ints, value: Array, size: int) -> Array:
    own = row == column
    diagonal = np.zeros(size)
    diagonal[row[own]] = value[own]
    return diagonal


def _blocks(row: Ints, column: Ints, value: Array, rows: int, d: int) -> Array:
    blocks = np.zeros((rows // d, d, d))
    own = (row < rows) & (column < rows) & (row // d == column // d)
    blocks[row[own] // d, row[own] % d, column[own] % d] = value[own]
    return blocks


def units(A: sp.csr_array, rows: int, d: int) -> Array:
    """s (N,): one over the root of the mean diagonal, per contact; where there is none, it equilibrates."""
    diagonal = np.abs(A.diagonal())
    diagonal[:rows] = np.repeat(diagonal[:rows].reshape(-1, d).mean(axis=1), d)
    some = diagonal > 0.0
    if some[:rows].any() and not some[:rows].all():
        diagonal[:rows][~some[:rows]] = diagonal[:rows][some[:rows]].min()
        some = diagonal > 0.0
    s = 1.0 / np.sqrt(np.where(some, diagonal, 1.0))
    if not some.all():
        equilibrate(A.indptr, A.indices, A.data, some, rows, d, s)
    return s


@kernel
def equilibrate(
    row_start: Ints, column: Ints, value: Reals, fixed: NDArray[np.bool_], rows: int, d: int, s: Reals
) -> None:
    """Change s where it is not fixed, so that the largest entries of s_i |A_ij| s_j are about one."""
    size = len(s)
    for _ in range(_ROUNDS):
        for i in range(size):
            largest = 0.0
            for k in range(row_start[i], row_start[i + 1]):
                largest = max(largest, abs(value[k]) * s[column[k]])
            if not fixed[i] and largest > 0.0:
                s[i] = math.sqrt(s[i] / largest)
        for c in range(rows // d):
            least = math.inf
            for i in range(c * d, (c + 1) * d):
                least = min(least, s[i])
            for i in range(c * d, (c + 1) * d):
                s[i] = least


def _eliminated(problem: Problem) -> tuple[Ints, Matrix, Array, Callable[[Array], Array]]:
    """Kept places, their matrix and offset, and the way back to all unknowns.

    The free ones are x_g = -(A_gg)^-1 (A_gk x_k + b_g), unless A_gg is singular or nearly so.
    """
    free = np.isneginf(problem.lower) & np.isposinf(problem.upper)
    everything, A, b = np.arange(len(problem.b)), problem.A, problem.b
    whole = everything, A, b, lambda x: x
    fixed = np.concatenate([np.zeros(problem.rows, bool), free])
    kept, gone = everything[~fixed], everything[fixed]
    sparse = sp.issparse(A)
    if len(gone) == 0 or (sparse and len(kept) * len(gone) > _LARGEST):
        return whole
    rows, above = A[gone], A[kept]
    own, across, back, front = rows[:, gone], rows[:, kept], above[:, gone], above[:, kept]
    solve = _eliminate_sparse(own) if sparse else _eliminate_dense(own)
    if solve is None:
        return whole
    response = solve(across)
    correction = solve(own @ response - across)
    if not abs(correction).max() <= _ACCURATE * abs(response).max() if len(kept) else False:
        return whole
    response = response - correction
    noise = abs(correction) + _ROUNDING * abs(response)

    def recover(x: Array) -> Array:
        full = np.zeros(len(b))
        full[kept] = x
        for _ in range(2):
            full[gone] -= solve(rows @ full + b[gone])
        return full

    left = _without_rounding(front - back @ response, front, back, noise)
    return kept, left, b[kept] + back @ recover(np.zeros(len(kept)))[gone], recover


def _eliminate_dense(own: Array) -> Solve | None:
    size = np.abs(own).max(axis=1, initial=0.0) * np.abs(own).max(axis=0, initial=0.0)
    if not (size > 0.0).all():
        return None
    s = size**-0.25
    factor, exchanges, _ = dgetrf(own * s[:, None] * s)
    pivots = np.abs(np.diag(factor))
    if not pivots.min() > _REGULAR * pivots.max():
        return None

    def solve(right: Array) -> Array:
        scale = s[:, None] if right.ndim == 2 else s
        return np.asarray(dgetrs(factor, exchanges, scale * right)[0] * scale)

    return solve


def _eliminate_sparse(own: sp.csr_array) -> Solve | None:
    diagonal = own.diagonal()
    if own.nnz == np.count_nonzero(diagonal) == own.shape[0]:
        inverse = sp.diags_array(1.0 / diagonal)
        return lambda right: inverse @ right
    try:
        factor = splu(sp.csc_array(own))
    except RuntimeError:
        return None
    pivots = np.abs(factor.U.diagonal())
    if not pivots.min() > _REGULAR * pivots.max():
        return None
    return lambda right: factor.solve(right.toarray() if sp.issparse(right) else right)


def _without_rounding(left: Matrix, front: Matrix, back: Matrix, noise: Matrix) -> Matrix:
    """`left` less what is nothing beside the rounding in its diagonal; `noise` is that of the response."""
    product = abs(back) * abs(noise.T)
    terms = _ROUNDING * np.abs(front.diagonal()) + np.asarray(product.sum(axis=1)).ravel()
    least = 2.0 * np.sqrt(terms)
    if not sp.issparse(left):
        return np.where(np.abs(left) > least[:, None] * least, left, 0.0)
    entries = sp.coo_array(left)
    row, column = entries.coords
    entries.data[np.abs(entries.data) <= least[row] * least[column]] = 0.0
    entries.eliminate_zeros()
    return sp.csr_array(entries)

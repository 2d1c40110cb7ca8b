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

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.linalg.lapack import dgetrf, dgetrs
from scipy.sparse.linalg import splu

from rungwise.contact.mixed import Array, Matrix, Problem
from rungwise.kernel import Ints, Reals, kernel

_REGULAR = 1e-13
_NOTHING = 2.0**-49
_ROUNDS = 10
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
    """The system of `problem`."""
    kept, A, b, recover = _eliminated(problem)
    rows, d = problem.rows, problem.directions
    lower, upper = problem.lower[kept[rows:] - rows], problem.upper[kept[rows:] - rows]
    csr = sp.csr_array(A)
    s = _units(csr, rows, d)
    bounds = np.concatenate([lower[np.isfinite(lower)], upper[np.isfinite(upper)], [0.0]])
    size = float(np.linalg.norm(s * b))
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


def _units(A: sp.csr_array, rows: int, d: int) -> Array:
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
    """Kept places, their matrix and offset, and the way back to all unknowns."""
    free = np.isneginf(problem.lower) & np.isposinf(problem.upper)
    everything = np.arange(len(problem.b))
    if free.any():
        fixed = np.concatenate([np.zeros(problem.rows, bool), free])
        kept, gone = everything[~fixed], everything[fixed]
        eliminate = _eliminate_sparse if sp.issparse(problem.A) else _eliminate_dense
        found = eliminate(problem.A, problem.b, kept, gone)
        if found is not None:
            return kept, *found
    return everything, problem.A, problem.b, lambda x: x


def _eliminate_dense(
    A: Array, b: Array, kept: Ints, gone: Ints
) -> tuple[Array, Array, Callable[[Array], Array]] | None:
    own = A[np.ix_(gone, gone)]
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

    return _schur(A, b, kept, gone, solve, solve(A[np.ix_(gone, kept)]))


def _eliminate_sparse(
    A: sp.csr_array, b: Array, kept: Ints, gone: Ints
) -> tuple[Matrix, Array, Callable[[Array], Array]] | None:
    own, across = sp.csc_array(A[gone][:, gone]), sp.csc_array(A[gone][:, kept])
    diagonal = own.diagonal()
    if own.nnz == np.count_nonzero(diagonal) == len(gone):
        return _schur(
            A,
            b,
            kept,
            gone,
            lambda right: right / diagonal,
            sp.csc_array(sp.diags_array(1.0 / diagonal) @ across),
        )
    if len(kept) * len(gone) > _LARGEST:
        return None
    try:
        factor = splu(own)
    except RuntimeError:
        return None
    pivots = np.abs(factor.U.diagonal())
    if not pivots.min() > _REGULAR * pivots.max():
        return None
    return _schur(A, b, kept, gone, factor.solve, sp.csc_array(factor.solve(across.toarray())))


def _schur(
    A: Matrix, b: Array, kept: Ints, gone: Ints, solve: Callable[[Array], Array], response: Matrix
) -> tuple[Matrix, Array, Callable[[Array], Array]]:
    """What is left of A and b with x_gone = -(A_gg)^-1 (A_gk x_k + b_g)."""
    sparse = sp.issparse(A)
    rows = A[gone] if sparse else A[gone, :]
    back = A[kept][:, gone] if sparse else A[np.ix_(kept, gone)]
    front = A[kept][:, kept] if sparse else A[np.ix_(kept, kept)]
    left = _without_rounding(front - back @ response, front, back, response)
    offset = b[kept] - back @ solve(b[gone])

    def recover(x: Array) -> Array:
        full = np.zeros(len(b))
        full[kept] = x
        for _ in range(2):
            full[gone] -= solve(rows @ full + b[gone])
        return full

    return left, offset, recover


def _without_rounding(left: Matrix, front: Matrix, back: Matrix, response: Matrix) -> Matrix:
    """`left` less the entries that are nothing beside the terms of which the diagonal was made."""
    product = abs(back) * abs(response.T)
    terms = np.abs(front.diagonal()) + np.asarray(product.sum(axis=1)).ravel()
    least = np.sqrt(_NOTHING * terms)
    if not sp.issparse(left):
        return np.where(np.abs(left) > least[:, None] * least, left, 0.0)
    entries = sp.coo_array(left)
    row, column = entries.coords
    entries.data[np.abs(entries.data) <= least[row] * least[column]] = 0.0
    entries.eliminate_zeros()
    return sp.csr_array(entries)

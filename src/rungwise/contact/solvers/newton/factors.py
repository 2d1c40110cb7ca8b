"""Factors of a matrix: how to solve with it, and the sign of its determinant."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.linalg.lapack import dgetrf, dgetrs
from scipy.sparse.csgraph import structural_rank
from scipy.sparse.linalg import splu

from rungwise.contact.problem import Array, Matrix
from rungwise.contact.solvers.work import DENSE
from rungwise.kernel import Ints, kernel

SMALL = 200
"""Unknowns up to which A is dense; chosen by trial, for speed."""
FULL = 0.1
"""Share of entries that are not zero from which on a matrix is taken as dense; chosen by trial, for speed."""


class Factors(NamedTuple):
    """solve(right) (N,) -> (N,); sign: 1 or -1, of the determinant; entries, as `Work` counts them."""

    solve: Callable[[Array], Array]
    sign: int
    entries: float


def factors(J: Matrix, order: str = "MMD_AT_PLUS_A") -> Factors | None:
    """Factors of J (N, N), dense or sparse, its columns in SuperLU's `order`; None if singular."""
    if not sp.issparse(J) or J.nnz > FULL * J.shape[0] ** 2:
        factor, exchanges, fault = dgetrf(J.toarray() if sp.issparse(J) else J)
        if fault:
            return None
        sign, entries = orientation(factor.diagonal(), exchanges), dense_entries(len(factor))
        return Factors(lambda right: np.asarray(dgetrs(factor, exchanges, right)[0]), sign, entries)
    if not J.diagonal().all() and structural_rank(sp.csr_array(J)) < J.shape[0]:
        return None  # SuperLU would find it out, and print complaints
    try:
        made = splu(sp.csc_array(J), permc_spec=order)
    except RuntimeError:
        return None
    sign = parity(made.perm_r.astype(np.int64)) * parity(made.perm_c.astype(np.int64))
    return Factors(made.solve, sign * _signs(made.U.diagonal()), made.nnz)


def diagonal_factors(J: Matrix, least: float = 0.0) -> Factors | None:
    """Factors of a sparse J whose pivots may be its diagonal, where its entry is at least this share of the
    largest entry below, in an order that fills least.

    J is such where inertia and the metric of cones stand beside levers: symmetric but for the signs, as
    quasidefinite matrices are. A second solve restores the digits lost to small pivots. Source: Vanderbei,
    SIAM J. Optim. 5 (1995) 100-113.
    """
    try:
        made = splu(
            sp.csc_array(J),
            permc_spec="MMD_AT_PLUS_A",
            diag_pivot_thresh=least,
            options={"SymmetricMode": True},
        )
    except RuntimeError:
        return None

    def solve(right: Array) -> Array:
        x = made.solve(right)
        return np.asarray(x + made.solve(right - J @ x))

    sign = parity(made.perm_r.astype(np.int64)) * parity(made.perm_c.astype(np.int64))
    return Factors(solve, sign * _signs(made.U.diagonal()), made.nnz)


def dense_entries(size: int) -> float:
    """Entries of dense factors (size, size) as `Work` counts them: fewer, for each takes less time."""
    return float(size**2 * DENSE ** (2 / 3))


def orientation(diagonal: Array, exchanges: NDArray[np.integer]) -> int:
    """Sign of a determinant from the diagonal of U and the rows exchanged one after another."""
    moved = np.count_nonzero(exchanges != np.arange(len(exchanges)))
    return _signs(diagonal) * (-1 if moved % 2 else 1)


def _signs(diagonal: Array) -> int:
    return -1 if np.count_nonzero(diagonal < 0.0) % 2 else 1


@kernel
def parity(order: Ints) -> int:
    """Sign of a permutation, which becomes the identity."""
    sign = 1
    for i in range(len(order)):
        while order[i] != i:
            j = order[i]
            order[i], order[j] = order[j], j
            sign = -sign
    return sign

"""Free unknowns eliminated where they can be: what is left is the Delassus form.

With A_ff regular the free unknowns (velocities, joint forces) follow from the others.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.linalg.lapack import dgetrf, dgetrs
from scipy.sparse.linalg import splu

from rungwise.contact.mixed import Array, Matrix, Problem
from rungwise.contact.units import compressed, fitted
from rungwise.kernel import Ints, Reals, kernel

_REGULAR = 1e-13
_ROUNDING, _ACCURATE = 2.0**-51, 1e-5
Solve = Callable[[Matrix], Any]
_SMALL = 200
"""Unknowns up to which sparse arithmetic takes longer than zeros do."""
_LARGEST = 30_000_000
"""Entries of the dense response that elimination from a sparse form may make."""
FEW, MOST = 2, 700
"""Eliminated unknowns that are worth to be remembered, dense: one for so many others, and no more than that;
sparse ones where there are as many others, and more than that."""


class Condensed(NamedTuple):
    """A = F - B own^-1 C as it was before elimination: own (g, g), sparse where it is large; front (N, 3),
    the rows of F's blocks.

    back_start (N + 1,), back_column, back_value: the rows of B; across_start (N + 1,), across_row,
    across_value: the columns of C.
    """

    own: Matrix
    front: Array
    back_start: Ints
    back_column: Ints
    back_value: Array
    across_start: Ints
    across_row: Ints
    across_value: Array

    def scaled(self, s: Array) -> Condensed:
        """The parts of s A s, s (N,)."""
        back, across = s.repeat(np.diff(self.back_start)), s.repeat(np.diff(self.across_start))
        return self._replace(back_value=back * self.back_value, across_value=across * self.across_value)


class Left(NamedTuple):
    """What is left of a problem: places kept (N,), matrix A and offset b, `recover` from x (N,) to all
    unknowns, and the parts of A. `demanded`: the largest rate demanded over that without forces, infinite if
    there is none."""

    kept: Ints
    A: Matrix
    b: Array
    recover: Callable[[Array], Array]
    condensed: Condensed | None = None
    demanded: float = math.inf


def everything(problem: Problem) -> Left:
    """The problem as it is, dense where it is small."""
    small = sp.issparse(problem.A) and len(problem.b) <= _SMALL
    A = problem.A.toarray() if small else problem.A
    return Left(np.arange(len(problem.b)), A, problem.b, lambda x: x)


def eliminated(problem: Problem) -> Left:
    """What is left: kept places, matrix, offset, the way back to all unknowns, and the matrix's parts.

    The free ones are x_g = -(A_gg)^-1 (A_gk x_k + b_g), unless A_gg is singular or nearly so.
    """
    whole = everything(problem)
    if not problem.free.any():
        return whole
    places, A, b = whole[:3]
    fixed = np.concatenate([np.zeros(problem.rows, bool), problem.free])
    kept, gone = places[~fixed], places[fixed]
    sparse = sp.issparse(A)
    if sparse and len(kept) * len(gone) > _LARGEST:
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
    if isinstance(response, np.ndarray):
        # A column is no better known than its largest entry, in units of the unknowns.
        unit = np.empty(len(gone))
        fitted(*compressed(own), 0, 1, unit)
        noise += _ROUNDING * unit[:, None] * (np.abs(response) / unit[:, None]).max(axis=0, initial=0.0)

    def recover(x: Array) -> Array:
        full = np.zeros(len(b))
        full[kept] = x
        for _ in range(2):
            full[gone] -= solve(rows @ full + b[gone])
        return full

    left = _without_rounding(front - back @ response, front, back, noise)
    still = recover(np.zeros(len(kept)))[gone]
    offset = b[kept] + back @ still
    # What should cancel, and does but for rounding, is no demand.
    offset[np.abs(offset) <= _ROUNDING * (np.abs(b[kept]) + abs(back) @ np.abs(still))] = 0.0
    condensed = _condensed(problem, own, across, back, front)
    return Left(kept, left, offset, recover, condensed, _demanded(problem, offset))


def _demanded(problem: Problem, without_forces: Array) -> float:
    rows, velocities = problem.rows, problem.velocities
    if velocities == 0 or not problem.b[rows : rows + velocities].any():
        return math.inf
    demands = float(np.abs(problem.demands).max(initial=0.0))
    largest = float(np.abs(without_forces).max(initial=0.0))
    return demands / largest if 0.0 < demands < largest else math.inf


def _condensed(
    problem: Problem, own: Matrix, across: Matrix, back: Matrix, front: Matrix
) -> Condensed | None:
    """The parts, where they are few, or many but sparse, and `front` has only the blocks of contacts."""
    few = own.shape[0] <= min(MOST, front.shape[0] // FEW)
    if not few and not (sp.issparse(own) and front.shape[0] >= max(MOST, own.shape[0])):
        return None
    rows, d = problem.rows, problem.directions
    entries = sp.coo_array(front)
    row, column = entries.coords
    apart = np.where(np.maximum(row, column) < rows, row // d != column // d, row != column)
    if apart.any():
        return None
    blocks = np.zeros((front.shape[0], 3))
    blocks[row, np.where(row < rows, column % d, 0)] = entries.data
    start, place, value = compressed(across.T.tocsr() if sp.issparse(across) else across.T)
    return Condensed(
        own.toarray() if few and sp.issparse(own) else own, blocks, *compressed(back), start, place, value
    )


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
    made = sp.csr_array(left)
    prune(made.indptr, made.indices, made.data, least)
    made.eliminate_zeros()
    return made


@kernel
def prune(row_start: NDArray[np.int32], column: NDArray[np.int32], value: Reals, least: Reals) -> None:
    """Make zero what is at most the product of the least values of its row and column."""
    for i in range(len(least)):
        for k in range(row_start[i], row_start[i + 1]):
            if abs(value[k]) <= least[i] * least[column[k]]:
                value[k] = 0.0

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
"""Eliminated unknowns that are worth to be remembered: one for so many others, and no more than that."""


class Condensed(NamedTuple):
    """A = F - B own^-1 C as it was before elimination: own (g, g); front (N, 3), the rows of F's blocks.

    back_start (N + 1,), back_column, back_value: the rows of B; across_start (N + 1,), across_row,
    across_value: the columns of C.
    """

    own: Array
    front: Array
    back_start: Ints
    back_column: Ints
    back_value: Array
    across_start: Ints
    across_row: Ints
    across_value: Array

    def scaled(self, s: Array, rows: int, d: int) -> Condensed:
        """The parts of s A s, s (N,), the first so many rows in blocks of d."""
        back, across = s.repeat(np.diff(self.back_start)), s.repeat(np.diff(self.across_start))
        return self._replace(
            front=_scaled_blocks(self.front, s, rows, d), back_value=back * self.back_value,
            across_value=across * self.across_value,
        )  # fmt: skip


class Product(NamedTuple):
    """A = F - B R, R = own^-1 C: far fewer numbers than A has, where bodies touch at many points.

    front (N, 3): the rows of F's blocks; back_start (N + 1,), back_column, back_value: the rows of B;
    response_start (N + 1,), response_row, response_value: the columns of R; diagonal (N,): that of A;
    velocities: R's rows.
    """

    front: Array
    back_start: Ints
    back_column: Ints
    back_value: Array
    response_start: Ints
    response_row: Ints
    response_value: Array
    diagonal: Array
    velocities: int

    def scaled(self, s: Array, rows: int, d: int) -> Product:
        """The parts of s A s, s (N,), the first so many rows in blocks of d."""
        back, response = s.repeat(np.diff(self.back_start)), s.repeat(np.diff(self.response_start))
        return self._replace(
            front=_scaled_blocks(self.front, s, rows, d), back_value=back * self.back_value,
            response_value=response * self.response_value, diagonal=s * s * self.diagonal,
        )  # fmt: skip


def _scaled_blocks(blocks: Array, s: Array, rows: int, d: int) -> Array:
    if not blocks.any():
        return blocks
    i = np.arange(len(s))
    first = np.where(i < rows, i // d * d, i)
    return np.asarray(blocks * s[:, None] * np.append(s, [0.0, 0.0])[first[:, None] + np.arange(3)])


class Left(NamedTuple):
    """What is left of a problem: places kept (N,), what makes the matrix A, offset b, `recover` from x (N,)
    to all unknowns, and the parts of A. `demanded`: the largest rate demanded over that without forces,
    infinite if there is none."""

    kept: Ints
    matrix: Callable[[], Matrix]
    b: Array
    recover: Callable[[Array], Array]
    condensed: Condensed | None = None
    product: Product | None = None
    demanded: float = math.inf


def everything(problem: Problem) -> Left:
    """The problem as it is, dense where it is small."""
    A = _whole(problem)
    return Left(np.arange(len(problem.b)), lambda: A, problem.b, lambda x: x)


def _whole(problem: Problem) -> Matrix:
    small = sp.issparse(problem.A) and len(problem.b) <= _SMALL
    return problem.A.toarray() if small else problem.A


def eliminated(problem: Problem) -> Left:
    """What is left: kept places, matrix, offset, the way back to all unknowns, and the matrix's parts.

    The free ones are x_g = -(A_gg)^-1 (A_gk x_k + b_g), unless A_gg is singular or nearly so.
    """
    free = np.isneginf(problem.lower) & np.isposinf(problem.upper)
    A, b = _whole(problem), problem.b
    fixed = np.concatenate([np.zeros(problem.rows, bool), free])
    kept, gone = np.flatnonzero(~fixed), np.flatnonzero(fixed)
    sparse = sp.issparse(A)
    if len(gone) == 0 or (sparse and len(kept) * len(gone) > _LARGEST):
        return everything(problem)
    own, across, back, front = (_part(A, rows, columns) for rows in (gone, kept) for columns in (gone, kept))
    solve = _eliminate_sparse(own) if sparse else _eliminate_dense(own)
    if solve is None:
        return everything(problem)
    response = solve(across)
    correction = solve(own @ response - across)
    if not _largest(correction) <= _ACCURATE * _largest(response):
        return everything(problem)
    response = response - correction

    def velocities(x: Array) -> Array:
        push, v = across @ x + b[gone], np.zeros(len(gone))
        for _ in range(2):
            v -= solve(own @ v + push)
        return v

    def recover(x: Array) -> Array:
        full = np.empty(len(b))
        full[kept], full[gone] = x, velocities(x)
        return full

    def matrix() -> Matrix:
        return _without_rounding(own, front, back, response, correction)

    still = velocities(np.zeros(len(kept)))
    offset = b[kept] + back @ still
    # What should cancel, and does but for rounding, is no demand.
    offset[np.abs(offset) <= _ROUNDING * (np.abs(b[kept]) + abs(back) @ np.abs(still))] = 0.0
    condensed = _condensed(problem, own, across, back, front)
    product = None
    if condensed is not None and sp.issparse(response):
        product = _product(problem, condensed, response, correction)
    return Left(kept, matrix, offset, recover, condensed, product, _demanded(problem, offset))


def _part(A: Matrix, rows: Ints, columns: Ints) -> Matrix:
    """A in these rows and columns, both in order."""
    if not sp.issparse(A):
        return A[np.ix_(rows, columns)]
    number = np.full(A.shape[1], -1)
    number[columns] = np.arange(len(columns))
    start, column, value = np.empty(len(rows) + 1, np.int32), np.empty(A.nnz, np.int32), np.empty(A.nnz)
    used = gather(A.indptr, A.indices, A.data, rows, number, start, column, value)
    return sp.csr_array((value[:used], column[:used], start), shape=(len(rows), len(columns)))


@kernel
def gather(
    row_start: NDArray[np.int32],
    column: NDArray[np.int32],
    value: Reals,
    rows: Ints,
    number: Ints,
    start: NDArray[np.int32],
    place: NDArray[np.int32],
    entry: Reals,
) -> int:
    """Fill the entries of these rows whose columns have a number, which is then theirs; returns how many."""
    used = 0
    for i in range(len(rows)):
        start[i] = used
        for k in range(row_start[rows[i]], row_start[rows[i] + 1]):
            if number[column[k]] >= 0:
                place[used], entry[used] = number[column[k]], value[k]
                used += 1
    start[len(rows)] = used
    return used


def _largest(A: Matrix) -> float:
    return float(np.abs(A.data if sp.issparse(A) else A).max(initial=0.0))


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
    """The parts, where they are few and `front` has only the blocks of contacts."""
    if not FEW * own.shape[0] <= front.shape[0] or own.shape[0] > MOST:
        return None
    blocks = np.zeros((front.shape[0], 3))
    if not gather_blocks(*compressed(front), problem.rows, problem.directions, blocks):
        return None
    dense = own.toarray() if sp.issparse(own) else own
    return Condensed(dense, blocks, *compressed(back), *_columns(across))


@kernel
def gather_blocks(row_start: Ints, column: Ints, value: Reals, rows: int, d: int, blocks: Reals) -> bool:
    """Fill the rows of contacts' blocks; False if there is anything beside these and the others' diagonal."""
    for i in range(len(blocks)):
        for k in range(row_start[i], row_start[i + 1]):
            first = column[k] // d * d if column[k] < rows else column[k]
            if first != (i // d * d if i < rows else i):
                return False
            blocks[i, column[k] - first] = value[k]
    return True


def _columns(A: Matrix) -> tuple[Ints, Ints, Array]:
    """Starts of the columns, rows in order and values of what is not zero in A."""
    return compressed(sp.csr_array(A.T) if sp.issparse(A) else A.T)


def _product(problem: Problem, parts: Condensed, response: Matrix, correction: Matrix) -> Product | None:
    """A as a product; None where units do not follow from its diagonal."""
    size, columns = len(parts.front), _columns(response)
    diagonal, terms, row = np.zeros(size), np.zeros(size), np.zeros(len(parts.own))
    back = parts.back_start, parts.back_column, parts.back_value
    accumulate(*back, *columns, -1.0, False, row, diagonal)
    accumulate(*back, *columns, _ROUNDING, True, row, terms)
    accumulate(*back, *_columns(correction), 1.0, True, row, terms)
    i = np.arange(size)
    own = parts.front[i, np.where(i < problem.rows, i % problem.directions, 0)]
    diagonal += own
    diagonal[np.abs(diagonal) <= 4.0 * (terms + _ROUNDING * np.abs(own))] = 0.0
    if not diagonal[: problem.rows].any() or not diagonal[problem.rows :].all():
        return None
    return Product(parts.front, *back, *columns, diagonal, len(row))


@kernel
def accumulate(
    row_start: Ints,
    column: Ints,
    value: Reals,
    column_start: Ints,
    row: Ints,
    other: Reals,
    factor: float,
    absolute: bool,
    scratch: Reals,
    out: Reals,
) -> None:
    """Add the diagonal of a product, or of that of absolute values, times the factor; scratch is zero."""
    for i in range(len(out)):
        for k in range(row_start[i], row_start[i + 1]):
            scratch[column[k]] = value[k]
        for k in range(column_start[i], column_start[i + 1]):
            term = scratch[row[k]] * other[k]
            out[i] += factor * (abs(term) if absolute else term)
        for k in range(row_start[i], row_start[i + 1]):
            scratch[column[k]] = 0.0


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


def _without_rounding(
    own: Matrix, front: Matrix, back: Matrix, response: Matrix, correction: Matrix
) -> Matrix:
    """front - back response, less what is nothing beside the rounding in its diagonal."""
    noise = abs(correction) + _ROUNDING * abs(response)
    if isinstance(response, np.ndarray):
        # A column is no better known than its largest entry, in units of the unknowns.
        unit = np.empty(own.shape[0])
        fitted(*compressed(own), 0, 1, unit)
        noise += _ROUNDING * unit[:, None] * (np.abs(response) / unit[:, None]).max(axis=0, initial=0.0)
    left, product = front - back @ response, abs(back) * abs(noise.T)
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

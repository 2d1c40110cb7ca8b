"""The matrix of a problem before velocities were eliminated, as a product: it has far fewer numbers.

Where bodies touch at many points there are far more forces than velocities, and each force acts on few.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

from rungwise.contact.prepare.inverse import Sparse
from rungwise.contact.prepare.units import compressed
from rungwise.contact.problem import Array, Matrix, Problem
from rungwise.kernel import Ints, Reals, kernel

ROUNDING = 2.0**-51
"""Rounding of a value, over the value: four roundings of double precision."""
FEW, MOST = 2, 1000
"""Eliminated unknowns that are kept dense: one for `FEW` others, and no more than `MOST`."""
_MANY = 700
"""Number of other unknowns from which on sparse eliminated ones are kept, too, if they are no more."""


class Condensed(NamedTuple):
    """A = F - B own^-1 C as it was before elimination: own (g, g), sparse where it is large; front
    (N, 3), the rows of F's blocks.

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
    response_start (N + 1,), response_row, response_value: the columns of R; diagonal (N,): the diagonal of A;
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


def condensed(problem: Problem, own: Matrix, across: Matrix, back: Matrix, front: Matrix) -> Condensed | None:
    """The parts of A, where they are few, or many but sparse, and `front` has only the blocks of contacts."""
    few = own.shape[0] <= min(MOST, front.shape[0] // FEW)
    if not few and not (sp.issparse(own) and front.shape[0] >= max(_MANY, own.shape[0])):
        return None
    blocks = np.zeros((front.shape[0], 3))
    if not gather_blocks(*compressed(front), problem.rows, problem.directions, blocks):
        return None
    return Condensed(
        own.toarray() if few and sp.issparse(own) else own, blocks, *compressed(back), *columns(across)
    )


@kernel
def gather_blocks(row_start: Ints, column: Ints, value: Reals, rows: int, d: int, blocks: Reals) -> bool:
    """Fill the rows of contacts' blocks; False if there are entries beside these and the others' diagonal."""
    for i in range(len(blocks)):
        for k in range(row_start[i], row_start[i + 1]):
            first = column[k] // d * d if column[k] < rows else column[k]
            if first != (i // d * d if i < rows else i):
                return False
            blocks[i, column[k] - first] = value[k]
    return True


def columns(A: Matrix) -> Sparse:
    """Starts of the columns, rows in order and values of the entries of A that are not zero."""
    if not sp.issparse(A):
        return compressed(A.T)
    A = A.tocsc()
    return A.indptr.astype(np.int64), A.indices.astype(np.int64), A.data


def product(problem: Problem, parts: Condensed, response: Sparse, change: Array) -> Product | None:
    """A as a product, from the response in columns and its known error; None where units do not follow from
    A's diagonal."""
    size = len(parts.front)
    diagonal, terms, scratch = np.zeros(size), np.zeros(size), np.zeros(parts.own.shape[0])
    back, (start, row, value) = (parts.back_start, parts.back_column, parts.back_value), response
    accumulate(*back, start, row, -value, False, scratch, diagonal)
    accumulate(*back, start, row, np.abs(change) + ROUNDING * np.abs(value), True, scratch, terms)
    i = np.arange(size)
    own = parts.front[i, np.where(i < problem.rows, i % problem.directions, 0)]
    diagonal += own
    diagonal[np.abs(diagonal) <= 4.0 * (terms + ROUNDING * np.abs(own))] = 0.0
    if not diagonal[: problem.rows].any() or not diagonal[problem.rows :].all():
        return None
    return Product(parts.front, *back, *response, diagonal, len(scratch))


@kernel
def accumulate(
    row_start: Ints,
    column: Ints,
    value: Reals,
    column_start: Ints,
    row: Ints,
    other: Reals,
    absolute: bool,
    scratch: Reals,
    out: Reals,
) -> None:
    """Add the diagonal of a product, or of the product of absolute values; scratch is zero."""
    for i in range(len(out)):
        for k in range(row_start[i], row_start[i + 1]):
            scratch[column[k]] = value[k]
        for k in range(column_start[i], column_start[i + 1]):
            term = scratch[row[k]] * other[k]
            out[i] += abs(term) if absolute else term
        for k in range(row_start[i], row_start[i + 1]):
            scratch[column[k]] = 0.0

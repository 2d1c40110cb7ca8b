"""The matrix of a problem before velocities were eliminated, as a product: it has far fewer numbers.

Where bodies touch at many points there are far more forces than velocities, and each force acts on few.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

from rungwise.contact.prepare.units import Sparse, compressed
from rungwise.contact.problem import Array, Matrix, Problem
from rungwise.kernel import Reals, kernel

ROUNDING = 2.0**-51
"""Rounding of a value, over the value: four roundings of double precision."""
FEW, MOST = 2, 1000
"""Eliminated unknowns that are kept dense: one for `FEW` others, and no more than `MOST`."""
_MANY = 700
"""Number of other unknowns from which on sparse eliminated ones are kept, too, if they are no more."""


class Condensed(NamedTuple):
    """A = F - B own^-1 C as it was before elimination: own (g, g), sparse where it is large; front
    (N, 3), the rows of F's blocks; back, the rows of B (N, g); across, the columns of C (g, N)."""

    own: Matrix
    front: Array
    back: Sparse
    across: Sparse

    def scaled(self, s: Array, rows: int, d: int) -> Condensed:
        """The parts of s A s, s (N,), the first so many rows in blocks of d."""
        front = _scaled_blocks(self.front, s, rows, d)
        return Condensed(self.own, front, self.back.scaled(s), self.across.scaled(s))


class Product(NamedTuple):
    """A = F - B R, R = own^-1 C: far fewer numbers than A has, where bodies touch at many points.

    front (N, 3): the rows of F's blocks; back: the rows of B (N, g); response: the columns of R (g, N);
    diagonal (N,): the diagonal of A; velocities: g.
    """

    front: Array
    back: Sparse
    response: Sparse
    diagonal: Array
    velocities: int

    def scaled(self, s: Array, rows: int, d: int) -> Product:
        """The parts of s A s, s (N,), the first so many rows in blocks of d."""
        return Product(
            _scaled_blocks(self.front, s, rows, d), self.back.scaled(s), self.response.scaled(s),
            s * s * self.diagonal, self.velocities,
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
    if not gather_blocks(compressed(front), problem.rows, problem.directions, blocks):
        return None
    own = own.toarray() if few and sp.issparse(own) else own
    return Condensed(own, blocks, compressed(back), columns(across))


@kernel
def gather_blocks(A: Sparse, rows: int, d: int, blocks: Reals) -> bool:
    """Fill the rows of contacts' blocks; False if there are entries beside these and the others' diagonal."""
    for i in range(len(blocks)):
        for k in range(A.start[i], A.start[i + 1]):
            first = A.place[k] // d * d if A.place[k] < rows else A.place[k]
            if first != (i // d * d if i < rows else i):
                return False
            blocks[i, A.place[k] - first] = A.value[k]
    return True


def columns(A: Matrix) -> Sparse:
    """The columns of A: the entries that are not zero, rows in order."""
    if not sp.issparse(A):
        return compressed(A.T)
    A = A.tocsc()
    return Sparse(A.indptr.astype(np.int64), A.indices.astype(np.int64), A.data)


def product(problem: Problem, parts: Condensed, response: Sparse, change: Array) -> Product | None:
    """A as a product, from the response in columns and its known error; None where units do not follow from
    A's diagonal."""
    size = len(parts.front)
    diagonal, terms, scratch = np.zeros(size), np.zeros(size), np.zeros(parts.own.shape[0])
    errors = np.abs(change) + ROUNDING * np.abs(response.value)
    accumulate(parts.back, response._replace(value=-response.value), False, scratch, diagonal)
    accumulate(parts.back, response._replace(value=errors), True, scratch, terms)
    i = np.arange(size)
    own = parts.front[i, np.where(i < problem.rows, i % problem.directions, 0)]
    diagonal += own
    diagonal[np.abs(diagonal) <= 4.0 * (terms + ROUNDING * np.abs(own))] = 0.0
    if not diagonal[: problem.rows].any() or not diagonal[problem.rows :].all():
        return None
    return Product(parts.front, parts.back, response, diagonal, len(scratch))


@kernel
def accumulate(A: Sparse, B: Sparse, absolute: bool, scratch: Reals, out: Reals) -> None:
    """Add the diagonal of A B, of rows of A and columns of B, or of |A| |B|; scratch is zero."""
    for i in range(len(out)):
        for k in range(A.start[i], A.start[i + 1]):
            scratch[A.place[k]] = A.value[k]
        for k in range(B.start[i], B.start[i + 1]):
            term = scratch[B.place[k]] * B.value[k]
            out[i] += abs(term) if absolute else term
        for k in range(A.start[i], A.start[i + 1]):
            scratch[A.place[k]] = 0.0

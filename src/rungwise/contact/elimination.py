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
from scipy.sparse.linalg import splu

from rungwise.contact import schur
from rungwise.contact.inverse import Sparse, inverse, responses
from rungwise.contact.mixed import Array, Matrix, Problem
from rungwise.contact.product import ROUNDING, Condensed, Product, columns, condensed, product
from rungwise.contact.schur import ACCURATE, DOUBT, REGULAR
from rungwise.contact.units import compressed, fitted, part
from rungwise.kernel import Ints, Reals, kernel

Solve = Callable[[Matrix], Any]
_SMALL = 200
"""Unknowns up to which sparse arithmetic takes longer than zeros do."""
_LARGEST = 30_000_000
"""Entries of the dense response that elimination from a sparse form may make."""


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
    """The problem as it is, dense where it is small, and else sparse."""
    A = _whole(problem)
    return Left(np.arange(len(problem.b)), lambda: A, problem.b, lambda x: x)


def _whole(problem: Problem) -> Matrix:
    if len(problem.b) > _SMALL:
        return sp.csr_array(problem.A)
    return problem.A.toarray() if sp.issparse(problem.A) else problem.A


def eliminated(problem: Problem) -> Left:
    """What is left: kept places, matrix, offset, the way back to all unknowns, and the matrix's parts.

    The free ones are x_g = -(A_gg)^-1 (A_gk x_k + b_g), unless A_gg is singular or nearly so.
    """
    if not problem.free.any():
        return everything(problem)
    A, b = _whole(problem), problem.b
    fixed = np.concatenate([np.zeros(problem.rows, bool), problem.free])
    kept, gone = np.flatnonzero(~fixed), np.flatnonzero(fixed)
    if isinstance(A, np.ndarray):
        return _eliminated_small(problem, A, kept, gone)
    if len(kept) * len(gone) > _LARGEST:
        return everything(problem)
    own, across, back, front = (part(A, rows, columns) for rows in (gone, kept) for columns in (gone, kept))
    response = _respond(own, across)
    if response is None:
        return everything(problem)
    solve, matrices, found = response

    def velocities(x: Array) -> Array:
        push = across @ x + b[gone]
        v = -solve(push)
        return np.asarray(v - solve(own @ v + push))

    def recover(x: Array) -> Array:
        full = np.empty(len(b))
        full[kept], full[gone] = x, velocities(x)
        return full

    def matrix() -> Matrix:
        return _without_rounding(own, front, back, *matrices())

    still = velocities(np.zeros(len(kept)))
    offset = b[kept] + back @ still
    # What should cancel, and does but for rounding, is no demand.
    doubt = DOUBT * np.abs(solve(own @ still + b[gone])) + ROUNDING * np.abs(still)
    offset[np.abs(offset) <= ROUNDING * np.abs(b[kept]) + abs(back) @ doubt] = 0.0
    parts = condensed(problem, own, across, back, front)
    whole = None if parts is None or found is None else product(problem, parts, *found)
    return Left(kept, matrix, offset, recover, parts, whole, _demanded(problem, kept, offset))


def _eliminated_small(problem: Problem, A: Array, kept: Ints, gone: Ints) -> Left:
    k, g, b = len(kept), len(gone), problem.b
    left, offset = np.empty((k, k)), np.empty(k)
    solver = np.empty((g, g)), np.empty(g), np.empty(g, np.int64)
    if not schur.eliminate(A, b, kept, gone, left, offset, *solver, np.empty(g)):
        return everything(problem)

    def recover(x: Array) -> Array:
        full = np.empty(len(b))
        full[kept] = x
        schur.recover(A, b, kept, gone, *solver, full)
        return full

    parts = condensed(problem, *(part(A, rows, columns) for rows in (gone, kept) for columns in (gone, kept)))
    return Left(kept, lambda: left, offset, recover, parts, None, _demanded(problem, kept, offset))


class Response(NamedTuple):
    """`solve` solves with A_gg; `matrices` are A_gg^-1 A_gk and how much a second solution changed it;
    `columns`, where they are sparse, its columns and the changes of their values."""

    solve: Solve
    matrices: Callable[[], tuple[Matrix, Matrix]]
    columns: tuple[Sparse, Array] | None = None


def _respond(own: sp.csr_array, across: sp.csr_array) -> Response | None:
    """How the eliminated unknowns respond to the others; None where A_gg is singular or nearly so."""
    if (inverted := inverse(compressed(own))) is not None:
        (start, row, value), change = responses(compressed(own), inverted, columns(across))
        if not _largest(change) <= ACCURATE * _largest(value):
            return None
        solver = sp.csr_array(inverted[::-1], shape=own.shape)

        def matrices() -> tuple[Matrix, Matrix]:
            return tuple(sp.csc_array((v, row, start), shape=across.shape).tocsr() for v in (value, change))

        return Response(lambda right: solver @ right, matrices, ((start, row, value), change))
    solve = _factors(own)
    if solve is None:
        return None
    response = solve(across)
    correction = solve(own @ response - across)
    if not _largest(correction) <= ACCURATE * _largest(response):
        return None
    return Response(solve, lambda: (response - correction, correction))


def _largest(A: Array) -> float:
    return float(np.abs(A).max(initial=0.0))


def _demanded(p: Problem, kept: Ints, offset: Array) -> float:
    return float(schur.demanded(p.b, p.rows, p.velocities, p.lower, p.upper, kept, offset))


def _factors(own: sp.csr_array) -> Solve | None:
    try:
        factor = splu(sp.csc_array(own))
    except RuntimeError:
        return None
    pivots = np.abs(factor.U.diagonal())
    if not pivots.min() > REGULAR * pivots.max():
        return None
    return lambda right: factor.solve(right.toarray() if sp.issparse(right) else right)


def _without_rounding(
    own: sp.csr_array, front: sp.csr_array, back: sp.csr_array, response: Matrix, correction: Matrix
) -> Matrix:
    """front - back response, less what is nothing beside the rounding in its diagonal."""
    noise = abs(correction) + ROUNDING * abs(response)
    if isinstance(response, np.ndarray):
        # A column is no better known than its largest entry, in units of the unknowns.
        unit = np.empty(own.shape[0])
        fitted(*compressed(own), 0, 1, unit)
        noise += ROUNDING * unit[:, None] * (np.abs(response) / unit[:, None]).max(axis=0, initial=0.0)
    left, product = front - back @ response, abs(back) * abs(noise.T)
    terms = ROUNDING * np.abs(front.diagonal()) + np.asarray(product.sum(axis=1)).ravel()
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

"""Free unknowns eliminated where they can be, which leaves the Delassus form.

With A_ff regular the free unknowns (velocities, joint forces) follow from the others.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import SuperLU, splu

from rungwise.contact.prepare import schur
from rungwise.contact.prepare.inverse import inverse, responses
from rungwise.contact.prepare.product import Condensed, Product, columns, condensed, product
from rungwise.contact.prepare.schur import ACCURATE, NOTHING, REGULAR
from rungwise.contact.prepare.units import Sparse, compressed, part
from rungwise.contact.problem import Array, Matrix, Problem
from rungwise.kernel import Ints

Solve = Callable[[Array], Any]
_SMALL = 200
"""Unknowns up to which sparse arithmetic takes longer than zeros do."""
_LARGEST = 30_000_000
"""Entries of the dense response that elimination from a sparse form may make."""


class Left(NamedTuple):
    """The rest of a problem: kept places (N,), a function that makes the matrix A, offset b, `recover` from x
    (N,) to all unknowns, and the parts of A. `demanded`: the largest demanded rate over the largest rate
    without forces, infinite if there is none."""

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
    """The rest of the problem: kept places, matrix, offset, the way back to all unknowns, the matrix's parts.

    The free unknowns are x_g = -(A_gg)^-1 (A_gk x_k + b_g), unless A_gg is singular or nearly so.
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
    solve, rounding, found = response.solve, response.rounding, response.columns

    def velocities(x: Array) -> Array:
        push = across @ x + b[gone]
        v = -solve(push)
        return np.asarray(v - solve(own @ v + push))

    def recover(x: Array) -> Array:
        full = np.empty(len(b))
        full[kept], full[gone] = x, velocities(x)
        return full

    def matrix() -> Matrix:
        made = response.matrix()
        errors = abs(own @ made - across) + NOTHING * (abs(own) @ abs(made) + abs(across))
        terms = abs(front) + abs(back) @ abs(made)
        return _without_rounding(front - back @ made, NOTHING * terms + rounding(back, errors))

    still = velocities(np.zeros(len(kept)))
    offset = b[kept] + back @ still
    # Terms that should cancel, and do but for rounding, are no demand.
    errors = np.abs(own @ still + b[gone]) + NOTHING * (abs(own) @ np.abs(still) + np.abs(b[gone]))
    terms = np.abs(b[kept]) + abs(back) @ np.abs(still)
    offset[np.abs(offset) <= NOTHING * terms + rounding(back, errors)] = 0.0
    parts = condensed(problem, own, across, back, front)
    whole = None if parts is None or found is None else product(problem, parts, *found)
    return Left(kept, matrix, offset, recover, parts, whole, _demanded(problem, kept, offset))


def _eliminated_small(problem: Problem, A: Array, kept: Ints, gone: Ints) -> Left:
    k, g, b = len(kept), len(gone), problem.b
    left, offset = np.empty((k, k)), np.empty(k)
    solver = np.empty((g, g)), np.empty(g), np.empty(g, np.int64)
    if not schur.eliminate(A, b, kept, gone, left, offset, *solver):
        return everything(problem)

    def recover(x: Array) -> Array:
        full = np.empty(len(b))
        full[kept] = x
        schur.recover(A, b, kept, gone, *solver, full)
        return full

    parts = condensed(problem, *(part(A, rows, columns) for rows in (gone, kept) for columns in (gone, kept)))
    return Left(kept, lambda: left, offset, recover, parts, None, _demanded(problem, kept, offset))


class Response(NamedTuple):
    """`solve` solves with A_gg; `matrix` is A_gg^-1 A_gk; `rounding` makes |B A_gg^-1| e, or no less, of B
    and of errors e in the equations of the free unknowns; `columns`, where they are sparse, the response's
    columns and how much a second solution changed their values."""

    solve: Solve
    matrix: Callable[[], Matrix]
    rounding: Callable[[Matrix, Matrix], Matrix]
    columns: tuple[Sparse, Array] | None = None


def _respond(own: sp.csr_array, across: sp.csr_array) -> Response | None:
    """How the eliminated unknowns respond to the others; None where A_gg is singular or nearly so."""
    if (inverted := inverse(compressed(own))) is not None:
        found, change = responses(compressed(own), inverted, columns(across))
        if not _largest(change) <= ACCURATE * _largest(found.value):
            return None
        solver = sp.csr_array(inverted[::-1], shape=own.shape)
        return Response(
            lambda right: solver @ right,
            lambda: sp.csc_array(found[::-1], shape=across.shape).tocsr(),
            lambda back, errors: abs(back) @ (abs(solver) @ errors),
            (found, change),
        )
    factor = _factors(own)
    if factor is None:
        return None
    first = factor.solve(across.toarray())
    change = factor.solve(own @ first - across)
    if not _largest(change) <= ACCURATE * _largest(first):
        return None
    return Response(
        factor.solve,
        lambda: first - change,
        lambda back, errors: np.abs(factor.solve(back.T.toarray(), "T")).T @ errors,
    )


def _largest(A: Array) -> float:
    return float(np.abs(A).max(initial=0.0))


def _demanded(p: Problem, kept: Ints, offset: Array) -> float:
    return float(schur.demanded(p.b, p.rows, p.velocities, p.lower, p.upper, kept, offset))


def _factors(own: sp.csr_array) -> SuperLU | None:
    try:
        factor = splu(sp.csc_array(own))
    except RuntimeError:
        return None
    pivots = np.abs(factor.U.diagonal())
    return factor if pivots.min() > REGULAR * pivots.max() else None


def _without_rounding(left: Matrix, least: Matrix) -> Matrix:
    """The entries of `left` that are larger than `least`, the errors of entries that may be zero."""
    if not sp.issparse(left):
        return np.where(np.abs(left) > least, left, 0.0)
    made = sp.csr_array(left.multiply(abs(left) > least))
    made.eliminate_zeros()
    return made

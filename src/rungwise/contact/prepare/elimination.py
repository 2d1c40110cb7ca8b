"""Free unknowns eliminated where they can be, which leaves the Delassus form.

With A_gg regular the free unknowns (velocities, joint forces) are x_g = -A_gg^-1 (A_gk x_k + b_g). A_gg is
factorised in units in which its largest entries are about one, and each solution is refined once; the change
by refinement tells how well a solution is known, and remainders within this doubt are zero. Source: Higham,
Accuracy and Stability of Numerical Algorithms (2002), chapters 7 and 12.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from scipy.linalg import LinAlgWarning, lu_factor, lu_solve
from scipy.sparse.linalg import splu

from rungwise.contact.prepare.units import part
from rungwise.contact.problem import Array, Matrix, Problem
from rungwise.kernel import Ints

_SMALL = 200
"""Unknowns up to which sparse arithmetic takes longer than zeros do."""
_LARGEST = 30_000_000
"""Entries of the dense response that elimination may make."""
_REGULAR, _ACCURATE = 1e-13, 1e-5
"""Least pivot over the largest; largest change of solutions by refinement, over the largest entry. Chosen by
trial, to a decade; the first is about a thousand roundings of double precision."""
_NOTHING = 2.0**-49
"""Share of its terms up to which a sum may be rounding: each term is rounded when made and when added."""


class Left(NamedTuple):
    """The rest of a problem: kept places (N,), the matrix A, offset b, and `recover` from x (N,) to all
    unknowns. `demanded`: the largest demanded rate over the largest rate without forces, infinite if there is
    none."""

    kept: Ints
    matrix: Matrix
    b: Array
    recover: Callable[[Array], Array]
    demanded: float = math.inf


class Factors(NamedTuple):
    """What solves with a matrix, and with its transpose, for dense right-hand sides."""

    solve: Callable[[Array], Array]
    transposed: Callable[[Array], Array]


def everything(problem: Problem) -> Left:
    """The problem as it is, dense where it is small, and else sparse."""
    return Left(np.arange(len(problem.b)), _whole(problem), problem.b, lambda x: x)


def _whole(problem: Problem) -> Matrix:
    if len(problem.b) > _SMALL:
        return sp.csr_array(problem.A)
    return problem.A.toarray() if sp.issparse(problem.A) else problem.A


def eliminated(problem: Problem) -> Left:
    """The rest of the problem without its free unknowns, unless A_gg is singular or nearly so."""
    b, fixed = problem.b, np.concatenate([np.zeros(problem.rows, bool), problem.free])
    kept, gone = np.flatnonzero(~fixed), np.flatnonzero(fixed)
    if len(gone) == 0 or len(kept) * len(gone) > _LARGEST:
        return everything(problem)
    A = _whole(problem)
    own, across, back, front = (part(A, rows, columns) for rows in (gone, kept) for columns in (gone, kept))
    factors = factorised(own)
    if factors is None:
        return everything(problem)
    right = np.column_stack([_dense(across), b[gone]])
    first = factors.solve(right)
    change = factors.solve(own @ first - right)
    if not _largest(change[:, :-1]) <= _ACCURATE * _largest(first[:, :-1]):
        return everything(problem)
    response = first - change
    # What rounding hides of the response, and what that does to the rows that are left.
    doubt = abs(own @ response - right) + _NOTHING * (abs(own) @ abs(response) + abs(right))
    doubt = abs(factors.transposed(_dense(back).T)).T @ doubt
    before = np.column_stack([_dense(front), b[kept]])
    made = before - back @ response
    made[abs(made) <= _NOTHING * (abs(before) + abs(back) @ abs(response)) + doubt] = 0.0
    left, offset = np.ascontiguousarray(made[:, :-1]), np.ascontiguousarray(made[:, -1])

    def recover(x: Array) -> Array:
        full, push = np.empty(len(b)), across @ x + b[gone]
        v = -factors.solve(push)
        full[kept], full[gone] = x, v - factors.solve(own @ v + push)
        return full

    matrix = sp.csr_array(left) if sp.issparse(A) else left
    return Left(kept, matrix, offset, recover, _demanded(problem, kept, offset))


def _dense(A: Matrix) -> Array:
    return np.asarray(A.toarray() if sp.issparse(A) else A)


def _largest(A: Array) -> float:
    return float(np.abs(A).max(initial=0.0))


def factorised(own: Matrix) -> Factors | None:
    """Factors of a matrix; None where it is singular or nearly so."""
    size = abs(own)
    row, column = (np.asarray(_dense(size.max(axis=axis))).ravel() for axis in (1, 0))
    if not (row * column > 0.0).all():
        return None
    unit = (row * column) ** -0.25
    if sp.issparse(own):
        scaled = sp.csc_array(sp.diags_array(unit) @ own @ sp.diags_array(unit))
        try:
            made = splu(scaled)
        except RuntimeError:
            return None
        pivots, solve = np.abs(made.U.diagonal()), lambda right, how: made.solve(right, "T" if how else "N")
    else:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", LinAlgWarning)  # pivots tell
            both = lu_factor(unit[:, None] * own * unit, check_finite=False)
        pivots, solve = (
            np.abs(both[0].diagonal()),
            lambda right, how: lu_solve(both, right, trans=how, check_finite=False),
        )
    if not pivots.min() > _REGULAR * pivots.max():
        return None
    return Factors(*(_in_units(unit, solve, how) for how in (0, 1)))


def _in_units(unit: Array, solve: Callable[[Array, int], Array], how: int) -> Callable[[Array], Array]:
    return lambda right: (unit * solve((unit * right.T).T, how).T).T


def _demanded(p: Problem, kept: Ints, offset: Array) -> float:
    """The largest demanded rate over the largest rate without forces, of all but fixed unknowns, of which
    nothing is demanded; infinite where there is no demand, or no load."""
    asked = np.concatenate([np.ones(p.rows, bool), p.lower != p.upper])
    loads = _largest(p.b[p.rows : p.rows + p.velocities])
    demands, largest = _largest(p.demands), _largest(offset[asked[kept]])
    return demands / largest if loads > 0.0 and 0.0 < demands < largest else math.inf

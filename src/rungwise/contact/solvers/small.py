"""Small problems in one compiled call: scaled, solved and judged as `solve` does, without Python in between.

Algorithm: free unknowns are eliminated (`schur`); then the first solver of the chain that accepts the rest,
`gauss_seidel` or `pivoting`, is called. Accepts: up to `LARGEST` unknowns, of which `MOST_LEFT` have limits;
no demands that are next to nothing. Promises: nothing; an answer that is not within tolerance is left to the
chain.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

from rungwise.contact.judge.residuals import Residuals, Units, is_plain, judge_rows
from rungwise.contact.prepare import schur
from rungwise.contact.prepare.magnitudes import Magnitudes, faint_terms, largest, measure
from rungwise.contact.prepare.system import Form
from rungwise.contact.prepare.units import Sparse, compress, expand, fitted, measured, rescaled, settle
from rungwise.contact.problem import Array, Laws, Problem
from rungwise.contact.solvers import gauss_seidel, pivoting
from rungwise.contact.solvers.gauss_seidel import alternate
from rungwise.contact.solvers.measure import distance
from rungwise.contact.solvers.newton.dense import VECTORS, Scratch, descend_dense
from rungwise.contact.solvers.polish.refine import SMALL as LITTLE
from rungwise.contact.solvers.polish.settled import NOTHING, calm, clip
from rungwise.kernel import Ints, Reals, allocating_kernel, kernel

LARGEST, MOST_LEFT = 120, 60
"""Most unknowns, and most unknowns with limits; chosen by trial, for speed."""
SWEPT, PIVOTED, REFUSED = 0, 1, 2
_NAMES = gauss_seidel.NAME, pivoting.NAME
MARGIN = 0.3
"""Residual asked of sweeps, and its square of pivoting, over the tolerance: the judge measures x in its given
rows. Chosen by trial."""
_START, _SOLVE, _REFINE = 0, 1, 2
_NEAR, _FINEST, _STEPS = 0.1, 1e-17, 4
"""Residual from which on an answer is refined, the residual that ends refinement, and the most steps.
In scaled units: the second is below one rounding of double precision; the others are chosen by trial."""
_REST = np.zeros(LARGEST)


class Answer(NamedTuple):
    """x and y (N,), judged; the solver, and its iterations, or -1 where the start was good enough; whether
    rows miss their own terms, beside which all terms are rounding."""

    x: Array
    y: Array
    residuals: Residuals
    solver: str
    iterations: int
    misses: bool


def solve_at_once(problem: Problem, start: Array | None, tol: float) -> Answer | None:
    """The answer from x = `start` (N,) or from rest; None where that is not within `tol`, or not tried."""
    answer = try_at_once(problem, start, tol)
    return answer if answer is not None and answer.residuals.worst <= tol else None


def try_at_once(problem: Problem, start: Array | None, tol: float) -> Answer | None:
    """The answer from x = `start` (N,) or from rest, within `tol` or not; None where the problem is not
    tried."""
    n = len(problem.b)
    if not 0 < n <= LARGEST:
        return None
    A = problem.A
    if sp.issparse(A):
        A = A.toarray()
        A.flags.writeable = False  # as dense problems are: one compiled form for both
    x, y, found = np.empty(n), np.empty(n), np.empty(8)
    given = _REST[:n] if start is None else start
    laws = problem.mu, problem.directions, problem.lower, problem.upper
    solver, iterations = solve_dense(
        A, problem.b, laws, problem.velocities, given, start is not None, tol, gauss_seidel.DAMPINGS,
        x, y, found,
    )  # fmt: skip
    if solver == REFUSED:
        return None
    *residuals, misses = found.tolist()
    return Answer(x, y, Residuals(*residuals), _NAMES[solver], iterations, misses > tol)


@allocating_kernel
def solve_dense(
    A: Reals,
    b: Reals,
    numbers: tuple[Reals, int, Reals, Reals],
    velocities: int,
    start: Reals,
    given: bool,
    tol: float,
    dampings: Reals,
    x: Reals,
    y: Reals,
    found: Reals,
) -> tuple[int, int]:
    """Fill x, its rates y (N,), residuals and the worst of them beside own terms alone (8,); returns the
    solver, or REFUSED, and its iterations. A start that was given is judged as it is, before it is improved.
    `numbers` are those of `Laws`, in a plain tuple, which takes Python a microsecond less."""
    mu, d, lower, upper = numbers
    laws = Laws(mu, d, lower, upper)
    n, rows, done, missed = len(b), d * len(mu), -1, 0.0
    kept, gone = _parted(lower, upper, rows)
    k, g = len(kept), len(gone)
    if k > MOST_LEFT:
        return REFUSED, done
    M, q, factor = A, b, np.empty((g, g))
    unit, order = np.empty(g), np.empty(g, np.int64)
    if g > 0:
        M, q = np.empty((k, k)), np.empty(k)
        if not schur.eliminate(A, b, kept, gone, M, q, factor, unit, order):
            return REFUSED, done
        if schur.demanded(b, rows, velocities, lower, upper, kept, q) < LITTLE:
            return REFUSED, done
    rows_given = Sparse(np.empty(k + 1, np.int64), np.empty(k * k, np.int64), np.empty(k * k))
    compress(M, rows_given)
    s, force, rate, offset = np.empty(k), np.empty(k), np.empty(k), np.empty(k)
    entries = Sparse(rows_given.start, rows_given.place, rows_given.value.copy())
    form = Form(entries, np.zeros((len(mu), d, d)), np.zeros(k - rows))
    matrix = np.zeros((k, k))
    scaled = Laws(mu, d, lower[kept[rows:] - rows], upper[kept[rows:] - rows])
    fitted(entries, rows, d, s)
    if not measured(s, q, scaled.lower, scaled.upper, rows, force, rate, offset):
        return REFUSED, done
    rescaled(entries, s, form.blocks, form.diagonal)
    solver = _chosen(d, form.blocks, form.diagonal)
    if solver == REFUSED:
        return REFUSED, done
    expand(entries, matrix)
    scratch = Scratch(np.empty((k, k)), np.empty((VECTORS, k)), np.empty(4 * k, np.int64))
    terms, best, units = np.empty((6, n)), start[kept] / force, Units(kept, force, rate)
    room, label = np.zeros((6, n)), np.empty(2 * n, np.int64)
    sizes = Magnitudes(room[0], room[1], label, room[2], room[3], room[4], room[5])
    nothing, faint, size, given_x = np.zeros(n), np.empty(n), np.empty(2 * n), np.empty(n)
    if g > 0:
        rows_given = Sparse(np.empty(n + 1, np.int64), np.empty(n * n, np.int64), np.empty(n * n))
        compress(A, rows_given)
    judged = scaled
    if is_plain(rows, velocities):
        measure(rows_given, b, laws, sizes)
        judged = Laws(mu, d, lower / sizes.force, upper / sizes.force)
        units = Units(np.arange(n), sizes.force, sizes.rate)
    for attempt in range(_START if given else _SOLVE, _REFINE + 1):
        if attempt == _START:
            x[:] = start
        elif attempt == _REFINE:
            done += descend_dense(
                entries, matrix, offset, 0.0, scaled, best, _FINEST, _STEPS, dampings, scratch
            )
        elif distance(entries, offset, 0.0, best, scaled, scratch.vectors) > tol:
            if solver == SWEPT:
                own, goal = best.copy(), MARGIN * tol
                done = alternate(form, matrix, offset, scaled, own, best, goal, dampings, scratch)
            else:
                done = _pivot(matrix, offset, scaled, MARGIN**2 * tol, best)
        if attempt != _START:
            settle(best, rows, scaled.lower, scaled.upper, NOTHING)
            for i in range(k):
                x[kept[i]] = best[i] * force[i]
            if g > 0:
                schur.recover(A, b, kept, gone, factor, unit, order, x)
            clip(x, laws)
        given_x[:] = x
        judge_rows(rows_given, b, units, judged, laws, gone, nothing, x, y, terms, found)
        missed = max(found[0], found[1])
        if missed > tol:  # beside faint terms, then, and first without what is rounding
            if not sizes.row[0] > 0.0:
                measure(rows_given, b, laws, sizes)
            largest(b, x, sizes, size)
            faint_terms(rows_given, sizes, size, rows, faint)
            if attempt != _START:
                calm(sizes, size, laws, NOTHING, x)
                judge_rows(rows_given, b, units, judged, laws, gone, nothing, x, y, terms, found)
                missed = max(found[0], found[1])
            if missed > tol:
                judge_rows(rows_given, b, units, judged, laws, gone, faint, x, y, terms, found)
            if max(found[0], found[1]) > tol:
                x[:] = given_x
                judge_rows(rows_given, b, units, judged, laws, gone, faint, x, y, terms, found)
        if max(found[0], found[1]) <= tol or (attempt == _SOLVE and not found[0] <= _NEAR):
            break
    found[7] = missed
    if g > 0 and _hides_rates(b, rows, velocities, kept, rate, terms[0]):
        return REFUSED, done
    return solver, done


@allocating_kernel
def _parted(lower: Reals, upper: Reals, rows: int) -> tuple[Ints, Ints]:
    """Places of the kept unknowns, and of the unknowns without limits."""
    kept, gone = np.empty(rows + len(lower), np.int64), np.empty(len(lower), np.int64)
    for i in range(rows):
        kept[i] = i
    k, g = rows, 0
    for j in range(len(lower)):
        if lower[j] == -math.inf and upper[j] == math.inf:
            gone[g] = rows + j
            g += 1
        else:
            kept[k] = rows + j
            k += 1
    return kept[:k], gone[:g]


@kernel
def _hides_rates(b: Reals, rows: int, velocities: int, kept: Ints, rate: Reals, terms: Reals) -> bool:
    """Whether demanded rates are next to nothing beside the rates without forces: the chain must do more
    then."""
    demands, actual = False, 0.0
    for i in range(len(b)):
        demands = demands or (b[i] != 0.0 and not rows <= i < rows + velocities)
    for i in range(len(kept)):
        actual = max(actual, (terms[kept[i]] + abs(b[kept[i]])) / rate[i])
    return demands and velocities > 0 and 0.0 < actual < LITTLE


@kernel
def _chosen(d: int, blocks: Reals, diagonal: Reals) -> int:
    if gauss_seidel.accepts_rows(d, blocks, diagonal):
        return SWEPT
    return PIVOTED if d < 3 or len(blocks) == 0 else REFUSED


@allocating_kernel
def _pivot(A: Reals, b: Reals, laws: Laws, tol: float, x: Reals) -> int:
    """Fill x (N,); returns the pivots."""
    mu, d, lower, upper = laws
    m = pivoting.unfolded_size(len(mu), d, lower, upper)
    row, sign, origin = np.empty(m, np.int64), np.ones(m), np.zeros(len(b))
    M, q, z = np.zeros((m, m)), np.zeros(m), np.empty(m)
    pivoting.unfold_into(A, b, mu, d, lower, upper, row, sign, origin, M, q)
    done = pivoting.pivot(
        M, q, np.ones((1, m)), tol, z, np.empty(m), np.empty((m, m + 2)), np.empty(4 * m + 2, np.int64),
        np.zeros(1, np.int64),
    )  # fmt: skip
    pivoting.fold(row, sign, origin, z, x)
    return done

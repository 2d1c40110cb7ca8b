"""What `rw.solve` and its parts take, for `solvers.py`: microseconds of the processor, medians."""

from __future__ import annotations

import statistics
from collections.abc import Callable
from typing import Any
from unittest import mock

import numpy as np
import scipy.sparse as sp
from clock import processor_times
from contact_peers import Cost

import rungwise as rw
from rungwise.contact.prepare import schur
from rungwise.contact.prepare.elimination import eliminated
from rungwise.contact.prepare.system import Form, System, scaled
from rungwise.contact.prepare.units import Sparse, compress, fitted, measured, rescaled
from rungwise.contact.problem import Laws
from rungwise.contact.solvers import pivoting, small
from rungwise.contact.solvers.gauss_seidel import DAMPINGS, SMALL, accepts, alternate
from rungwise.contact.solvers.measure import natural
from rungwise.contact.solvers.newton.dense import Scratch, scratch_for
from rungwise.contact.solvers.small import solve_dense
from rungwise.kernel import Ints, Reals, allocating_kernel, kernel

TOL = 1e-8


def usual(work: Callable[[], object], repeats: int) -> float:
    """Median microseconds of so many."""
    return 1e6 * statistics.median(processor_times(work, repeats))


def fresh(problem: rw.Problem, work: Callable[[rw.Problem], object], repeats: int) -> float:
    """Median microseconds of work on a problem that was never seen."""
    p = problem
    copies = [
        rw.Problem(p.A, p.b, p.mu, p.directions, p.lower, p.upper, p.velocities) for _ in range(repeats)
    ]
    return usual(lambda: work(copies.pop()), repeats)


@kernel
def repeat(
    form: Form,
    A: Reals,
    b: Reals,
    laws: Laws,
    start: Reals,
    x: Reals,
    best: Reals,
    tol: float,
    dampings: Reals,
    scratch: Scratch,
    times: int,
) -> None:
    """Solve so many times, each from `start`."""
    for _ in range(times):
        for i in range(len(x)):
            x[i] = best[i] = start[i]
        alternate(form, A, b, laws, x, best, tol, dampings, scratch)


def compiled(system: System, start: np.ndarray, repeats: int) -> float | None:
    """Microseconds of one compiled solve from `start`; None if it does not converge."""
    s, best = system, np.empty(system.size)
    times = max(1, 400_000 // s.size**2)
    arguments = (
        s.form, s.dense(), s.b, s.laws, start, np.empty(s.size), best, TOL, DAMPINGS, scratch_for(s.size),
    )  # fmt: skip
    repeat(*arguments, 1)
    if natural(s, best) > TOL:
        return None
    return usual(lambda: repeat(*arguments, times), repeats) / times


@kernel
def repeat_pivoting(
    M: Reals,
    q: Reals,
    covers: Reals,
    found: Reals,
    z: Reals,
    tableau: Reals,
    place: Ints,
    halt: Ints,
    times: int,
) -> None:
    """Solve so many times."""
    for _ in range(times):
        pivoting.pivot(M, q, covers, 0.3 * TOL, found, z, tableau, place, halt)


def compiled_pivoting(system: System, repeats: int) -> float | None:
    """Microseconds of one compiled solve by pivoting, which knows no start; None if it finds nothing."""
    unfolded = pivoting.unfold(system)
    n = len(unfolded.q)
    times, found = max(1, 400_000 // n**2), np.empty(n)
    halt = np.zeros(1, np.int64)
    arguments = unfolded.M, unfolded.q, pivoting.coverings(n), found, *pivoting.workspace(n), halt
    repeat_pivoting(*arguments, 1)
    if natural(system, unfolded.folded(found)) > TOL:
        return None
    return usual(lambda: repeat_pivoting(*arguments, times), repeats) / times


def alone(problem: rw.Problem, found: rw.ContactSolution, repeats: int) -> list[float | None]:
    """Compiled solves of the prepared problem: from nothing, and from near the answer."""
    system = scaled(problem)
    if not 0 < system.size <= SMALL:
        return [None, None]
    if not accepts(system):
        return [compiled_pivoting(system, repeats) if pivoting.accepts(system) else None, None]
    answer = found.x[system.kept] / system.force
    starts = np.zeros(system.size), answer * (1.0 + 1e-3)
    return [compiled(system, start, repeats) for start in starts]


@allocating_kernel
def repeat_at_once(arguments: tuple[Any, ...], times: int) -> None:
    """Eliminate, scale, solve and judge so many times."""
    for _ in range(times):
        solve_dense(*arguments)


def at_once(problem: rw.Problem, repeats: int) -> float | None:
    """Microseconds from the problem as it was given to its judged answer, all compiled, with the arguments
    that `rw.solve` gives; None where no such call gets there."""
    given: list[tuple[Any, ...]] = []

    def noted(*arguments: Any) -> tuple[int, int]:
        given.append(arguments)
        return solve_dense(*arguments)

    with mock.patch.object(small, "solve_dense", noted):
        if small.solve_at_once(problem, None, TOL) is None:
            return None
    times = max(1, 400_000 // len(problem.b) ** 2)
    repeat_at_once(given[0], 1)
    return usual(lambda: repeat_at_once(given[0], times), repeats) / times


@allocating_kernel
def repeat_preparation(
    A: Reals,
    b: Reals,
    kept: Ints,
    gone: Ints,
    rows: int,
    d: int,
    lower: Reals,
    upper: Reals,
    scaling: bool,
    times: int,
) -> None:
    """Eliminate, and scale or not, so many times, as `solve_dense` does."""
    k, g = len(kept), len(gone)
    for _ in range(times):
        M, q = A, b
        if g > 0:
            M, q = np.empty((k, k)), np.empty(k)
            solver = np.empty((g, g)), np.empty(g), np.empty(g, np.int64)
            schur.eliminate(A, b, kept, gone, M, q, *solver)
        if scaling:
            entries = Sparse(np.empty(k + 1, np.int64), np.empty(k * k, np.int64), np.empty(k * k))
            compress(M, entries)
            s, force, rate, offset = np.empty(k), np.empty(k), np.empty(k), np.empty(k)
            fitted(entries, rows, d, s)
            measured(s, q, lower.copy(), upper.copy(), rows, force, rate, offset)
            rescaled(entries, s, np.zeros((rows // d, d, d)), np.zeros(k - rows))


def preparation(problem: rw.Problem, is_compiled: bool, repeats: int) -> Cost:
    """What it takes us to eliminate what is free, nothing where there is none, and to scale what is left:
    compiled, or as `rw.solve` does where it does not do all in one compiled call."""
    p, is_whole = problem, not problem.free.any()
    if not is_compiled:
        own = 0.0 if is_whole else fresh(p, lambda new: eliminated(new).matrix(), repeats)
        return Cost(1e-6 * own, 1e-6 * fresh(p, lambda new: scaled(new).matrix(), repeats))
    gone = np.concatenate([np.zeros(p.rows, bool), p.free])
    kept = np.flatnonzero(~gone)
    limited = kept[p.rows :] - p.rows
    arguments = (
        _dense(p), p.b, kept, np.flatnonzero(gone), p.rows, p.directions, p.lower[limited], p.upper[limited],
    )  # fmt: skip
    times = max(1, 400_000 // len(p.b) ** 2)
    took = []
    for scaling in (False, True):
        repeat_preparation(*arguments, scaling, 1)
        each = usual(lambda scaling=scaling: repeat_preparation(*arguments, scaling, times), repeats) / times
        took.append(1e-6 * each)
    return Cost(0.0 if is_whole else took[0], took[1])


def _dense(problem: rw.Problem) -> np.ndarray:
    """A, read-only as the problem's own is: else the kernels would be compiled twice."""
    A = problem.A.toarray() if sp.issparse(problem.A) else problem.A
    A.flags.writeable = False
    return A

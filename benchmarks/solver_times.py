"""How long `rw.solve` takes, in microseconds of the processor: the whole, and the compiled solve alone."""

from __future__ import annotations

import statistics
from collections.abc import Callable

import numpy as np
from clock import processor_times
from contact_peers import Cost

import rungwise as rw
from rungwise.contact.grouped import solve_grouped
from rungwise.contact.measure import natural
from rungwise.contact.prepare.elimination import eliminated
from rungwise.contact.prepare.system import System, scaled
from rungwise.contact.prepare.units import Sparse
from rungwise.contact.problem import Laws
from rungwise.kernel import Ints, Reals, allocating_kernel

TOL = 1e-8
SMALL = 200
"""Unknowns up to which the compiled solve is timed by itself."""


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


@allocating_kernel
def repeat(
    A: Sparse, b: Reals, laws: Laws, start: Reals, x: Reals, work: Reals, halt: Ints, count: Ints, times: int
) -> None:
    """Solve so many times, each from `start`."""
    for _ in range(times):
        for i in range(len(x)):
            x[i] = start[i]
        solve_grouped(A, A, b, laws, 0, 0.0, x, work, halt, count)


def compiled(system: System, start: np.ndarray, repeats: int) -> float | None:
    """Microseconds of one compiled solve from `start`; None if it does not converge."""
    s, x, enough = system, np.empty(system.size), np.array([1e15])
    times, halt, count = max(1, 400_000 // s.size**2), np.zeros(1, np.int64), np.zeros(4, np.int64)
    arguments = s.form.entries, s.b, s.laws, start, x, enough, halt, count
    repeat(*arguments, 1)
    if natural(s, x) > TOL:
        return None
    return usual(lambda: repeat(*arguments, times), repeats) / times


def alone(problem: rw.Problem, found: rw.ContactSolution, repeats: int) -> list[float | None]:
    """Compiled solves of the prepared problem: from nothing, and from near the answer."""
    system = scaled(problem)
    if not 0 < system.size <= SMALL:
        return [None, None]
    answer = found.x[system.kept] / system.force
    starts = np.zeros(system.size), answer * (1.0 + 1e-3)
    return [compiled(system, start, repeats) for start in starts]


def preparation(problem: rw.Problem, repeats: int) -> Cost:
    """What it takes us to eliminate what is free, nothing where there is none, and to scale what is left."""
    own = 0.0 if not problem.free.any() else fresh(problem, lambda new: eliminated(new).matrix, repeats)
    return Cost(1e-6 * own, 1e-6 * fresh(problem, lambda new: scaled(new).matrix(), repeats))

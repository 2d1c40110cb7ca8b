"""Solvers called in turn, on each island of a system apart where that is worth it."""

from __future__ import annotations

from types import ModuleType

from rungwise.contact.prepare.islands import islands
from rungwise.contact.prepare.system import System
from rungwise.contact.problem import Array
from rungwise.contact.solution import Attempt
from rungwise.contact.solvers import gauss_seidel
from rungwise.contact.solvers.measure import natural
from rungwise.contact.solvers.small import MARGIN
from rungwise.contact.solvers.work import Work

_WORTH = 60
"""Unknowns from which on it takes less time to solve islands one by one; chosen by trial."""


def run_chain(
    chain: tuple[ModuleType, ...], system: System, x: Array, tol: float, work: Work
) -> tuple[Array, list[Attempt]]:
    """The best x of the chain, and the part of each solver."""
    attempts: list[Attempt] = []
    least = natural(system, x)
    for solver in chain:
        if least <= tol or work.is_halted:
            break
        if solver.accepts(system):
            own = work.part()
            allowed = own.left
            trial, iterations = _apart(solver, system, x, MARGIN * tol, own)
            work.spend(allowed - own.left)
            found = natural(system, trial)
            if found < least:
                x, least = trial, found
            attempts.append(Attempt(solver.NAME, iterations, least))
    return x, attempts


def _apart(solver: ModuleType, system: System, x: Array, tol: float, work: Work) -> tuple[Array, int]:
    """The x after a solver worked on the islands that are not solved, one by one, and the most iterations of
    one."""
    apart = islands(system) if system.size > _WORTH and solver is not gauss_seidel else None
    if apart is None:  # or the solver does so itself, compiled
        found: tuple[Array, int] = solver.solve(system, x, tol, work)
        return found
    inside, goals, most = apart.inwards(x), apart.goals(tol), 0
    for i in range(len(apart)):
        if work.is_halted:
            break
        own, rows = apart.part(i), slice(apart.first[i], apart.first[i + 1])
        if natural(own, inside[rows]) > goals[i] and solver.accepts(own):
            trial, iterations = solver.solve(own, inside[rows], goals[i], work)
            most = max(most, iterations)
            if natural(own, trial) < natural(own, inside[rows]):
                inside[rows] = trial
    return apart.outwards(inside), most

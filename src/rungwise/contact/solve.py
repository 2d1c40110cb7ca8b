"""`solve`: solvers are chosen by what they accept, called in turn, and judged by the problem alone."""

from __future__ import annotations

from types import ModuleType

import numpy as np
import scipy.sparse as sp

from rungwise.contact.judge import judged
from rungwise.contact.mixed import Array, Problem, vector
from rungwise.contact.problem import ContactProblem
from rungwise.contact.refine import refined
from rungwise.contact.solution import Attempt, ContactSolution, Status
from rungwise.contact.solvers import (
    branching,
    gauss_seidel,
    interior_point,
    newton,
    pivoting,
    proximal_point,
    step,
)
from rungwise.contact.solvers.measure import natural
from rungwise.contact.system import System, scaled

SOLVERS: tuple[ModuleType, ...] = (
    gauss_seidel,
    pivoting,
    interior_point,
    newton,
    proximal_point,
)
"""In the order of the default chain. Each has NAME, accepts(system), solve(system, start, tol)."""
TOLERANCE = 1e-9
_MARGIN, _ROUNDS = 0.3, 5


def solve(
    problem: Problem | ContactProblem,
    *,
    tol: float = TOLERANCE,
    start: Array | None = None,
    solvers: tuple[str, ...] | None = None,
) -> ContactSolution:
    """Solve a contact problem of any kind; see `Problem` for what there is.

    The answer is SOLVED only if its residual (`Residuals.worst`, without unit) is within `tol`; JAMMED and
    UNSUPPORTED carry a certificate that has been checked; everything else is NOT_CONVERGED. `start` (N,)
    begins from a known x; `solvers` names the chain, in order, instead of the default. The problem of a step,
    given as assembled, is first solved as a run would.

    Raises ValueError naming what is wrong with the arguments.
    """
    assembled = problem if isinstance(problem, ContactProblem) else None
    problem = Problem.of(problem)
    if isinstance(tol, str) or not 0.0 < tol < 1.0:
        raise ValueError(f"tol: must be between 0 and 1, not {tol!r}")
    chain = _chain(solvers)
    system = scaled(problem)
    given = np.zeros(len(problem.b)) if start is None else vector("start", start)
    if given.shape != problem.b.shape:
        raise ValueError(f"start: has {len(given)} entries; the problem has {len(problem.b)} unknowns")
    attempts: list[Attempt] = []
    if assembled is not None and solvers is None and step.accepts(assembled):
        full = step.solve(assembled, given)
        (residuals, y), proof = judged(problem, system, full), None
        attempts.append(Attempt(step.NAME, 1, residuals.worst))
    if not attempts or attempts[0].residual > tol:
        x, more = _run(chain, system, given[system.kept] / system.force, tol)
        attempts += more
        full = system.recover(x * system.force)
        (residuals, y), proof = judged(problem, system, full), None
    if residuals.worst > tol:
        found = branching.search(system, x, _MARGIN * tol)
        attempts.append(Attempt(branching.NAME, found.nodes, found.residual))
        full, proof = system.recover(found.x * system.force), found.proof
        residuals, y = judged(problem, system, full)
    if residuals.worst > tol and proof is None and problem.is_boxes:
        other, more = _in_other_units(problem, chain, tol)
        attempts += more
        if (better := judged(problem, system, other))[0].worst < residuals.worst:
            full, (residuals, y) = other, better
    if residuals.worst <= tol:
        finer = refined(problem, system, full, tol)
        if finer is not full and (better := judged(problem, system, finer))[0].worst <= tol:
            full, (residuals, y) = finer, better
    status = Status.NOT_CONVERGED if proof is None else Status(proof.kind)
    if residuals.worst <= tol:
        status, proof = Status.SOLVED, None
    return ContactSolution(problem, status, full, y, residuals, tol, tuple(attempts), proof)


def _in_other_units(
    problem: Problem, chain: tuple[ModuleType, ...], tol: float
) -> tuple[Array, list[Attempt]]:
    """What the chain comes to with units for rows and for unknowns, each of its own."""
    A, per_row, unit = sp.csr_array(problem.A), np.ones(len(problem.b)), np.ones(len(problem.b))
    size = abs(A)
    for _ in range(_ROUNDS):
        largest = np.maximum((size * unit).max(axis=1).toarray().ravel(), np.abs(problem.b))
        per_row = 1.0 / np.where(largest > 0.0, largest, 1.0)
        largest = (sp.diags_array(per_row) @ size).max(axis=0).toarray().ravel()
        unit = 1.0 / np.where(largest > 0.0, largest, 1.0)
    made = sp.diags_array(per_row) @ A @ sp.diags_array(unit)
    again = Problem.boxes(made, per_row * problem.b, problem.lower / unit, problem.upper / unit)
    system = scaled(again)
    x, attempts = _run(chain, system, np.zeros(system.size), _MARGIN * tol)
    return unit * system.recover(x * system.force), attempts


def _chain(names: tuple[str, ...] | None) -> tuple[ModuleType, ...]:
    known = {module.NAME: module for module in SOLVERS}
    for name in names or ():
        if name not in known:
            raise ValueError(f"solvers: {name!r} is none of {', '.join(known)}")
    return SOLVERS if names is None else tuple(known[name] for name in names)


def _run(chain: tuple[ModuleType, ...], system: System, x: Array, tol: float) -> tuple[Array, list[Attempt]]:
    """The best x that the chain came to, and who did what."""
    attempts: list[Attempt] = []
    least = natural(system, x)
    for solver in chain:
        if least <= tol:
            break
        if solver.accepts(system):
            trial, iterations = solver.solve(system, x, _MARGIN * tol)
            found = natural(system, trial)
            if found < least:
                x, least = trial, found
            attempts.append(Attempt(solver.NAME, iterations, least))
    return x, attempts

"""`solve`: solvers are chosen by what they accept, called in turn, and judged by the problem alone."""

from __future__ import annotations

from types import ModuleType
from typing import NamedTuple

import numpy as np

from rungwise.contact.chain import run_chain
from rungwise.contact.judge.farkas import Infeasible, proves
from rungwise.contact.judge.residuals import Residuals, is_plain, judged, misses
from rungwise.contact.prepare.even import in_even_units
from rungwise.contact.prepare.system import System, scaled, uneliminated
from rungwise.contact.prepare.units import settle
from rungwise.contact.problem import Array, Problem, vector
from rungwise.contact.solution import Attempt, ContactSolution, Status
from rungwise.contact.solvers import (
    branching,
    gauss_seidel,
    homotopy,
    interior_point,
    pivoting,
    proximal_point,
    step,
)
from rungwise.contact.solvers.measure import natural
from rungwise.contact.solvers.newton import newton
from rungwise.contact.solvers.polish.exact import exact
from rungwise.contact.solvers.polish.refine import SMALL, rate_error, refined, sharpened
from rungwise.contact.solvers.polish.rest import rested
from rungwise.contact.solvers.polish.settled import calmed, clip
from rungwise.contact.solvers.small import MARGIN, try_at_once
from rungwise.contact.solvers.work import Work, allowed
from rungwise.contact.step.problem import ContactProblem
from rungwise.deadline import Deadline, seconds
from rungwise.keywords import keywords

SOLVERS: tuple[ModuleType, ...] = (gauss_seidel, pivoting, interior_point, homotopy, proximal_point)
"""In the order of the default chain. Each has NAME, accepts(system), solve(system, start, tol, work)."""
TOLERANCE = 1e-9
"""The default `tol` of `Residuals.worst`, without unit: some seven decades above the rounding of double
precision, as room for ill-conditioned problems."""
_ROUNDS, _STEPS, _FINEST = 5, 5, 1e-16
"""Rounds that find the modes of an exact answer; Newton steps of settled forces; the residual, about one
rounding of double precision, asked of last steps. The first two are chosen by trial."""
_FAINT = 2.0**-40, 2.0**-32, 2.0**-24
"""Shares of the largest unknown, in magnitudes, below which an unknown may be rounding that the condition of
the rows has made larger; tried in turn, where rows miss their own terms. Chosen by trial, to a decade."""
_ASIDE = 0.3
"""Share of the work that is left for the form with all unknowns, whose factors have many more entries.
Chosen by trial."""
_NEAR = 1e-3
"""Residual below which patience is worth its time, without unit, as `TOLERANCE`; chosen by trial, to a
decade."""


@keywords
def solve(
    problem: Problem | ContactProblem,
    *,
    tol: float = TOLERANCE,
    start: Array | None = None,
    solvers: tuple[str, ...] | None = None,
    limit: float | None = None,
) -> ContactSolution:
    """Solve a contact problem of any kind; see `Problem` for the kinds.

    The answer is SOLVED only if its residual (`Residuals.worst`, without unit) is within `tol`; JAMMED and
    UNSUPPORTED carry a certificate that has been checked; everything else is NOT_CONVERGED. `start` (N,)
    begins from a known x; `solvers` names the chain, in order, instead of the default. The problem of a step,
    given as assembled, is first solved as in a run. However hard a problem is, solvers do no more work than
    `allowed` for its size, and after `limit` seconds the best answer so far is judged.

    Raises ValueError naming the argument that is wrong.
    """
    assembled = problem if isinstance(problem, ContactProblem) else None
    problem = Problem.of(problem)
    if not isinstance(tol, int | float | np.number) or not 0.0 < tol < 1.0:
        raise ValueError(f"tol: must be between 0 and 1, not {tol!r}")
    _chain(solvers)
    given = None if start is None else vector("start", start)
    if given is not None and given.shape != problem.b.shape:
        raise ValueError(f"start: has {len(given)} entries; the problem has {len(problem.b)} unknowns")
    with Deadline(seconds(limit)).running() as deadline:
        return _solve(problem, assembled, tol, given, solvers, deadline)


def _solve(
    problem: Problem, assembled: ContactProblem | None, tol: float, given: Array | None,
    solvers: tuple[str, ...] | None, deadline: Deadline,
) -> ContactSolution:  # fmt: skip
    chain, attempts = _chain(solvers), list[Attempt]()
    own = try_at_once(problem, given, tol) if assembled is None and solvers is None else None
    if own is not None:
        if own.iterations >= 0:
            attempts.append(Attempt(own.solver, own.iterations, own.residuals.natural))
        if own.residuals.worst <= tol:
            answer = _Answer(own.x, own.y, own.residuals)
            if own.misses and (given is None or attempts):
                answer = _exact(problem, scaled(problem), answer, tol)
            return _solved(problem, answer, tol, attempts)
    system = scaled(problem)
    if given is not None:
        answer = _as_it_is(problem, system, given)
        if _tells(problem, system, answer, tol):
            return _solved(problem, answer, tol, [])
    if own is not None:
        answer = _judged(problem, system, own.x, tol)
        if _tells(problem, system, answer, tol):
            return _solved(problem, _exact(problem, system, answer, tol), tol, attempts)
        attempts.clear()
    given = np.zeros(len(problem.b)) if given is None else given
    work = Work(allowed(len(problem.b)), deadline)
    if assembled is not None and solvers is None and step.accepts(assembled):
        answer = _judged(problem, system, step.solve(assembled, given, work.halt), tol)
        attempts.append(Attempt(step.NAME, 1, answer.residual))
    if not attempts or answer.residual > tol:
        x, more = run_chain(chain, system, given[system.kept] / system.force, tol, work)
        attempts += more
        answer = _judged_scaled(problem, system, x, tol, work)
    massless = None
    if not work.is_halted and demands_little(problem if assembled is None else assembled, system):
        answer = _finer(problem, system, answer, tol)
        if not _tells(problem, system, answer, tol):
            massless, more = _without_inertia(problem, chain, answer.x, tol, work)
            attempts += more
            if massless.proof is not None and not is_kinematic(problem, massless.proof):
                massless = massless._replace(proof=None)  # a proof counts if it is one whatever inertia is
    if massless is not None and (massless.residual <= tol or massless.proof is not None):
        answer = massless
    else:
        answer, more = _last_resort(problem, system, chain, answer, tol, work)
        attempts += more
        answer = _finer(problem, system, answer, tol)
        if massless is None and problem.velocities > 0 and _is_open(answer, tol) and not work.is_low:
            massless, more = _without_inertia(problem, chain, answer.x, tol, work)
            attempts += more
            answer = answer if _is_open(massless, tol) else massless
        elif massless is not None and system.demanded < tol and answer.residual <= tol:
            answer = answer if _tells(problem, system, answer, tol) else massless
    is_massless = answer is massless
    if answer.residual <= tol and not is_massless:
        answer = _exact(problem, system, answer, tol)
    status = Status.NOT_CONVERGED if answer.proof is None else Status(answer.proof.kind)
    if answer.residual <= tol:
        status, answer = Status.SOLVED, answer._replace(proof=None)
    return ContactSolution(
        problem, status, answer.x, answer.y, answer.residuals, tol, tuple(attempts), answer.proof,
        is_massless, work.is_halted,
    )  # fmt: skip


class _Answer(NamedTuple):
    """x (N,) and its rates, judged; with a proof that there is no solution, the x of least residual met."""

    x: Array
    y: Array
    residuals: Residuals
    proof: Infeasible | None = None

    @property
    def residual(self) -> float:
        return self.residuals.worst


def _solved(problem: Problem, answer: _Answer, tol: float, attempts: list[Attempt]) -> ContactSolution:
    return ContactSolution(problem, Status.SOLVED, answer.x, answer.y, answer.residuals, tol, tuple(attempts))


def _as_it_is(problem: Problem, system: System, x: Array) -> _Answer:
    residuals, y = judged(problem, system, x)
    return _Answer(x, y, residuals)


def _clipped(problem: Problem, system: System, x: Array, tol: float) -> _Answer:
    """The answer x within its limits; without what is rounding, where rows hold better so."""
    clip(x := x.copy(), problem.laws)
    answer = _as_it_is(problem, system, x)
    if not (missed := misses(problem, x, answer.y)) > tol:
        return answer
    calmer = _as_it_is(problem, system, calmed(problem, x))
    better = misses(problem, calmer.x, calmer.y) < missed or answer.residual > tol
    return calmer if better and calmer.residual <= max(tol, answer.residual) else answer


def _exact(problem: Problem, system: System, answer: _Answer, tol: float) -> _Answer:
    """The answer made exact where rows miss their own terms by more than `tol`; or the answer. Bodies at rest
    are left as they are: what moves them is rounding."""
    if answer.residual <= tol and not is_plain(problem.rows, problem.velocities):
        return answer
    if not (missed := misses(problem, answer.x, answer.y)) > tol:
        return answer
    trial = answer.x
    for _ in range(_ROUNDS):
        trial = exact(problem, trial)
        found = _clipped(problem, system, trial, tol)
        least = misses(problem, found.x, found.y)
        if (least < missed or answer.residual > tol) and found.residual <= max(tol, answer.residual):
            answer, missed = found, least
        if missed <= tol:
            return answer
    for share in _FAINT:
        found = _clipped(problem, system, calmed(problem, answer.x, share), tol)
        if found.residual <= tol and misses(problem, found.x, found.y) <= tol:
            return found
    return answer


def _judged(problem: Problem, system: System, x: Array, tol: float) -> _Answer:
    """The answer x; or, where x is not within `tol`, the answer sharpened in the rows as they were given."""
    answer = _clipped(problem, system, x, tol)
    if answer.residual > tol and (sharp := sharpened(problem, answer.x)) is not answer.x:
        other = _clipped(problem, system, sharp, tol)
        answer = other if other.residual < answer.residual else answer
    return _exact(problem, system, answer, tol) if answer.residual > tol else answer


def _judged_scaled(problem: Problem, system: System, x: Array, tol: float, work: Work) -> _Answer:
    """The answer of scaled x; or a finer one, where small numbers alone are wrong."""
    answer = _clipped(problem, system, system.recover(x * system.force), tol)
    if work.is_halted:
        return answer
    if answer.residual > tol and natural(system, x) <= tol:
        exact, _ = newton.finish(system, newton.form(system), x, _FINEST, work)
        other = _clipped(problem, system, system.recover(exact * system.force), tol)
        answer = other if other.residual < answer.residual else answer
    if answer.residual > tol:
        answer = _judged(problem, system, answer.x, tol)
    if answer.residual > tol and not problem.free.any() and natural(system, x) <= tol:
        settled = x.copy()
        for _ in range(2):
            settle(settled, system.rows, system.lower, system.upper, tol)
            finer, _ = newton.descend(
                system, newton.form(system), settled, system.b, 0.0, tol**2, _STEPS, work
            )
            settled = finer.copy()
        other = _judged(problem, system, system.recover(settled * system.force), tol)
        answer = other if other.residual < answer.residual else answer
    if answer.residual > tol and (rest := rested(problem, answer.x)) is not answer.x:
        other = _as_it_is(problem, system, rest)
        answer = other if other.residual <= tol else answer
    return answer


def _finer(problem: Problem, system: System, answer: _Answer, tol: float) -> _Answer:
    """The answer with its rates refined, where the refined answer is within `tol` too."""
    if answer.residual > tol:
        return answer
    finer = refined(problem, system, answer.x, tol)
    if finer is answer.x:
        return answer
    better = _as_it_is(problem, system, finer)
    return better if better.residual <= tol else answer


def _tells(problem: Problem, system: System, answer: _Answer, tol: float) -> bool:
    """Whether the residual says something of the rates of the answer, beside the rates without forces."""
    return answer.residual <= tol and rate_error(problem, system, answer.x) <= tol


def _without_inertia(
    problem: Problem, chain: tuple[ModuleType, ...], x: Array, tol: float, work: Work
) -> tuple[_Answer, list[Attempt]]:
    """The answer in which the demanded rates decide, or a proof."""
    system = scaled(problem, massless=True)
    own, attempts = run_chain(chain, system, x / system.force, tol, work)
    answer = _judged_scaled(problem, system, own, tol, work)
    if answer.residual > tol:
        answer, attempt = _branched(problem, system, answer.x, tol, work)
        attempts.append(attempt)
    return answer, attempts


def _is_open(answer: _Answer, tol: float) -> bool:
    return answer.residual > tol and answer.proof is None


def demands_little(given: Problem | ContactProblem, system: System) -> bool:
    """Whether demanded rates are next to nothing beside the rates without forces, and yet no noise."""
    if isinstance(given, ContactProblem):
        rates = np.abs([*given.w, *given.w_s[given.F > 0.0]])
        return bool(rates.max(initial=0.0) > given.quantum) and system.demanded < SMALL
    return system.demanded < SMALL


def is_kinematic(problem: Problem, proof: Infeasible) -> bool:
    """Whether a proof of the massless system weighs no balance of forces, and so holds for any inertia."""
    balance = slice(problem.rows, problem.rows + problem.velocities)
    return not any(p[balance].any() for p in proof.vectors)


def _last_resort(
    problem: Problem,
    system: System,
    chain: tuple[ModuleType, ...],
    answer: _Answer,
    tol: float,
    work: Work,
) -> tuple[_Answer, list[Attempt]]:
    """The answer after other units, branching, and all unknowns, where it was not within `tol`."""
    attempts: list[Attempt] = []
    if answer.residual > tol and is_plain(problem.rows, problem.velocities) and not work.is_low:
        answer, attempts = _in_other_units(problem, system, answer, chain, tol, work)
    if answer.residual > tol and not work.is_halted:
        answer, attempt = _branched(problem, system, answer.x, tol, work)
        attempts.append(attempt)
    open_end = answer.residual > tol and answer.proof is None and not work.is_low
    if open_end and len(system.kept) < len(problem.b):
        whole, more = _in_all_unknowns(problem, system, chain, answer.x, tol, work)
        attempts += more
        if whole.residual < answer.residual:
            answer = whole
    if open_end and tol < answer.residual < _NEAR and not work.is_halted:
        patient, attempt = _patiently(problem, system, answer.x, tol, work)
        attempts.append(attempt)
        if patient.residual < answer.residual:
            answer = patient
    return answer, attempts


def _in_all_unknowns(
    problem: Problem, system: System, chain: tuple[ModuleType, ...], x: Array, tol: float, work: Work
) -> tuple[_Answer, list[Attempt]]:
    """The chain's answer where nothing is eliminated: beside a light body, the rates of a heavy one are lost
    in the sums of the condensed form."""
    whole = uneliminated(problem)
    own, attempts = run_chain(chain, whole, x / whole.force, tol, part := work.part(_ASIDE))
    work.spend(_ASIDE * work.left - part.left)
    answer = _judged(problem, system, whole.recover(own * whole.force), tol)
    if answer.residual > tol and natural(whole, own) <= tol:
        own, _ = newton.finish(whole, newton.form(whole), own, _FINEST, work)
        answer = _judged(problem, system, whole.recover(own * whole.force), tol)
    return answer, attempts


def _patiently(problem: Problem, system: System, x: Array, tol: float, work: Work) -> tuple[_Answer, Attempt]:
    own, done = proximal_point.solve_patiently(system, x[system.kept] / system.force, MARGIN * tol, work)
    attempt = Attempt(proximal_point.NAME, done, natural(system, own))
    return _judged(problem, system, system.recover(own * system.force), tol), attempt


def _branched(problem: Problem, system: System, x: Array, tol: float, work: Work) -> tuple[_Answer, Attempt]:
    found = branching.search(system, x[system.kept] / system.force, MARGIN * tol, work)
    answer = _judged_scaled(problem, system, found.x, tol, work)
    if found.proof is not None and proves(problem, system, found.proof):
        answer = answer._replace(proof=found.proof)
    return answer, Attempt(branching.NAME, found.nodes, found.residual)


def _in_other_units(
    problem: Problem, system: System, answer: _Answer, chain: tuple[ModuleType, ...], tol: float, work: Work
) -> tuple[_Answer, list[Attempt]]:
    """The answer, or a better one, found in units in which entries are as near to one as they can be."""
    again, unit = in_even_units(problem)
    even = scaled(again)
    own, attempts = run_chain(chain, even, np.zeros(even.size), tol, work)
    x = unit * _judged_scaled(again, even, own, tol, work).x
    other = _judged(problem, system, x, tol)
    return (other if other.residual < answer.residual else answer), attempts


def _chain(names: tuple[str, ...] | None) -> tuple[ModuleType, ...]:
    known = {module.NAME: module for module in SOLVERS}
    if names is not None and not isinstance(names, tuple | list):
        raise ValueError(f"solvers: must be a tuple of names, not {names!r}")
    for name in names or ():
        if not isinstance(name, str) or name not in known:
            raise ValueError(f"solvers: {name!r} is none of {', '.join(known)}")
    return SOLVERS if names is None else tuple(known[name] for name in names)

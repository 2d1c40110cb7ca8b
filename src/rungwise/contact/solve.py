"""`solve`: the contact solver, and where it finds nothing the search over modes; answers are judged by the
problem alone."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

from rungwise.contact.assembled import accepts, solve_assembled
from rungwise.contact.balanced import balanced
from rungwise.contact.exact import calmed, clip, exact
from rungwise.contact.grouped import is_balance, solve_grouped
from rungwise.contact.judge.farkas import Infeasible, proves
from rungwise.contact.judge.residuals import Residuals, is_plain, judged, misses
from rungwise.contact.measure import SMALL, natural, rate_error
from rungwise.contact.prepare.even import in_even_units
from rungwise.contact.prepare.system import System, scaled, uneliminated
from rungwise.contact.prepare.units import compressed
from rungwise.contact.problem import Array, Problem, vector
from rungwise.contact.search import Found, search
from rungwise.contact.solution import Attempt, ContactSolution, Status
from rungwise.contact.step.problem import ContactProblem
from rungwise.deadline import Deadline, seconds
from rungwise.keywords import keywords

TOLERANCE = 1e-9
"""The default `tol` of `Residuals.worst`, without unit: some seven decades above the rounding of double
precision, as room for ill-conditioned problems."""
MARGIN = 0.1
"""The part of the tolerance that the search asks for: its own measure is not the judge's."""
LIMIT, SLIGHT, SQUARE = 1e11, 1e9, 1e4
"""Multiplications that one call may make at most; and those that it may for any problem and for each pair of
its unknowns."""
_runaway = np.errstate(over="ignore", invalid="ignore")
"""Iterates that ran away are judged, not warned about."""
_ROUNDS = 5
"""Rounds that find the modes of an exact answer."""
_FAINT = 2.0**-40, 2.0**-32, 2.0**-24
"""Shares of the largest unknown, in magnitudes, below which an unknown may be rounding that the condition of
the rows has made larger; tried in turn, where rows miss their own terms. Chosen by trial, to a decade."""


@keywords
def solve(
    problem: Problem | ContactProblem,
    *,
    tol: float = TOLERANCE,
    start: Array | None = None,
    limit: float | None = None,
) -> ContactSolution:
    """Solve a contact problem of any kind; see `Problem` for the kinds.

    The answer is SOLVED only if its residual (`Residuals.worst`, without unit) is within `tol`; JAMMED and
    UNSUPPORTED carry a certificate that has been checked; everything else is NOT_CONVERGED. `start` (N,)
    begins from a known x. The problem of a step, given as assembled, is first solved as in a run. However
    hard a problem is, the solver does no more work than `allowed` for its size, and after `limit` seconds the
    best answer so far is judged.

    Raises ValueError naming the argument that is wrong.
    """
    assembled = problem if isinstance(problem, ContactProblem) else None
    problem = Problem.of(problem)
    if not isinstance(tol, int | float | np.number) or not 0.0 < tol < 1.0:
        raise ValueError(f"tol: must be between 0 and 1, not {tol!r}")
    given = None if start is None else vector("start", start)
    if given is not None and given.shape != problem.b.shape:
        raise ValueError(f"start: has {len(given)} entries; the problem has {len(problem.b)} unknowns")
    with Deadline(seconds(limit)).running() as deadline:
        return _Solve(problem, assembled, tol, deadline).from_start(given)


def allowed(unknowns: int) -> float:
    """Multiplications for a problem of so many unknowns."""
    return min(SLIGHT + SQUARE * float(unknowns) ** 2, LIMIT)


class _Answer(NamedTuple):
    """x (N,) and its rates, judged; with a proof that there is no solution, the x of least residual met."""

    x: Array
    y: Array
    residuals: Residuals
    proof: Infeasible | None = None

    @property
    def residual(self) -> float:
        return self.residuals.worst


class _Solve:
    """One call: the problem, and what was tried."""

    def __init__(
        self, problem: Problem, assembled: ContactProblem | None, tol: float, deadline: Deadline
    ) -> None:
        self.problem, self.assembled, self.tol, self.deadline = problem, assembled, tol, deadline
        self.system, self.attempts = scaled(problem), list[Attempt]()
        self.work = np.array([allowed(len(problem.b))])

    def from_start(self, given: Array | None) -> ContactSolution:
        """The solution found from a known x (N,), or from nothing."""
        if given is not None:
            answer = self._as_it_is(given)
            if self._tells(answer):
                return self._solution(answer)
        start = np.zeros(len(self.problem.b)) if given is None else given
        answer = self._by_solver(start)
        if demands_little(self.assembled or self.problem, self.system):
            if self._tells(answer):
                return self._solution(answer)
            massless = self._without_inertia(answer.x)
            if massless.proof is not None and not is_kinematic(self.problem, massless.proof):
                massless = massless._replace(proof=None)  # a proof counts if it is one whatever inertia is
            if not self._is_open(massless):
                return self._solution(massless, massless=True)
        if not self._is_solved(answer):
            answer = self._by_search(self.system, answer)
            if self._is_open(answer) and self.problem.velocities > 0:
                massless = self._without_inertia(answer.x)
                if not self._is_open(massless):
                    return self._solution(massless, massless=True)
        return self._solution(answer)

    def _solution(self, answer: _Answer, massless: bool = False) -> ContactSolution:
        status = Status.NOT_CONVERGED if answer.proof is None else Status(answer.proof.kind)
        if self._is_solved(answer):
            answer = answer if massless else self._exact(answer)
            status, answer = Status.SOLVED, answer._replace(proof=None)
        return ContactSolution(
            self.problem, status, answer.x, answer.y, answer.residuals, self.tol, tuple(self.attempts),
            answer.proof, massless, self.deadline.is_over,
        )  # fmt: skip

    def _is_solved(self, answer: _Answer) -> bool:
        return answer.residual <= self.tol

    def _is_open(self, answer: _Answer) -> bool:
        return answer.proof is None and not self._is_solved(answer)

    def _tells(self, answer: _Answer) -> bool:
        """Whether the residual says something of the rates of the answer, beside the rates without forces."""
        return self._is_solved(answer) and rate_error(self.problem, self.system, answer.x) <= self.tol

    def _as_it_is(self, x: Array) -> _Answer:
        residuals, y = judged(self.problem, self.system, x)
        return _Answer(x, y, residuals)

    def _judged(self, x: Array) -> _Answer:
        """The answer x within its limits; made exact, or balanced, where it is not within the tolerance."""
        answer = self._clipped(x)
        if not self._is_solved(answer):
            answer = self._exact(answer)
        if not self._is_solved(answer) and (other := balanced(self.problem, answer.x)) is not answer.x:
            answer = self._better(answer, self._as_it_is(other))
        return answer

    def _clipped(self, x: Array) -> _Answer:
        """The answer x within its limits; without what is rounding, where rows hold better so."""
        clip(x := x.copy(), self.problem.laws)
        answer = self._as_it_is(x)
        if not (missed := self._misses(answer)) > self.tol:
            return answer
        calmer = self._as_it_is(calmed(self.problem, x))
        better = self._misses(calmer) < missed or not self._is_solved(answer)
        return calmer if better and calmer.residual <= max(self.tol, answer.residual) else answer

    def _misses(self, answer: _Answer) -> float:
        return misses(self.problem, answer.x, answer.y)

    def _exact(self, answer: _Answer) -> _Answer:
        """The answer made exact where rows miss their own terms by more than the tolerance; or the answer.
        Bodies at rest are left as they are: what moves them is rounding."""
        if self._is_solved(answer) and not is_plain(self.problem.rows, self.problem.velocities):
            return answer
        if not (missed := self._misses(answer)) > self.tol:
            return answer
        trial = answer.x
        for _ in range(_ROUNDS):
            trial = exact(self.problem, trial)
            found = self._clipped(trial)
            least = self._misses(found)
            if (least < missed or not self._is_solved(answer)) and found.residual <= max(
                self.tol, answer.residual
            ):
                answer, missed = found, least
            if missed <= self.tol:
                return answer
        for share in _FAINT:
            found = self._clipped(calmed(self.problem, answer.x, share))
            if self._is_solved(found) and self._misses(found) <= self.tol:
                return found
        return answer

    def _by_solver(self, start: Array) -> _Answer:
        """The answer of the contact solver: of a step as in a run; in what is left after elimination; in all
        unknowns; and without contacts in units in which entries are near to one."""
        answer = self._as_it_is(start)
        if self.assembled is not None and accepts(self.assembled):
            x = solve_assembled(self.assembled, start, self.deadline.halt)
            answer = self._better(answer, self._judged(x))
            self.attempts.append(Attempt("solver", 1, answer.residual))
        if not self._is_solved(answer):
            answer = self._better(answer, self._balanced(start))
        if not self._is_solved(answer):
            answer = self._better(answer, self._run(self.system, start))
        if not self._is_solved(answer) and len(self.system.kept) < len(self.problem.b):
            answer = self._better(answer, self._run(uneliminated(self.problem), start))
        if not self._is_solved(answer) and is_plain(self.problem.rows, self.problem.velocities):
            answer = self._evened(answer)
        return answer

    @_runaway
    def _evened(self, answer: _Answer) -> _Answer:
        """The answer, or a better one, found in units in which entries are as near to one as they can be:
        by the solver, or else by the search."""
        again, unit = in_even_units(self.problem)
        even = scaled(again)
        x = np.zeros(even.size)
        self._iterate(even, x)
        answer = self._better(answer, self._judged(unit * even.recover(x * even.force)))
        if not self._is_solved(answer):
            found = self._search(even, x)
            answer = self._better(answer, self._judged(unit * even.recover(found.x * even.force)))
        return answer

    def _balanced(self, start: Array) -> _Answer:
        """The answer of the solver where velocities and forces are in balance; else the start."""
        p, x = self.problem, start.copy()
        rows = compressed(p.A)
        if not is_balance(rows, p.laws, p.velocities):
            return self._as_it_is(start)
        quantum = 0.0 if self.assembled is None else float(self.assembled.quantum[0])
        columns, count = compressed(sp.csr_array(p.A.T)), np.zeros(4, np.int64)
        solve_grouped(
            rows, columns, p.b, p.laws, p.velocities, quantum, x, self.work, self.deadline.halt, count
        )
        answer = self._judged(x)
        self.attempts.append(Attempt("solver", int(count[0]), answer.residual))
        return answer

    def _better(self, answer: _Answer, other: _Answer) -> _Answer:
        return other if other.residual < answer.residual else answer

    @_runaway
    def _run(self, system: System, start: Array) -> _Answer:
        """The answer of the solver in a system, from `start` (N,)."""
        x = start[system.kept] / system.force
        self._iterate(system, x)
        return self._judged(system.recover(x * system.force))

    def _iterate(self, system: System, x: Array) -> None:
        """Solve from scaled x, into it."""
        count, A = np.zeros(4, np.int64), system.form.entries
        solve_grouped(A, A, system.b, system.laws, 0, 0.0, x, self.work, self.deadline.halt, count)
        self.attempts.append(Attempt("solver", int(count[0]), natural(system, x)))

    @_runaway
    def _by_search(self, system: System, answer: _Answer) -> _Answer:
        """The answer that the search over modes finds, or the answer with a proof that there is none."""
        found = self._search(system, answer.x[system.kept] / system.force)
        other = self._better(answer, self._judged(system.recover(found.x * system.force)))
        proved = found.proof is not None and proves(self.problem, system, found.proof)
        return other._replace(proof=found.proof) if proved else other

    def _search(self, system: System, x: Array) -> Found:
        """What the search finds from scaled x."""
        found = search(system, x, MARGIN * self.tol, self.work, self.deadline)
        self.attempts.append(Attempt("search", found.nodes, found.residual))
        return found

    def _without_inertia(self, x: Array) -> _Answer:
        """The answer in which the demanded rates decide, or a proof."""
        system = scaled(self.problem, massless=True)
        answer = self._run(system, x)
        return answer if self._is_solved(answer) else self._by_search(system, answer)


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

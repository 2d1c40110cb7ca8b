"""The proximal point method, each of its regular subproblems by Gauss-Seidel and Newton steps.

Algorithm: x_(k+1) solves the problem with A + a and offset b - a x_k, which is well posed where A alone is
rank deficient; the weight a falls while subproblems are solved and grows when one is not. Sources:
Rockafellar, SIAM J. Control Optim. 14 (1976) 877-898; for contact with friction, Acary, Bremond, Huber, in
Advanced Topics in Nonsmooth Dynamics (2018), section 10.5.4. Accepts: everything. Promises: the best iterate;
convergence where A is monotone and friction does not couple too strongly, however rank deficient A is.
"""

from __future__ import annotations

import math

import numpy as np

from rungwise.contact.prepare.system import System
from rungwise.contact.problem import Array
from rungwise.contact.solvers import gauss_seidel
from rungwise.contact.solvers.measure import natural
from rungwise.contact.solvers.newton import newton
from rungwise.contact.solvers.settings import STALLED
from rungwise.contact.solvers.work import Work

NAME = "proximal-point"
_OUTER, _PATIENT = 120, 5000
"""How many subproblems are solved at most, and how many near a solution with time to spare: where tiny gaps
decide which contacts carry, forces drift for long from one set to another."""
_WINDOW = 40
"""The method ends where the least residual is above `STALLED` of its value so many subproblems earlier.
Chosen by trial."""
_INNER, _SWEEPS = 25, 20
"""Most Newton steps, and most sweeps, of one subproblem; chosen by trial."""
_WEIGHT, _SHARE, _EASIER, _HARDER = 1e-2, 0.1, 0.5, 2.0
"""The first weight, as `_LIGHTEST`; the share of the root of the first residual that it must not exceed,
since some solutions repel what is heavy; factors on it after success and failure. Chosen by trial."""
_LIGHTEST, _HEAVIEST = 1e-12, 1e3
"""Least and largest weight, in scaled units, where the diagonal of A is about one: the least is thousands of
roundings of double precision, and both are chosen by trial, to a decade."""
_ACCURACY = 0.03
"""Residual at which a subproblem is solved, over the residual of the whole (at most 1); chosen by trial."""


def accepts(_system: System) -> bool:
    return True


@np.errstate(all="ignore")  # iterates that run away are judged, not warned about
def solve(system: System, start: Array, tol: float, work: Work) -> tuple[Array, int]:
    """The best iterate x (N,), and how many subproblems were tried."""
    return _followed(system, start, tol, work, _OUTER, STALLED)


@np.errstate(all="ignore")
def solve_patiently(system: System, start: Array, tol: float, work: Work) -> tuple[Array, int]:
    """The same, going on where progress is slow."""
    return _followed(system, start, tol, work, _PATIENT, math.inf)


def _followed(
    system: System, start: Array, tol: float, work: Work, most: int, stalled: float
) -> tuple[Array, int]:
    s = system
    A, sweeping = newton.form(s), gauss_seidel.accepts(s)
    x = best = start
    found = least = before = natural(s, start)
    weight = min(_WEIGHT, _SHARE * math.sqrt(least)) if least > 0.0 else _WEIGHT
    for done in range(most):
        if least <= tol or work.is_spent:
            return best, done
        if done % _WINDOW == 0:
            if done and least > stalled * before:
                return best, done
            before = least
        offset = s.b - weight * x
        goal = max(_ACCURACY * min(found, 1.0), 0.3 * tol)
        trial = x
        if sweeping:
            trial = gauss_seidel.smooth(s, x, offset, weight, 0.1 * goal, _SWEEPS, work.halt)
            work.spend(_SWEEPS * len(s.form.entries.value))
        trial, _ = newton.descend(s, A, trial, offset, weight, 0.1 * goal, _INNER, work)
        left, reached = natural(s, trial, offset, weight), natural(s, trial)
        if reached < least:
            best, least = trial, reached
        if left <= goal:
            x, found = trial, reached
            weight = max(weight * _EASIER, _LIGHTEST)
        else:
            weight = min(weight * _HARDER, _HEAVIEST)
    return best, most

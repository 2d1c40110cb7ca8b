"""Answers made exact by Newton steps on the problem as it was given.

Where free unknowns were eliminated through an ill-conditioned block, or rows of very different sizes stand
beside each other, an x that solves the scaled system to rounding may be far from solving its own rows. From
there a few undamped steps, in which each row counts beside its own terms, solve all rows at once: free ones
and active ones (`sharpened`).

Once velocities are eliminated, the rates of contacts are differences of W H^-1 c and W H^-1 W^T r. In a
quasistatic step H is small beside all that holds the bodies, these terms are many orders larger than their
difference, and a residual of 1e-14 of the terms may be a hundredth of the rates. In the mixed form rates are
sums of
velocities: an undamped step of the generalised Jacobian (see `newton`), solved by least squares of its
equilibrated rows, finds them to rounding wherever modes determine them.
Accepts: up to `LARGEST` unknowns. Promises: an x that is no worse.
"""

from __future__ import annotations

import math

import numpy as np
import scipy.sparse as sp
from scipy.linalg import LinAlgError, lstsq

from rungwise.contact.judge.natural import natural_map
from rungwise.contact.judge.residuals import absolute, in_own_terms, own_units
from rungwise.contact.prepare.system import System, uneliminated
from rungwise.contact.problem import Array, Laws, Problem
from rungwise.contact.solvers.measure import rates
from rungwise.contact.solvers.newton.dense import alart_curnier
from rungwise.contact.solvers.polish.exact import LARGEST
from rungwise.kernel import Reals, kernel

SMALL = 1e-6
"""Rates below this share of the rates without forces mean that inertia does not matter; chosen by trial, to
a decade."""
_STEPS, _SINGULAR = 3, 1e-14
"""Most steps, chosen by trial; and the reciprocal condition number beyond which least squares drop columns:
tens of roundings of double precision."""
_NEARLY = 1e-6
"""Largest share of the right side that the solution of a regular system leaves; chosen by trial, to a
decade."""
_SHARP, _ROUNDING = 8, 1e-15
"""Most steps in own terms, and the violation below which no step is better than rounding: a few
roundings of double precision. The number by trial."""


def sharpened(problem: Problem, x: Array) -> Array:
    """x (N,), or its successor after Newton steps in the rows' own terms, where this violates the laws
    less."""
    if len(problem.b) > LARGEST:
        return x
    A = problem.A.toarray() if sp.issparse(problem.A) else problem.A
    best, least, trial = x, math.inf, x
    for done in range(_SHARP + 1):
        y = A @ trial + problem.b
        found = in_own_terms(problem, trial, y)
        if found < least:
            best, least = trial, found
        if done == _SHARP or not found > _ROUNDING or not np.isfinite(y).all():
            break
        step = _own_step(problem, A, trial, y, *own_units(problem, trial))
        if step is None:
            break
        trial = step
    return best


def _own_step(p: Problem, A: Array, x: Array, y: Array, rate: Array, force: Array) -> Array | None:
    """The next x (N,), with rates and forces counted in the units `rate` and `force`."""
    n, rows = len(x), p.rows
    F, derivative, J = np.empty(n), np.zeros((n, 3)), np.empty((n, n))
    own, laws = x / force, Laws(p.mu, p.directions, p.lower / force[rows:], p.upper / force[rows:])
    alart_curnier(own, y / rate, laws, 1.0, F, derivative)
    jacobian(A * force / rate[:, None], derivative, rows, p.directions, 1.0, 1.0, 0.0, J)
    try:
        step = np.linalg.solve(J, F)
    except np.linalg.LinAlgError:
        step = np.full(n, np.nan)
    if not np.abs(J @ step - F).max() <= _NEARLY * np.abs(F).max():
        try:
            step = lstsq(J, F, cond=_SINGULAR, lapack_driver="gelsy")[0]
        except (LinAlgError, ValueError):
            return None
    trial, ahead = x - step * force, own[rows:] - y[rows:] / rate[rows:]
    trial[:rows][(derivative[:rows] == 0.0).all(axis=1)] = 0.0
    trial[rows:] = np.where(ahead < laws.lower, p.lower, np.where(ahead > laws.upper, p.upper, trial[rows:]))
    return trial


def refined(problem: Problem, system: System, x: Array, tol: float) -> Array:
    """x (N,), or a better x where the rates of x are wrong by more than `tol` of their size."""
    if problem.velocities == 0 or len(system.kept) == len(problem.b) or len(problem.b) > LARGEST:
        return x
    if not problem.demands.any() or not rate_error(problem, system, x) > tol:
        return x
    whole = uneliminated(problem)
    trial = x / whole.force
    for _ in range(_STEPS):
        step = _step(whole, trial)
        if step is None or not np.isfinite(step).all():
            break
        trial = trial - step
    best = trial * whole.force
    return best if rate_error(problem, system, best) < rate_error(problem, system, x) else x


def rate_error(problem: Problem, system: System, x: Array) -> float:
    """The natural map beside the largest sum of a rate's terms, in units of the rates without forces; zero
    unless the rates without forces are far larger."""
    kept = system.kept
    y, terms = problem.A @ x + problem.b, rate_terms(problem, x)
    actual, out = float((terms[kept] / system.rate).max(initial=0.0)), np.empty(len(kept))
    if not 0.0 < actual < SMALL:
        return 0.0
    return natural_map(x[kept] / system.force, y[kept] / system.rate, system.laws, out) / actual


def rate_terms(problem: Problem, x: Array) -> Array:
    """The sums of the sizes of the terms of the rates of x."""
    return np.asarray(absolute(problem) @ np.abs(x) + np.abs(problem.b))


def _step(whole: System, x: Array) -> Array | None:
    n = whole.size
    y, F, derivative, J = np.empty(n), np.empty(n), np.zeros((n, 3)), np.empty((n, n))
    rates(whole.form.entries, whole.b, 0.0, x, y)
    alart_curnier(x, y, whole.laws, 1.0, F, derivative)
    jacobian(whole.dense(), derivative, whole.rows, whole.directions, 1.0, 1.0, 0.0, J)
    per_row = 1.0 / np.maximum(np.abs(J).max(axis=1), np.finfo(float).tiny)
    J *= per_row[:, None]
    unit = 1.0 / np.maximum(np.abs(J).max(axis=0), np.finfo(float).tiny)
    try:
        return np.asarray(unit * lstsq(J * unit, per_row * F, cond=_SINGULAR, lapack_driver="gelsy")[0])
    except (LinAlgError, ValueError):
        return None


@kernel
def jacobian(
    A: Reals, derivative: Reals, rows: int, d: int, rho: float, kept: float, damping: float, J: Reals
) -> None:
    """J = (1 + damping) I - kept D + rho D A."""
    for i in range(len(A)):
        first, width = (i // d * d, d) if i < rows else (i, 1)
        for c in range(len(A)):
            J[i, c] = 0.0
            for j in range(width):
                J[i, c] += rho * derivative[i, j] * A[first + j, c]
        for j in range(width):
            J[i, first + j] -= kept * derivative[i, j]
        J[i, i] += 1.0 + damping

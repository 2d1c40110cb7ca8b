"""Finding certificates by linear programming (HiGHS, through scipy)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rungwise.contact.certificate import Certificate, check, rigid_rows
from rungwise.contact.modes import all_modes, linear_system, mode_count, natural_units
from rungwise.contact.problem import ContactProblem

MAX_MODES = 5000


def certify_infeasible(problem: ContactProblem) -> Certificate | None:
    """A checked certificate that no velocity and force solve the problem, or None if none was found.

    Frictional certificates are looked for only up to `MAX_MODES` modes. There are none for a problem whose
    numbers, in its natural units, are beyond what floating point holds.
    """
    with np.errstate(all="ignore"):
        for certificate in (_kinematic(problem), _frictional(problem)):
            if certificate is not None and check(problem, certificate):
                return certificate
    return None


def certify_unsupported(problem: ContactProblem, resisting: NDArray[np.float64]) -> Certificate | None:
    """A checked motion along which the loads are not resisted; `resisting` (n, n) is H less its inertia."""
    with np.errstate(all="ignore"):
        certificate = _unsupported(problem, resisting)
        return certificate if certificate is not None and check(problem, certificate, resisting) else None


def _unsupported(problem: ContactProblem, resisting: NDArray[np.float64]) -> Certificate | None:
    units = natural_units(problem)
    n, d = len(problem.c), problem.R.shape[1]
    finite = np.isfinite(problem.F)
    limited, speed = int(finite.sum()), units.coordinates / units.velocity
    cost = -np.concatenate([problem.c * speed, -problem.F[finite]]) / units.force
    normal, tangent, rows = problem.W[::d] * speed, problem.W[1::d] * speed, problem.S * speed
    upper = [
        np.hstack([-(normal + s * problem.mu[:, None] * tangent), np.zeros((len(normal), limited))])
        for s in (1, -1)
    ]
    upper += [np.hstack([s * rows[finite], -np.eye(limited)]) for s in (1, -1)]
    stiffness = resisting * speed * speed[:, None]
    still = np.vstack([stiffness / max(float(np.abs(stiffness).max(initial=0.0)), 1e-300), rows[~finite]])
    least = np.vstack(upper)
    found = _minimise(
        cost,
        [(-1.0, 1.0)] * n + [(0.0, 1e6)] * limited,
        np.hstack([still, np.zeros((len(still), limited))]),
        least,
    )
    return None if found is None else Certificate("unsupported", (found[:n] * units.coordinates,))


def _minimise(
    cost: NDArray[np.float64],
    bounds: list[tuple[float, float]],
    equal: NDArray[np.float64],
    upper: NDArray[np.float64] | None = None,
) -> NDArray[np.float64] | None:
    """The vertex x with equal x = 0 (and upper x <= 0) of least cost, to rounding; None when no cost is below
    zero, or when the numbers are not finite."""
    from scipy.optimize import linprog

    if not all(np.isfinite(given).all() for given in (cost, equal, 0.0 if upper is None else upper)):
        return None
    right = None if upper is None else np.zeros(len(upper))
    found = linprog(cost, upper, right, equal, np.zeros(len(equal)), bounds=bounds, method="highs")
    if not found.success or found.fun >= 0.0:
        return None
    x = np.asarray(found.x)
    inside = np.abs(x) > 1e-9
    x = np.where(inside, x, 0.0)
    if upper is None:
        # The solver stops at its own tolerance; the vertex itself balances to rounding.
        for _ in range(2):
            x[inside] -= np.linalg.lstsq(equal[:, inside], equal @ x, rcond=None)[0]
    return x


def _kinematic(problem: ContactProblem) -> Certificate | None:
    rows, offset, contacts = rigid_rows(problem)
    if len(rows) == 0:
        return None
    units = natural_units(problem)
    bounds = [(0.0, 1.0)] * contacts + [(-1.0, 1.0)] * (len(offset) - contacts)
    found = _minimise(offset / units.velocity, bounds, (rows * (units.coordinates / units.velocity)).T)
    return None if found is None else Certificate("kinematic", (found,))


def _frictional(problem: ContactProblem) -> Certificate | None:
    if problem.R.shape[1] != 2 or mode_count(problem) > MAX_MODES:
        return None
    vectors = []
    for mode in all_modes(problem):
        equal, value, least, bound = linear_system(problem, mode)
        bounds = [(-1.0, 1.0)] * len(value) + [(0.0, 1.0)] * len(bound)
        found = _minimise(-np.concatenate([value, bound]), bounds, np.vstack([equal, least]).T)
        if found is None:
            return None
        vectors.append(found)
    return Certificate("frictional", tuple(vectors))

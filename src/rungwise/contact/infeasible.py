"""Finding certificates by linear programming (HiGHS, through scipy)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rungwise.contact.certificate import Certificate, check, rigid_rows
from rungwise.contact.modes import all_modes, linear_system, mode_count
from rungwise.contact.problem import ContactProblem

MAX_MODES = 5000


def certify_infeasible(problem: ContactProblem) -> Certificate | None:
    """A checked certificate that no velocity and force solve the problem, or None if none was found.

    Frictional certificates are looked for only up to `MAX_MODES` modes.
    """
    for certificate in (_kinematic(problem), _frictional(problem)):
        if certificate is not None and check(problem, certificate):
            return certificate
    return None


def certify_unsupported(problem: ContactProblem, resisting: NDArray[np.float64]) -> Certificate | None:
    """A checked motion along which the loads are not resisted; `resisting` (n, n) is H less its inertia."""
    from scipy.optimize import linprog

    n, limited, d = len(problem.c), len(problem.F), problem.R.shape[1]
    scale = max(float(np.abs(problem.c).max(initial=0.0)), 1e-300)
    cost = -np.concatenate([problem.c, -problem.F]) / scale
    normal = problem.W[::d]
    cone = [normal + sign * problem.mu[:, None] * problem.W[1::d] for sign in (1.0, -1.0)]
    upper = [np.hstack([-rows, np.zeros((len(rows), limited))]) for rows in cone]
    upper += [np.hstack([sign * problem.S, -np.eye(limited)]) for sign in (1.0, -1.0)]
    rows = np.vstack(upper)
    stiffness = np.hstack([resisting, np.zeros((n, limited))]) / max(float(np.abs(problem.H).max(initial=0.0)), 1e-300)
    found = linprog(
        cost, rows, np.zeros(len(rows)), stiffness, np.zeros(n),
        bounds=[(-1.0, 1.0)] * n + [(0.0, None)] * limited, method="highs",
    )  # fmt: skip
    if not found.success:
        return None
    certificate = Certificate("unsupported", (found.x[:n],))
    return certificate if check(problem, certificate, resisting) else None


def _kinematic(problem: ContactProblem) -> Certificate | None:
    from scipy.optimize import linprog

    rows, offset, contacts = rigid_rows(problem)
    scale = float(np.abs(offset).max(initial=0.0))
    if not scale > 0.0:
        return None
    bounds = [(0.0, 1.0)] * contacts + [(-1.0, 1.0)] * (len(offset) - contacts)
    found = linprog(offset / scale, None, None, rows.T, np.zeros(rows.shape[1]), bounds=bounds, method="highs")
    if not found.success or found.fun >= 0.0:
        return None
    return Certificate("kinematic", (found.x,))


def _frictional(problem: ContactProblem) -> Certificate | None:
    from scipy.optimize import linprog

    if mode_count(problem) > MAX_MODES:
        return None
    vectors = []
    for mode in all_modes(problem):
        equal, value, least, bound = linear_system(problem, mode)
        found = linprog(
            -np.concatenate([value, bound]), None, None, np.vstack([equal, least]).T, np.zeros(equal.shape[1]),
            bounds=[(-1.0, 1.0)] * len(value) + [(0.0, 1.0)] * len(bound), method="highs",
        )  # fmt: skip
        if not found.success or found.fun >= 0.0:
            return None
        vectors.append(found.x)
    return Certificate("frictional", tuple(vectors))

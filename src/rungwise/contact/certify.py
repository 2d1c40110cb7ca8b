"""Finding certificates: by linear programs (HiGHS, through scipy) of speeds and of motions alone; and by the
search over modes, which comes after the contact solver."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rungwise.contact.judge.certificate import (
    REACH,
    Balance,
    Certificate,
    check,
    demanded,
    rigid_rows,
    without_inertia,
    without_yields,
)
from rungwise.contact.judge.farkas import CLOSED
from rungwise.contact.problem import MOST_DIRECTIONS, Problem
from rungwise.contact.solution import ContactSolution, Status
from rungwise.contact.solve import solve
from rungwise.contact.step.modes import BACKWARD, FORWARD, OPEN, STICK, natural_units, yielding
from rungwise.contact.step.problem import ContactProblem
from rungwise.deadline import NEVER, Deadline

CUTS = 40
"""Times that a motion whose slips are cut off too little is looked for again."""
_SOLVES = 1e-9
"""Rate or force, in natural units, up to which it is none. Chosen by trial, to a decade."""
_SMALL = 1e-9
"""Cost over the greatest that is left out where it keeps the solver from an end. Chosen by trial."""
_SINGULAR = 1e-6
"""Singular value, over the greatest, below which what the solver leaves of a balance stays: taking this away
would change the vector more than the solver's tolerance (about 1e-9). Chosen by trial, to a decade."""


def certify_infeasible(problem: ContactProblem, deadline: Deadline = NEVER) -> Certificate | None:
    """A checked certificate that no velocity and force solve the problem, or None if none was found.

    There is none for a problem whose numbers, in its natural units, are beyond the range of floating point.
    Raises TimeOver where the deadline has come.
    """
    return certify_or_solve(problem, deadline)[0]


def certify_or_solve(
    problem: ContactProblem, deadline: Deadline = NEVER
) -> tuple[Certificate | None, ContactSolution | None]:
    """The certificate of `certify_infeasible`, or what `solve` finds; or neither."""
    with np.errstate(all="ignore"):
        certificate = _kinematic(problem, deadline)
        if certificate is not None and check(problem, certificate):
            return certificate, None
        found = proof = _answered(problem, deadline)
        if found is not None and found.status != Status.SOLVED and any(map(np.any, yielding(problem))):
            proof = _answered(without_yields(problem), deadline)
        certificate = None if proof is None else _of_modes("frictional", proof)
        if certificate is not None and check(problem, certificate):
            return certificate, None
    return None, found


def _answered(problem: ContactProblem | Problem, deadline: Deadline) -> ContactSolution | None:
    """What the solver and the search find; None for contacts that resist turning, and beyond all numbers."""
    if isinstance(problem, ContactProblem) and not 1 <= problem.R.shape[1] <= MOST_DIRECTIONS:
        return None
    try:
        found = solve(problem, limit=deadline.seconds)
    except ValueError:  # numbers that are not finite, or that no units bring into range
        return None
    deadline.look_in_proof()
    return found


def _of_modes(kind: str, found: ContactSolution) -> Certificate | None:
    proof = found.certificate
    return None if proof is None else Certificate(kind, proof.vectors, proof.modes)


def certify_unsupported(
    problem: ContactProblem, resisting: NDArray[np.float64], deadline: Deadline = NEVER
) -> Certificate | None:
    """A checked motion along which the loads are not resisted, or else a checked proof that no motion makes
    up their balance; `resisting` (n, n) is H less its inertia, raises TimeOver."""
    return certify_or_balance(problem, resisting, deadline)[0]


def certify_or_balance(
    problem: ContactProblem, resisting: NDArray[np.float64], deadline: Deadline
) -> tuple[Certificate | None, Balance | None]:
    """The certificate of `certify_unsupported`, or what may balance the loads without inertia; or neither."""
    with np.errstate(all="ignore"):
        for part in _apart(problem, resisting):
            certificate = _unsupported(problem, resisting, part, deadline)
            if certificate is not None:
                return certificate, None
        limit = without_inertia(problem, resisting)
        found = _answered(limit, deadline)
        certificate = None if found is None else _of_modes("unbalanced", found)
        if certificate is not None and check(problem, certificate, resisting):
            return certificate, None
    return None, None if found is None or found.status != Status.SOLVED else _balance(limit, found)


def _apart(problem: ContactProblem, resisting: NDArray[np.float64]) -> list[NDArray[np.bool_]]:
    """Coordinates (n,) of each part that no row joins to another, and no contact, whose friction is as great
    as it presses: the loads of one part do not bear on another."""
    from scipy.sparse.csgraph import connected_components

    touched = problem.W.reshape(-1, problem.R.shape[1], len(problem.c)).any(axis=1)
    rows = np.vstack([touched, problem.S, resisting]) != 0.0
    count, part = connected_components(rows.T.astype(int) @ rows, directed=False)
    return [part == k for k in range(count)]


def _unsupported(
    problem: ContactProblem, resisting: NDArray[np.float64], part: NDArray[np.bool_], deadline: Deadline
) -> Certificate | None:
    """A checked motion of the coordinates of `part` (n,) alone, by Kelley's cutting planes: the friction of a
    contact resists the length of its slip, that is its projection on every heading; those that a motion lacks
    are added."""
    units = natural_units(problem)
    n, d = len(problem.c), problem.R.shape[1]
    finite = np.isfinite(problem.F)
    limited, speed = int(finite.sum()), units.coordinates / units.velocity
    loads = np.where(part, problem.c * speed, 0.0)
    cost = -np.concatenate([loads, -problem.F[finite]]) / max(float(np.abs(loads).max(initial=0.0)), 1e-300)
    rows = problem.S * speed
    at = (problem.W * speed).reshape(-1, d, n)
    normal, across = at[:, 0], problem.mu[:, None, None] * at[:, 1:]
    upper = [_bear(-(normal + side * across[:, i]), limited) for i in range(d - 1) for side in (1, -1)]
    upper += [_bear(-normal, limited)] if d == 1 else []
    upper += [np.hstack([s * rows[finite], -np.eye(limited)]) for s in (1, -1)]
    stiffness = resisting * speed * speed[:, None]
    still = np.vstack([stiffness / max(float(np.abs(stiffness).max(initial=0.0)), 1e-300), rows[~finite]])
    bounds = [(-1.0, 1.0) if own else (0.0, 0.0) for own in part] + [(0.0, 1e6)] * limited
    for _ in range(CUTS):
        found, _ = _minimise(cost, bounds, _bear(still, limited), np.vstack(upper), deadline)
        if found is None:
            return None
        certificate = Certificate("unsupported", (found[:n] * units.coordinates,))
        if check(problem, certificate, resisting):
            return certificate
        slip = across @ found[:n]
        length = np.linalg.norm(slip, axis=1)
        short = length > np.maximum(normal @ found[:n], 0.0)
        if not short.any():
            return None
        heading = slip[short] / length[short, None]
        upper.append(_bear(np.einsum("ki,kin->kn", heading, across[short]) - normal[short], limited))
    return None


def _bear(rows: NDArray[np.float64], limited: int) -> NDArray[np.float64]:
    """Rows of coordinates, in which dry friction takes no part."""
    return np.hstack([rows, np.zeros((len(rows), limited))])


def _minimise(
    cost: NDArray[np.float64],
    bounds: list[tuple[float, float]],
    equal: NDArray[np.float64],
    upper: NDArray[np.float64] | None = None,
    deadline: Deadline = NEVER,
) -> tuple[NDArray[np.float64] | None, NDArray[np.float64]]:
    """The vertex x with equal x = 0 (and upper x <= 0) of least cost, to rounding, or None when no cost is
    below zero, or when the numbers are not finite; and the multipliers of the equations, NaN if unknown."""
    from scipy.optimize import linprog

    unknown = np.full(len(equal), np.nan)

    if not all(np.isfinite(given).all() for given in (cost, equal, 0.0 if upper is None else upper)):
        return None, unknown
    right = None if upper is None else np.zeros(len(upper))
    small = _SMALL * float(np.abs(cost).max(initial=0.0))
    for each in (cost, np.where(np.abs(cost) > small, cost, 0.0)):
        found = linprog(
            each, upper, right, equal, np.zeros(len(equal)), bounds=bounds, method="highs",
            options={"time_limit": deadline.seconds},
        )  # fmt: skip
        deadline.look_in_proof()
        if found.success:
            break
    else:
        return None, unknown
    multipliers = -np.asarray(found.eqlin.marginals)
    if found.fun >= 0.0:
        return None, multipliers
    x = np.asarray(found.x)
    inside = np.abs(x) > 1e-9
    x = np.where(inside, x, 0.0)
    if upper is None:
        # The solver stops at its own tolerance; the vertex itself balances to rounding.
        for _ in range(2):
            x[inside] -= np.linalg.lstsq(equal[:, inside], equal @ x, rcond=_SINGULAR)[0]
            x = np.clip(x, *np.transpose(bounds))
    return x, multipliers


def _kinematic(problem: ContactProblem, deadline: Deadline) -> Certificate | None:
    rows, offset, contacts = rigid_rows(problem)
    if len(rows) == 0:
        return None
    units = natural_units(problem)
    push = np.arange(len(offset)) < contacts
    cost = offset / demanded(offset, contacts)
    balance = (rows * (units.coordinates / units.velocity)).T
    found, _ = _minimise(cost, [(0.0 if one else -1.0, 1.0) for one in push], balance, deadline=deadline)
    if found is None:
        found = _least_left(cost, push, balance, deadline)
    return None if found is None else Certificate("kinematic", (found,))


def _least_left(
    cost: NDArray[np.float64], push: NDArray[np.bool_], balance: NDArray[np.float64], deadline: Deadline
) -> NDArray[np.float64] | None:
    """The x, not negative where `push`, with cost . x <= -1 and the least |balance x|, for positions that are
    nearly singular; rows that cost more than `REACH` stay out of it. None if there is none."""
    from scipy.optimize import linprog

    if not (np.isfinite(cost).all() and np.isfinite(balance).all()):
        return None
    near = cost < REACH
    # The objective counts in 1 / REACH^2: the solver's own tolerance would hide it otherwise.
    A, most = balance[:, near], np.full((len(balance), 1), -1.0 / REACH**2)
    found = linprog(
        np.append(np.zeros(A.shape[1]), 1.0),
        np.vstack([np.hstack([A, most]), np.hstack([-A, most]), np.append(cost[near], 0.0)]),
        np.append(np.zeros(2 * len(A)), -1.0),
        bounds=[*((0.0 if one else None, None) for one in push[near]), (0.0, None)],
        method="highs",
        options={"time_limit": deadline.seconds},
    )
    deadline.look_in_proof()
    if not found.success:
        return None
    x = np.zeros(len(cost))
    x[near] = found.x[:-1]
    return x


def _balance(problem: ContactProblem, found: ContactSolution) -> Balance:
    """Forces of a planar solution, and the modes that they are in."""
    units, d = natural_units(problem), problem.R.shape[1]
    normal, contacts = found.r[::d], len(problem.mu)
    slip = np.concatenate(
        [found.u[1::d] if d > 1 else np.zeros(contacts), found.y[len(found.y) - len(found.z) :]]
    )
    modes = np.where(slip < 0.0, BACKWARD, FORWARD)
    modes[np.abs(slip) <= _SOLVES * units.velocity] = STICK
    modes[:contacts][normal <= _SOLVES * units.force] = OPEN
    return Balance(modes, found.r, found.z)


def presses(certificate: Certificate, contacts: int) -> NDArray[np.bool_]:
    """Which of the contacts are closed in a mode that a certificate of modes excludes."""
    return np.asarray((np.array(certificate.modes)[:, :contacts] >= CLOSED).any(axis=0))

"""Finding certificates by linear programming (HiGHS, through scipy)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rungwise.contact.judge.certificate import (
    REACH,
    Certificate,
    check,
    demanded,
    excludes_mode,
    rigid_rows,
    without_inertia,
)
from rungwise.contact.step.modes import ANY, CLOSED, choices, linear_system, natural_units, parts
from rungwise.contact.step.problem import ContactProblem

MAX_NODES = 2000
"""Partial modes that are looked at before a frictional certificate is given up."""
CUTS = 40
"""Times that a motion whose slips are cut off too little is looked for again."""
_SOLVES = 1e-9
"""Violation of a law, in natural units of rates and forces, up to which a point meets the law. Chosen by
trial, to a decade."""


def certify_infeasible(problem: ContactProblem) -> Certificate | None:
    """A checked certificate that no velocity and force solve the problem, or None if none was found.

    The search for a frictional certificate ends after `MAX_NODES` partial modes. There is none for a problem
    whose numbers, in its natural units, are beyond the range of floating point.
    """
    with np.errstate(all="ignore"):
        for certificate in (_kinematic(problem), _frictional(problem)):
            if certificate is not None and check(problem, certificate):
                return certificate
    return None


def certify_unsupported(problem: ContactProblem, resisting: NDArray[np.float64]) -> Certificate | None:
    """A checked motion along which the loads are not resisted, or else a checked proof that no motion makes
    up their balance; `resisting` (n, n) is H less its inertia."""
    with np.errstate(all="ignore"):
        for part in _apart(problem, resisting):
            certificate = _unsupported(problem, resisting, part)
            if certificate is not None:
                return certificate
        certificate = _frictional(without_inertia(problem, resisting), held=False)
        if certificate is not None and check(problem, certificate, resisting):
            return certificate
    return None


def _apart(problem: ContactProblem, resisting: NDArray[np.float64]) -> list[NDArray[np.bool_]]:
    """Coordinates (n,) of each part that no row joins to another: the loads of one part do not bear on
    another."""
    from scipy.sparse.csgraph import connected_components

    rows = np.vstack([problem.W, problem.S, resisting]) != 0.0
    count, part = connected_components(rows.T.astype(int) @ rows, directed=False)
    return [part == k for k in range(count)]


def _unsupported(
    problem: ContactProblem, resisting: NDArray[np.float64], part: NDArray[np.bool_]
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
        found, _ = _minimise(cost, bounds, _bear(still, limited), np.vstack(upper))
        if found is None:
            return None
        certificate = Certificate("unsupported", (found[:n] * units.coordinates,))
        if check(problem, certificate, resisting):
            return certificate
        slip = across @ found[:n]
        length = np.linalg.norm(slip, axis=1)
        short = length > normal @ found[:n]
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
) -> tuple[NDArray[np.float64] | None, NDArray[np.float64]]:
    """The vertex x with equal x = 0 (and upper x <= 0) of least cost, to rounding, or None when no cost is
    below zero, or when the numbers are not finite; and the multipliers of the equations."""
    from scipy.optimize import linprog

    if not all(np.isfinite(given).all() for given in (cost, equal, 0.0 if upper is None else upper)):
        return None, np.zeros(len(equal))
    right = None if upper is None else np.zeros(len(upper))
    found = linprog(cost, upper, right, equal, np.zeros(len(equal)), bounds=bounds, method="highs")
    if not found.success:
        return None, np.zeros(len(equal))
    multipliers = -np.asarray(found.eqlin.marginals)
    if found.fun >= 0.0:
        return None, multipliers
    x = np.asarray(found.x)
    inside = np.abs(x) > 1e-9
    x = np.where(inside, x, 0.0)
    if upper is None:
        # The solver stops at its own tolerance; the vertex itself balances to rounding.
        for _ in range(2):
            x[inside] -= np.linalg.lstsq(equal[:, inside], equal @ x, rcond=None)[0]
    return x, multipliers


def _kinematic(problem: ContactProblem) -> Certificate | None:
    rows, offset, contacts = rigid_rows(problem)
    if len(rows) == 0:
        return None
    units = natural_units(problem)
    push = np.arange(len(offset)) < contacts
    cost = offset / demanded(offset, contacts)
    balance = (rows * (units.coordinates / units.velocity)).T
    found, _ = _minimise(cost, [(0.0 if one else -1.0, 1.0) for one in push], balance)
    if found is None:
        found = _least_left(cost, push, balance)
    return None if found is None else Certificate("kinematic", (found,))


def _least_left(
    cost: NDArray[np.float64], push: NDArray[np.bool_], balance: NDArray[np.float64]
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
    )
    if not found.success:
        return None
    x = np.zeros(len(cost))
    x[near] = found.x[:-1]
    return x


def _frictional(problem: ContactProblem, held: bool = True) -> Certificate | None:
    """The certificate by branch and bound over partial modes: a mode without solutions is not split
    further."""
    if problem.R.shape[1] != 2:
        return None
    options = choices(problem, held)
    waiting = [tuple(own[0] if len(own) == 1 else ANY for own in options)]
    modes: list[tuple[int, ...]] = []
    vectors: list[NDArray[np.float64]] = []
    resisted = _is_resisted(problem)
    for _ in range(MAX_NODES):
        if not waiting:
            return Certificate("frictional" if held else "unbalanced", tuple(vectors), tuple(modes))
        mode = waiting.pop()
        vector, point = _farkas(problem, mode, held)
        if vector is not None and excludes_mode(problem, mode, vector, held):
            modes.append(mode)
            vectors.append(vector)
            continue
        contradicts = _contradictions(problem, mode, point)
        if not {ANY, CLOSED} & set(mode) or (vector is None and contradicts.max() <= _SOLVES):
            return None
        first = resisted & (contradicts > _SOLVES)
        i = int(np.argmax(np.where(first, contradicts, -1.0) if first.any() else contradicts))
        waiting += [(*mode[:i], option, *mode[i + 1 :]) for option in parts(options[i], mode[i])]
    return None


def _is_resisted(problem: ContactProblem) -> NDArray[np.bool_]:
    """Which contacts and limited rows feel a coordinate that something resists: their forces are bounded, and
    their modes say more than the modes of others."""
    own = np.diag(problem.H) > 0.0
    feels = (np.vstack([problem.W, problem.S])[:, own] != 0.0).any(axis=1)
    contacts, d = len(problem.mu), problem.R.shape[1]
    return np.concatenate([feels[: contacts * d].reshape(contacts, d).any(axis=1), feels[contacts * d :]])


def _farkas(
    problem: ContactProblem, mode: tuple[int, ...], held: bool
) -> tuple[NDArray[np.float64] | None, NDArray[np.float64]]:
    """The vector that combines the rows of `mode` to the largest contradiction, if any, and the unknowns that
    satisfy them best."""
    equal, value, least, bound = linear_system(problem, mode, held)
    bounds = [(-1.0, 1.0)] * len(value) + [(0.0, 1.0)] * len(bound)
    return _minimise(-np.concatenate([value, bound]), bounds, np.vstack([equal, least]).T)


def _contradictions(
    problem: ContactProblem, mode: tuple[int, ...], point: NDArray[np.float64]
) -> NDArray[np.float64]:
    """How far each undecided contact and limited row is from all its modes at `point`; -1 for the others."""
    p = problem
    n, contacts = len(p.c), len(p.mu)
    units = natural_units(p)
    v, forces = point[:n] * units.coordinates, point[n:] * units.force
    force, tau = forces[: 2 * contacts], forces[2 * contacts :]
    own = np.einsum("kij,kj->ki", p.R, force.reshape(-1, 2)).ravel()
    rate = (p.W @ v + own + p.w) / units.velocity
    slip = (p.S @ v + p.R_s * tau + p.w_s) / units.velocity
    normal, tangential = force[::2] / units.force, force[1::2] / units.force
    friction = _dissipates(rate[1::2], tangential, p.mu * normal)
    apart = np.concatenate(
        [np.minimum(rate[::2], normal) + friction, _dissipates(slip, tau / units.force, p.F / units.force)]
    )
    return np.where(np.isin(mode, (ANY, CLOSED)), np.maximum(apart, 0.0), -1.0)


def _dissipates(
    slip: NDArray[np.float64], force: NDArray[np.float64], limit: NDArray[np.float64]
) -> NDArray[np.float64]:
    """0 where there is no slip, or the force is at its limit against the slip."""
    return np.minimum(np.abs(slip), limit + np.sign(slip) * force)

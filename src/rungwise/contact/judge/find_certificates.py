"""Finding certificates by linear programming (HiGHS, through scipy)."""

from __future__ import annotations

from typing import NamedTuple

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
from rungwise.contact.step.modes import (
    ANY,
    BACKWARD,
    CLOSED,
    FORWARD,
    OPEN,
    STICK,
    choices,
    linear_system,
    natural_units,
    parts,
)
from rungwise.contact.step.problem import ContactProblem
from rungwise.deadline import NEVER, Deadline

MAX_NODES = 2000
"""Partial modes that are looked at before a frictional certificate is given up."""
CUTS = 40
"""Times that a motion whose slips are cut off too little is looked for again."""
_SOLVES = 1e-9
"""Violation of a law, in natural units of rates and forces, up to which a point meets the law. Chosen by
trial, to a decade."""
_SMALL = 1e-9
"""Cost over the greatest that is left out where it keeps the solver from an end. Chosen by trial."""
_SINGULAR = 1e-6
"""Singular value, over the greatest, below which what the solver leaves of a balance stays: taking this away
would change the vector more than the solver's tolerance (about 1e-9). Chosen by trial, to a decade."""


class Balance(NamedTuple):
    """Modes (contacts, then limited rows) of which nothing excludes a solution, with their forces (2 k,) and
    (b,), as far as a linear program finds them."""

    modes: NDArray[np.int64]
    force: NDArray[np.float64]
    tau: NDArray[np.float64]


def certify_infeasible(problem: ContactProblem, deadline: Deadline = NEVER) -> Certificate | None:
    """A checked certificate that no velocity and force solve the problem, or None if none was found.

    The search for a frictional certificate ends after `MAX_NODES` partial modes. There is none for a problem
    whose numbers, in its natural units, are beyond the range of floating point. Raises TimeOver where the
    deadline has come.
    """
    with np.errstate(all="ignore"):
        for certificate in (_kinematic(problem, deadline), _frictional(problem, True, deadline)[0]):
            if certificate is not None and check(problem, certificate):
                return certificate
    return None


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
        certificate, balance = _frictional(without_inertia(problem, resisting), False, deadline)
        if certificate is None or not check(problem, certificate, resisting):
            return None, balance
    return certificate, None


def _apart(problem: ContactProblem, resisting: NDArray[np.float64]) -> list[NDArray[np.bool_]]:
    """Coordinates (n,) of each part that no row joins to another: the loads of one part do not bear on
    another."""
    from scipy.sparse.csgraph import connected_components

    rows = np.vstack([problem.W, problem.S, resisting]) != 0.0
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


def _frictional(
    problem: ContactProblem, held: bool, deadline: Deadline
) -> tuple[Certificate | None, Balance | None]:
    """The certificate of an island without solution, by branch and bound over its partial modes; or modes of
    which nothing excludes a solution; or neither."""
    if problem.R.shape[1] != 2:
        return None, None
    n, contacts, force = len(problem.c), len(problem.mu), natural_units(problem).force
    balance = Balance(
        np.full(contacts + len(problem.F), OPEN), np.zeros(2 * contacts), np.zeros(len(problem.F))
    )
    undecided = False
    for own in _islands(problem):
        found = _search(problem, held, own, deadline)
        if found.certificate is not None:
            return found.certificate, None
        if found.solves is None:
            undecided = True
            continue
        mode, point = found.solves
        balance.modes[own] = _decided(problem, mode, point)[own]
        pushes, pulls = np.repeat(own[:contacts], 2), own[contacts:]
        balance.force[pushes] = force * point[n : n + 2 * contacts][pushes]
        balance.tau[pulls] = force * point[n + 2 * contacts :][pulls]
    return None, None if undecided else balance


def _islands(problem: ContactProblem) -> list[NDArray[np.bool_]]:
    """Contacts and limited rows (k + b,) of each part of the problem that shares no coordinate with another;
    those that feel no coordinate come last."""
    contacts, d = len(problem.mu), problem.R.shape[1]
    normal = (problem.W != 0.0).reshape(contacts, d, len(problem.c)).any(axis=1)
    feels = np.vstack([normal, problem.S != 0.0])
    every = [*_apart(problem, problem.H), np.ones(len(problem.c), bool)]
    islands = [np.asarray(feels[:, part].any(axis=1)) for part in every]
    islands[-1] = ~islands[-1]
    return [own for own in islands if own.any()]


class _Found(NamedTuple):
    """A certificate, or else a partial mode of which nothing excludes a solution, with its unknowns; or
    neither."""

    certificate: Certificate | None = None
    solves: tuple[tuple[int, ...], NDArray[np.float64]] | None = None


def _search(problem: ContactProblem, held: bool, own: NDArray[np.bool_], deadline: Deadline) -> _Found:
    """Branch and bound over the modes of the rows `own`: one without solutions is not split further."""
    options = choices(problem, held)
    waiting = [tuple(each[0] if len(each) == 1 else ANY for each in options)]
    modes: list[tuple[int, ...]] = []
    vectors: list[NDArray[np.float64]] = []
    resisted = _is_resisted(problem)
    for _ in range(MAX_NODES):
        if not waiting:
            return _Found(Certificate("frictional" if held else "unbalanced", tuple(vectors), tuple(modes)))
        mode = waiting.pop()
        vector, point = _farkas(problem, mode, held, deadline)
        if vector is not None and excludes_mode(problem, mode, vector, held):
            modes.append(mode)
            vectors.append(vector)
            continue
        if np.isnan(point).any():
            break
        contradicts = np.where(own, _contradictions(problem, mode, point), -1.0)
        if contradicts.max() < 0.0 or (vector is None and contradicts.max() <= _SOLVES):
            return _Found(solves=(mode, point))
        first = resisted & (contradicts > _SOLVES)
        i = int(np.argmax(np.where(first, contradicts, -1.0) if first.any() else contradicts))
        waiting += [(*mode[:i], option, *mode[i + 1 :]) for option in parts(options[i], mode[i])]
    return _Found()


def _decided(problem: ContactProblem, mode: tuple[int, ...], point: NDArray[np.float64]) -> NDArray[np.int64]:
    """`mode` with what it leaves open as the unknowns have it."""
    contacts, units = len(problem.mu), natural_units(problem)
    slip, normal = _slips(problem, point), point[len(problem.c) :: 2][:contacts]
    decided = np.array(mode)
    for i in np.flatnonzero(np.isin(mode, (ANY, CLOSED))):
        if i < contacts and normal[i] <= _SOLVES:
            decided[i] = OPEN
        elif abs(slip[i]) <= _SOLVES * units.velocity and not (i < contacts and problem.mu[i] == 0.0):
            decided[i] = STICK
        else:
            decided[i] = BACKWARD if slip[i] < 0.0 else FORWARD
    return decided


def _slips(problem: ContactProblem, point: NDArray[np.float64]) -> NDArray[np.float64]:
    """Tangential rates of contacts, then rates of limited rows."""
    p, units = problem, natural_units(problem)
    n, k = len(p.c), 2 * len(p.mu)
    v, force, tau = (
        point[:n] * units.coordinates,
        point[n : n + k] * units.force,
        point[n + k :] * units.force,
    )
    own = np.einsum("kj,kj->k", p.R[:, 1], force.reshape(-1, 2))
    return np.concatenate([p.W[1::2] @ v + own + p.w[1::2], p.S @ v + p.R_s * tau + p.w_s])


def _is_resisted(problem: ContactProblem) -> NDArray[np.bool_]:
    """Which contacts and limited rows feel a coordinate that something resists: their forces are bounded, and
    their modes say more than the modes of others."""
    own = np.diag(problem.H) > 0.0
    feels = (np.vstack([problem.W, problem.S])[:, own] != 0.0).any(axis=1)
    contacts, d = len(problem.mu), problem.R.shape[1]
    return np.concatenate([feels[: contacts * d].reshape(contacts, d).any(axis=1), feels[contacts * d :]])


def _farkas(
    problem: ContactProblem, mode: tuple[int, ...], held: bool, deadline: Deadline
) -> tuple[NDArray[np.float64] | None, NDArray[np.float64]]:
    """The vector that combines the rows of `mode` to the largest contradiction, if any, and the unknowns that
    satisfy them best."""
    equal, value, least, bound = linear_system(problem, mode, held)
    bounds = [(-1.0, 1.0)] * len(value) + [(0.0, 1.0)] * len(bound)
    return _minimise(-np.concatenate([value, bound]), bounds, np.vstack([equal, least]).T, deadline=deadline)


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

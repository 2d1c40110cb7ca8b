"""Branch and bound over contact modes: the judge of last resort, and the finder of certificates.

Algorithm: at each node some laws are held at one of their pieces and the others at their convex hulls; a
linear program (HiGHS, through scipy) either finds multipliers that exclude the node, or a point x of it. From
that point the contact solver is tried; if it finds nothing the law that x violates most is divided. Islands
are searched one by one: a proof that excludes one excludes the whole. Source: Land and Doig, Econometrica 28
(1960) 497-520; for complementarity, Bard and Moore, SIAM J. Sci. Stat. Comput. 11 (1990) 281-292. Accepts:
everything; it goes beyond the root of an island up to `LARGEST` unknowns. Promises: at most `NODES` linear
programs; a solution or a proof for LCPs, boxes and planar friction if these suffice; in space a proof where
arcs of slips give one.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from scipy.linalg import block_diag

from rungwise.contact.grouped import solve_grouped
from rungwise.contact.judge.farkas import (
    Infeasible,
    Mode,
    check,
    excludes,
    generators,
    headings,
    hull,
    limits,
    pieces,
    signs,
)
from rungwise.contact.measure import natural, of_each_law
from rungwise.contact.prepare.islands import islands
from rungwise.contact.prepare.system import System
from rungwise.contact.problem import Array, Matrix
from rungwise.deadline import Deadline
from rungwise.kernel import Ints

LARGEST, LARGEST_ROOT, NODES = 80, 3000, 300
"""Unknowns of an island up to which it is divided, and up to which its root is tried; most linear programs.
Chosen by trial, so that a search takes seconds."""
ENTRIES = 1_000_000
"""Entries of A up to which the linear program of the root ends in seconds."""
ROUNDING = 1e-9
"""Size in scaled units below which multipliers, at most 1, and their gain are rounding: ten times the
tolerances of the linear programs."""
_ACTIVE = (1e-6, 1e-8, 1e-10)
"""Sizes in scaled units below which a constraint on multipliers may be active: the first that gives a proof
counts. Chosen by trial."""
OPTIONS = {
    "primal_feasibility_tolerance": 1e-10,
    "dual_feasibility_tolerance": 1e-10,
    "time_limit": 5.0,
}
"""Options of HiGHS: the least tolerances that it accepts, without unit; seconds, chosen by trial."""


class Found(NamedTuple):
    """The best x (N,), its residual, the linear programs solved, and the proof if there is none."""

    x: Array
    residual: float
    nodes: int
    proof: Infeasible | None


def search(system: System, start: Array, tol: float, work: Array, deadline: Deadline) -> Found:
    """A solution within tol, or a checked proof that there is none, or the best x met."""
    apart = islands(system)
    if apart is None:
        return _search(system, start, tol, work, NODES, deadline)
    inside, goals, nodes = apart.inwards(start), apart.goals(tol), 0
    for i in range(len(apart)):
        own, rows = apart.part(i), slice(apart.first[i], apart.first[i + 1])
        if natural(own, inside[rows]) <= goals[i]:
            continue
        found = _search(own, inside[rows], goals[i], work, NODES - nodes, deadline)
        inside[rows], nodes = found.x, nodes + found.nodes
        if found.proof is not None and (whole := _of_whole(system, apart.place[rows], found.proof)):
            return Found(start, natural(system, start), nodes, whole)
    x = apart.outwards(inside)
    return Found(x, natural(system, x), nodes, None)


def _of_whole(system: System, place: Ints, proof: Infeasible) -> Infeasible | None:
    """The proof of an island, whose rows are `place` of the system, as a proof of the system; None if it
    proves nothing in the system's units."""
    d, pairs = system.directions, place < system.rows
    law = np.concatenate([place[pairs][::d] // d, place[~pairs] - system.rows + len(system.mu)])
    modes, vectors = [], []
    for own, p in zip(proof.modes, proof.vectors, strict=True):
        mode, vector = np.array(hull(system)), np.zeros(system.size)
        mode[law], vector[place] = own, p
        modes.append(tuple(mode.tolist()))
        vectors.append(vector)
    made = Infeasible(proof.kind, tuple(modes), tuple(vectors))
    return made if check(system, made) else None


@np.errstate(all="ignore")  # iterates that run away are judged, not warned about
def _search(system: System, start: Array, tol: float, work: Array, nodes: int, deadline: Deadline) -> Found:
    best, least = start, natural(system, start)
    if system.size > LARGEST_ROOT or len(system.form.entries.value) > ENTRIES:
        return Found(best, least, 0, None)
    waiting, excluded, proving = [hull(system)], [], True
    done = 0
    for done in range(1, nodes + 1):
        if deadline.is_over:
            return Found(best, least, done - 1, None)
        mode = waiting.pop()
        p, x = separate(system, mode, until(deadline))
        if p is not None:
            excluded.append((mode, p))
        elif system.size <= LARGEST and x is not None:
            trial, count = x.copy(), np.zeros(4, np.int64)
            A = system.form.entries
            solve_grouped(A, A, system.b, system.laws, 0, 0.0, trial, work, deadline.halt, count)
            for candidate in (x, trial):
                found = natural(system, candidate)
                if found < least:
                    best, least = candidate, found
            divided = divide(system, mode, x)
            waiting += divided
            proving = proving and bool(divided)
        else:
            return Found(best, least, done, None)
        if least <= tol or not waiting:
            break
    if least <= tol or waiting or not proving:
        return Found(best, least, done, None)
    return Found(best, least, done, proof(system, excluded))


def proof(system: System, excluded: list[tuple[Mode, Array]]) -> Infeasible | None:
    """The modes with the multipliers that exclude each, if checked to prove that there is no solution.

    The proof is unsupported when it weighs the rows of free unknowns alone: loads that nothing balances.
    """
    used = np.any([p != 0.0 for _, p in excluded], axis=0)
    others = np.isfinite(system.lower) | np.isfinite(system.upper)
    jammed = used[: system.rows].any() or used[system.rows :][others].any()
    modes, vectors = tuple(mode for mode, _ in excluded), tuple(p for _, p in excluded)
    made = Infeasible("jammed" if jammed else "unsupported", modes, vectors)
    return made if check(system, made) else None


def divide(system: System, mode: Mode, x: Array, first: int | None = None) -> list[Mode]:
    """Children by the law `first`, or else by the law that x violates most, the likeliest child last."""
    d, contacts, worst = system.directions, len(system.mu), of_each_law(system, x)
    for law in sorted(range(len(mode)), key=lambda law: (law != first, -worst[law])):
        parts = pieces(system, law, mode[law])
        if parts:
            force = x[law * d] if law < contacts else 1.0
            order = parts if force > 0.0 else parts[::-1]
            return [(*mode[:law], part, *mode[law + 1 :]) for part in order]
    return []


def separate(system: System, mode: Mode, options: dict[str, float]) -> tuple[Array | None, Array | None]:
    """Multipliers p, at most 1, with p . y < 0 for every x of the mode; else such an x, from the dual."""
    from scipy.optimize import linprog

    s = system
    least, most = signs(s, mode)
    lower, upper = limits(s, mode)
    m = len(lower)
    cone, push, drawn = _constraints(s, mode)
    bounds = [(max(a, -1.0), min(c, 1.0)) for a, c in zip(least, most, strict=True)]
    bounds += [(0.0, 0.0 if np.isinf(c) else None) for c in upper]
    bounds += [(0.0, 0.0 if np.isinf(a) else None) for a in lower]
    ends = np.concatenate([upper, -lower])
    found = linprog(
        np.concatenate([s.b, np.where(np.isinf(ends), 0.0, ends)]),
        push if push.shape[0] else None,
        np.zeros(push.shape[0]) if push.shape[0] else None,
        drawn if m else None,
        np.zeros(m) if m else None,
        bounds=bounds,
        method="highs",
        options=options,
    )
    if found.x is None:
        return None, None
    if found.fun < -ROUNDING:
        rows = np.vstack([push, drawn]) if s.size <= LARGEST else sp.vstack([push, drawn], format="csr")
        for active in _ACTIVE:
            p = _sharpen(np.asarray(found.x)[: s.size], rows[:, : s.size], active)
            if excludes(s, mode, p):
                break
        return p, None
    contact = np.zeros(s.rows)
    if cone.shape[0]:
        contact = -np.asarray(found.ineqlin.marginals)[: cone.shape[0]] @ cone
    others = -np.asarray(found.eqlin.marginals) if m else np.zeros(0)
    return None, np.concatenate([contact, others])


def until(deadline: Deadline) -> dict[str, float]:
    """Options of linear programs that end when the deadline has come."""
    left = deadline.seconds
    return OPTIONS if left is None else OPTIONS | {"time_limit": min(OPTIONS["time_limit"], left)}


def _constraints(s: System, mode: Mode) -> tuple[Matrix, Matrix, Matrix]:
    """Rays of all contacts; how multipliers draw along them, and against arcs of slips; and (A^T p)_j = above
    - below: how much x_j is drawn to its upper and to its lower limit. Dense for few unknowns."""
    rays, m = [generators(s, k, mode[k]) for k in range(len(s.mu))], len(s.lower)
    if s.size <= LARGEST:
        back, cone = s.dense().T, block_diag(*rays) if rays else np.zeros((0, 0))
        push = np.vstack([cone @ back[: s.rows], -headings(s, mode)])
        push = np.hstack([push, np.zeros((len(push), 2 * m))])
        return cone, push, np.hstack([back[s.rows :], -np.eye(m), np.eye(m)])
    back = sp.csr_array(s.matrix().T)
    cone = sp.block_diag(list(map(sp.coo_array, rays)), format="csr") if rays else sp.csr_array((0, 0))
    push = sp.hstack([cone @ back[: s.rows], sp.csr_array((cone.shape[0], 2 * m))], format="csr")
    return cone, push, sp.hstack([back[s.rows :], -sp.eye_array(m), sp.eye_array(m)], format="csr")


def _sharpen(p: Array, constraints: Matrix, nearly: float) -> Array:
    """p with rounding removed: entries nearly zero are zero, and constraints nearly active are met."""
    p = np.where(np.abs(p) > ROUNDING, p, 0.0)
    inside = np.abs(p) > 0.0
    active = np.abs(constraints @ p) < nearly
    rows = constraints[active][:, inside]
    rows = rows.toarray() if sp.issparse(rows) else rows
    for _ in range(2):
        p[inside] -= np.linalg.lstsq(rows, rows @ p[inside], rcond=None)[0]
    return p

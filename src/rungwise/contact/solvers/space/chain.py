"""A step's problem in space: forces of contacts with an exact cone, from compiled code, judged there.

Algorithm: rows are sorted by islands of bodies that touch (`rows`). An island that rests, or moves
on, by the forces of the last step is left alone; the others are solved by sweeps (`sweeps`) and
Newton's method in velocities (`newton`), and where that does not end by the proximal point method
(`proximal`), from there or from an interior point (`path`). Each is tried with forces
beside rates as bodies alone would answer, and as the problem's loads are beside the rates that it demands:
where next to nothing resists a motion, other contacts and drives answer. The last try takes the answer of the
body that yields least. Accepts: H positive definite, three or four directions. Promises: SOLVED only with a
residual within `TOLERANCE`, computed from the problem as it was given.
"""

from __future__ import annotations

import math

import numpy as np

from rungwise.contact.solvers.settings import FINISH, NEARER, STALLED
from rungwise.contact.solvers.space.measure import Island, measure
from rungwise.contact.solvers.space.newton import descend
from rungwise.contact.solvers.space.path import advance, begin, product_ahead
from rungwise.contact.solvers.space.proximal import approach, put, residual_at
from rungwise.contact.solvers.space.room import (
    Room,
    allocate_room,
    give_back,
    room_for,
    sort_problem,
    span_of,
    take_start,
)
from rungwise.contact.solvers.space.rows import Bodies, Groups, demanded_yield, lead_rows
from rungwise.contact.solvers.space.sweeps import accelerate, respond, sweep
from rungwise.contact.step.modes import FORWARD, OPEN, STICK
from rungwise.contact.step.problem import ContactProblem, Sizes, Unknowns
from rungwise.contact.step.residual_in_space import residual_where
from rungwise.contact.step.solve import GUESS, NO_SOLUTION, PIVOTING, PROXIMAL, SOLVED, TOLERANCE, WEDGED
from rungwise.contact.step.touched import Touched, touch
from rungwise.kernel import Ints, Reals, allocating_kernel, inner_kernel, kernel, rare_kernel

_MARGIN, _ENOUGH = 0.1, 0.5
"""Residual asked of an island, and residual that is enough where it takes many steps to come closer or where
what rests goes on to rest, over the tolerance of the whole. The first is chosen by trial, to a decade."""
_NEAR = 0.3
"""Residual from which on Newton's method comes before any sweep. Chosen by trial, to a decade."""
_SWEEPS, _STEPS = 4, 6
"""Sweeps before Newton's method, and most of its steps. Chosen by trial."""
_SUBPROBLEMS = 60
"""Most subproblems of the proximal point method; chosen by trial."""
_PATH, _WINDOW = 40, 6
"""Most steps of the interior point method, which ends where product and residual are above `STALLED` of
their values a window of steps earlier. Chosen by trial."""
_STILL = 1e-6
"""Tangential rate over its largest term up to which a contact at the limit of its friction sticks: a hundred
times the tolerance; chosen by trial, to a decade."""
_INSIDE = 1.0 - 1e-9
"""Part of the friction limit up to which a contact sticks; the gap to 1 is chosen by trial, to a decade."""


@allocating_kernel
def solve_spatial(
    problem: ContactProblem, sizes: Sizes, unknowns: Unknowns, columns: Ints, couplings: Ints, halt: Ints
) -> tuple[int, float, int]:
    """Solve, starting from `force`, `tau`, and rest or v, into these and the modes, where a contact that
    slips is FORWARD whatever its heading; returns (status, residual, stage). Without a solution forces and
    velocities are zero, and the residual is the least that was found. It ends so when `halt` (1,) is set.
    Where entries are, `columns` and `couplings` say as for `touch`, unless they are empty."""
    n, contacts, limited = sizes
    _, v, force, tau = unknowns
    p, d = problem, problem.R.shape[1]
    touched = touch(p, sizes, columns, couplings)
    going = v[:n].copy()
    v[:n] = 0.0
    # What rested goes on resting, and what moved steadily moves on so: nothing need be sorted.
    lone = _all_touch(touched, n)
    for turn in range(2 if lone else 1):
        if turn == 1:
            v[:n] = going
        error = residual_where(p, sizes, touched, unknowns)
        if error <= _ENOUGH * TOLERANCE:
            tell_modes(p, sizes, touched, unknowns)
            return SOLVED, error, GUESS
    lead = lead_rows(np.empty(0, np.int64), limited)
    by = sort_problem(p, sizes, touched, np.ones(contacts, np.int64), lead, d)
    if not by.solid:
        v[:n], force[: contacts * d], tau[:limited] = 0.0, 0.0, 0.0
        return NO_SOLUTION, math.inf, GUESS
    room, islands = allocate_room(by, p.quantum[0], halt), len(by.ends)
    demand, lone = demanded_yield(p, sizes, touched), lone and islands == 1
    v[:n] = going
    take_start(by, sizes, d, unknowns, going, room.point.x)
    worst = GUESS
    for polishes in (False, True):
        for i in range(islands):
            touching = Island(by.bodies, by.groups, span_of(by.ends, i), p.quantum[0], halt)
            own = room_for(touching, room)
            if polishes:
                descend(touching, 0.0, _STEPS, own.point, own.trial, own.steps)
            else:
                worst = max(worst, _solve_island(touching, lone, demand, going, own))
        give_back(by, sizes, d, room.point, unknowns)
        error = residual_where(p, sizes, touched, unknowns)
        # What rests is measured by its own speed in an island, by all speeds in the end.
        if error <= TOLERANCE or worst == PIVOTING:
            break
    status = (
        SOLVED
        if error <= TOLERANCE and _exertion(by.bodies, by.groups, p.quantum[0], room.point.x) <= WEDGED
        else NO_SOLUTION
    )
    if status != SOLVED:
        v[:n], force[: contacts * d], tau[:limited] = 0.0, 0.0, 0.0
    tell_modes(p, sizes, touched, unknowns)
    return status, error, worst


@allocating_kernel
def _all_touch(touched: Touched, n: int) -> bool:
    """Whether each coordinate has a part in a contact or limited row: motion of what touches nothing is known
    to rounding."""
    touches = np.zeros(n, np.bool_)
    for e in range(touched.first[-1]):
        touches[touched.coordinate[e]] = True
    return bool(touches.all())


@kernel
def _solve_island(island: Island, lone: bool, demand: float, going: Reals, room: Room) -> int:
    """Solve from the forces at the point, and rest or velocities `going` (n,), unless the island is `lone`,
    so that these were tried; returns the stage that it took."""
    tol = _MARGIN * TOLERANCE
    span = island.span
    point, trial, best, steps = room.point, room.trial, room.best, room.steps
    # At rest, or in steady motion, velocities that are differences of forces would be rounding.
    for turn in range(2 if span.first < span.last and not lone else 0):
        for i in range(span.low, span.high):
            point.v[i] = going[i] if turn == 1 else 0.0
        if residual_at(island, point, steps) <= tol:
            return GUESS
    accelerate(island, point)
    if span.first == span.last:
        return GUESS
    found = residual_at(island, point, steps)
    if found <= _ENOUGH * TOLERANCE:
        return GUESS
    put(island, point, best)
    if found <= _NEAR:
        descend(island, tol, _STEPS, point, trial, steps)
        if measure(island, point, steps.dv) <= tol:
            return PROXIMAL
    respond(island, room.answers)
    for turn in range(2 if demand > 0.0 else 1):
        _look_ahead(island, demand if turn == 1 else 0.0)
        put(island, best, point)
        if _by_newton(island, room):
            return PROXIMAL
    for turn in range(1 if demand > 0.0 else 0, -1, -1):
        _look_ahead(island, demand if turn == 1 else 0.0)
        if _by_path(island, room):
            return PIVOTING
    _look_ahead(island, _least_yield(island))
    if not _by_newton(island, room):
        put(island, best, point)
    return PIVOTING


@rare_kernel
def _least_yield(island: Island) -> float:
    """The least yield of a row by one of its coordinates alone: what is heavy, or damped, answers to forces
    that pass through what is light."""
    bodies, groups, (_, _, first, last), _, _ = island
    least = math.inf
    for g in range(first, last):
        at, begin, end = groups.entry[g], groups.column[g], groups.column[g + 1]
        for _ in range(groups.row[g], groups.row[g + 1]):
            for c in range(begin, end):
                i = groups.touched[c]
                if groups.W[at] != 0.0:
                    least = min(least, groups.W[at] ** 2 / bodies.H[bodies.at[i] + i])
                at += 1
    return least


@inner_kernel
def _look_ahead(island: Island, demand: float) -> None:
    """Let the map look ahead with this yield, or where it is 0 with those of the bodies."""
    groups, span = island.groups, island.span
    for g in range(span.first, span.last):
        groups.ahead[g] = demand if demand > 0.0 else groups.scale[g]


@kernel
def _by_newton(island: Island, room: Room) -> bool:
    """Sweeps, Newton steps, and the proximal point method; whether the point is a solution."""
    tol = _MARGIN * TOLERANCE
    point, trial, answers, steps = room.point, room.trial, room.answers, room.steps
    accelerate(island, point)
    sweep(island, answers, _SWEEPS, point, steps.dx)
    accelerate(island, point)
    descend(island, tol, _STEPS, point, trial, steps)
    if measure(island, point, steps.dv) <= tol:
        return True
    found = approach(island, answers, tol, _SUBPROBLEMS, point, trial, steps)
    return bool(found <= _ENOUGH * TOLERANCE)


@kernel
def _by_path(island: Island, room: Room) -> bool:
    """The interior point method, with the proximal point method from it; leaves the least residual met at
    the point, and returns whether it is a solution."""
    tol, least = _MARGIN * TOLERANCE, math.inf
    point, trial, attempt, best, answers, duals, steps = room
    begin(island, point, duals, steps)
    finish, earlier, before = FINISH, math.inf, math.inf
    for done in range(_PATH):
        if island.halt[0] != 0 or not advance(island, point, duals, steps):
            break
        found = residual_at(island, point, steps)
        if done % _WINDOW == 0:
            product, _ = product_ahead(island, point.x, duals, 0.0, steps)
            if not (product <= STALLED * earlier or found <= STALLED * before):
                break
            earlier, before = product, found
        if found < least:
            least = found
            put(island, point, best)
        if found < finish:
            finish = NEARER * found
            put(island, point, attempt)
            found = approach(island, answers, tol, _SUBPROBLEMS, attempt, trial, steps)
            if found < least:
                least = found
                put(island, attempt, best)
        if least <= _ENOUGH * TOLERANCE:
            break
    put(island, best, point)
    return bool(least <= _ENOUGH * TOLERANCE)


@kernel
def _exertion(bodies: Bodies, groups: Groups, quantum: float, x: Reals) -> float:
    """Greatest force over the greatest that loads, demanded rates and limits call for, as
    `contact.step.proximal.exertion` for planar problems."""
    called, greatest = 0.0, 0.0
    for i in range(len(bodies.c)):
        called = max(called, abs(bodies.c[i]))
    for g in range(len(groups.source)):
        unit = math.sqrt(groups.scale[g])
        if unit == 0.0:
            continue
        for i in range(groups.row[g + 1] - groups.row[g]):
            own, r = groups.R[g, i, i], groups.row[g] + i
            greatest = max(greatest, abs(x[r]) * unit)
            least = min(own, groups.scale[g]) if own > 0.0 else groups.scale[g]
            called = max(called, max(abs(groups.w[r]), quantum) * unit / least)
        if groups.mu[g] < 0.0 and groups.limit[g] < math.inf:
            called = max(called, groups.limit[g] * unit)
    return greatest / called if greatest > 0.0 else 0.0


@kernel
def tell_modes(p: ContactProblem, sizes: Sizes, touched: Touched, unknowns: Unknowns) -> None:
    """A contact that pushes slips where its friction is at the limit and its rate is more than rounding."""
    _, contacts, limited = sizes
    mode, v, force, tau = unknowns
    d = p.R.shape[1]
    for k in range(contacts):
        rubs = 0.0
        for i in range(k * d + 1, k * d + d):
            rubs += force[i] * force[i]
        inside = math.sqrt(rubs) < _INSIDE * p.mu[k] * force[k * d]
        sticks = inside or (p.mu[k] > 0.0 and _is_still(p, touched, k, v, force))
        mode[k] = OPEN if force[k * d] <= 0.0 else STICK if sticks else FORWARD
    for r in range(limited):
        mode[contacts + r] = STICK if abs(tau[r]) < _INSIDE * p.F[r] else FORWARD


@kernel
def _is_still(p: ContactProblem, touched: Touched, k: int, v: Reals, force: Reals) -> bool:
    """Whether the tangential rate of a contact is rounding of its terms."""
    d, rate, scale = p.R.shape[1], 0.0, p.quantum[0]
    for i in range(k * d + 1, k * d + d):
        own = p.w[i]
        for e in range(touched.first[k], touched.first[k + 1]):
            j = touched.coordinate[e]
            own += p.W[i, j] * v[j]
            scale = max(scale, abs(p.W[i, j] * v[j]))
        for j in range(d):
            own += p.R[k, i - k * d, j] * force[k * d + j]
        scale = max(scale, abs(p.w[i]))
        rate = max(rate, abs(own))
    return rate <= _STILL * scale

"""A step's problem with friction of supports: limited rows share balls, and all laws are met at once.

Algorithm: as `space.chain`: rows are sorted by islands of bodies that touch, and what rests by the forces of
the last step is left alone. Contacts that push nothing and that velocities do not close are left out, so that
they join no islands, until velocities close them. What moves is solved by Newton's method from the velocities
and forces of the last step, and where that does not end, from points of an interior path (`space.path`), and
then by the proximal point method from the best of these. The maps look ahead with the rates that the step
demands over the limits of the balls: where next to nothing else resists, those are the forces.
Accepts: H positive definite, contacts of any number of directions, balls of up to three limited rows.
Promises: nothing but the residual that is returned.
"""

from __future__ import annotations

import math

import numpy as np

from rungwise.contact.solvers.settings import FINISH, NEARER
from rungwise.contact.solvers.space.chain import tell_modes
from rungwise.contact.solvers.space.measure import Island, Point, measure
from rungwise.contact.solvers.space.newton import descend, evaluate
from rungwise.contact.solvers.space.path import advance, begin_on_axes
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
from rungwise.contact.solvers.space.rows import lead_rows
from rungwise.contact.solvers.space.sweeps import accelerate, respond
from rungwise.contact.step.modes import BACKWARD, FORWARD
from rungwise.contact.step.problem import ContactProblem, Sizes, Unknowns
from rungwise.contact.step.touched import Touched, touch
from rungwise.kernel import Ints, Reals, allocating_kernel, inner_kernel, kernel

_MOST = 4
"""Room for the rows of a group: those of a ball, and the axis of its cone."""
_EXACT, _ENOUGH = 1e-12, 1e-9
"""Residual at which Newton's method ends, and which is enough where it comes no nearer: laws of balls are met
to 1e-10. Chosen by trial, to a decade."""
_CLOSES = 1e-12
"""Rate over its greatest term from which on it closes a contact: about ten thousand roundings."""
_RESTS = 1e-10
"""Residual up to which forces of the last step let an island rest. Chosen by trial, to a decade."""
_STEPS, _POLISH = 12, 6
"""Most steps of Newton's method from the last step, and from the path. Chosen by trial."""
_PATH = 40
"""Most steps of the interior point method; chosen by trial."""
_SUBPROBLEMS = 20
"""Most subproblems of the proximal point method; chosen by trial."""


@allocating_kernel
def solve_with_balls(
    problem: ContactProblem,
    sizes: Sizes,
    unknowns: Unknowns,
    surface: Ints,
    columns: Ints,
    couplings: Ints,
    halt: Ints,
) -> float:
    """Solve from the unknowns, but for the modes, into them; returns the residual, inf where halt (1,) is set
    or an island is not solved. Limited rows with the same number in `surface` (limited,) share a ball, sum of
    (tau / F)^2 <= 1, unless it is negative. `columns` and `couplings` as for `touch`."""
    d, contacts, v, force = problem.R.shape[1], sizes.contacts, unknowns.v, unknowns.force
    touched, lead = touch(problem, sizes, columns, couplings), lead_rows(surface, sizes.limited)
    awake, found = np.zeros(contacts, np.int64), 0.0
    for k in range(contacts):
        awake[k] = 1 if force[k * d] > 0.0 else 0
    woken = _wake(problem, contacts, touched, v, awake)
    for turn in range(contacts + 1):
        if turn > 0 and woken == 0:
            break
        found = _solve_awake(problem, sizes, unknowns, touched, awake, lead, halt)
        if not found <= _ENOUGH or halt[0] != 0:
            return math.inf
        woken = _wake(problem, contacts, touched, v, awake)
    tell_modes(problem, sizes, touched, unknowns)
    _tell_signs(sizes, d, unknowns)
    return found


@kernel
def _wake(p: ContactProblem, contacts: int, touched: Touched, v: Reals, awake: Ints) -> int:
    """Wake the contacts that velocities would close; returns how many."""
    d, woken = p.R.shape[1], 0
    for k in range(contacts):
        rate = scale = p.w[k * d]
        scale = max(abs(scale), p.quantum[0])
        for e in range(touched.first[k], touched.first[k + 1]):
            term = p.W[k * d, touched.coordinate[e]] * v[touched.coordinate[e]]
            rate += term
            scale = max(scale, abs(term))
        if awake[k] == 0 and not rate >= -_CLOSES * scale:
            awake[k] = 1
            woken += 1
    return woken


@allocating_kernel
def _solve_awake(
    problem: ContactProblem,
    sizes: Sizes,
    unknowns: Unknowns,
    touched: Touched,
    awake: Ints,
    lead: Ints,
    halt: Ints,
) -> float:
    """Solve with the contacts that are `awake`, and without the others; returns the residual."""
    d, worst = problem.R.shape[1], 0.0
    by = sort_problem(problem, sizes, touched, awake, lead, _MOST)
    if not by.solid:
        return math.inf
    room = allocate_room(by, problem.quantum[0], halt)
    take_start(by, sizes, d, unknowns, room.point.v, room.point.x)
    for i in range(len(by.ends)):
        island = Island(by.bodies, by.groups, span_of(by.ends, i), problem.quantum[0], halt)
        worst = max(worst, _solve_island(island, room_for(island, room)))
        if not worst <= _ENOUGH:
            return math.inf
    give_back(by, sizes, d, room.point, unknowns)
    return worst


@inner_kernel
def _tell_signs(sizes: Sizes, d: int, unknowns: Unknowns) -> None:
    """Tell the heading of what slips by the sign of its force, where it is one force."""
    for g in range(sizes.contacts if d == 2 else 0):
        if unknowns.mode[g] == FORWARD and unknowns.force[2 * g + 1] > 0.0:
            unknowns.mode[g] = BACKWARD
    for r in range(sizes.limited):
        if unknowns.mode[sizes.contacts + r] == FORWARD and unknowns.tau[r] > 0.0:
            unknowns.mode[sizes.contacts + r] = BACKWARD


@kernel
def _solve_island(island: Island, room: Room) -> float:
    """Solve from velocities and forces at the point; returns the residual."""
    point, span, steps = room.point, island.span, room.steps
    put(island, point, room.best)
    for i in range(span.low, span.high):
        point.v[i] = 0.0
    if residual_at(island, point, steps) <= _RESTS:
        return 0.0
    if span.first == span.last:
        accelerate(island, point)
        return 0.0
    put(island, room.best, point)
    pace, force = _look_ahead(island, point, room)
    put(island, room.best, point)
    descend(island, _EXACT, _STEPS, point, room.trial, steps)
    found = measure(island, point, steps.dv)
    if found <= _ENOUGH or not pace > 0.0:
        return found
    return _by_path(island, math.sqrt(pace * force), room)


@kernel
def _look_ahead(island: Island, point: Point, room: Room) -> tuple[float, float]:
    """Let the maps look ahead with the greatest demanded rate over the limits of balls, where bodies yield
    more; returns that rate, and the mean limit. Velocities at the point are those of the last step, and are
    lost where nothing demands a rate but loads."""
    groups, span = island.groups, island.span
    pace, force, balls = 0.0, 0.0, 0
    for turn in range(2):
        if turn == 1:
            for r in range(groups.row[span.first], groups.row[span.last]):
                point.x[r] = 0.0
            accelerate(island, point)
        evaluate(island, 0.0, point, room.steps)
        pace = max(pace, _demanded(island, point))
        if pace > 0.0:
            break
    for g in range(span.first, span.last):
        if groups.mu[g] < 0.0 and 0.0 < groups.limit[g] < math.inf:
            force += groups.limit[g]
            balls += 1
    force = force / balls if balls > 0 else 0.0
    for g in range(span.first, span.last):
        limit = groups.limit[g] if groups.mu[g] < 0.0 and 0.0 < groups.limit[g] < math.inf else force
        if pace > 0.0 and limit > 0.0:
            groups.ahead[g] = min(groups.scale[g], pace / limit)
    return pace, force


@kernel
def _demanded(island: Island, point: Point) -> float:
    """The greatest rate that closed contacts and limited rows have or are asked for."""
    groups, span, pace = island.groups, island.span, 0.0
    for g in range(span.first, span.last):
        row, end = groups.row[g], groups.row[g + 1]
        if groups.mu[g] >= 0.0:
            pace = max(pace, -groups.w[row])
        for r in range(row + 1 if groups.mu[g] >= 0.0 else row, end):
            pace = max(pace, abs(groups.w[r]))
            if groups.mu[g] < 0.0:
                pace = max(pace, abs(point.u[r]))
    return pace


@kernel
def _by_path(island: Island, unit: float, room: Room) -> float:
    """Newton's method from points of the path, on which rates have the energy unit squared at first, and in
    the end the proximal point method from the best of all; returns the residual."""
    point, trial, attempt, best, answers, duals, steps = room
    for i in range(island.span.low, island.span.high):
        point.v[i] = 0.0
    begin_on_axes(island, unit, point, duals)
    finish, least = FINISH, math.inf
    for _ in range(_PATH):
        if island.halt[0] != 0 or not advance(island, point, duals, steps):
            break
        found = residual_at(island, point, steps)
        if found < least:
            least = found
            put(island, point, best)
        if found < finish:
            finish = NEARER * found
            put(island, point, attempt)
            descend(island, _EXACT, _POLISH, attempt, trial, steps)
            found = measure(island, attempt, steps.dv)
            if found < least:
                least = found
                put(island, attempt, best)
        if least <= _ENOUGH:
            break
    put(island, best, point)
    if least <= _ENOUGH or not least < math.inf or island.halt[0] != 0:
        return least
    respond(island, answers)
    return approach(island, answers, _ENOUGH, _SUBPROBLEMS, point, trial, steps)

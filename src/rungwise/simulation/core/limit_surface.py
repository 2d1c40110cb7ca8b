"""Dry friction of a body along several coordinates: one force in an ellipsoid, against the motion.

    t in argmin over |t| <= 1 of t . u,   t_i = tau_i / F_i,   u_i = F_i s_i  (power)

for the rows i of one limit surface, at most three. Two algorithms take turns. Semismooth Newton on t = P(t -
u / c), P the projection on the unit ball, has linear pieces, each of which is a step's problem with
force-limited rows, which the chain solves: while the body sticks, the rows as they are (a box, about the
ball); while it slips, the row along the force, limited, and across it rows that yield, u_across + rho
t_across = 0. Few such problems lead to an answer where one body slides; directions of several do not settle
so. There, and where a piece has no solution, the laws of contacts and surfaces are met at once
(`contact.solvers.space.balls`), and the pieces of that answer judge it. Source: Goyal, Ruina, Papadopoulos,
Wear 143 (1991) 307-330 (limit surface); Alart and Curnier, Comput. Methods Appl. Mech. Eng. 92 (1991)
353-375.
"""

from __future__ import annotations

import math

import numpy as np

from rungwise.contact.step import (
    BACKWARD,
    FORWARD,
    NO_SOLUTION,
    PROXIMAL,
    SOLVED,
    STICK,
    TOLERANCE,
    ContactProblem,
    Sizes,
    judged,
    trim,
)
from rungwise.kernel import Ints, Reals, kernel
from rungwise.simulation.core.chains import solve_in_plane, solve_on_surfaces
from rungwise.simulation.core.state import Scratch, State, unknowns_in
from rungwise.system.terms import APART, Terms

STUCK, SLIPS = 0, 1
"""Pieces of the law that a problem is made of."""
FIRST, AFTER = 4, 8
"""Problems of pieces before all laws are met at once, of one surface alone, and after it. Chosen by trial."""
EXACT = 1e-10
"""Distance of t from its projection, in the ball of radius 1, up to which the law is met."""
ROUNDED = 1e-13
"""Rounding of a speed, over the speed of the fastest surface: a surface far slower knows its direction less
well, and its law is met as far as that. Chosen by trial, to a decade."""
VAGUE = 1e-6
"""Greatest distance that rounding excuses."""


@kernel
def solve_supported(
    sizes: Sizes, terms: Terms, state: State, scratch: Scratch, problem: ContactProblem
) -> tuple[int, float, int]:
    """Solve the assembled `problem` as `solve_planar`, changing the rows that share a surface; forces and
    modes belong to the rows of `terms`. The first guess slips along `state.v`, or sticks."""
    n, contacts, limited = sizes
    for r in range(limited):
        row = scratch.support[r]
        row.offset, row.scale = problem.w_s[r], 0.0
    _measure(contacts, limited, n, state.v, False, terms, state, scratch)
    _aim(limited, terms, scratch)
    found, stage, left, tried = math.inf, 0, FIRST if _is_one(limited, terms) else 0, False
    while left > 0 or not tried:
        if left == 0:
            met, found = _meet_at_once(sizes, terms, state, scratch, problem)
            if met:
                _hand_over(contacts, limited, terms, scratch)
                return SOLVED, found, PROXIMAL
            left, tried = AFTER, True
        left -= 1
        _fill(contacts, limited, n, terms, state, scratch, problem)
        status, found, stage = solve_in_plane(problem, sizes, terms, scratch)
        if status != SOLVED:
            left = 0
            continue
        for i in range(n):
            scratch.v_new[state.free[i]] = scratch.x[i]
        _measure(contacts, limited, n, scratch.v_new, True, terms, state, scratch)
        apart, met = _aim(limited, terms, scratch)
        if met:
            _hand_over(contacts, limited, terms, scratch)
            return SOLVED, max(found, apart), stage
    return NO_SOLUTION, found, stage


@kernel
def _is_one(limited: int, terms: Terms) -> bool:
    """Whether there is one surface alone."""
    surfaces = 0
    for first in range(limited):
        surfaces += 1 if leads(first, limited, terms) > 0 else 0
    return surfaces == 1


@kernel
def _meet_at_once(
    sizes: Sizes, terms: Terms, state: State, scratch: Scratch, problem: ContactProblem
) -> tuple[bool, float]:
    """Solve all laws at once, from where the pieces are, and set the pieces that belong to the solution;
    whether it meets all laws, and the residual of these pieces."""
    n, contacts, limited = sizes
    for r in range(limited):
        scratch.support[r].piece = STUCK
    _fill(contacts, limited, n, terms, state, scratch, problem)
    for r in range(limited):
        if terms.surface[r] != APART:
            scratch.limited_force[r] = scratch.support[r].force * terms.limit[r]
    for i in range(n):
        scratch.x[i] = state.v[state.free[i]]
    if not solve_on_surfaces(problem, sizes, terms, scratch) < math.inf:
        _measure(contacts, limited, n, state.v, False, terms, state, scratch)
        _aim(limited, terms, scratch)
        return False, math.inf
    for i in range(n):
        scratch.v_new[state.free[i]] = scratch.x[i]
    for first in range(limited):
        size, force = leads(first, limited, terms), 0.0
        for j in range(size):
            r = _member(first, j, terms)
            force += (scratch.limited_force[r] / terms.limit[r]) ** 2
        for j in range(size):
            sticks = math.sqrt(force) < 1.0 - EXACT
            scratch.mode[contacts + _member(first, j, terms)] = STICK if sticks else FORWARD
    _measure(contacts, limited, n, scratch.v_new, True, terms, state, scratch)
    apart, met = _aim(limited, terms, scratch)
    if not met:
        return False, apart
    _fill(contacts, limited, n, terms, state, scratch, problem)
    for first in range(limited):
        size = leads(first, limited, terms)
        for m in range(size):
            own, force = _member(first, m, terms), 0.0
            for j in range(size):
                force += (
                    _turned(first, m, j, terms, scratch) * scratch.support[_member(first, j, terms)].force
                )
            unit = terms.limit[own if scratch.support[first].piece == STUCK else first]
            scratch.limited_force[own] = force * unit
    found = judged(problem, sizes, unknowns_in(scratch))
    return found <= TOLERANCE, max(found, apart)


def without_law(problem: ContactProblem, terms: Terms, free: Ints, inertia: float) -> ContactProblem:
    """A trimmed problem of a rung with this `inertia`, without surfaces: if it has no solution, the law has
    none.

    Where one surface alone resists, its force is -(S^T F^2 S) v / power: velocities are as with a damper, and
    forces a multiple. Elsewhere each row of a surface may have any force within its own limit; it yields, so
    that certificates read no more of it than this interval.
    """
    n = len(problem.c)
    rows = np.flatnonzero(terms.surface[: len(problem.F)] != APART)
    if len(rows) == 0:
        return problem
    S = terms.limited[rows][:, free[:n]]
    if inertia == 0.0 and len(terms.exact) == 0 and _resists_alone(problem, terms, rows, free[:n]):
        damper = (S.T * terms.limit[rows] ** 2) @ S
        problem.H[:] = damper * (np.trace(problem.H) / np.trace(damper))
        return trim(problem, n, len(problem.mu), 0)
    problem.S[rows] = S
    with np.errstate(all="ignore"):  # steps as short as numbers can be
        yields = (S**2 / np.diagonal(problem.H)).sum(1)
    problem.R_s[rows] = np.nan_to_num(yields)
    problem.F[rows], problem.w_s[rows] = terms.limit[rows], 0.0
    return problem


def _resists_alone(problem: ContactProblem, terms: Terms, rows: Ints, free: Ints) -> bool:
    """Whether rows of one surface hold all that moves, and nothing else yields, resists or pulls."""
    alone = len(rows) == len(problem.F) and len(set(terms.surface[rows])) == 1
    grid = np.ix_(free, free)
    still = not (terms.stiffness[grid].any() or terms.damping[grid].any() or problem.c.any())
    carried = np.delete(terms.limited[rows], free, axis=1).any()
    holds = np.linalg.matrix_rank(terms.limited[rows][:, free]) == len(free)
    return bool(alone and still and not carried and holds and not problem.R.any())


@kernel
def leads(first: int, limited: int, terms: Terms) -> int:
    """How many rows the surface has whose first row is `first`; 0 for another row, or a row without
    surface."""
    if terms.surface[first] == APART:
        return 0
    count = 0
    for r in range(limited):
        if terms.surface[r] == terms.surface[first]:
            if r < first:
                return 0
            count += 1
    return count


@kernel
def _member(first: int, j: int, terms: Terms) -> int:
    """Row number j of the surface that begins with row `first`."""
    r = first
    for _ in range(j):
        r += 1
        while terms.surface[r] != terms.surface[first]:
            r += 1
    return r


@kernel
def _measure(
    contacts: int,
    limited: int,
    n: int,
    v: Reals,
    solved: bool,
    terms: Terms,
    state: State,
    scratch: Scratch,
) -> None:
    """Set powers of the rows at v (n_v,), and the forces t: from the solution if `solved`, else against v.

    A row that sticks in the solution has no power: what its velocity leaves is rounding, beside bodies that
    move however fast.
    """
    for first in range(limited):
        size, power = leads(first, limited, terms), 0.0
        for j in range(size):
            r = _member(first, j, terms)
            row = scratch.support[r]
            row.power = row.offset
            for i in range(n):
                row.power += terms.limited[r, state.free[i]] * v[state.free[i]]
            row.power *= terms.limit[r]
            if solved and scratch.support[first].piece == STUCK and scratch.mode[contacts + r] == STICK:
                row.power = 0.0
            power += row.power**2
            if solved:
                row.force = 0.0
                for m in range(size):
                    own = _member(first, m, terms)
                    unit = terms.limit[own if scratch.support[first].piece == STUCK else first]
                    row.force += _turned(first, m, j, terms, scratch) * scratch.limited_force[own] / unit
        for j in range(size):
            row = scratch.support[_member(first, j, terms)]
            if not solved:
                row.force = -row.power / math.sqrt(power) if power > 0.0 else 0.0


@kernel
def _turned(first: int, m: int, j: int, terms: Terms, scratch: Scratch) -> float:
    """Part of row j of the surface in direction m of the problem: Householder's reflection takes the first
    direction to the force."""
    same = 1.0 if m == j else 0.0
    if scratch.support[first].piece == STUCK:
        return same
    lead = math.copysign(1.0, scratch.support[first].along)
    a = scratch.support[_member(first, m, terms)].along + (lead if m == 0 else 0.0)
    b = scratch.support[_member(first, j, terms)].along + (lead if j == 0 else 0.0)
    return float(same - a * b / (1.0 + abs(scratch.support[first].along)))


@kernel
def _aim(limited: int, terms: Terms, scratch: Scratch) -> tuple[float, bool]:
    """Set the piece of the law that each surface asks for; returns the greatest distance from the law, and
    whether all laws are met, as far as rounding of speeds allows."""
    worst, met, rounding = 0.0, True, ROUNDED * _fastest(limited, terms, scratch)
    for first in range(limited):
        size = leads(first, limited, terms)
        if size == 0:
            continue
        lead, power = scratch.support[first], 0.0
        for j in range(size):
            power += scratch.support[_member(first, j, terms)].power ** 2
        power = math.sqrt(power)
        lead.scale = max(lead.scale, power)
        length, apart = 0.0, 0.0
        for j in range(size):
            row = scratch.support[_member(first, j, terms)]
            row.along = row.force - (row.power / lead.scale if lead.scale > 0.0 else 0.0)
            length += row.along * row.along
        length = math.sqrt(length)
        for j in range(size):
            row = scratch.support[_member(first, j, terms)]
            apart += (row.force - row.along / max(length, 1.0)) ** 2
            row.along /= length if length > 0.0 else 1.0
        worst = max(worst, math.sqrt(apart))
        allowed = EXACT
        if lead.scale > 0.0:
            allowed += min(rounding * terms.limit[first] / lead.scale, VAGUE)
        met &= math.sqrt(apart) <= allowed
        lead.piece = SLIPS if length > 1.0 - EXACT else STUCK
        lead.yields = lead.scale * max(length - 1.0, 0.0)
    return worst, met


@kernel
def _fastest(limited: int, terms: Terms, scratch: Scratch) -> float:
    """Speed of the fastest surface: its power over its limit."""
    fastest = 0.0
    for first in range(limited):
        size, power = leads(first, limited, terms), 0.0
        for j in range(size):
            power += scratch.support[_member(first, j, terms)].power ** 2
        if size > 0 and terms.limit[first] > 0.0:
            fastest = max(fastest, math.sqrt(power) / terms.limit[first])
    return fastest


@kernel
def _fill(
    contacts: int, limited: int, n: int, terms: Terms, state: State, scratch: Scratch, problem: ContactProblem
) -> None:
    """Fill the rows of the surfaces for their pieces; each direction in the unit of the first row's force."""
    p = problem
    for first in range(limited):
        size = leads(first, limited, terms)
        lead = scratch.support[first]
        for m in range(size):
            r = _member(first, m, terms)
            unit = terms.limit[r if lead.piece == STUCK else first]
            p.R_s[r] = p.w_s[r] = 0.0
            p.F[r] = unit
            scratch.limited_force[r], scratch.mode[contacts + r] = 0.0, STICK
            for i in range(n):
                p.S[r, i] = 0.0
            for j in range(size):
                own = _member(first, j, terms)
                part = _turned(first, m, j, terms, scratch) * terms.limit[own] / unit
                p.w_s[r] += part * scratch.support[own].offset
                for i in range(n):
                    p.S[r, i] += part * terms.limited[own, state.free[i]]
            if lead.piece == SLIPS and m > 0:
                p.R_s[r] = lead.yields / (unit * unit)
        if size > 0 and lead.piece == SLIPS:
            # The reflection takes the first direction to the opposite of a positive force.
            side = -math.copysign(1.0, lead.along)
            scratch.limited_force[first] = side * terms.limit[first]
            scratch.mode[contacts + first] = BACKWARD if side > 0.0 else FORWARD


@kernel
def _hand_over(contacts: int, limited: int, terms: Terms, scratch: Scratch) -> None:
    """Write forces, and whether they hold, into the rows of `terms`."""
    for first in range(limited):
        size, force = leads(first, limited, terms), 0.0
        for j in range(size):
            force += scratch.support[_member(first, j, terms)].force ** 2
        for j in range(size):
            r = _member(first, j, terms)
            scratch.limited_force[r] = scratch.support[r].force * terms.limit[r]
            scratch.mode[contacts + r] = STICK if math.sqrt(force) < 1.0 - EXACT else FORWARD

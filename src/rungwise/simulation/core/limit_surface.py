"""Dry friction of a body along several coordinates: one force in an ellipsoid, against the motion.

    t in argmin over |t| <= 1 of t . u,   t_i = tau_i / F_i,   u_i = F_i s_i  (power)

for the rows i of one limit surface, at most three. Algorithm: semismooth Newton on t = P(t - u / c), P the
projection on the unit ball. Each of its linear pieces is a step's problem with force-limited rows, which the
chain solves: while the body sticks, the rows as they are (a box, about the ball); while it slips, the row
along the force, limited, and across it rows that yield, u_across + rho t_across = 0. Where directions do not
settle, or a piece has no solution, surfaces that slip are damped for a few turns: the force along the motion
grows with its speed, about the speed of the solution before (the proximal point method in velocities). Later,
all rows yield by the power of the solution before (Weiszfeld's iteration, which descends; with a secant).
Newton goes on from there. Source: Goyal, Ruina, Papadopoulos, Wear 143 (1991) 307-330 (limit surface); Alart
and Curnier, Comput. Methods Appl. Mech. Eng. 92 (1991) 353-375; Rockafellar, SIAM J. Control Optim. 14 (1976)
877-898.
"""

from __future__ import annotations

import math

import numpy as np

from rungwise.contact.step import (
    BACKWARD,
    FORWARD,
    NO_SOLUTION,
    SOLVED,
    STICK,
    ContactProblem,
    Sizes,
    trim,
)
from rungwise.kernel import Ints, Reals, Record, kernel, rare_kernel
from rungwise.simulation.core.chains import solve_in_plane
from rungwise.simulation.core.state import Scratch, State
from rungwise.system.terms import APART, Terms

STUCK, SLIPS, DAMPED, YIELDS = 0, 1, 2, 3
"""Pieces of the law that a problem is made of."""
DIRECTIONS, TURNS, ROUNDS = 8, 4, 200
"""Problems after which directions count as not settled, of one iteration before the other has its turn (the
descending one has twice as many each time), and after which the law counts as not met."""
LOOSE = 1e3
"""Limit of a row that yields, over its own: far above what the law allows, and finite, so that the chain can
tell great forces from the forces of a singular mode."""
DAMPING = 0.3
"""Slope of a damped force over its speed, over the force per speed. Chosen by trial, to a decade."""
FAR = 10.0
"""Farthest that the secant goes, as a factor."""
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
        row.offset = problem.w_s[r]
        row.scale = row.tried = 0.0
    _measure(contacts, limited, n, state.v, False, terms, state, scratch)
    _aim(limited, False, False, terms, scratch)
    status, found, stage, damped = NO_SOLUTION, math.inf, 0, False
    unsettled, descends, until, spell = False, False, DIRECTIONS, TURNS
    for turn in range(ROUNDS):
        _fill(contacts, limited, n, terms, state, scratch, problem)
        status, found, stage = solve_in_plane(problem, sizes, terms, scratch)
        if status != SOLVED:
            if damped or not _damp(limited, terms, scratch):
                break
            damped = True
            continue
        damped = False
        for i in range(n):
            scratch.v_new[state.free[i]] = scratch.x[i]
        _measure(contacts, limited, n, scratch.v_new, True, terms, state, scratch)
        if turn == until:
            unsettled, descends = not unsettled, spell > TURNS
            until += spell if unsettled else TURNS
            spell *= 2 if unsettled else 1
        apart, met = _aim(limited, unsettled, descends, terms, scratch)
        if met:
            _hand_over(contacts, limited, terms, scratch)
            return SOLVED, max(found, apart), stage
    return NO_SOLUTION, found, stage


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
    if scratch.support[first].piece in (STUCK, YIELDS):
        return same
    lead = math.copysign(1.0, scratch.support[first].along)
    a = scratch.support[_member(first, m, terms)].along + (lead if m == 0 else 0.0)
    b = scratch.support[_member(first, j, terms)].along + (lead if j == 0 else 0.0)
    return float(same - a * b / (1.0 + abs(scratch.support[first].along)))


@kernel
def _aim(limited: int, unsettled: bool, descends: bool, terms: Terms, scratch: Scratch) -> tuple[float, bool]:
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
        slips, moves = length > 1.0 - EXACT, unsettled and power > EXACT * lead.scale
        if moves and descends:
            lead.yields = _ahead(lead, power) if lead.piece == YIELDS else power
            lead.piece = YIELDS
        elif moves and slips:
            lead.piece, lead.yields, lead.tried = DAMPED, power, 0.0
        else:
            lead.piece = SLIPS if slips else STUCK
            lead.yields, lead.tried = lead.scale * max(length - 1.0, 0.0), 0.0
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


@rare_kernel
def _ahead(lead: Record, power: float) -> float:
    """What rows should yield by after they yielded by `lead.yields` and gave `power`: where the two would be
    equal if the inverse of one were linear in the inverse of the other, as it is for a body alone; far ahead
    where this leads to rest."""
    ahead = power
    if lead.tried > 0.0 and lead.tried != lead.yields:
        slope = (1.0 / power - 1.0 / lead.met) / (1.0 / lead.yields - 1.0 / lead.tried)
        inverse = (1.0 / power - slope / lead.yields) / (1.0 - slope)
        rests = not (slope < 1.0 and inverse > 0.0)
        ahead = power / FAR if rests else min(max(1.0 / inverse, power / FAR), power * FAR)
    lead.tried, lead.met = lead.yields, power
    return ahead


@rare_kernel
def _damp(limited: int, terms: Terms, scratch: Scratch) -> bool:
    """Let the surfaces that slip be damped; returns whether anything slips."""
    slips = False
    for first in range(limited):
        size, lead, power = leads(first, limited, terms), scratch.support[first], 0.0
        for j in range(size):
            power += scratch.support[_member(first, j, terms)].power ** 2
        if size > 0 and lead.piece == SLIPS:
            slips = True
            lead.piece, lead.yields = (DAMPED, math.sqrt(power)) if power > 0.0 else (STUCK, 0.0)
    return slips


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
            p.F[r] = LOOSE * unit if lead.piece in (DAMPED, YIELDS) else unit
            scratch.limited_force[r], scratch.mode[contacts + r] = 0.0, STICK
            for i in range(n):
                p.S[r, i] = 0.0
            for j in range(size):
                own = _member(first, j, terms)
                part = _turned(first, m, j, terms, scratch) * terms.limit[own] / unit
                p.w_s[r] += part * scratch.support[own].offset
                for i in range(n):
                    p.S[r, i] += part * terms.limited[own, state.free[i]]
            if lead.piece != STUCK and (m > 0 or lead.piece != SLIPS):
                p.R_s[r] = lead.yields / (unit * unit)
        if size > 0 and lead.piece in (SLIPS, DAMPED):
            # The reflection takes the first direction to the opposite of a positive force.
            side, unit = -math.copysign(1.0, lead.along), terms.limit[first]
            scratch.limited_force[first] = side * unit
            if lead.piece == DAMPED:
                p.R_s[first] /= DAMPING
                p.w_s[first] += side * lead.yields * (1.0 - 1.0 / DAMPING) / unit
            else:
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

"""The proximal point method of `contact.step.proximal`, on a part: the same problems, and factors with few
entries in place of full ones.

Accepts: planar problems, H positive definite. Promises: nothing but the residual that it returns; it keeps
the given forces as far as they solve the problem.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from rungwise.contact import block_factors
from rungwise.contact.block_factors import Factors, add, substitute
from rungwise.contact.least_degree import Pattern
from rungwise.contact.solvers.plane.flips import flip
from rungwise.contact.solvers.plane.judge import exertion_of, moved, rates, residual_of
from rungwise.contact.solvers.plane.part import Part, sizes_of
from rungwise.contact.step.mode_newton import MAX_FLIPS
from rungwise.contact.step.problem import Unknowns
from rungwise.contact.step.proximal import (
    MAX_ROUNDS,
    MOST,
    STILL,
    WEDGED,
    Round,
    change_of_force,
    collect,
    fill_push,
    first_round,
    impose,
    is_final,
    next_round,
    return_to,
    stiffer,
)
from rungwise.kernel import Ints, Reals, allocating_kernel, kernel

TURNS, FEWER = 4, 3
"""Turns of solves, and by how many halvings fewer contacts may change their mode in each turn than in the one
before. Chosen by trial."""


class Yielding(NamedTuple):
    """The problem in which forces yield about their last values, of n velocities and r rows; as `Yielding` of
    `contact.step.proximal`, without its factors."""

    unit: Reals
    centre: Reals
    give: Reals
    push: Reals
    rate: Reals
    step: Reals


@allocating_kernel
def solve_part(part: Part, unknowns: Unknowns, enough: float, turns: int, halt: Ints) -> float:
    """Solve from `mode`, `force` and `tau`; returns the residual, inf when the modes did not settle in so
    many turns or halt (1,) is set."""
    n, contacts, limited = len(part.c), len(part.mu), len(part.F)
    sizes, v, rows = sizes_of(part), unknowns.v, 2 * contacts + limited
    soft = Yielding(
        np.empty(n), np.empty(rows), np.empty(rows), np.empty(2 * rows), np.empty(rows), np.empty(n)
    )
    for i in range(n):
        v[i] = 0.0
        soft.unit[i] = 1.0 / math.sqrt(part.diagonal[i])
    matrix = block_factors.plan(Pattern(part.H_first, part.H_column, part.first, part.column))
    symmetric = _is_symmetric(part)
    collect(sizes, unknowns, soft.centre)
    last = first_round()
    for _ in range(MAX_ROUNDS):
        if halt[0] != 0:
            break
        if not _settle(part, last, turns, symmetric, soft, matrix, unknowns):
            if last.rho >= MOST:
                break
            last = stiffer(last)
            return_to(sizes, soft.centre, unknowns)
            continue
        found = residual_of(part, unknowns)
        rests = change_of_force(sizes, unknowns, soft.centre) <= STILL
        if rests and exertion_of(part, unknowns) <= WEDGED and is_final(found, last, enough):
            return found
        last = next_round(last, found, sizes, unknowns, soft.centre)
    return math.inf


@kernel
def _settle(
    part: Part,
    now: Round,
    turns: int,
    symmetric: bool,
    soft: Yielding,
    matrix: Factors,
    unknowns: Unknowns,
) -> bool:
    """Newton's method on the modes about one centre; returns whether they settle. `symmetric`: H is."""
    sizes, groups, factored = sizes_of(part), len(part.first) - 1, now.factored
    for flips in range(turns * MAX_FLIPS):
        if not factored:
            impose(part.mu, part.F, sizes, unknowns)
            _give(part, now.rho, soft.give)
            fill_push(part.mu, part.R, part.R_s, sizes, unknowns.mode, soft.give, soft.push)
            if not _factorise(part, symmetric, soft, matrix):
                return False
        for _ in range(2):
            _correct(part, soft, matrix, unknowns)
        # Many flips at once may cycle.
        most = max(groups >> FEWER * (flips // MAX_FLIPS), 1)
        if not flip(part, unknowns, soft.give, soft.centre, most):
            return True
        factored = False
    return False


@kernel
def _give(part: Part, rho: float, give: Reals) -> None:
    """Fill in the yield of each row to its own force beside R: at least rho of the bodies' yield, or of the
    yield of another row's bodies where no body of its own yields."""
    contacts, most, rows = len(part.mu), 0.0, 2 * len(part.mu) + len(part.F)
    for r in range(rows):
        give[r] = moved(part, r // 2, r % 2) if r < 2 * contacts else moved(part, r - contacts, 0)
        most = max(most, give[r])
    for r in range(rows):
        own = part.R[r // 2, r % 2, r % 2] if r < 2 * contacts else part.R_s[r - 2 * contacts]
        bodies = give[r] if give[r] > 0.0 else (most if most > 0.0 else 1.0)
        give[r] = max(rho * bodies - own, 0.0)


@kernel
def _factorise(part: Part, symmetric: bool, soft: Yielding, matrix: Factors) -> bool:
    """Factors of H + W^T push W + S^T push S in these units; `symmetric`: H is."""
    contacts, unit, push, column = len(part.mu), soft.unit, soft.push, part.column
    block_factors.clear(matrix)
    for i in range(len(part.c)):
        for e in range(part.H_first[i], part.H_first[i + 1]):
            j = part.H_column[e]
            add(matrix, i, j, part.H_value[e] * unit[i] * unit[j])
    for g in range(len(part.first) - 1):
        r = g - contacts
        if push[4 * g if r < 0 else 4 * contacts + r] == 0.0:
            continue
        symmetric &= r >= 0 or push[4 * g + 1] == push[4 * g + 2]
        for e in range(part.first[g], part.first[g + 1]):
            i, a, b = column[e], part.normal[e], part.tangential[e]
            if r < 0:
                normal = (a * push[4 * g] + b * push[4 * g + 2]) * unit[i]
                tangential = (a * push[4 * g + 1] + b * push[4 * g + 3]) * unit[i]
            else:
                normal, tangential = a * push[4 * contacts + r] * unit[i], 0.0
            for f in range(part.first[g], part.first[g + 1]):
                value = normal * part.normal[f] + tangential * part.tangential[f]
                add(matrix, i, column[f], value * unit[column[f]])
    return block_factors.factorise(matrix, symmetric)


@kernel
def _is_symmetric(part: Part) -> bool:
    """Whether H is symmetric."""
    first, column, value = part.H_first, part.H_column, part.H_value
    for i in range(len(part.c)):
        for e in range(first[i], first[i + 1]):
            other = 0.0
            for f in range(first[column[e]], first[column[e] + 1]):
                other = value[f] if column[f] == i else other
            if other != value[e]:
                return False
    return True


@kernel
def _correct(part: Part, soft: Yielding, matrix: Factors, unknowns: Unknowns) -> None:
    """Take one Newton step of all equations of the modes, from the remainder of each."""
    n, contacts, limited = len(part.c), len(part.mu), len(part.F)
    _, v, force, tau = unknowns
    unit, centre, give, push, rate, step = soft
    for i in range(n):
        step[i] = part.c[i]
        for e in range(part.H_first[i], part.H_first[i + 1]):
            step[i] -= part.H_value[e] * v[part.H_column[e]]
    for k in range(contacts):
        at, r = 4 * k, 2 * k
        normal, tangential = rates(part, k, v)
        for d in range(2):
            x = part.w[r + d] + part.R[k, d, 0] * force[r] + part.R[k, d, 1] * force[r + 1]
            x += give[r + d] * (force[r + d] - centre[r + d])
            rate[r + d] = -(x + (normal if d == 0 else tangential))
        normal = force[r] + push[at] * rate[r] + push[at + 1] * rate[r + 1]
        tangential = force[r + 1] + push[at + 2] * rate[r] + push[at + 3] * rate[r + 1]
        for e in range(part.first[k], part.first[k + 1]):
            step[part.column[e]] += part.normal[e] * normal + part.tangential[e] * tangential
    for r in range(limited):
        at, g = 2 * contacts + r, contacts + r
        moving, _ = rates(part, g, v)
        rate[at] = -(part.w_s[r] + part.R_s[r] * tau[r] + give[at] * (tau[r] - centre[at]) + moving)
        x = tau[r] + push[4 * contacts + r] * rate[at]
        for e in range(part.first[g], part.first[g + 1]):
            step[part.column[e]] += part.normal[e] * x
    for i in range(n):
        step[i] *= unit[i]
    substitute(matrix, step)
    for i in range(n):
        step[i] *= unit[i]
        v[i] += step[i]
    for k in range(contacts):
        at, r = 4 * k, 2 * k
        normal, tangential = rates(part, k, step)
        normal, tangential = rate[r] - normal, rate[r + 1] - tangential
        force[r] += push[at] * normal + push[at + 1] * tangential
        force[r + 1] += push[at + 2] * normal + push[at + 3] * tangential
    for r in range(limited):
        moving, _ = rates(part, contacts + r, step)
        tau[r] += push[4 * contacts + r] * (rate[2 * contacts + r] - moving)

"""Proximal point method for redundant contacts: forces that may be shared in many ways start from a guess.

Algorithm: a sequence of problems in which each force yields a little about its last value, R + rho and
w - rho lambda, so that its contact modes have one answer each; every one is solved by Newton's method on the
modes, in velocities alone (W^T (R + rho)^-1 W + H is as large as there are coordinates, however many contacts
there are). rho falls while the modes settle and rises when they do not; the added yield vanishes at the end.
Sources: Rockafellar, SIAM J. Control Optim. 14 (1976) 877-898; Carpentier, Montaut, Le Lidec: From compliant
to rigid contact simulation, RSS 2024.
Accepts: planar problems (d = 2), H positive definite. Promises: nothing but the residual that it returns; it
keeps the given forces as far as they solve the problem.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from rungwise.contact.linear import factorise, substitute
from rungwise.contact.step.mode_newton import MAX_FLIPS, flip, sign
from rungwise.contact.step.modes import OPEN, STICK
from rungwise.contact.step.problem import ContactProblem, Elimination, Sizes, Unknowns
from rungwise.contact.step.step_residual import residual
from rungwise.kernel import Ints, Reals, copy, inner_kernel, kernel, rare_kernel

FIRST, MOST, LEAST = 1e-4, 1.0, 1e-12
"""Yield rho of a force, relative to the yield of the bodies and the contact: at first, at most, at least.
Chosen by trial, to a decade."""
MAX_ROUNDS = 40
"""Proximal problems, at most."""
TARGET = 1e-11
"""Residual, without unit (see `residual`), at which the rounds end. Chosen by trial, to a decade, between the
tolerance of steps and rounding."""
STILL = 1e-3
"""Forces that change by more from round to round, over the greatest force, may be growing without bound,
which hides any error. Chosen by trial, to a decade."""
WEDGED = 1e3
"""Forces may exceed the needs of loads and demanded rates by this factor, in wedges; more hides errors.
Chosen by trial, to a decade."""


class Round(NamedTuple):
    """A proximal problem: its yield rho; whether factors belong to it and to the modes; the residual of the
    one before, and whether rho was lowered since."""

    rho: float
    factored: bool
    before: float
    lowered: bool


@inner_kernel
def first_round() -> Round:
    return Round(FIRST, False, math.inf, False)


@inner_kernel
def stiffer(last: Round) -> Round:
    """The round after one whose modes did not settle."""
    return Round(min(100.0 * last.rho, MOST), False, last.before, last.lowered)


@inner_kernel
def next_round(last: Round, found: float, sizes: Sizes, unknowns: Unknowns, centre: Reals) -> Round:
    """The round after one of this residual: about other forces, and softer where they gained little."""
    collect(sizes, unknowns, centre)
    lowered = found > 0.1 * last.before
    return Round(max(0.01 * last.rho, LEAST) if lowered else last.rho, not lowered, found, lowered)


@inner_kernel
def is_final(found: float, last: Round, enough: float) -> bool:
    """Whether a residual ends the rounds: where a smaller rho does not help, the rest is rounding."""
    return bool(found <= TARGET or (found <= enough and last.lowered and found > 0.5 * last.before))


class Yielding(NamedTuple):
    """The problem in which forces yield about their last values, of n velocities and r rows.

    unit (n,): units of velocities in which H has a unit diagonal; centre (r,): the last forces; give (r,):
    the added yield of each row; push (2 r,): its force per approach; factors (n, n), order (n,): of the
    equations of the modes; rate (r,), step (n,): scratch.
    """

    unit: Reals
    centre: Reals
    give: Reals
    push: Reals
    factors: Reals
    order: Ints
    rate: Reals
    step: Reals


@kernel
def solve_proximal(
    problem: ContactProblem,
    sizes: Sizes,
    unknowns: Unknowns,
    room: Elimination,
    enough: float,
    halt: Ints,
) -> float:
    """Solve from `mode`, `force` and `tau`; returns the residual, inf when the modes did not settle, or
    halt (1,) is set."""
    n, contacts, limited = sizes
    v = unknowns.v
    rows = 2 * contacts + limited
    flat = room.matrix.reshape(room.matrix.size)
    at = n * n
    factors = flat[:at].reshape(n, n)
    vectors = flat[at : at + 3 * rows].reshape(3, rows)
    centre, give, rate = vectors[0], vectors[1], vectors[2]
    at += 3 * rows
    push, step = flat[at : at + 2 * rows], flat[at + 2 * rows : at + 2 * rows + n]
    at += 2 * rows + n
    unit = flat[at : at + n]
    soft = Yielding(unit, centre, give, push, factors, room.order, rate, step)
    for i in range(n):
        v[i] = 0.0
        unit[i] = 1.0 / math.sqrt(problem.H[i, i])
    collect(sizes, unknowns, centre)
    last = first_round()
    for _ in range(MAX_ROUNDS):
        if not _settle(problem, sizes, last, soft, unknowns, halt):
            if last.rho >= MOST or halt[0] != 0:
                break
            last = stiffer(last)
            return_to(sizes, centre, unknowns)
            continue
        found = residual(problem, sizes, unknowns)
        rests = change_of_force(sizes, unknowns, centre) <= STILL
        if rests and exertion(problem, sizes, unknowns) <= WEDGED and is_final(found, last, enough):
            return found
        last = next_round(last, found, sizes, unknowns, centre)
    return math.inf


@kernel
def _settle(
    problem: ContactProblem,
    sizes: Sizes,
    now: Round,
    soft: Yielding,
    unknowns: Unknowns,
    halt: Ints,
) -> bool:
    """Newton's method on the modes about one centre; returns whether they settle."""
    contacts, limited, factored = sizes.contacts, sizes.limited, now.factored
    for flips in range(2 * MAX_FLIPS):
        if halt[0] != 0:
            return False
        if not factored:
            impose(problem.mu, problem.F, sizes, unknowns)
            _give(problem, sizes, now.rho, soft.give)
            fill_push(problem.mu, problem.R, problem.R_s, sizes, unknowns.mode, soft.give, soft.push)
            if not _factorise(problem, sizes, soft):
                return False
        for _ in range(2):
            _correct(problem, sizes, soft, unknowns)
        # Many flips at once may cycle.
        most = contacts + limited if flips < MAX_FLIPS else 1
        if not flip(problem, sizes, unknowns, soft.give, soft.centre, most):
            return True
        factored = False
    return False


@kernel
def change_of_force(sizes: Sizes, unknowns: Unknowns, centre: Reals) -> float:
    """Greatest change of a force from its centre, relative to the greatest force."""
    contacts, limited = sizes.contacts, sizes.limited
    force, tau = unknowns.force, unknowns.tau
    moved, largest = 0.0, 0.0
    for r in range(2 * contacts + limited):
        now = force[r] if r < 2 * contacts else tau[r - 2 * contacts]
        moved, largest = max(moved, abs(now - centre[r])), max(largest, abs(now))
    return moved / largest if largest > 0.0 else 0.0


@kernel
def exertion(p: ContactProblem, sizes: Sizes, unknowns: Unknowns) -> float:
    """Greatest force over the greatest that loads, demanded rates and limits call for, each in units in which
    H has a unit diagonal. A rate calls for the force that moves the bodies so fast, or that deforms a
    yielding contact, if that is more; no rate counts for less than its rounding. Where hardly anything
    resists a body that others press, its units say little: then forces are compared as forces, if that is
    less."""
    n, contacts, limited = sizes
    force, tau = unknowns.force, unknowns.tau
    called, greatest = 0.0, 0.0
    for i in range(n):
        called = max(called, abs(p.c[i]) / math.sqrt(p.H[i, i]))
    for r in range(2 * contacts + limited):
        c = r - 2 * contacts
        bodies = 0.0
        for i in range(n):
            row = p.W[r, i] if c < 0 else p.S[c, i]
            bodies += row * row / p.H[i, i]
        if bodies > 0.0:
            unit = math.sqrt(bodies)
            greatest = max(greatest, abs(force[r] if c < 0 else tau[c]) * unit)
            own = p.R[r // 2, r % 2, r % 2] if c < 0 else p.R_s[c]
            least = min(own, bodies) if own > 0.0 else bodies
            rate = max(abs(p.w[r] if c < 0 else p.w_s[c]), p.quantum[0])
            called = max(called, rate * unit / least)
            if c >= 0 and math.isfinite(p.F[c]):
                called = max(called, p.F[c] * unit)
    excess = greatest / called if greatest > 0.0 else 0.0
    if excess > WEDGED:
        excess = min(excess, _excess_of_force(p, sizes, unknowns))
    return excess


@rare_kernel
def _excess_of_force(p: ContactProblem, sizes: Sizes, unknowns: Unknowns) -> float:
    """Greatest force over the greatest load or limit, as forces along the rows."""
    n, contacts, limited = sizes
    force, tau = unknowns.force, unknowns.tau
    called, greatest = 0.0, 0.0
    for i in range(n):
        lever = 0.0
        for r in range(2 * contacts):
            lever = max(lever, abs(p.W[r, i]))
        for r in range(limited):
            lever = max(lever, abs(p.S[r, i]))
        called = max(called, abs(p.c[i]) / lever if lever > 0.0 else 0.0)
    for r in range(2 * contacts):
        greatest = max(greatest, abs(force[r]))
    for r in range(limited):
        greatest = max(greatest, abs(tau[r]))
        called = max(called, p.F[r] if math.isfinite(p.F[r]) else 0.0)
    return greatest / called if called > 0.0 else math.inf


@kernel
def _give(p: ContactProblem, sizes: Sizes, rho: float, give: Reals) -> None:
    """Fill in the yield of each row to its own force beside R: at least rho of the bodies' yield, or of the
    yield of another row's bodies where no body of its own yields."""
    n, contacts, limited = sizes
    most = 0.0
    for r in range(2 * contacts + limited):
        c, bodies = r - 2 * contacts, 0.0
        for i in range(n):
            row = p.W[r, i] if c < 0 else p.S[c, i]
            bodies += row * row / p.H[i, i]
        give[r] = bodies
        most = max(most, bodies)
    for r in range(2 * contacts + limited):
        c = r - 2 * contacts
        own = p.R[r // 2, r % 2, r % 2] if c < 0 else p.R_s[c]
        bodies = give[r] if give[r] > 0.0 else (most if most > 0.0 else 1.0)
        give[r] = max(rho * bodies - own, 0.0)


@inner_kernel
def collect(sizes: Sizes, unknowns: Unknowns, centre: Reals) -> None:
    """Copy the forces, of contacts and then of limited rows, into `centre`."""
    rows = 2 * sizes.contacts
    copy(unknowns.force[:rows], centre[:rows])
    copy(unknowns.tau[: sizes.limited], centre[rows : rows + sizes.limited])


@inner_kernel
def spread(sizes: Sizes, centre: Reals, unknowns: Unknowns) -> None:
    """Copy `centre` back into the forces."""
    rows = 2 * sizes.contacts
    copy(centre[:rows], unknowns.force[:rows])
    copy(centre[rows : rows + sizes.limited], unknowns.tau[: sizes.limited])


@inner_kernel
def return_to(sizes: Sizes, centre: Reals, unknowns: Unknowns) -> None:
    """Begin again at rest with the forces of the centre."""
    for i in range(sizes.n):
        unknowns.v[i] = 0.0
    spread(sizes, centre, unknowns)


@inner_kernel
def impose(mu: Reals, limit: Reals, sizes: Sizes, unknowns: Unknowns) -> None:
    """Set the forces that follow from the modes."""
    contacts, limited = sizes.contacts, sizes.limited
    mode, force, tau = unknowns.mode, unknowns.force, unknowns.tau
    for k in range(contacts):
        if mode[k] == OPEN:
            force[2 * k] = force[2 * k + 1] = 0.0
        elif mode[k] != STICK or mu[k] == 0.0:
            force[2 * k + 1] = sign(mode[k]) * mu[k] * force[2 * k]
    for r in range(limited):
        if mode[contacts + r] != STICK:
            tau[r] = sign(mode[contacts + r]) * limit[r]


@inner_kernel
def fill_push(mu: Reals, R: Reals, R_s: Reals, sizes: Sizes, mode: Ints, give: Reals, push: Reals) -> None:
    """Fill in the force per approach of each row, given its mode: 2 x 2 for a contact, one for a limited
    row."""
    contacts, limited = sizes.contacts, sizes.limited
    for k in range(contacts):
        at = 4 * k
        a, d = R[k, 0, 0] + give[2 * k], R[k, 1, 1] + give[2 * k + 1]
        push[at] = push[at + 1] = push[at + 2] = push[at + 3] = 0.0
        if mode[k] == STICK and mu[k] > 0.0:
            b, c = R[k, 0, 1], R[k, 1, 0]
            inverse = 1.0 / (a * d - b * c)
            push[at], push[at + 1] = d * inverse, -b * inverse
            push[at + 2], push[at + 3] = -c * inverse, a * inverse
        elif mode[k] != OPEN:
            slope = sign(mode[k]) * mu[k]
            push[at] = 1.0 / (a + slope * R[k, 0, 1])
            push[at + 2] = slope * push[at]
    for r in range(limited):
        held = mode[contacts + r] == STICK
        push[4 * contacts + r] = 1.0 / (R_s[r] + give[2 * contacts + r]) if held else 0.0


@kernel
def _factorise(p: ContactProblem, sizes: Sizes, soft: Yielding) -> bool:
    """Factors of H + W^T push W + S^T push S in these units: pivots are chosen by size."""
    n, contacts, limited = sizes
    unit, push, factors = soft.unit, soft.push, soft.factors
    for i in range(n):
        for j in range(n):
            factors[i, j] = p.H[i, j]
    for k in range(contacts):
        at = 4 * k
        if push[at] == 0.0:
            continue
        for i in range(n):
            a, b = p.W[2 * k, i], p.W[2 * k + 1, i]
            if a == 0.0 and b == 0.0:
                continue
            normal = a * push[at] + b * push[at + 2]
            tangential = a * push[at + 1] + b * push[at + 3]
            for j in range(n):
                factors[i, j] += normal * p.W[2 * k, j] + tangential * p.W[2 * k + 1, j]
    for r in range(limited):
        if push[4 * contacts + r] == 0.0:
            continue
        for i in range(n):
            a = p.S[r, i] * push[4 * contacts + r]
            if a != 0.0:
                for j in range(n):
                    factors[i, j] += a * p.S[r, j]
    for i in range(n):
        for j in range(n):
            factors[i, j] *= unit[i] * unit[j]
    return factorise(factors, n, soft.order)


@kernel
def _correct(p: ContactProblem, sizes: Sizes, soft: Yielding, unknowns: Unknowns) -> None:
    """Take one Newton step of all equations of the modes, from the remainder of each."""
    n, contacts, limited = sizes
    _, v, force, tau = unknowns
    unit, centre, give, push, factors, order, rate, step = soft
    for i in range(n):
        step[i] = p.c[i]
        for j in range(n):
            step[i] -= p.H[i, j] * v[j]
    for k in range(contacts):
        for d in range(2):
            r = 2 * k + d
            x = p.w[r] + p.R[k, d, 0] * force[2 * k] + p.R[k, d, 1] * force[2 * k + 1]
            x += give[r] * (force[r] - centre[r])
            for i in range(n):
                x += p.W[r, i] * v[i]
            rate[r] = -x
        normal = push[4 * k] * rate[2 * k] + push[4 * k + 1] * rate[2 * k + 1]
        tangential = push[4 * k + 2] * rate[2 * k] + push[4 * k + 3] * rate[2 * k + 1]
        normal += force[2 * k]
        tangential += force[2 * k + 1]
        for i in range(n):
            step[i] += p.W[2 * k, i] * normal + p.W[2 * k + 1, i] * tangential
    for r in range(limited):
        at = 2 * contacts + r
        x = p.w_s[r] + p.R_s[r] * tau[r] + give[at] * (tau[r] - centre[at])
        for i in range(n):
            x += p.S[r, i] * v[i]
        rate[at] = -x
        x = tau[r] - push[4 * contacts + r] * x
        for i in range(n):
            step[i] += p.S[r, i] * x
    for i in range(n):
        step[i] *= unit[i]
    substitute(factors, n, order, step)
    for i in range(n):
        step[i] *= unit[i]
        v[i] += step[i]
    for k in range(contacts):
        normal, tangential = rate[2 * k], rate[2 * k + 1]
        for i in range(n):
            normal -= p.W[2 * k, i] * step[i]
            tangential -= p.W[2 * k + 1, i] * step[i]
        force[2 * k] += push[4 * k] * normal + push[4 * k + 1] * tangential
        force[2 * k + 1] += push[4 * k + 2] * normal + push[4 * k + 3] * tangential
    for r in range(limited):
        x = rate[2 * contacts + r]
        for i in range(n):
            x -= p.S[r, i] * step[i]
        tau[r] += push[4 * contacts + r] * x

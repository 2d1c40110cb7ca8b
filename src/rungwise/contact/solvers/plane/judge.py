"""How good an answer to a part is: its residual and its exertion, by the formulas, and in the order of terms,
of `contact.step.step_residual` and `contact.step.proximal`."""

from __future__ import annotations

import math

import numpy as np

from rungwise.contact.solvers.plane.part import Part
from rungwise.contact.step.problem import Unknowns
from rungwise.contact.step.proximal import WEDGED
from rungwise.contact.step.step_residual import FLOOR, REST, ROUNDING, imbalance, per, row_within, worse
from rungwise.kernel import Reals, allocating_kernel, inner_kernel, kernel, rare_kernel


@inner_kernel
def rates(part: Part, g: int, v: Reals) -> tuple[float, float]:
    """Rates of group g by velocities alone: normal and tangential, or of a limited row and zero."""
    normal, tangential = 0.0, 0.0
    for e in range(part.first[g], part.first[g + 1]):
        normal += part.normal[e] * v[part.column[e]]
        tangential += part.tangential[e] * v[part.column[e]]
    return normal, tangential


@allocating_kernel
def residual_of(part: Part, unknowns: Unknowns) -> float:
    """Largest scaled violation of the rows of a part, as `residual` has it to the last digit."""
    n, contacts, limited = len(part.c), len(part.mu), len(part.F)
    _, v, force, tau = unknowns
    velocity, largest = part.quantum, 0.0
    for k in range(contacts):
        velocity = max(velocity, abs(part.w[2 * k]), abs(part.w[2 * k + 1]))
        for e in range(part.first[k], part.first[k + 1]):
            speed = v[part.column[e]]
            velocity = max(velocity, abs(part.normal[e] * speed), abs(part.tangential[e] * speed))
        largest = max(largest, abs(force[2 * k]), abs(force[2 * k + 1]))
        for d in range(2):
            velocity = max(velocity, abs(_yielding(part, k, d, force)))
    for r in range(limited):
        velocity = max(velocity, abs(part.w_s[r]), abs(part.R_s[r] * tau[r]))
        for e in range(part.first[contacts + r], part.first[contacts + r + 1]):
            velocity = max(velocity, abs(part.normal[e] * v[part.column[e]]))
        largest = max(largest, abs(tau[r]))
    at_rest = velocity
    for g in range(contacts + limited):
        velocity = max(velocity, _rest(at_rest, part, g, largest))
    for g in range(contacts + limited):
        largest = _at_least(FLOOR * velocity, part, g, largest)
    room = np.zeros((3, n))
    worst = _balance(part, unknowns, largest, room[0], room[1], room[2])
    per_velocity, per_rate, per_force = per(velocity), per(at_rest), per(largest)
    for k in range(contacts):
        worst = worse(worst, _contact(part, k, unknowns, per_velocity, per_force))
    for r in range(limited):
        s = part.R_s[r] * tau[r] + part.w_s[r]
        for e in range(part.first[contacts + r], part.first[contacts + r + 1]):
            s += part.normal[e] * v[part.column[e]]
        worst = worse(worst, row_within(tau[r], s, part.F[r], per_velocity, per_rate, per_force))
    return worst


@inner_kernel
def _yielding(part: Part, k: int, d: int, force: Reals) -> float:
    """(R lambda) of contact k in direction d."""
    yielding: float = part.R[k, d, 0] * force[2 * k] + part.R[k, d, 1] * force[2 * k + 1]
    return yielding


@inner_kernel
def _at_least(speed: float, part: Part, g: int, force: float) -> float:
    """`force`, or roughly the force that changes the rate of group g by `speed`, if this is more."""
    yields = 0.0
    for e in range(part.first[g], part.first[g + 1]):
        own = part.diagonal[part.column[e]]
        for square in (part.normal[e] * part.normal[e], part.tangential[e] * part.tangential[e]):
            if square * force > speed * own:
                return force
            yields = max(yields, square / own)
    return max(force, speed / yields) if yields > 0.0 else force


@inner_kernel
def _rest(velocity: float, part: Part, g: int, force: float) -> float:
    """The speed to measure group g against when `velocity` is only rounding of the change that `force`
    causes; else 0."""
    speed = 0.0
    for e in range(part.first[g], part.first[g + 1]):
        own, push = part.diagonal[part.column[e]], part.normal[e] * part.normal[e] * force
        if velocity * own < ROUNDING * push:
            speed = max(speed, REST * push / own)
    return speed


@kernel
def _balance(
    part: Part, unknowns: Unknowns, largest: float, total: Reals, scale: Reals, lever: Reals
) -> float:
    """Largest violation of balance; the last three (n,) are scratch, the lever zero at first."""
    n, contacts, limited = len(part.c), len(part.mu), len(part.F)
    _, v, force, tau = unknowns
    for i in range(n):
        total[i], scale[i] = -part.c[i], abs(part.c[i])
        for e in range(part.H_first[i], part.H_first[i + 1]):
            term = part.H_value[e] * v[part.H_column[e]]
            total[i] += term
            scale[i] = max(scale[i], abs(term))
    for k in range(contacts):
        for e in range(part.first[k], part.first[k + 1]):
            i = part.column[e]
            lever[i] = max(lever[i], abs(part.normal[e]), abs(part.tangential[e]))
            total[i] -= part.normal[e] * force[2 * k]
            total[i] -= part.tangential[e] * force[2 * k + 1]
    for r in range(limited):
        for e in range(part.first[contacts + r], part.first[contacts + r + 1]):
            i = part.column[e]
            lever[i] = max(lever[i], abs(part.normal[e]))
            total[i] -= part.normal[e] * tau[r]
    return imbalance(n, total, scale, lever, largest)


@inner_kernel
def _contact(part: Part, k: int, unknowns: Unknowns, per_velocity: float, per_force: float) -> float:
    v, force = unknowns.v, unknowns.force
    normal, tangential = force[2 * k] * per_force, force[2 * k + 1] * per_force
    opening = part.w[2 * k] + _yielding(part, k, 0, force)
    slip = part.w[2 * k + 1] + _yielding(part, k, 1, force)
    for e in range(part.first[k], part.first[k + 1]):
        opening += part.normal[e] * v[part.column[e]]
        slip += part.tangential[e] * v[part.column[e]]
    opening *= per_velocity
    slip *= per_velocity
    worst = worse(0.0, abs(min(opening, normal)) + 0.0 * opening)
    length = math.sqrt((tangential - slip) ** 2)
    radius = part.mu[k] * max(normal, 0.0)
    shrink = 1.0 if length <= radius else radius / length
    return worse(worst, math.sqrt((tangential - shrink * (tangential - slip)) ** 2))


@kernel
def exertion_of(part: Part, unknowns: Unknowns) -> float:
    """Greatest force over the greatest that loads, demanded rates and limits call for, as `exertion` has
    it."""
    contacts = len(part.mu)
    force, tau = unknowns.force, unknowns.tau
    called, greatest = 0.0, 0.0
    for i in range(len(part.c)):
        called = max(called, abs(part.c[i]) / math.sqrt(part.diagonal[i]))
    for g in range(len(part.first) - 1):
        r = g - contacts
        for d in range(2 if r < 0 else 1):
            bodies = moved(part, g, d)
            if bodies > 0.0:
                unit = math.sqrt(bodies)
                greatest = max(greatest, abs(force[2 * g + d] if r < 0 else tau[r]) * unit)
                own = part.R[g, d, d] if r < 0 else part.R_s[r]
                least = min(own, bodies) if own > 0.0 else bodies
                rate = max(abs(part.w[2 * g + d] if r < 0 else part.w_s[r]), part.quantum)
                called = max(called, rate * unit / least)
                if r >= 0 and math.isfinite(part.F[r]):
                    called = max(called, part.F[r] * unit)
    excess = greatest / called if greatest > 0.0 else 0.0
    if excess > WEDGED:
        excess = min(excess, _excess_of_force(part, unknowns))
    return excess


@inner_kernel
def moved(part: Part, g: int, d: int) -> float:
    """W H^-1 W^T of direction d of a group, by the diagonal of H."""
    total = 0.0
    for e in range(part.first[g], part.first[g + 1]):
        row = part.normal[e] if d == 0 else part.tangential[e]
        total += row * row / part.diagonal[part.column[e]]
    return total


@rare_kernel
def _excess_of_force(part: Part, unknowns: Unknowns) -> float:
    """Greatest force over the greatest load or limit, as forces along the rows."""
    contacts, force, tau = len(part.mu), unknowns.force, unknowns.tau
    called, greatest = 0.0, 0.0
    for i in range(len(part.c)):
        lever = 0.0
        for e in range(len(part.column)):
            if part.column[e] == i:
                lever = max(lever, abs(part.normal[e]), abs(part.tangential[e]))
        called = max(called, abs(part.c[i]) / lever if lever > 0.0 else 0.0)
    for r in range(2 * contacts):
        greatest = max(greatest, abs(force[r]))
    for r in range(len(part.F)):
        greatest = max(greatest, abs(tau[r]))
        called = max(called, part.F[r] if math.isfinite(part.F[r]) else 0.0)
    return greatest / called if called > 0.0 else math.inf

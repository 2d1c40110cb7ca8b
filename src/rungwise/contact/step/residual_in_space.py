"""The residual of `residual`, for problems in space: many rows, each of which touches few coordinates.

Definitions are those of `residual`, which says why they are so; here the coordinates that a contact touches
are found once, and rates are computed once. Results agree up to the rounding of sums.
"""

from __future__ import annotations

import math

import numpy as np

from rungwise.contact.step.problem import ContactProblem, Sizes, Unknowns
from rungwise.contact.step.step_residual import FLOOR, REST, ROUNDING, imbalance, per, row_within, worse
from rungwise.contact.step.touched import Touched, touch
from rungwise.kernel import Ints, Reals, allocating_kernel, kernel


@allocating_kernel
def residual_in_space(problem: ContactProblem, sizes: Sizes, unknowns: Unknowns) -> float:
    """Largest scaled violation of the problem's rows in use by `unknowns`; inf when something is not
    finite."""
    nowhere = np.empty((0, 4), np.int64)
    return float(residual_where(problem, sizes, touch(problem, sizes, nowhere, nowhere), unknowns))


@allocating_kernel
def residual_where(problem: ContactProblem, sizes: Sizes, touched: Touched, unknowns: Unknowns) -> float:
    """The residual, where it is known which coordinates the rows touch."""
    n, contacts, limited = sizes
    force, tau = unknowns.force, unknowns.tau
    p, d, (first, coordinate, _, _) = problem, problem.R.shape[1], touched
    u, s = np.empty(contacts * d), np.empty(limited)
    velocity = _fill_rates(p, sizes, touched, unknowns, u, s)
    largest = 0.0
    for r in range(contacts * d):
        largest = max(largest, abs(force[r]))
    for r in range(limited):
        largest = max(largest, abs(tau[r]))
    at_rest = velocity
    for g in range(contacts + limited):
        rows, r = (p.W, g * d) if g < contacts else (p.S, g - contacts)
        velocity = max(velocity, _rest(at_rest, p, rows[r], coordinate[first[g] : first[g + 1]], largest))
    for g in range(contacts + limited):
        rows, r, count = (p.W, g * d, d) if g < contacts else (p.S, g - contacts, 1)
        own = coordinate[first[g] : first[g + 1]]
        largest = _at_least(FLOOR * velocity, p, rows[r : r + count], own, largest)
    found = np.empty((3, n))
    worst = _balance(p, sizes, touched, unknowns, largest, found)  # (1) balance
    per_velocity, per_rate, per_force = per(velocity), per(at_rest), per(largest)
    for k in range(contacts):
        at = k * d
        worst = worse(
            worst, _contact(p.mu[k], u[at : at + d], force[at : at + d], per_velocity, per_force)
        )  # (2), (3)
    for r in range(limited):
        worst = worse(worst, row_within(tau[r], s[r], p.F[r], per_velocity, per_rate, per_force))  # (4), (5)
    return worst


@kernel
def _fill_rates(
    p: ContactProblem, sizes: Sizes, touched: Touched, unknowns: Unknowns, u: Reals, s: Reals
) -> float:
    """Write (W v + R lambda + w) and (S v + R_s tau + w_s); returns the largest term, at least the problem's
    quantum."""
    contacts, limited = sizes.contacts, sizes.limited
    first, coordinate, _, _ = touched
    _, v, force, tau = unknowns
    d, greatest = p.R.shape[1], p.quantum[0]
    for k in range(contacts):
        for i in range(d):
            r, yielded = k * d + i, 0.0
            total = p.w[r]
            greatest = max(greatest, abs(total))
            for e in range(first[k], first[k + 1]):
                term = p.W[r, coordinate[e]] * v[coordinate[e]]
                greatest = max(greatest, abs(term))
                total += term
            for j in range(d):
                yielded += p.R[k, i, j] * force[k * d + j]
            greatest = max(greatest, abs(yielded))
            u[r] = total + yielded
    for r in range(limited):
        total, yielded = p.w_s[r], p.R_s[r] * tau[r]
        greatest = max(greatest, abs(total), abs(yielded))
        for e in range(first[contacts + r], first[contacts + r + 1]):
            term = p.S[r, coordinate[e]] * v[coordinate[e]]
            greatest = max(greatest, abs(term))
            total += term
        s[r] = total + yielded
    return greatest


@kernel
def _rest(velocity: float, p: ContactProblem, row: Reals, touched: Ints, force: float) -> float:
    speed = 0.0
    for j in touched:
        push = row[j] * row[j] * force
        if velocity * p.H[j, j] < ROUNDING * push:
            speed = max(speed, REST * push / p.H[j, j])
    return speed


@kernel
def _at_least(speed: float, p: ContactProblem, rows: Reals, touched: Ints, force: float) -> float:
    yields = 0.0
    for j in touched:
        for i in range(len(rows)):
            square = rows[i, j] * rows[i, j]
            if square * force > speed * p.H[j, j]:
                return force
            yields = max(yields, square / p.H[j, j])
    return max(force, speed / yields) if yields > 0.0 else force


@kernel
def _balance(
    p: ContactProblem, sizes: Sizes, touched: Touched, unknowns: Unknowns, largest: float, found: Reals
) -> float:
    """`found` (3, n) holds sums, their largest terms, and the largest entries of rows."""
    n, contacts, limited = sizes
    first, coordinate, begin, end = touched
    _, v, force, tau = unknowns
    total, scale, lever = found[0], found[1], found[2]
    d = p.R.shape[1]
    for i in range(n):
        left, most = -p.c[i], abs(p.c[i])
        for j in range(begin[i], end[i]):
            term = p.H[i, j] * v[j]
            left += term
            most = max(most, abs(term))
        total[i], scale[i], lever[i] = left, most, 0.0
    for k in range(contacts):
        for r in range(k * d, k * d + d):
            for e in range(first[k], first[k + 1]):
                j = coordinate[e]
                lever[j] = max(lever[j], abs(p.W[r, j]))
                total[j] -= p.W[r, j] * force[r]
    for r in range(limited):
        for e in range(first[contacts + r], first[contacts + r + 1]):
            j = coordinate[e]
            lever[j] = max(lever[j], abs(p.S[r, j]))
            total[j] -= p.S[r, j] * tau[r]
    return imbalance(n, total, scale, lever, largest)


@kernel
def _contact(mu: float, u: Reals, force: Reals, per_velocity: float, per_force: float) -> float:
    d, normal = len(u), force[0] * per_force
    worst, length = worse(0.0, abs(min(u[0] * per_velocity, normal)) + 0.0 * u[0]), 0.0  # (2) Signorini
    for i in range(1, d):
        length += (force[i] * per_force - u[i] * per_velocity) ** 2
    length = math.sqrt(length)  # (3) friction
    radius = mu * max(normal, 0.0)
    shrink = 1.0 if length <= radius else radius / length
    total = 0.0
    for i in range(1, d):
        x = force[i] * per_force
        total += (x - shrink * (x - u[i] * per_velocity)) ** 2
    return worse(worst, math.sqrt(total))

"""The residual of `solver.residual`, of a step's problem as it stands: for guesses of modes, whose few rows
take longer to sort into groups than to judge. A test compares the two."""

from __future__ import annotations

import math

from rungwise.contact.solver.residual import DEMANDED, FLOOR, REST, ROUNDING
from rungwise.contact.step.problem import ContactProblem, Sizes, Unknowns
from rungwise.kernel import Reals, inner_kernel, kernel


@kernel
def residual(problem: ContactProblem, sizes: Sizes, unknowns: Unknowns) -> float:
    """Largest scaled violation of the problem's rows in use by `unknowns`; inf when something is not
    finite."""
    n, contacts, limited = sizes
    _, v, force, tau = unknowns
    p, d = problem, problem.R.shape[1]
    velocity, largest, demanded = p.quantum[0], 0.0, 0.0
    for r in range(contacts * d):
        velocity = max(velocity, _magnitude(p.W, p.w, r, n, v))
        demanded = max(demanded, abs(p.w[r]))
        largest = max(largest, abs(force[r]))
    for k in range(contacts):
        for i in range(d):
            demanded = max(demanded, abs(_yielding(p, k, i, force)))
    for r in range(limited):
        if p.F[r] > 0.0:  # else no law restricts the rate
            velocity = max(velocity, _magnitude(p.S, p.w_s, r, n, v))
            demanded = max(demanded, abs(p.w_s[r]), abs(p.R_s[r] * tau[r]))
        largest = max(largest, abs(tau[r]))
    velocity = at_rest = max(velocity, demanded)
    rounded = p.quantum[0] == 0.0 or demanded <= DEMANDED * p.quantum[0]
    for k in range(contacts if rounded else 0):
        velocity = max(velocity, _rest(at_rest, p, p.W, k * d, n, largest))
    for r in range(limited if rounded else 0):
        velocity = max(velocity, _rest(at_rest, p, p.S, r, n, largest))
    for k in range(contacts):
        largest = _at_least(FLOOR * velocity, p, p.W, k * d, d, n, largest)
    for r in range(limited):
        largest = _at_least(FLOOR * velocity, p, p.S, r, 1, n, largest)
    worst = _balance(p, sizes, unknowns, largest)  # (1) balance
    per_velocity, per_rate, per_force = per(velocity), per(at_rest), per(largest)
    for k in range(contacts):
        worst = worse(worst, _contact(p, k, n, unknowns, per_velocity, per_force))  # (2), (3)
    for r in range(limited):
        s = p.R_s[r] * tau[r] + p.w_s[r]
        for i in range(n):
            s += p.S[r, i] * v[i]
        worst = worse(worst, row_within(tau[r], s, p.F[r], per_velocity, per_rate, per_force))  # (4), (5)
    return worst


@inner_kernel
def per(most: float) -> float:
    """One over the greatest term of a kind. Where all are zero, nothing is left to be measured."""
    return 1.0 / most if most > 0.0 else 0.0


@inner_kernel
def row_within(
    x: float, s: float, limit: float, per_velocity: float, per_rate: float, per_force: float
) -> float:
    """Violation of (4) a joint or (5) a drive, whose row has the force x, the rate s and the limit."""
    x, bound = x * per_force, limit * per_force if per_force > 0.0 else math.inf
    opens = s * (per_velocity if math.isfinite(bound) else per_rate)
    return abs(x - min(max(x - opens, -bound), bound)) + 0.0 * s


@kernel
def worse(a: float, b: float) -> float:
    """The larger of two violations; inf when b is not a number (max and min may drop it)."""
    if b <= a:
        return a
    return b if math.isfinite(b) else math.inf


@kernel
def _at_least(
    speed: float, p: ContactProblem, rows: Reals, r: int, count: int, n: int, force: float
) -> float:  # fmt: skip
    """`force`, or roughly the force that changes the rate of one of the rows from r on by `speed`, if this is
    more."""
    yields = 0.0
    for i in range(n):
        for k in range(r, r + count):
            # Most forces are larger by far: no division then.
            if rows[k, i] * rows[k, i] * force > speed * p.H[i, i]:
                return force
            yields = max(yields, rows[k, i] * rows[k, i] / p.H[i, i])
    return max(force, speed / yields) if yields > 0.0 else force


@kernel
def _rest(velocity: float, p: ContactProblem, rows: Reals, r: int, n: int, force: float) -> float:
    """The speed to measure row r against when `velocity` is only rounding of the change that `force` causes;
    else 0."""
    speed = 0.0
    for i in range(n):
        push = rows[r, i] * rows[r, i] * force
        if velocity * p.H[i, i] < ROUNDING * push:
            speed = max(speed, REST * push / p.H[i, i])
    return speed


@kernel
def _magnitude(rows: Reals, offset: Reals, r: int, n: int, v: Reals) -> float:
    total = float(abs(offset[r]))
    for i in range(n):
        total = max(total, abs(rows[r, i] * v[i]))
    return total


@kernel
def _yielding(p: ContactProblem, k: int, i: int, force: Reals) -> float:
    """(R lambda) of contact k in direction i."""
    d = p.R.shape[1]
    total = 0.0
    for j in range(d):
        total += p.R[k, i, j] * force[k * d + j]
    return total


@kernel
def _balance(p: ContactProblem, sizes: Sizes, unknowns: Unknowns, largest: float) -> float:
    n, contacts, limited = sizes
    _, v, force, tau = unknowns
    worst = 0.0
    for i in range(n):
        total, scale, lever = -p.c[i], abs(p.c[i]), 0.0
        for j in range(n):
            term = p.H[i, j] * v[j]
            total += term
            scale = max(scale, abs(term))
        for r in range(contacts * p.R.shape[1]):
            lever = max(lever, abs(p.W[r, i]))
            total -= p.W[r, i] * force[r]
        for r in range(limited):
            lever = max(lever, abs(p.S[r, i]))
            total -= p.S[r, i] * tau[r]
        worst = _unbalanced(worst, total, max(scale, lever * largest))
    return worst


@inner_kernel
def imbalance(n: int, total: Reals, scale: Reals, lever: Reals, largest: float) -> float:
    """The worst violation of n rows of balance: their sums, greatest terms, and greatest entries of rows."""
    worst = 0.0
    for i in range(n):
        worst = _unbalanced(worst, total[i], max(scale[i], lever[i] * largest))
    return worst


@inner_kernel
def _unbalanced(worst: float, total: float, scale: float) -> float:
    """The worst violation so far, or that of a row of balance, whose sum should be zero."""
    return worst if abs(total) <= worst * scale else worse(worst, abs(total) / scale)


@kernel
def _contact(
    p: ContactProblem, k: int, n: int, unknowns: Unknowns, per_velocity: float, per_force: float
) -> float:
    v, force = unknowns.v, unknowns.force
    d = p.R.shape[1]
    first = k * d
    normal = force[first] * per_force
    worst, length = 0.0, 0.0
    for i in range(d):
        u = p.w[first + i] + _yielding(p, k, i, force)
        for j in range(n):
            u += p.W[first + i, j] * v[j]
        u *= per_velocity
        if i == 0:
            worst = worse(0.0, abs(min(u, normal)) + 0.0 * u)  # (2) Signorini
        else:
            length += (force[first + i] * per_force - u) ** 2
    length = math.sqrt(length)  # (3) friction
    radius = p.mu[k] * max(normal, 0.0)
    shrink = 1.0 if length <= radius else radius / length
    total = 0.0
    for i in range(1, d):
        u = p.w[first + i] + _yielding(p, k, i, force)
        for j in range(n):
            u += p.W[first + i, j] * v[j]
        x = force[first + i] * per_force
        total += (x - shrink * (x - u * per_velocity)) ** 2
    return worse(worst, math.sqrt(total))

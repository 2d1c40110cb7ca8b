"""The one assembly: terms of a state and a rung -> the step's contact problem, line by line.

Numbers are those of the lines of `contact.step.problem`.

With theta = 1, for a step h from (q, v), unknown the end velocity (theta < 1: the velocity at theta):

    H = eps M / (theta h) + theta h K_p + K_d
    c = eps M v / (theta h) + load - (prescribed columns of H) v_p
    R = (theta h K + C)^-1
    w_n = (psi + (R (C - (1 - theta) h K) delta)_n) / h + W_p v_p
    w_t = -(R K delta)_t + W_p v_p

    rigid contact: R = 0, w_n = psi / h + W_p v_p (psi = 0 where it is rounding: contacts side by side agree;
    overlapping bodies come apart in no less than a pause, however short the step, or they would be thrown,
    and open joints close in no less than half a pause)
    restitution: w_n = e g + W_p v_p where g < -rest and psi + h g <= 0, unless overlap comes apart faster: on
    bodies that turn each step is an approach, and the overlap that it adds would stay
"""

from __future__ import annotations

import math
from typing import NamedTuple

from rungwise.contact.linear import invert
from rungwise.contact.step import ContactProblem, span, stretch
from rungwise.kernel import Ints, Reals, RecordArray, inner_kernel, kernel, rare_kernel
from rungwise.models.entries import Velocities, fill_entries, take_entries
from rungwise.system.entries import is_crowded, rate
from rungwise.system.terms import JOINT, Terms


class Step(NamedTuple):
    """A step of length h [time], whose equation holds at the part theta of it and has inertia times eps;
    overlap comes apart in no less than `ease` [time]: a pause, or never."""

    h: float
    theta: float
    eps: float
    ease: float


@kernel
def assemble(
    rung: RecordArray,
    step: Step,
    terms: Terms,
    contacts: int,
    limited: int,
    velocities: Velocities,
    bounce: bool,
    problem: ContactProblem,
) -> bool:
    """Fill `problem`.

    `bounce` says whether Newton's restitution applies; returns whether it does at any contact.
    """
    h, theta, eps, ease = step
    free, n, v, speed = velocities
    problem.quantum[0] = terms.rounding[0] / h
    crowded = is_crowded(terms.entries)
    if crowded:
        fill_entries(rung, h * theta, eps, terms, velocities, problem)
    elif rung[0].metric:
        _fill_metric(terms, free, n, problem)
    else:  # (1) balance
        _fill_balance(rung, h * theta, eps, terms, velocities, problem)
    bounced, driven = False, _is_driven(speed)
    d = terms.contact_stiffness.shape[1]
    for k in range(contacts):
        problem.mu[k] = terms.friction[k] if rung[0].friction else 0.0  # (3) friction
        if crowded:
            take_entries(k, d, terms, problem)
        else:
            _take_rows(terms.rows, k * d, k * d + d, free, n, problem.W)
        if rung[0].compliant and math.isfinite(terms.contact_stiffness[k, 0, 0]):
            _soften(k, d, h, theta, terms, problem)  # (2) Signorini, (3) friction
        else:
            problem.R[k, :, :] = 0.0
            problem.w[k * d : k * d + d] = 0.0
            # (2) Signorini
            g = approach(k * d, terms, v, speed, free, n, eps) if terms.restitution[k] > 0.0 else 0.0
            if terms.gap[k] > terms.rounding[0] or rung[0].metric:
                problem.w[k * d] = terms.gap[k] / h
            elif terms.gap[k] < -terms.rounding[0]:
                problem.w[k * d] = terms.gap[k] / max(h, ease)
            if bounce and g < 0.0 and terms.gap[k] + h * g <= 0.0:
                rebound = terms.restitution[k] * g
                if rebound < problem.w[k * d]:
                    problem.w[k * d] = rebound
                    bounced = True
        if driven:
            for r in range(k * d, k * d + d):
                problem.w[r] += rate(terms.entries, terms.rows, r, d, speed)
    for r in range(limited):
        stiff, damp = terms.gains[r, 0], terms.gains[r, 1]
        resist = theta * h * stiff + damp
        problem.R_s[r] = 1.0 / resist if resist > 0.0 else 0.0  # (5) drives
        problem.w_s[r] = -problem.R_s[r] * (stiff * terms.error[r, 0] + damp * terms.error[r, 1])
        if math.isinf(stiff):  # (4) joints
            drifts = terms.account[r] == JOINT and not rung[0].metric
            problem.w_s[r] = -terms.error[r, 0] / (max(h, 0.5 * ease) if drifts else h)
        if driven:
            problem.w_s[r] += carried(terms.limited, r, speed)
        problem.F[r] = terms.limit[r]
        _take_rows(terms.limited, r, r + 1, free, n, problem.S)
    return bounced


@inner_kernel
def _take_rows(source: Reals, first: int, last: int, free: Ints, n: int, target: Reals) -> None:
    """Copy the free coordinates of rows."""
    for r in range(first, last):
        if n == source.shape[1]:
            for i in range(n):
                target[r, i] = source[r, i]
        else:
            for i in range(n):
                target[r, i] = source[r, free[i]]


@kernel
def _is_driven(speed: Reals) -> bool:
    """Whether something moves at a speed that is prescribed."""
    driven = False
    for i in range(speed.shape[0]):
        driven |= speed[i] != 0.0
    return driven


@kernel
def _fill_metric(terms: Terms, free: Ints, n: int, problem: ContactProblem) -> None:
    """Fill in H and c on the kinematic rung: the slowest admissible motion in the unit-mass metric."""
    for i in range(n):
        problem.c[i] = 0.0
        for j in range(n):
            problem.H[i, j] = terms.metric[free[i], free[j]]


@kernel
def _fill_balance(
    rung: RecordArray, step: float, eps: float, terms: Terms, velocities: Velocities, problem: ContactProblem
) -> None:
    free, n, v, speed = velocities
    inertia, driven = eps / step, _is_driven(speed)
    momentum = inertia if rung[0].inertia > 0.0 else 0.0
    for i in range(n):
        a = free[i]
        problem.c[i] = terms.load[a] if rung[0].loads else 0.0
        for b in range(v.shape[0] if momentum > 0.0 else 0):
            problem.c[i] += momentum * terms.inertia[a, b] * v[b]
        for b in range(v.shape[0] if driven else 0):
            resist = inertia * terms.inertia[a, b] + step * terms.stiffness[a, b] + terms.damping[a, b]
            problem.c[i] -= resist * speed[b]
        if n == v.shape[0]:
            for b in range(n):
                problem.H[i, b] = (
                    inertia * terms.inertia[i, b] + step * terms.stiffness[i, b] + terms.damping[i, b]
                )
        else:
            for j in range(n):
                b = free[j]
                problem.H[i, j] = (
                    inertia * terms.inertia[a, b] + step * terms.stiffness[a, b] + terms.damping[a, b]
                )


@kernel
def lean(
    rung: RecordArray,
    h: float,
    eps: float,
    terms: Terms,
    contacts: int,
    free: Ints,
    n: int,
    wish: Reals,
    problem: ContactProblem,
) -> None:
    """Move the assembled step from rest to `wish` (n_v,): c += eps M wish / h, or metric wish (kinematic).

    Of the motions that order 0 admits the solution is then the one nearest to `wish`; where nothing resists
    (eps = 1) contact forces vanish in the limit, and friction has no say in which motion that is.
    """
    for i in range(n):
        low, high = stretch(terms.entries.matrices, free[i], len(wish))
        for j in range(n):
            a, b = free[i], free[j]
            if low <= b < high:
                own = terms.metric[a, b - low] if rung[0].metric else eps / h * terms.inertia[a, b - low]
                problem.c[i] += own * wish[b]
    if eps == 1.0:
        for k in range(contacts):
            problem.mu[k] = 0.0


@inner_kernel
def carried(rows: Reals, r: int, speed: Reals) -> float:
    """Part of a row's rate that prescribed coordinates carry; `speed` is zero on the free ones."""
    total = 0.0
    for j in range(speed.shape[0]):
        total += rows[r, j] * speed[j]
    return total


@inner_kernel
def approach(r: int, terms: Terms, v: Reals, speed: Reals, free: Ints, n: int, eps: float) -> float:
    """Rate of the gap at the start of the step, or 0 when it is no faster than loads cause in a pause, and no
    faster than in a fall from a height that counts as zero."""
    d = terms.contact_stiffness.shape[1]
    g = rate(terms.entries, terms.rows, r, d, speed)
    loaded = 0.0
    if is_crowded(terms.entries):
        g, loaded = _approach(r, d, g, terms, v, eps)
    else:
        for i in range(n):
            a = free[i]
            g += terms.rows[r, a] * v[a]
            if eps > 0.0:
                loaded += terms.rows[r, a] * terms.fall[a] / eps
    rest = abs(loaded) * terms.pause[0]
    if math.isfinite(terms.low[0]):
        rest = min(rest, math.sqrt(2.0 * abs(loaded) * terms.low[0]))
    return 0.0 if g >= -rest else g


@rare_kernel
def _approach(r: int, d: int, g: float, terms: Terms, v: Reals, eps: float) -> tuple[float, float]:
    """The rate `g` of row r with that of the free coordinates, and the rate per time that loads cause."""
    entries, loaded = terms.entries, 0.0
    place = entries.place
    for side in range(2):
        first, end, shift = span(entries.rows, r // d, side, len(v))
        for a in range(first, end):
            if place[a + 1] > place[a]:
                g += terms.rows[r, a - shift] * v[a]
                loaded += terms.rows[r, a - shift] * terms.fall[a] / eps if eps > 0.0 else 0.0
    return g, loaded


@kernel
def _soften(k: int, d: int, h: float, theta: float, terms: Terms, problem: ContactProblem) -> None:
    """Fill in R, and the contribution of the deformation at the start to w."""
    for i in range(d):
        for j in range(d):
            problem.R[k, i, j] = theta * h * terms.contact_stiffness[k, i, j] + terms.contact_damping[k, i, j]
    invert(problem.R[k], d)
    for i in range(d):
        kept, yielded = 0.0, 0.0
        for j in range(d):
            stiff, damp = 0.0, 0.0
            for m in range(d):
                x = terms.deformation[k * d + m]
                stiff += terms.contact_stiffness[k, j, m] * x
                damp += terms.contact_damping[k, j, m] * x
            kept += problem.R[k, i, j] * (damp - (1.0 - theta) * h * stiff)
            yielded += problem.R[k, i, j] * stiff
        problem.w[k * d + i] = (terms.gap[k] + kept) / h if i == 0 else -yielded


@kernel
def deform(
    h: float, theta: float, terms: Terms, k: int, force: Reals, problem: ContactProblem, after: Reals
) -> None:
    """Write the deformation of contact k after the step into `after` (d,).

    With force the deformation is R (h lambda + (C - (1 - theta) h K) delta).

    Without force the deformation relaxes fully implicitly, K delta' + C (delta' - delta) / h = 0: with theta
    = 1/2 and little damping it would otherwise change sign from step to step for ever.
    """
    d = after.shape[0]
    pushed = False
    for i in range(d):
        pushed |= force[k * d + i] != 0.0
    early = (1.0 - theta) * h if pushed else 0.0
    if not pushed and theta < 1.0:
        for i in range(d):
            for j in range(d):
                problem.R[k, i, j] = h * terms.contact_stiffness[k, i, j] + terms.contact_damping[k, i, j]
        invert(problem.R[k], d)
    for i in range(d):
        after[i] = 0.0
        for j in range(d):
            push = h * force[k * d + j]
            for m in range(d):
                keep = terms.contact_damping[k, j, m] - early * terms.contact_stiffness[k, j, m]
                push += keep * terms.deformation[k * d + m]
            after[i] += problem.R[k, i, j] * push

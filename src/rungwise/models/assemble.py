"""The one assembly: terms of a state and a rung -> the step's contact problem, line by line.

With theta = 1, for a step h from (q, v), unknown the end velocity (theta < 1: the velocity at theta):

    H = eps M / (theta h) + theta h K_p + K_d
    c = eps M v / (theta h) + load - (prescribed columns of H) v_p
    R = (theta h K + C)^-1
    w_n = (psi + (R (C - (1 - theta) h K) delta)_n) / h + W_p v_p
    w_t = -(R K delta)_t + W_p v_p

    rigid contact: R = 0, w_n = psi / h + W_p v_p (psi = 0 where it is rounding: contacts side by side agree;
    what overlaps comes apart in no less than a pause, however short the step, or it would be thrown, and what
    joints hold closes in no less than half a pause)
    restitution: w_n = e g + W_p v_p where g < -rest and psi + h g <= 0
"""

from __future__ import annotations

import math

from rungwise.contact.step.problem import ContactProblem
from rungwise.kernel import Ints, Reals, RecordArray, inner_kernel, kernel, rare_kernel
from rungwise.system.terms import INERTIA, JOINT, METRIC, Terms

LIMIT = 1e-8
"""How small the inertia of the limit eps -> 0+ is, relative to what else resists motion."""
FAINT = 1e-3
"""Damping that resists less than this part of the softest contact, as rates, leaves it to inertia which way
nothing else decides: so far below the stiffness it would be lost in the rounding of contact forces."""
STIR = 1e3
"""Motion in a step, over the rounding of positions, from which on something under load no longer rests."""
_SMALL = 1e-3
"""A load that is a smaller part of the greatest counts as this part, or inertia would be lost in the rounding
of what balances the greatest."""


@kernel
def assemble(
    rung: RecordArray,
    h: float,
    theta: float,
    eps: float,
    terms: Terms,
    contacts: int,
    limited: int,
    free: Ints,
    n: int,
    v: Reals,
    speed: Reals,
    bounce: bool,
    problem: ContactProblem,
) -> bool:
    """Fill `problem` for the `free` (n,) coordinates; the others move at `speed`, and the step starts from v.

    `bounce` says whether Newton's restitution applies; returns whether it does at any contact.
    """
    problem.quantum[0] = terms.rounding[0] / h
    if rung[0].metric:
        _fill_metric(terms, free, n, problem)
    else:
        _fill_balance(rung, h * theta, eps, terms, free, n, v, speed, problem)
    bounced = False
    d = terms.contact_stiffness.shape[1]
    for k in range(contacts):
        problem.mu[k] = terms.friction[k] if rung[0].friction else 0.0
        for r in range(k * d, k * d + d):
            for i in range(n):
                problem.W[r, i] = terms.rows[r, free[i]]
        if rung[0].compliant and math.isfinite(terms.contact_stiffness[k, 0, 0]):
            _soften(k, d, h, theta, terms, problem)
        else:
            problem.R[k, :, :] = 0.0
            problem.w[k * d : k * d + d] = 0.0
            g = approach(k * d, terms, v, speed, free, n, eps)
            if bounce and g < 0.0 and terms.restitution[k] > 0.0 and terms.gap[k] + h * g <= 0.0:
                problem.w[k * d] = terms.restitution[k] * g
                bounced = True
            elif terms.gap[k] > terms.rounding[0] or rung[0].metric:
                problem.w[k * d] = terms.gap[k] / h
            elif terms.gap[k] < -terms.rounding[0]:
                problem.w[k * d] = terms.gap[k] / max(h, terms.pause[0])
        for r in range(k * d, k * d + d):
            problem.w[r] += _carried(terms.rows, r, speed)
    for r in range(limited):
        stiff, damp = terms.gains[r, 0], terms.gains[r, 1]
        resist = theta * h * stiff + damp
        problem.R_s[r] = 1.0 / resist if resist > 0.0 else 0.0
        problem.w_s[r] = -problem.R_s[r] * (stiff * terms.error[r, 0] + damp * terms.error[r, 1])
        if math.isinf(stiff):
            drifts = terms.account[r] == JOINT and not rung[0].metric
            problem.w_s[r] = -terms.error[r, 0] / (max(h, 0.5 * terms.pause[0]) if drifts else h)
        problem.w_s[r] += _carried(terms.limited, r, speed)
        problem.F[r] = terms.limit[r]
        for i in range(n):
            problem.S[r, i] = terms.limited[r, free[i]]
    return bounced


@kernel
def _fill_metric(terms: Terms, free: Ints, n: int, problem: ContactProblem) -> None:
    """Kinematic rung: the slowest admissible motion in the unit-mass metric."""
    for i in range(n):
        problem.c[i] = 0.0
        for j in range(n):
            problem.H[i, j] = terms.metric[free[i], free[j]]


@kernel
def _fill_balance(
    rung: RecordArray,
    step: float,
    eps: float,
    terms: Terms,
    free: Ints,
    n: int,
    v: Reals,
    speed: Reals,
    problem: ContactProblem,
) -> None:
    inertia = eps / step
    momentum = inertia if rung[0].inertia > 0.0 else 0.0
    for i in range(n):
        a = free[i]
        problem.c[i] = terms.load[a] if rung[0].loads else 0.0
        for b in range(v.shape[0]):
            problem.c[i] += momentum * terms.inertia[a, b] * v[b]
            if speed[b] != 0.0:
                resist = inertia * terms.inertia[a, b] + step * terms.stiffness[a, b] + terms.damping[a, b]
                problem.c[i] -= resist * speed[b]
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
    (eps = 1) contact forces vanish in the limit, and friction has no say in which one that is.
    """
    for i in range(n):
        for j in range(n):
            a, b = free[i], free[j]
            own = terms.metric[a, b] if rung[0].metric else eps / h * terms.inertia[a, b]
            problem.c[i] += own * wish[b]
    if eps == 1.0:
        for k in range(contacts):
            problem.mu[k] = 0.0


@kernel
def _carried(rows: Reals, r: int, speed: Reals) -> float:
    """Part of a row's rate that prescribed coordinates carry; `speed` is zero on the free ones."""
    total = 0.0
    for j in range(speed.shape[0]):
        total += rows[r, j] * speed[j]
    return total


@inner_kernel
def approach(r: int, terms: Terms, v: Reals, speed: Reals, free: Ints, n: int, eps: float) -> float:
    """Rate of the gap at the start of the step, or 0 when it is no faster than loads cause in a pause, and no
    faster than in a fall from a height that counts as none."""
    g = _carried(terms.rows, r, speed)
    loaded = 0.0
    for i in range(n):
        a = free[i]
        g += terms.rows[r, a] * v[a]
        if eps > 0.0:
            loaded += terms.rows[r, a] * terms.fall[a] / eps
    rest = abs(loaded) * terms.pause[0]
    if math.isfinite(terms.low[0]):
        rest = min(rest, math.sqrt(2.0 * abs(loaded) * terms.low[0]))
    return 0.0 if g >= -rest else g


@kernel
def _soften(k: int, d: int, h: float, theta: float, terms: Terms, problem: ContactProblem) -> None:
    """R, and what the deformation at the start contributes to w."""
    for i in range(d):
        for j in range(d):
            problem.R[k, i, j] = theta * h * terms.contact_stiffness[k, i, j] + terms.contact_damping[k, i, j]
    _invert(problem.R[k], d)
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
def _invert(a: Reals, d: int) -> None:
    """Inverse of a positive definite matrix in place (Gauss-Jordan; no pivoting is needed)."""
    for k in range(d):
        pivot = 1.0 / a[k, k]
        a[k, k] = 1.0
        for j in range(d):
            a[k, j] *= pivot
        for i in range(d):
            if i != k:
                factor = a[i, k]
                a[i, k] = 0.0
                for j in range(d):
                    a[i, j] -= factor * a[k, j]


@kernel
def deform(
    h: float, theta: float, terms: Terms, k: int, force: Reals, problem: ContactProblem, after: Reals
) -> None:
    """Deformation of contact k after the step into `after` (d,).

    With force it is R (h lambda + (C - (1 - theta) h K) delta).

    Without force it relaxes fully implicitly, K delta' + C (delta' - delta) / h = 0: with theta = 1/2 and
    little damping it would otherwise change sign from step to step for ever.
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
        _invert(problem.R[k], d)
    for i in range(d):
        after[i] = 0.0
        for j in range(d):
            push = h * force[k * d + j]
            for m in range(d):
                keep = terms.contact_damping[k, j, m] - early * terms.contact_stiffness[k, j, m]
                push += keep * terms.deformation[k * d + m]
            after[i] += problem.R[k, i, j] * push


@kernel
def limit_inertia(
    rung: RecordArray,
    h: float,
    terms: Terms,
    contacts: int,
    limited: int,
    n: int,
    free: Ints,
    speed: Reals,
    landing: bool,
) -> float:
    """The eps of a rung: its own, or for the limit 0+ one far below every other resistance to motion.

    Each resistance is a rate at which it stops the heaviest body, which contacts may have it push: damping
    over inertia, a row's resistance times what the row yields to a force, a load over the momentum of the
    fastest motion demanded. Damping that is faint beside other damping or the loads does not count. With
    `landing` it does, and eps is so small that what closes any gap within the step still needs no force for
    it, nor what moves against the faintest damping. Without loads, damping, servos and compliance the limit
    does not depend on eps, and 1 is exact.
    """
    if rung[0].metric:
        return 0.0
    if rung[0].inertia > 0.0:
        return rung[0].inertia
    if n == 0:
        return 1.0
    heaviest = 0.0
    for i in range(n):
        a = free[i]
        heaviest = max(heaviest, terms.heft[a, INERTIA] / terms.heft[a, METRIC])
    least, fastest = math.inf, 0.0
    if limited > 0 or greatest_load(terms, n, free)[0] > 0.0:
        fastest = _demanded_pace(h, terms, contacts, limited, n, free, speed, landing)
        least = _load_rate(terms, n, free, fastest)
    damped, soft = math.inf, math.inf
    faint = 0.0
    if not landing:
        beside = _greatest_damping(h, heaviest, terms, n, free)
        faint = LIMIT * (max(beside, least) if least < math.inf else beside)
    for i in range(n):
        rate = _damping_rate(h, heaviest, terms, free[i])
        if rate > 0.0 and rate >= faint:
            damped = min(damped, rate)
    if rung[0].compliant:
        d = terms.contact_stiffness.shape[1]
        for r in range(contacts * d):
            k, j = r // d, r % d
            resist = h * terms.contact_stiffness[k, j, j] + terms.contact_damping[k, j, j]
            rate = resist * _mobility(terms.rows, r, terms, n, free) / heaviest
            if 0.0 < rate < math.inf:
                soft = min(soft, rate)
    if not landing and soft < math.inf:
        damped = max(damped, FAINT * soft)
    least = min(least, damped, soft)
    for r in range(limited):
        mobility = _mobility(terms.limited, r, terms, n, free) / heaviest
        rate = (h * terms.gains[r, 0] + terms.gains[r, 1]) * mobility
        if rate > 0.0:
            least = min(least, rate)
        pace = fastest * _reach(terms.limited, r, terms, n, free)
        if terms.limit[r] > 0.0 and pace > 0.0:
            least = min(least, terms.limit[r] * mobility / pace)
    return min(1.0, LIMIT * least * h)


@kernel
def resting_inertia(h: float, terms: Terms, n: int, free: Ints) -> float:
    """An eps for what rests under load: beside the loads inertia shows in motions beyond `STIR` roundings of
    positions a step, and in no others.

    Where damping is faint beside the loads, the rounding of contact forces would otherwise move what rests.
    """
    pace = STIR * terms.rounding[0] / h
    return min(1.0, LIMIT * _load_rate(terms, n, free, pace) * h)


@kernel
def stirs(h: float, terms: Terms, n: int, free: Ints, v: Reals) -> bool:
    """Whether something moves with `v` beyond `STIR` roundings of positions in the step."""
    moves = False
    for i in range(n):
        a = free[i]
        moves |= h * abs(v[a]) * math.sqrt(terms.heft[a, METRIC]) > STIR * terms.rounding[0]
    return moves


@kernel
def _load_rate(terms: Terms, n: int, free: Ints, pace: float) -> float:
    """The least load over the momentum of a coordinate at this pace; inf without loads or pace."""
    force, acceleration = greatest_load(terms, n, free)
    least = math.inf
    if force > 0.0 and pace > 0.0:
        for i in range(n):
            a = free[i]
            momentum = terms.heft[a, INERTIA] * pace / math.sqrt(terms.heft[a, METRIC])
            least = min(least, noticed_load(terms, a, force, acceleration, _SMALL) / momentum)
    return least


@kernel
def _damping_rate(h: float, heaviest: float, terms: Terms, a: int) -> float:
    """Rate at which a coordinate's own springs and dampers stop the heaviest body."""
    rate: float = (h * terms.stiffness[a, a] + terms.damping[a, a]) / (heaviest * terms.heft[a, METRIC])
    return rate


@rare_kernel
def _greatest_damping(h: float, heaviest: float, terms: Terms, n: int, free: Ints) -> float:
    greatest = 0.0
    for i in range(n):
        greatest = max(greatest, _damping_rate(h, heaviest, terms, free[i]))
    return greatest


@rare_kernel
def _demanded_pace(
    h: float, terms: Terms, contacts: int, limited: int, n: int, free: Ints, speed: Reals, landing: bool
) -> float:
    """Fastest motion, as a length per time, by which a free body alone would meet what one row demands."""
    fastest, d = 0.0, terms.contact_stiffness.shape[1]
    for r in range(contacts * d):
        demanded = abs(_carried(terms.rows, r, speed))
        if r % d == 0 and (landing or terms.gap[r // d] < -terms.rounding[0]):
            demanded = max(demanded, abs(terms.gap[r // d]) / h)
        fastest = max(fastest, demanded * _answer(terms.rows, r, terms, n, free))
    for r in range(limited):
        demanded = abs(_carried(terms.limited, r, speed))
        if math.isinf(terms.gains[r, 0]):
            demanded = max(demanded, abs(terms.error[r, 0]) / h)
        fastest = max(fastest, demanded * _answer(terms.limited, r, terms, n, free))
    return fastest


@kernel
def _mobility(rows: Reals, r: int, terms: Terms, n: int, free: Ints) -> float:
    """W M^-1 W^T of a row for bodies of mass 1, by the diagonal of M: what its force does to its own rate."""
    total = 0.0
    for i in range(n):
        a = free[i]
        total += rows[r, a] * rows[r, a] / terms.heft[a, METRIC]
    return total


@kernel
def _reach(rows: Reals, r: int, terms: Terms, n: int, free: Ints) -> float:
    """Rate of a row per speed of the bodies, at most; what turns moves by its radius of gyration."""
    total = 0.0
    for i in range(n):
        a = free[i]
        total += abs(rows[r, a]) / math.sqrt(terms.heft[a, METRIC])
    return total


@kernel
def _answer(rows: Reals, r: int, terms: Terms, n: int, free: Ints) -> float:
    """Greatest speed of a body per rate of a row, in the slowest motion that has this rate."""
    greatest, mobility = 0.0, _mobility(rows, r, terms, n, free)
    for i in range(n):
        a = free[i]
        greatest = max(greatest, abs(rows[r, a]) / math.sqrt(terms.heft[a, METRIC]))
    return greatest / mobility if mobility > 0.0 else 0.0


@kernel
def greatest_load(terms: Terms, n: int, free: Ints) -> tuple[float, float]:
    """The greatest load as a force, and as an acceleration; what turns counts by its radius of gyration."""
    force, acceleration = 0.0, 0.0
    for i in range(n):
        a = free[i]
        own = abs(terms.load[a]) / math.sqrt(terms.heft[a, METRIC])
        force = max(force, own)
        acceleration = max(acceleration, own * terms.heft[a, METRIC] / terms.heft[a, INERTIA])
    return force, acceleration


@kernel
def noticed_load(terms: Terms, a: int, force: float, acceleration: float, least: float) -> float:
    """Load beside which what inertia is left of coordinate a must be small.

    It is the coordinate's own, but no less than a part `least` of the greatest; where it has none it is the
    greatest, as a force or as an acceleration, whichever is less here.
    """
    unit = math.sqrt(terms.heft[a, METRIC])
    greatest = unit * min(force, terms.heft[a, INERTIA] / terms.heft[a, METRIC] * acceleration)
    own = abs(terms.load[a])
    return max(own, least * greatest) if own > 0.0 else greatest

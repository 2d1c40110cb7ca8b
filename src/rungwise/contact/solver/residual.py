"""Residual of a candidate solution, from the problem alone: no solver has a say in it.

Each equation is measured against the largest term of its kind, so that the residual is free of units, also
where coordinates of different units meet: each balance row against its own terms and the largest term that
the greatest contact force L could have in it, velocities against U, the largest velocity term of the
contact rows but no less than the problem's quantum, forces against L. Signorini is the natural map min(u_n
/ U, lambda_n / L); friction is lambda_t / L less its projection, after a step -u_t / U, on the disc of
radius mu lambda_n / L (exact cone). L is at least `FLOOR` of the force that would change a contact's speed
by U along the direction that yields most, so that forces of rounding size count as none (a normal that
meets the axis of a hinge yields by rounding alone); and where U is only rounding beside the change of
speed that L causes, and no rate is demanded, by an offset or by what yields, it is `REST` of that change,
so that things may rest. Joints hold exactly: their rates are measured against U as it was.
"""

from __future__ import annotations

import math

from rungwise.contact.kinds import (
    cone,
    forces_of,
    free,
    interval,
    nothing,
    restricts_rates,
    violation,
    worse,
)
from rungwise.contact.solver.groups import Groups
from rungwise.contact.solver.settings import WEDGED
from rungwise.contact.step.problem import ContactProblem, Sizes, Unknowns
from rungwise.kernel import Reals, inner_kernel, kernel, rare_kernel

FLOOR = 1e-6
"""Least L, over the force that would change a contact's speed by U. Chosen by trial, to a decade."""
ROUNDING, REST = 1e-14, 1e-3
"""U over the change of speed that L causes: U is rounding below the first, about a hundred roundings, and is
then raised to the second. Both chosen by trial, to a decade."""
DEMANDED = 1e3
"""Rate over the problem's quantum from which on it is a demand, not rounding, which nothing excuses.
Chosen by trial, to a decade."""
GROWN = 1e3
"""Forces over what the problem calls for that excuse no more than such forces would: growing without bound
they would hide any error. Chosen by trial, to a decade."""


@kernel
def residual(
    g: Groups, v: Reals, x: Reals, y: Reals, G: Reals, lever: Reals, a: Reals, b: Reals, scale: Reals
) -> float:
    """Largest scaled violation of the balance and the laws by velocities v (n,) and forces x (rows,), in the
    units of the groups; inf when something is not finite. y (rows,) are then the rates and G (n,) what the
    balance lacks; scale (2,) the force and rate that others are measured against, lever (n,) the greatest
    entries of rows; a and b (d,) are scratch."""
    n, forces, rates, demanded = len(v), 0.0, g.noise[0], 0.0
    for i in range(n):
        total = -g.c[i]
        for e in range(g.H_first[i], g.H_first[i + 1]):
            total += g.H[e] * v[g.H_column[e]]
        G[i], lever[i] = total, 0.0
    for k in range(len(g.kind)):
        first, end, at, low, high = g.row[k], g.row[k + 1], g.entry[k], g.first[k], g.first[k + 1]
        asked = 1.0 if restricts_rates(g.kind[k], g.law[k]) else 0.0
        for r in range(first, end):
            own, total, greatest, yielded = x[r], g.w[r], abs(g.w[r]), 0.0
            for e in range(low, high):
                i, part = g.column[e], g.C[at]
                term = g.W[at] * v[i]
                total += term
                greatest = max(greatest, abs(term))
                G[i] -= part * own
                lever[i] = max(lever[i], abs(part) / g.force[r])
                at += 1
            for q in range(first, end):
                yielded += g.R[k, r - first, q - first] * x[q]
            y[r] = total + yielded
            forces = max(forces, abs(own) * g.force[r])
            rates = max(rates, asked * max(greatest, abs(yielded)) * g.rate[r])
            demanded = max(demanded, asked * max(abs(g.w[r]), abs(yielded)) * g.rate[r])
    at_rest = rates
    if _is_noise(demanded, g.noise[0]):
        most = GROWN * called(g)
        for k in range(len(g.kind)):
            rates = max(rates, _rest(g, k, at_rest, min(forces, most * g.force[g.row[k]])))
    for k in range(len(g.kind)):
        forces = _at_least(g, k, FLOOR * rates, forces)
    worst = 0.0
    for i in range(n):
        most = max(abs(g.c[i]), lever[i] * forces)
        for e in range(g.H_first[i], g.H_first[i + 1]):
            most = max(most, abs(g.H[e] * v[g.H_column[e]]))
        worst = _unbalanced(worst, G[i], most)
    if not worst < math.inf:
        return math.inf
    scale[0], scale[1] = forces, rates
    per_rate, per_rest, per_force = _per(rates, 0.0), _per(at_rest, 0.0), _per(forces, 1.0)
    for k in range(len(g.kind)):
        first, d = g.row[k], g.row[k + 1] - g.row[k]
        per = per_rest if g.kind[k] == free.KIND else per_rate
        for i in range(d):
            a[i], b[i] = x[first + i] * g.force[first] * per_force, y[first + i] * g.rate[first] * per
        worst = max(worst, violation(g.kind[k], g.law[k], g.numbers, g.force[first] * per_force, d, a, b))
    return worst


@kernel
def called(g: Groups) -> float:
    """The greatest force that loads, demanded rates and limits call for, in the units of the groups. A rate
    calls for the force that moves the bodies so fast, or that deforms what yields, if that is more."""
    greatest = 0.0
    for i in range(len(g.c)):
        greatest = max(greatest, abs(g.c[i]))
    for k in range(len(g.kind)):
        first = g.row[k]
        for r in range(first, g.row[k + 1] if restricts_rates(g.kind[k], g.law[k]) else first):
            own = g.R[k, r - first, r - first]
            rate = max(abs(g.w[r]), g.noise[0] / g.rate[r])
            greatest = max(greatest, rate / min(own, 1.0) if own > 0.0 else rate)
        if forces_of(g.kind[k]) > 0:
            greatest = max(greatest, abs(g.law[k, 0]))
    return greatest


@kernel
def _rest(g: Groups, k: int, rates: float, forces: float) -> float:
    """The rate to measure a group against when `rates` is only rounding of the change that `forces` cause in
    its first row; else 0."""
    speed, at, first = 0.0, g.entry[k], g.row[k]
    per = g.rate[first] / g.force[first]
    for e in range(g.first[k], g.first[k + 1]):
        speed = max(speed, _rest_by(g.C[at] * g.W[at] / g.diagonal[g.column[e]] * per * forces, rates))
        at += 1
    return speed


@kernel
def _at_least(g: Groups, k: int, rate: float, forces: float) -> float:
    """`forces`, or roughly the force that changes the rate of one of the group's rows by `rate`, if this is
    more."""
    yields, at = 0.0, g.entry[k]
    for r in range(g.row[k], g.row[k + 1]):
        per = g.rate[r] / g.force[r]
        for e in range(g.first[k], g.first[k + 1]):
            own = g.C[at] * g.W[at] / g.diagonal[g.column[e]] * per
            if own * forces > rate:  # most forces are larger by far: no division then
                return forces
            yields = max(yields, own)
            at += 1
    return max(forces, rate / yields) if yields > 0.0 else forces


@inner_kernel
def _is_noise(demanded: float, noise: float) -> bool:
    """Whether demanded rates are none beside what rounds, so that things may rest."""
    return noise == 0.0 or demanded <= DEMANDED * noise


@inner_kernel
def _rest_by(push: float, rates: float) -> float:
    """The rate at rest beside the change `push` that forces cause, if `rates` are its rounding; else 0."""
    return REST * push if rates < ROUNDING * push else 0.0


@inner_kernel
def _per(most: float, nothing: float) -> float:
    """One over the greatest term of a kind; where all are zero, nothing is left to be measured."""
    return 1.0 / most if most > 0.0 else nothing


@inner_kernel
def _unbalanced(worst: float, lacks: float, most: float) -> float:
    """The worst violation so far, or that of a row of balance whose greatest term is `most`; inf if it is
    not a number."""
    if abs(lacks) <= worst * most:
        return worst
    part = abs(lacks) / most if most > 0.0 else math.inf
    return part if part < math.inf else math.inf


@kernel
def residual_of_rows(p: ContactProblem, sizes: Sizes, unknowns: Unknowns, scratch: Reals) -> float:
    """The same of a step's problem as it stands, as a whole, contacts with Coulomb's cone and limited rows:
    for guesses of modes, whose few rows take longer to sort into groups than to judge. inf also where forces
    exceed by far what the problem calls for. scratch (3, rows and some) then has the rates in its first row,
    and in the second by how much a row's own force, one, changes its rate."""
    n, contacts, limited = sizes
    _, v, force, tau = unknowns
    d, y, own = p.R.shape[1], scratch[0], scratch[1]
    rows, forces, rates, demanded = contacts * d, 0.0, p.quantum[0], 0.0
    exerted, needed = 0.0, 0.0
    for i in range(n):
        needed = max(needed, abs(p.c[i]) / math.sqrt(p.H[i, i]))
    for r in range(rows + limited):
        k, m = r // d, r - rows
        if r < rows:
            x, w, give, limit, yielded = force[r], p.w[r], p.R[k, r - k * d, r - k * d], math.inf, 0.0
            for j in range(d):
                yielded += p.R[k, r - k * d, j] * force[k * d + j]
            total, greatest, own[r] = _rate(p.W, r, w, p.H, n, v)
        else:
            x, w, give, limit, yielded = tau[m], p.w_s[m], p.R_s[m], p.F[m], p.R_s[m] * tau[m]
            total, greatest, own[r] = _rate(p.S, m, w, p.H, n, v)
        y[r], forces = total + yielded, max(forces, abs(x))
        if limit > 0.0:  # else no law restricts the rate
            rates = max(rates, greatest, abs(yielded))
            demanded = max(demanded, abs(w), abs(yielded))
        if own[r] > 0.0:
            unit = math.sqrt(own[r])
            exerted = max(exerted, abs(x) * unit)
            least = min(give, own[r]) if give > 0.0 else own[r]
            needed = max(needed, max(abs(w), p.quantum[0]) * unit / least)
            needed = max(needed, limit * unit) if limit < math.inf else needed
    if exerted > WEDGED * needed and forces > WEDGED * _load_of_rows(p, sizes):
        return math.inf
    at_rest = rates
    if _is_noise(demanded, p.quantum[0]):
        for r in range(rows + limited):
            if own[r] > 0.0 and (r >= rows or r % d == 0):
                push = min(forces * own[r], GROWN * needed * math.sqrt(own[r]))
                rates = max(rates, _rest_by(push, at_rest))
    for k in range(contacts + limited):
        first, end = (k * d, k * d + d) if k < contacts else (rows + k - contacts, rows + k - contacts + 1)
        most = 0.0
        for r in range(first, end):
            most = max(most, own[r])
        if most * forces < FLOOR * rates and most > 0.0:
            forces = FLOOR * rates / most
    worst = 0.0
    for i in range(n):
        total, most, lever = -p.c[i], abs(p.c[i]), 0.0
        for j in range(n):
            term = p.H[i, j] * v[j]
            total += term
            most = max(most, abs(term))
        for r in range(rows):
            lever = max(lever, abs(p.W[r, i]))
            total -= p.W[r, i] * force[r]
        for r in range(limited):
            lever = max(lever, abs(p.S[r, i]))
            total -= p.S[r, i] * tau[r]
        worst = _unbalanced(worst, total, max(most, lever * forces))
    per_rate, per_rest, per_force = _per(rates, 0.0), _per(at_rest, 0.0), _per(forces, 1.0)
    law, a, b = scratch[2, :2], scratch[2, 2 : 2 + d], scratch[2, 2 + d : 2 + 2 * d]
    for k in range(contacts):
        law[0] = p.mu[k]
        for i in range(d):
            a[i], b[i] = force[k * d + i] * per_force, y[k * d + i] * per_rate
        worst = worse(worst, cone.violation(law, per_force, d, a, b) + nothing(d, a, b))
    for m in range(limited):
        law[0], law[1], a[0], is_free = -p.F[m], p.F[m], tau[m] * per_force, math.isinf(p.F[m])
        b[0] = y[rows + m] * (per_rest if is_free else per_rate)
        if is_free:
            found = free.violation(law, per_force, 1, a, b)
        else:
            found = interval.violation(law, per_force, 1, a, b)
        worst = worse(worst, found + nothing(1, a, b))
    return worst


@inner_kernel
def _rate(rows: Reals, r: int, w: float, H: Reals, n: int, v: Reals) -> tuple[float, float, float]:
    """Rate of row r without what yields, its greatest term, and by how much a force of one changes it,
    roughly."""
    total, greatest, own = w, abs(w), 0.0
    for i in range(n):
        term = rows[r, i] * v[i]
        total += term
        greatest = max(greatest, abs(term))
        own = max(own, rows[r, i] * rows[r, i] / H[i, i])
    return total, greatest, own


@rare_kernel
def _load_of_rows(p: ContactProblem, sizes: Sizes) -> float:
    """Greatest force that a load or a limit calls for, as a force along the rows."""
    n, contacts, limited = sizes
    load = 0.0
    for i in range(n):
        lever = 0.0
        for r in range(contacts * p.R.shape[1]):
            lever = max(lever, abs(p.W[r, i]))
        for r in range(limited):
            lever = max(lever, abs(p.S[r, i]))
        load = max(load, abs(p.c[i]) / lever if lever > 0.0 else 0.0)
    for r in range(limited):
        load = max(load, p.F[r] if p.F[r] < math.inf else 0.0)
    return load

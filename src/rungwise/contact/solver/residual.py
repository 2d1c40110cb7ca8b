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

from rungwise.contact.solver.groups import Groups
from rungwise.contact.solver.kinds import forces_of, free, restricts_rates, violation
from rungwise.kernel import Reals, kernel

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
    if g.noise[0] == 0.0 or demanded <= DEMANDED * g.noise[0]:
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
        if not abs(G[i]) <= worst * most:
            worst = abs(G[i]) / most
            if not worst < math.inf:
                return math.inf
    scale[0], scale[1] = forces, rates
    per_rate = 1.0 / rates if rates > 0.0 else 0.0
    per_rest = 1.0 / at_rest if at_rest > 0.0 else 0.0
    per_force = 1.0 / forces if forces > 0.0 else 1.0
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
        push = g.C[at] * g.W[at] / g.diagonal[g.column[e]] * per * forces
        if rates < ROUNDING * push:
            speed = max(speed, REST * push)
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

"""Forces to start from where bodies may rest: those of the associated law of friction.

There a contact opens at mu times its slip, or more: rates and forces are in dual cones, and the problem is
convex. Its velocities are unique, and zero wherever forces in the cones balance the loads at rest; then
Coulomb's law holds, too, which may also let the bodies fall (strong and weak stability: Pang and Trinkle,
ZAMM 80 (2000) 643-663). Where things slide, the opening is taken back: w_n + mu |s| in place of w_n, with the
slip s of the answer before, again and again. At a fixed point Coulomb's law holds. Source: Acary, Cadoux,
Lemarechal, Malick, ZAMM 91 (2011) 155-175.
Accepts: H positive definite. Promises: nothing but that bodies for which rest is admissible rest if all do.
"""

from __future__ import annotations

import math

import numpy as np

from rungwise.contact.kinds.associated import KIND as ASSOCIATED
from rungwise.contact.solver.step import solve_groups
from rungwise.contact.step.problem import ContactProblem, Sizes, Surfaces, Unknowns
from rungwise.contact.step.spans import diagonal, span
from rungwise.contact.step.status import SOLVED
from rungwise.kernel import Ints, allocating_kernel, kernel

ROUNDS = 20
"""Most convex problems."""
SETTLED = 1e-9
"""Change of slips, over the greatest, at which the rounds end."""
STILL = 1e-9
"""Slip over the rates that loads alone cause, and demanded ones, below which all contacts stick."""


@allocating_kernel
def start_associated(
    problem: ContactProblem,
    sizes: Sizes,
    unknowns: Unknowns,
    surfaces: Surfaces,
    columns: Ints,
    couplings: Ints,
    halt: Ints,
) -> bool:
    """Fill modes, velocities and forces; returns whether the convex problems had a solution; none has once
    `halt` (1,) is set. `surfaces`, `columns` and `couplings`: see `solve_groups`."""
    n, contacts, d = sizes.n, sizes.contacts, problem.R.shape[1]
    p, slip = problem, np.zeros(contacts)
    offset, pace = p.w[: d * contacts].copy(), _pace(p, n, contacts, columns, couplings)
    for r in range(len(unknowns.force)):
        unknowns.force[r] = 0.0
    for i in range(n):
        unknowns.v[i] = 0.0
    ended = True
    for _ in range(ROUNDS):
        for k in range(contacts):
            p.w[d * k] = offset[d * k] + p.mu[k] * slip[k]
        status, _, _, _ = solve_groups(p, sizes, unknowns, ASSOCIATED, surfaces, columns, couplings, halt)
        ended = status == SOLVED
        if not ended:
            break
        change, greatest = 0.0, p.quantum[0]
        for k in range(contacts):
            s = _slip(p, k, n, columns, unknowns) if unknowns.force[d * k] > 0.0 else 0.0
            change, greatest = max(change, abs(s - slip[k])), max(greatest, s)
            slip[k] = s
        if greatest <= STILL * pace or change <= SETTLED * greatest:
            break
    for k in range(contacts):
        p.w[d * k] = offset[d * k]
    return ended


@kernel
def _slip(p: ContactProblem, k: int, n: int, columns: Ints, unknowns: Unknowns) -> float:
    """Speed of slip of contact k."""
    d, total = p.R.shape[1], 0.0
    for r in range(d * k + 1, d * k + d):
        s = p.w[r]
        for j in range(d):
            s += p.R[k, r - d * k, j] * unknowns.force[d * k + j]
        for side in range(2):
            first, end, shift = span(columns, k, side, n)
            for i in range(first, end):
                s += p.W[r, i - shift] * unknowns.v[i]
        total += s * s
    return math.sqrt(total)


@kernel
def _pace(p: ContactProblem, n: int, contacts: int, columns: Ints, couplings: Ints) -> float:
    """Greatest rate of a contact that loads alone cause, or that is demanded."""
    pace, d = 0.0, p.R.shape[1]
    for r in range(d * contacts):
        rate = abs(p.w[r])
        for side in range(2):
            first, end, shift = span(columns, r // d, side, n)
            for i in range(first, end):
                rate += abs(p.W[r, i - shift] * p.c[i]) / diagonal(p.H, couplings, i)
        pace = max(pace, rate)
    return pace

"""Forces to start from where bodies may rest: those of the associated law of friction.

There a contact opens at mu times its slip, or more: rates and forces are in dual cones, and the problem is
convex. Its velocities are unique, and zero wherever forces in the cones balance the loads at rest; then
Coulomb's law holds, too, which may also let the bodies fall (strong and weak stability: Pang and Trinkle,
ZAMM 80 (2000) 643-663). Where things slide, the opening is taken back: w_n + mu |s| in place of w_n, with the
slip s of the answer before, again and again. At a fixed point Coulomb's law holds. Algorithm: Lemke's method
on each convex problem. Source: Acary, Cadoux, Lemarechal, Malick, ZAMM 91 (2011) 155-175.
Accepts: planar problems (d = 2), H positive definite. Promises: nothing but that bodies for which rest is
admissible rest if all do.
"""

from __future__ import annotations

import numpy as np

from rungwise.contact.step.modes import STICK
from rungwise.contact.step.pivoting import solve_by_pivoting
from rungwise.contact.step.problem import ContactProblem, Sizes, Unknowns
from rungwise.kernel import Ints, Reals, allocating_kernel, kernel

ROUNDS = 20
"""Most convex problems."""
SETTLED = 1e-9
"""Change of slips, over the greatest, at which the rounds end."""
STILL = 1e-6
"""Slip over the rates that loads alone cause, and demanded ones, below which a contact sticks: pivots leave
more rounding than other solvers. Chosen by trial, to a decade."""

RESERVES = (0.9, 0.99)
"""Parts of the friction with which contacts that stick may still do so. Chosen by trial."""


@allocating_kernel
def start_associated(problem: ContactProblem, sizes: Sizes, unknowns: Unknowns, halt: Ints) -> bool:
    """Fill mode, v, force and tau; returns whether the convex problems had a solution; none has once `halt`
    (1,) is set. Allocates: it is the exception, not the rule."""
    n, contacts = sizes.n, sizes.contacts
    mode, v, force = unknowns.mode, unknowns.v, unknowns.force
    p = problem
    offset, slip, pace = p.w[: 2 * contacts].copy(), np.zeros(contacts), _pace(p, n, contacts)
    ended = True
    for _ in range(ROUNDS):
        for k in range(contacts):
            p.w[2 * k] = offset[2 * k] + p.mu[k] * abs(slip[k])
        ended = solve_by_pivoting(p, sizes, unknowns, True, halt)
        if not ended:
            break
        change, greatest = 0.0, p.quantum[0]
        for k in range(contacts):
            s = _slip(p, k, n, v, force) if force[2 * k] > 0.0 else 0.0
            change, greatest = max(change, abs(abs(s) - abs(slip[k]))), max(greatest, abs(s))
            slip[k] = s
        if greatest <= STILL * pace or change <= SETTLED * greatest:
            break
    if ended:
        for k in range(contacts):
            if force[2 * k] > 0.0 and abs(slip[k]) <= STILL * pace:
                mode[k] = STICK
        _keep_reserve(p, sizes, STILL * pace, unknowns, halt)
    for k in range(contacts):
        p.w[2 * k] = offset[2 * k]
    return ended


@allocating_kernel
def _keep_reserve(p: ContactProblem, sizes: Sizes, still: float, unknowns: Unknowns, halt: Ints) -> None:
    """Where contacts that stick do so with less friction, too, take the forces found then: pivots end at
    sides of cones, where rounding decides whether a contact sticks."""
    n, contacts = sizes.n, sizes.contacts
    mode, v, force, tau = unknowns
    mu = p.mu[:contacts].copy()
    other = Unknowns(mode.copy(), v.copy(), force.copy(), tau.copy())
    for reserve in RESERVES:
        for k in range(contacts):
            p.mu[k] = reserve * mu[k] if mode[k] == STICK else mu[k]
        sticks = solve_by_pivoting(p, sizes, other, True, halt)
        for r in range(2 * contacts):
            change = 0.0
            for i in range(n):
                change += p.W[r, i] * (other.v[i] - v[i])
            sticks &= abs(change) <= still
        if sticks:
            for k in range(contacts):
                if mode[k] == STICK and other.force[2 * k] > 0.0:
                    other.mode[k] = STICK
            mode[:], v[:], force[:], tau[:] = other
            break
    p.mu[:contacts] = mu


@kernel
def _slip(p: ContactProblem, k: int, n: int, v: Reals, force: Reals) -> float:
    r = 2 * k + 1
    s: float = p.w[r] + p.R[k, 1, 0] * force[r - 1] + p.R[k, 1, 1] * force[r]
    for i in range(n):
        s += p.W[r, i] * v[i]
    return s


@kernel
def _pace(p: ContactProblem, n: int, contacts: int) -> float:
    """Greatest rate of a contact that loads alone cause, or that is demanded."""
    pace = 0.0
    for r in range(2 * contacts):
        rate = abs(p.w[r])
        for i in range(n):
            rate += abs(p.W[r, i] * p.c[i]) / p.H[i, i]
        pace = max(pace, rate)
    return pace

"""What forces of an answer exert beside what the problem calls for: beside forces far greater than that
any other error looks small."""

from __future__ import annotations

import math

from rungwise.contact.step.problem import ContactProblem, Sizes, Unknowns
from rungwise.kernel import kernel, rare_kernel

WEDGED = 1e8
"""Forces that exceed the needs of loads and demanded rates by this factor belong to a singular mode.
Chosen by trial, to a decade."""


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

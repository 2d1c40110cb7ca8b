"""Exhaustive search over contact modes, the judge for few contacts.

Algorithm: the linear system of every mode, one after the other. Source: the paper, section 2.2 (3^n modes;
sliding has two senses in the plane, so 4^n here).
Accepts: planar problems with at most `MAX_MODES` modes, or so many of the contacts that touch where the step
begins; the others then stay open, which a step that is short enough lets them do.
Promises: a solution whenever some mode's system is regular and solves the problem.
"""

from __future__ import annotations

import math

from rungwise.contact.solver.modes.mode_newton import solve_mode
from rungwise.contact.solver.residual import residual_of_rows
from rungwise.contact.step.modes import FORWARD, OPEN, STICK
from rungwise.contact.step.problem import ContactProblem, Elimination, Sizes, Unknowns
from rungwise.kernel import Ints, inner_kernel, kernel

MAX_MODES = 5000
"""Modes that are tried, one after another, at most."""


@kernel
def mode_count(problem: ContactProblem, sizes: Sizes, touching: bool) -> float:
    """Number of modes of all contacts, or of those that touch; as a float: it grows fast."""
    count = 3.0**sizes.limited
    for k in range(sizes.contacts):
        count *= 4.0 if _may_push(problem, k, touching) else 1.0
    return count


@inner_kernel
def _may_push(p: ContactProblem, k: int, touching: bool) -> bool:
    """Whether contact k has modes beside OPEN: where only those that are `touching` count, it is closed, or
    overlaps, where the step begins."""
    return bool(not touching or p.w[2 * k] <= p.quantum[0])


@kernel
def solve_by_enumeration(
    problem: ContactProblem,
    sizes: Sizes,
    unknowns: Unknowns,
    room: Elimination,
    touching: bool,
    tolerance: float,
) -> float:
    """Find the first mode, of all contacts or of those `touching`, whose solution has a residual within
    `tolerance`; returns that residual, or the least residual met."""
    contacts, limited = sizes.contacts, sizes.limited
    mode = unknowns.mode
    best = 1e300
    for index in range(int(mode_count(problem, sizes, touching))):
        rest = index
        for k in range(contacts):
            mode[k] = OPEN
            if _may_push(problem, k, touching):
                mode[k] = OPEN + rest % 4
                rest //= 4
        for r in range(limited):
            mode[contacts + r] = STICK + rest % 3
            rest //= 3
        if _repeats(problem, sizes, mode) or _holds_too_much(problem, sizes, mode):
            continue
        solve_mode(problem, sizes, unknowns, room)
        found = residual_of_rows(problem, sizes, unknowns, room.matrix)
        best = min(best, found)
        if found <= tolerance:
            return found
    return best


@kernel
def _holds_too_much(p: ContactProblem, sizes: Sizes, mode: Ints) -> bool:
    """Whether more rigid rows are closed than there are velocities: where forces balance with such a mode,
    they do with fewer rows, too, for forces can be shifted among dependent rows until one of them vanishes or
    comes to the side of its cone."""
    n, contacts, limited = sizes
    rows = 0
    for k in range(contacts):
        if mode[k] != OPEN and p.R[k, 0, 0] == 0.0:
            rows += 2 if mode[k] == STICK and p.mu[k] > 0.0 else 1
    for r in range(limited):
        rows += 1 if mode[contacts + r] == STICK and p.R_s[r] == 0.0 else 0
    return rows > n


@kernel
def _repeats(p: ContactProblem, sizes: Sizes, mode: Ints) -> bool:
    """Whether another mode says the same: without friction every closed mode does, and joints only hold."""
    contacts, limited = sizes.contacts, sizes.limited
    for k in range(contacts):
        if p.mu[k] == 0.0 and mode[k] != OPEN and mode[k] != FORWARD:
            return True
    repeated = False
    for r in range(limited):
        repeated |= math.isinf(p.F[r]) and mode[contacts + r] != STICK
    return repeated

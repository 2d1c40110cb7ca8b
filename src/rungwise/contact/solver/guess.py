"""Warm mode guess: solve a contact mode's linear system, flip the modes it contradicts, until none flips.

Algorithm: semismooth Newton (active set) on the mixed problem, whose pieces are the contact modes.
Source: Alart and Curnier, Comput. Methods Appl. Mech. Eng. 92 (1991) 353-375.
Accepts: planar problems (d = 2), singular H included as long as the mode's saddle system determines v.
Promises: the exact solution of the last mode, usually after one solve when the guess is right; modes may
cycle, so the answer counts only if the residual says so.
"""

from __future__ import annotations

import math

from rungwise.contact.linear import solve_in_place
from rungwise.contact.solver.residual import residual_of_rows
from rungwise.contact.step.modes import BACKWARD, FORWARD, OPEN, STICK
from rungwise.contact.step.problem import ContactProblem, Elimination, Sizes, Unknowns
from rungwise.kernel import Ints, Reals, inner_kernel, kernel

MAX_FLIPS = 12
"""Solves in which contacts may change their mode, at most."""
CONTRADICTED = 1e-12
"""Rates over the greatest velocity term, and forces over the greatest force or the limit, that contradict no
mode: about ten thousand roundings of double precision. Chosen by trial, to a decade."""
BY_SLIP = -1
"""No mode: forces ask for none, and the slip decides."""


@kernel
def solve_by_modes(
    problem: ContactProblem, sizes: Sizes, unknowns: Unknowns, room: Elimination, flips: int, halt: Ints
) -> float:
    """Improve `mode` (contacts, then limited rows) in at most `flips` solves, fewer where halt (1,) is set;
    returns the residual of the solution found. The kernel ends at a mode that does not determine the
    forces."""
    for i in range(flips):
        regular = solve_mode(problem, sizes, unknowns, room)
        # The last solution keeps the mode that it belongs to.
        if not regular or i + 1 == flips or halt[0] != 0:
            break
        if not _flip(problem, sizes, unknowns):
            break
    return residual_of_rows(problem, sizes, unknowns, room.matrix)


@kernel
def solve_mode(problem: ContactProblem, sizes: Sizes, unknowns: Unknowns, room: Elimination) -> bool:
    """Solve the linear equations of `mode`, inequalities aside; returns whether the solution is unique."""
    size = _assemble(problem, sizes, unknowns, room.matrix)
    regular = solve_in_place(room.matrix, size, 1, room.order) == size
    _unpack(problem, sizes, size, room.matrix, unknowns)
    return regular


@kernel
def _unpack(p: ContactProblem, sizes: Sizes, size: int, matrix: Reals, unknowns: Unknowns) -> None:
    """Take v, force and tau from the solved system, in the units that `_assemble` left in them."""
    n, contacts, limited = sizes
    mode, v, force, tau = unknowns
    for i in range(n):
        v[i] *= matrix[i, size]
    at = n
    for k in range(contacts):
        if mode[k] == OPEN:
            force[2 * k] = force[2 * k + 1] = 0.0
            continue
        force[2 * k] *= matrix[at, size]
        at += 1
        if mode[k] == STICK and p.mu[k] > 0.0:
            force[2 * k + 1] *= matrix[at, size]
            at += 1
        else:
            force[2 * k + 1] = _sign(mode[k]) * p.mu[k] * force[2 * k]
    for r in range(limited):
        if mode[contacts + r] == STICK:
            tau[r] *= matrix[at, size]
            at += 1
        else:
            tau[r] = _sign(mode[contacts + r]) * p.F[r]


@kernel
def _sign(mode: int) -> float:
    """Sign of the friction force."""
    if mode == BACKWARD:
        return 1.0
    return -1.0 if mode == FORWARD else 0.0


@kernel
def _assemble(p: ContactProblem, sizes: Sizes, unknowns: Unknowns, a: Reals) -> int:
    """Saddle matrix of the mode with its right-hand side in the last column; returns its size.

    Unknowns: v, then for each closed contact the normal force and, where it sticks, the tangential one, then
    the forces of the limited rows that hold. Each is in its own unit, so that H has a unit diagonal and no
    row is lost beside another; the units are left in v, force and tau.
    """
    n, contacts, limited = sizes
    mode, v, force, tau = unknowns
    size = n
    for k in range(contacts):
        if mode[k] != OPEN:
            size += 2 if mode[k] == STICK and p.mu[k] > 0.0 else 1
    for r in range(limited):
        size += 1 if mode[contacts + r] == STICK else 0
    ease = _ease(p, sizes)
    for i in range(n):
        v[i] = ease / math.sqrt(p.H[i, i])
    for i in range(n):
        for j in range(n):
            a[i, j] = p.H[i, j] * v[i] * v[j]
        a[i, size] = p.c[i] * v[i]
    for i in range(n, size):
        for j in range(n, size):
            a[i, j] = 0.0
    at = n
    for k in range(contacts):
        if mode[k] == OPEN:
            continue
        row, sticks = 2 * k, mode[k] == STICK and p.mu[k] > 0.0
        slope = 0.0 if sticks else _sign(mode[k]) * p.mu[k]
        unit = _unit(p.W, row, row + 1, n, p.R[k, 0, 0], v)
        _unknown(p.W, row, n, slope, row + 1, unit, v, at, a)
        a[at, at] = (p.R[k, 0, 0] + slope * p.R[k, 0, 1]) * unit * unit
        a[at, size] = -p.w[row] * unit
        force[row] = unit
        if sticks:
            other = _unit(p.W, row + 1, row, n, p.R[k, 1, 1], v)
            _unknown(p.W, row + 1, n, 0.0, row, other, v, at + 1, a)
            a[at, at + 1], a[at + 1, at] = p.R[k, 0, 1] * unit * other, p.R[k, 1, 0] * unit * other
            a[at + 1, at + 1] = p.R[k, 1, 1] * other * other
            a[at + 1, size] = -p.w[row + 1] * other
            force[row + 1] = other
            at += 1
        at += 1
    for r in range(limited):
        if mode[contacts + r] == STICK:
            unit = _unit(p.S, r, r, n, p.R_s[r], v)
            _unknown(p.S, r, n, 0.0, r, unit, v, at, a)
            a[at, at] = p.R_s[r] * unit * unit
            a[at, size] = -p.w_s[r] * unit
            tau[r] = unit
            at += 1
        else:
            for i in range(n):
                a[i, size] += p.S[r, i] * v[i] * _sign(mode[contacts + r]) * p.F[r]
    return size


@kernel
def _ease(p: ContactProblem, sizes: Sizes) -> float:
    """Factor of the units of velocities: 1, or less where inertia is far below the stiffness of contacts (the
    quasistatic limit), so that neither is lost beside the other."""
    n, contacts, limited = sizes
    least = 1.0
    for k in range(contacts):
        least = min(least, _share(p.W, 2 * k, n, p.R[k, 0, 0], p.H))
    for r in range(limited):
        least = min(least, _share(p.S, r, n, p.R_s[r], p.H))
    return math.sqrt(math.sqrt(least))


@kernel
def _share(rows: Reals, row: int, n: int, yields: float, inertia: Reals) -> float:
    """Part of a row's yielding that is not the yielding of bodies; 1 for a rigid row."""
    total = yields
    for i in range(n):
        total += rows[row, i] * rows[row, i] / inertia[i, i]
    return yields / total if yields > 0.0 else 1.0


@kernel
def _unit(rows: Reals, row: int, other: int, n: int, yields: float, v: Reals) -> float:
    """Unit of a row's force: the row then has a length of about one, in units v of the velocities, or where
    nothing yields to it the `other` direction of its contact, which friction may push."""
    for i in range(n):
        yields += (rows[row, i] * v[i]) ** 2
    if yields == 0.0:
        for i in range(n):
            yields += (rows[other, i] * v[i]) ** 2
    return 1.0 / math.sqrt(yields) if yields > 0.0 else 1.0


@kernel
def _unknown(
    rows: Reals, row: int, n: int, slope: float, other: int, unit: float, v: Reals, at: int, a: Reals
) -> None:
    """Equation of `row` in line `at`; in column `at` its force, with `slope` times the force of row
    `other`."""
    for i in range(n):
        x = unit * v[i]
        a[at, i] = rows[row, i] * x
        a[i, at] = -(rows[row, i] + slope * rows[other, i]) * x


@kernel
def _flip(p: ContactProblem, sizes: Sizes, unknowns: Unknowns) -> bool:
    """Move contacts and rows that contradict their modes to the modes they ask for; whether any did."""
    n, contacts, limited = sizes
    mode, v, force, tau = unknowns
    velocity, largest = p.quantum[0], 0.0
    for r in range(2 * contacts):
        velocity = max(velocity, abs(p.w[r]))
        largest = max(largest, abs(force[r]))
        for i in range(n):
            velocity = max(velocity, abs(p.W[r, i] * v[i]))
    slack, tiny = CONTRADICTED * velocity, CONTRADICTED * largest
    flipped = False
    for k in range(contacts):
        wanted = _contact_mode(p, n, k, unknowns, slack, tiny)
        flipped |= wanted != mode[k]
        mode[k] = wanted
    for r in range(limited):
        at = contacts + r
        wanted = _asked_by_limit(mode[at], tau[r], p.F[r])
        if wanted == BY_SLIP:
            s = p.R_s[r] * tau[r] + p.w_s[r]
            for i in range(n):
                s += p.S[r, i] * v[i]
            wanted = STICK if s * tau[r] > 0.0 else mode[at]
        flipped |= wanted != mode[at]
        mode[at] = wanted
    return bool(flipped)


@kernel
def _contact_mode(p: ContactProblem, n: int, k: int, unknowns: Unknowns, slack: float, tiny: float) -> int:
    mode, v = unknowns.mode[k], unknowns.v
    normal, tangential = unknowns.force[2 * k], unknowns.force[2 * k + 1]
    if mode == OPEN:
        rate = p.w[2 * k]
        for i in range(n):
            rate += p.W[2 * k, i] * v[i]
        if rate >= -slack:
            return OPEN
        return STICK if p.mu[k] > 0.0 else FORWARD
    wanted = _asked_by_force(mode, p.mu[k], normal, tangential, tiny)
    if wanted != BY_SLIP:
        return wanted
    slip = p.w[2 * k + 1] + p.R[k, 1, 0] * normal + p.R[k, 1, 1] * tangential
    for i in range(n):
        slip += p.W[2 * k + 1, i] * v[i]
    return STICK if slip * _sign(mode) > slack else mode


@inner_kernel
def _asked_by_force(mode: int, mu: float, normal: float, tangential: float, tiny: float) -> int:
    """The mode that the forces of a contact that is not open ask for; forces up to `tiny` are rounding."""
    if normal < -tiny:
        if mode == STICK and abs(tangential) > -mu * normal:
            return BACKWARD if tangential > 0.0 else FORWARD
        return OPEN
    if mu == 0.0:
        return mode
    if mode == STICK:
        if abs(tangential) <= mu * normal + tiny:
            return STICK
        return BACKWARD if tangential > 0.0 else FORWARD
    return BY_SLIP


@inner_kernel
def _asked_by_limit(mode: int, tau: float, limit: float) -> int:
    """The mode that the force of a limited row asks for."""
    if mode != STICK:
        return BY_SLIP
    if abs(tau) > limit * (1.0 + CONTRADICTED):
        return BACKWARD if tau > 0.0 else FORWARD
    return STICK

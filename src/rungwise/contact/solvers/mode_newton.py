"""Warm mode guess: solve the linear system of a contact mode, flip what it contradicts, until nothing flips.

Algorithm: semismooth Newton (active set) on the mixed problem, whose pieces are the contact modes.
Source: Alart and Curnier, Comput. Methods Appl. Mech. Eng. 92 (1991) 353-375.
Accepts: planar problems (d = 2), singular H included as long as the mode's saddle system determines v.
Promises: the exact solution of the mode that it ends in, usually after one solve when the guess is right; it may cycle,
so its answer counts only if the residual says so.
"""

from __future__ import annotations

import math

from rungwise.contact.modes import BACKWARD, FORWARD, OPEN, STICK
from rungwise.contact.residual import residual
from rungwise.contact.solvers.linear import solve_in_place
from rungwise.kernel import kernel

MAX_FLIPS = 12
PROXIMAL = 1e-7
"""Yield of forces, relative to the inertia, by which a mode with dependent contacts picks its least forces."""
PROXIMAL_STEPS = 3
_TOLERANCE = 1e-12


@kernel
def solve_by_modes(problem, n, contacts, limited, mode, v, force, tau, matrix, order, flips):  # type: ignore[no-untyped-def]
    """Improve `mode` (contacts, then limited rows) at most `flips` times; returns the residual of what it found."""
    for _ in range(flips):
        solve_mode(problem, n, contacts, limited, mode, v, force, tau, matrix, order)
        if not _flip(problem, n, contacts, limited, mode, v, force, tau):
            break
    return residual(problem, n, contacts, limited, v, force, tau)


@kernel
def solve_mode(problem, n, contacts, limited, mode, v, force, tau, matrix, order):  # type: ignore[no-untyped-def]
    """The one solution of the linear equations of `mode`, inequalities aside."""
    p = problem
    scale = _scale(p, n, contacts, limited)
    size = _assemble(p, n, contacts, limited, mode, scale, 0.0, force, tau, matrix)
    if solve_in_place(matrix, size, 1, order) < size:
        force[:] = 0.0
        tau[:] = 0.0
        for _ in range(PROXIMAL_STEPS):
            size = _assemble(p, n, contacts, limited, mode, scale, PROXIMAL, force, tau, matrix)
            solve_in_place(matrix, size, 1, order)
            _unpack(p, n, contacts, limited, mode, scale, size, matrix, v, force, tau)
    _unpack(p, n, contacts, limited, mode, scale, size, matrix, v, force, tau)


@kernel
def _unpack(p, n, contacts, limited, mode, scale, size, matrix, v, force, tau):  # type: ignore[no-untyped-def]
    """Velocities and forces from the solved system."""
    for i in range(n):
        v[i] = matrix[i, size]
    at = n
    for k in range(contacts):
        force[2 * k] = force[2 * k + 1] = 0.0
        if mode[k] != OPEN:
            force[2 * k] = scale * matrix[at, size]
            at += 1
            if mode[k] == STICK and p.mu[k] > 0.0:
                force[2 * k + 1] = scale * matrix[at, size]
                at += 1
            else:
                force[2 * k + 1] = _sign(mode[k]) * p.mu[k] * force[2 * k]
    for r in range(limited):
        if mode[contacts + r] == STICK:
            tau[r] = scale * matrix[at, size]
            at += 1
        else:
            tau[r] = _sign(mode[contacts + r]) * p.F[r]


@kernel
def _scale(p, n, contacts, limited):  # type: ignore[no-untyped-def]
    """Force per velocity by which forces are scaled: midway between inertia and the stiffest contact, so that neither
    is lost beside the other."""
    inertia, contact = 0.0, 0.0
    for i in range(n):
        inertia = max(inertia, p.H[i, i])
    for k in range(contacts):
        if p.R[k, 0, 0] > 0.0:
            contact = max(contact, 1.0 / p.R[k, 0, 0])
    for r in range(limited):
        if p.R_s[r] > 0.0:
            contact = max(contact, 1.0 / p.R_s[r])
    return math.sqrt(inertia * max(inertia, contact))


@kernel
def _sign(mode):  # type: ignore[no-untyped-def]
    """Sign of the friction force."""
    if mode == BACKWARD:
        return 1.0
    return -1.0 if mode == FORWARD else 0.0


@kernel
def _assemble(p, n, contacts, limited, mode, scale, proximal, force, tau, a):  # type: ignore[no-untyped-def]
    """Saddle matrix of the mode with its right-hand side in the last column; returns its size.

    Unknowns: v, then for each closed contact the normal force and, where it sticks, the tangential one, then the
    forces of the limited rows that hold. Balance rows are divided by `scale`, forces too. A `proximal` > 0 lets each
    force yield by so much about its present value.
    """
    size = n
    for k in range(contacts):
        if mode[k] != OPEN:
            size += 2 if mode[k] == STICK and p.mu[k] > 0.0 else 1
    for r in range(limited):
        size += 1 if mode[contacts + r] == STICK else 0
    for i in range(n):
        for j in range(n):
            a[i, j] = p.H[i, j] / scale
        for j in range(n, size):
            a[i, j] = 0.0
        a[i, size] = p.c[i] / scale
    for i in range(n, size):
        for j in range(n, size + 1):
            a[i, j] = 0.0
    at = n
    for k in range(contacts):
        if mode[k] == OPEN:
            continue
        row = 2 * k
        if mode[k] == STICK and p.mu[k] > 0.0:
            _unknown(p.W, row, n, 0.0, row, at, a)
            _unknown(p.W, row + 1, n, 0.0, row, at + 1, a)
            a[at, at], a[at, at + 1] = p.R[k, 0, 0] * scale, p.R[k, 0, 1] * scale
            a[at + 1, at], a[at + 1, at + 1] = p.R[k, 1, 0] * scale, p.R[k, 1, 1] * scale
            a[at, size], a[at + 1, size] = -p.w[row], -p.w[row + 1]
            at += 2
        else:
            slope = _sign(mode[k]) * p.mu[k]
            _unknown(p.W, row, n, slope, row + 1, at, a)
            a[at, at] = (p.R[k, 0, 0] + slope * p.R[k, 0, 1]) * scale
            a[at, size] = -p.w[row]
            at += 1
    for r in range(limited):
        if mode[contacts + r] == STICK:
            _unknown(p.S, r, n, 0.0, r, at, a)
            a[at, at] = p.R_s[r] * scale
            a[at, size] = -p.w_s[r]
            at += 1
        else:
            for i in range(n):
                a[i, size] += p.S[r, i] * _sign(mode[contacts + r]) * p.F[r] / scale
    if proximal > 0.0:
        _make_proximal(n, contacts, limited, mode, scale, proximal, p, force, tau, a, size)
    return size


@kernel
def _make_proximal(n, contacts, limited, mode, scale, proximal, p, force, tau, a, size):  # type: ignore[no-untyped-def]
    at = n
    for k in range(contacts):
        if mode[k] != OPEN:
            for i in range(2 if mode[k] == STICK and p.mu[k] > 0.0 else 1):
                a[at, at] += proximal
                a[at, size] += proximal * force[2 * k + i] / scale
                at += 1
    for r in range(limited):
        if mode[contacts + r] == STICK:
            a[at, at] += proximal
            a[at, size] += proximal * tau[r] / scale
            at += 1


@kernel
def _unknown(rows, row, n, slope, other, at, a):  # type: ignore[no-untyped-def]
    """Equation of `row` in line `at`; in column `at` its force, with `slope` times that of row `other`."""
    for i in range(n):
        a[at, i] = rows[row, i]
        a[i, at] = -rows[row, i] - slope * rows[other, i]


@kernel
def _flip(p, n, contacts, limited, mode, v, force, tau):  # type: ignore[no-untyped-def]
    """Move every contact that contradicts its mode to the mode it asks for; returns whether any did."""
    velocity, largest = p.quantum[0], 0.0
    for r in range(2 * contacts):
        velocity = max(velocity, abs(p.w[r]))
        largest = max(largest, abs(force[r]))
        for i in range(n):
            velocity = max(velocity, abs(p.W[r, i] * v[i]))
    slack, tiny = _TOLERANCE * velocity, _TOLERANCE * largest
    changed = False
    for k in range(contacts):
        wanted = _contact_mode(p, n, k, mode[k], v, force, slack, tiny)
        changed |= wanted != mode[k]
        mode[k] = wanted
    for r in range(limited):
        at = contacts + r
        wanted = mode[at]
        if mode[at] == STICK:
            if abs(tau[r]) > p.F[r] * (1.0 + _TOLERANCE):
                wanted = BACKWARD if tau[r] > 0.0 else FORWARD
        else:
            s = p.R_s[r] * tau[r] + p.w_s[r]
            for i in range(n):
                s += p.S[r, i] * v[i]
            if s * tau[r] > 0.0:
                wanted = STICK
        changed |= wanted != mode[at]
        mode[at] = wanted
    return changed


@kernel
def _contact_mode(p, n, k, mode, v, force, slack, tiny):  # type: ignore[no-untyped-def]
    normal, tangential = force[2 * k], force[2 * k + 1]
    if mode == OPEN:
        rate = p.w[2 * k]
        for i in range(n):
            rate += p.W[2 * k, i] * v[i]
        if rate >= -slack:
            return OPEN
        return STICK if p.mu[k] > 0.0 else FORWARD
    if normal < -tiny:
        return OPEN
    if p.mu[k] == 0.0:
        return mode
    if mode == STICK:
        if abs(tangential) <= p.mu[k] * normal + tiny:
            return STICK
        return BACKWARD if tangential > 0.0 else FORWARD
    slip = p.w[2 * k + 1] + p.R[k, 1, 0] * normal + p.R[k, 1, 1] * tangential
    for i in range(n):
        slip += p.W[2 * k + 1, i] * v[i]
    return STICK if slip * _sign(mode) > slack else mode

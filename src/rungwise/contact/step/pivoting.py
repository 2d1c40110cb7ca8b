"""Pivoting for planar steps with exact Coulomb friction.

Algorithm: Lemke's method (`contact.lemke`) on the linear complementarity problem in (lambda_n, lambda_+,
lambda_-, gamma), after the velocities and bilateral rows have been eliminated. In the plane the polyhedral
cone is the exact one. Pivots are judged in units in which H and the Delassus matrix have diagonals of about
one. Source: Stewart and Trinkle, Int. J. Numer. Methods Eng. 39 (1996) 2673-2691.
Accepts: d = 2, H positive definite; R, b may be anything that leaves the matrix copositive
(symmetric positive semidefinite Delassus blocks do). Promises: a solution or a ray in finitely many pivots; a
ray is a hint that there is no solution, not a proof.
"""

from __future__ import annotations

import math

import numpy as np

from rungwise.contact.lemke import lemke
from rungwise.contact.linear import solve_in_place
from rungwise.contact.step.modes import BACKWARD, FORWARD, OPEN, STICK
from rungwise.contact.step.problem import ContactProblem, Sizes, Unknowns
from rungwise.kernel import Ints, Reals, allocating_kernel, kernel

ATTEMPTS, GOLDEN, EXACT = 8, 0.5 * (math.sqrt(5.0) - 1.0), 1e-10
"""In the associated law, where bodies may rest, many ratios are equal, and rounding may lead pivots astray:
so many covering vectors are tried, of entries that are spread over an interval by multiples of the golden
ratio, until the law is violated by no more than this, over the greatest load. Chosen by trial."""


@allocating_kernel
def solve_by_pivoting(
    problem: ContactProblem, sizes: Sizes, unknowns: Unknowns, associated: bool, halt: Ints
) -> bool:
    """Fill mode, v, force and tau; returns whether pivoting ended at a solution. Allocates: it is the
    exception, not the rule. `associated`: see `contact.step.associated`; it ends when `halt` (1,) is set."""
    n, contacts, limited = sizes
    mode, v, force, tau = unknowns
    rows = 2 * contacts + limited
    x, y = _units(problem, sizes)
    delassus, offset, response = _reduce(problem, sizes, x, y)
    unit = 0.0
    for i in range(rows):
        unit = max(unit, abs(offset[i]))
    if not unit > 0.0:
        unit = 1.0
    M, q = _unfold(problem, sizes, delassus, offset, y, unit, associated)
    size = len(q)
    z, covering, ended = np.zeros(size), np.ones(size), False
    for attempt in range(ATTEMPTS if associated else 1):
        for i in range(size if associated else 0):
            covering[i] = 0.5 + (i + 1) * (attempt + 1) * GOLDEN % 1.0
        tableau, place = np.empty((size, size + 2)), np.empty(4 * size + 2, np.int64)
        ended, _ = lemke(M, q, covering, z, tableau, place, halt)
        if ended and (not associated or _violation(M, q, z) <= EXACT):
            break
    if not ended:
        return False
    _unpack(sizes, z, unit, unknowns)
    for i in range(n):
        v[i] = x[i] * _respond(response, i, sizes, unknowns)
    for r in range(limited):
        if math.isinf(problem.F[r]):
            tau[r] = _respond(response, n + r, sizes, unknowns)
            mode[contacts + r] = STICK
    for r in range(2 * contacts):
        force[r] *= y[r]
    for r in range(limited):
        tau[r] *= y[2 * contacts + r]
    return True


@kernel
def _violation(M: Reals, q: Reals, z: Reals) -> float:
    """Greatest |min(z, M z + q)|."""
    worst = 0.0
    for i in range(len(q)):
        w = q[i]
        for j in range(len(q)):
            w += M[i, j] * z[j]
        worst = max(worst, abs(min(z[i], w)))
    return worst


@allocating_kernel
def _units(p: ContactProblem, sizes: Sizes) -> tuple[Reals, Reals]:
    """Units x of the velocities and y of the forces in which H has a unit diagonal and rows are about one.

    Both directions of a contact share one unit, so that friction coefficients stay the same.
    """
    n, contacts, limited = sizes
    x, y, most = np.ones(n), np.zeros(2 * contacts + limited), 0.0
    for i in range(n):
        x[i] = 1.0 / math.sqrt(p.H[i, i])
    for k in range(contacts):
        yields = 0.0
        for r in range(2 * k, 2 * k + 2):
            own = p.R[k, r - 2 * k, r - 2 * k]
            for i in range(n):
                own += (p.W[r, i] * x[i]) ** 2
            yields = max(yields, own)
        y[2 * k] = y[2 * k + 1] = yields
        most = max(most, yields)
    for r in range(limited):
        yields = p.R_s[r]
        for i in range(n):
            yields += (p.S[r, i] * x[i]) ** 2
        y[2 * contacts + r] = yields
        most = max(most, yields)
    for r in range(2 * contacts + limited):
        # A force to which nothing yields has the unit of another.
        yields = y[r] if y[r] > 0.0 else most
        y[r] = 1.0 / math.sqrt(yields) if yields > 0.0 else 1.0
    return x, y


@kernel
def _respond(response: Reals, i: int, sizes: Sizes, unknowns: Unknowns) -> float:
    """Unknown i of (v, joint forces) under the loads and these forces, all in their units."""
    contacts, limited = sizes.contacts, sizes.limited
    force, tau = unknowns.force, unknowns.tau
    total = response[i, 2 * contacts + limited]
    for r in range(2 * contacts):
        total += response[i, r] * force[r]
    for r in range(limited):
        total += response[i, 2 * contacts + r] * tau[r]
    return total


@allocating_kernel
def _reduce(p: ContactProblem, sizes: Sizes, x: Reals, y: Reals) -> tuple[Reals, Reals, Reals]:
    """Delassus matrix and offset of contact and limited rows, and the response of (v, joint forces) to their
    forces.

    Everything is in the units x and y. Rows with infinite limit are joints: they are eliminated with v, and
    their own rows and columns come out zero.
    """
    n, contacts, limited = sizes
    rows, size = 2 * contacts + limited, n + limited
    scaled = np.empty((rows, n))
    for r in range(rows):
        for i in range(n):
            scaled[r, i] = y[r] * x[i] * (p.W[r, i] if r < 2 * contacts else p.S[r - 2 * contacts, i])
    a = np.zeros((size, size + rows + 1))
    for i in range(n):
        for j in range(n):
            a[i, j] = p.H[i, j] * x[i] * x[j]
        for r in range(2 * contacts):
            a[i, size + r] = scaled[r, i]
        a[i, size + rows] = p.c[i] * x[i]
    for r in range(limited):
        own = 2 * contacts + r
        if math.isinf(p.F[r]):
            for i in range(n):
                a[i, n + r] = -scaled[own, i]
                a[n + r, i] = scaled[own, i]
            a[n + r, n + r] = p.R_s[r] * y[own] ** 2
            a[n + r, size + rows] = -p.w_s[r] * y[own]
        else:
            a[n + r, n + r] = 1.0
            for i in range(n):
                a[i, size + own] = scaled[own, i]
    solve_in_place(a, size, rows + 1, np.empty(size, np.int64))
    response = a[:, size:].copy()
    delassus = np.zeros((rows, rows))
    offset = np.zeros(rows)
    for r in range(rows):
        if r >= 2 * contacts and math.isinf(p.F[r - 2 * contacts]):
            continue
        for i in range(n):
            for j in range(rows):
                delassus[r, j] += scaled[r, i] * response[i, j]
            offset[r] += scaled[r, i] * response[i, rows]
        offset[r] += y[r] * (p.w[r] if r < 2 * contacts else p.w_s[r - 2 * contacts])
    for k in range(contacts):
        for i in range(2):
            for j in range(2):
                delassus[2 * k + i, 2 * k + j] += p.R[k, i, j] * y[2 * k] ** 2
    for r in range(limited):
        if not math.isinf(p.F[r]):
            delassus[2 * contacts + r, 2 * contacts + r] += p.R_s[r] * y[2 * contacts + r] ** 2
    return delassus, offset, response


@allocating_kernel
def _unfold(
    p: ContactProblem, sizes: Sizes, delassus: Reals, offset: Reals, y: Reals, unit: float, associated: bool
) -> tuple[Reals, Reals]:
    """M and q of 0 <= z _|_ M z + q >= 0; forces z are in units of y and `unit`. In the associated law a
    contact opens at mu times its slip, or more: M is then positive semidefinite."""
    contacts, limited = sizes.contacts, sizes.limited
    size = 4 * contacts + 3 * limited
    sign, source = np.zeros(size), np.full(size, -1)
    for k in range(contacts):
        source[4 * k], sign[4 * k] = 2 * k, 1.0
        for s in range(2):
            source[4 * k + 1 + s], sign[4 * k + 1 + s] = 2 * k + 1, 1.0 - 2.0 * s
    for r in range(limited):
        for s in range(2):
            i = 4 * contacts + 3 * r + s
            source[i], sign[i] = 2 * contacts + r, 1.0 - 2.0 * s
    M, q = np.zeros((size, size)), np.zeros(size)
    for i in range(size):
        if source[i] >= 0:
            q[i] = sign[i] * offset[source[i]] / unit
            for j in range(size):
                if source[j] >= 0:
                    M[i, j] = sign[i] * sign[j] * delassus[source[i], source[j]]
    for k in range(contacts):
        gamma = 4 * k + 3
        M[gamma, 4 * k] = p.mu[k]
        M[4 * k, gamma] = -p.mu[k] if associated else 0.0
        for s in range(1, 3):
            M[gamma, 4 * k + s], M[4 * k + s, gamma] = -1.0, 1.0
    for r in range(limited):
        first = 4 * contacts + 3 * r
        q[first + 2] = 0.0 if math.isinf(p.F[r]) else p.F[r] / (y[2 * contacts + r] * unit)
        for s in range(2):
            M[first + 2, first + s], M[first + s, first + 2] = -1.0, 1.0
    return M, q


@kernel
def _unpack(sizes: Sizes, z: Reals, unit: float, unknowns: Unknowns) -> None:
    contacts, limited = sizes.contacts, sizes.limited
    mode, force, tau = unknowns.mode, unknowns.force, unknowns.tau
    for k in range(contacts):
        normal, plus, minus, gamma = z[4 * k], z[4 * k + 1], z[4 * k + 2], z[4 * k + 3]
        # Rounding may leave friction where nothing presses.
        friction = plus - minus if normal > 0.0 else 0.0
        force[2 * k], force[2 * k + 1] = normal * unit, friction * unit
        mode[k] = _mode(normal > 0.0, plus, minus, gamma)
    for r in range(limited):
        first = 4 * contacts + 3 * r
        tau[r] = (z[first] - z[first + 1]) * unit
        mode[contacts + r] = _mode(True, z[first], z[first + 1], z[first + 2])


@kernel
def _mode(closed: bool, plus: float, minus: float, gamma: float) -> int:
    if not closed:
        return OPEN
    # Friction both ways means that nothing slips: what gamma then is, is rounding.
    if gamma > 0.0 and not (plus > 0.0 and minus > 0.0):
        return BACKWARD if plus > minus else FORWARD
    return STICK

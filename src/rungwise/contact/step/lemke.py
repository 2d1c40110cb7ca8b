"""Lemke's pivoting method for planar problems with exact Coulomb friction.

Algorithm: complementary pivoting on the linear complementarity problem in (lambda_n, lambda_+, lambda_-,
gamma), with lexicographic ratio test, after the velocities and bilateral rows have been eliminated. In the
plane the polyhedral cone is the exact one. Pivots are judged in units in which H and the Delassus matrix have
diagonals of about one. Sources: Lemke, Management Science 11 (1965) 681-689; Stewart and Trinkle, Int. J.
Numer. Methods Eng. 39 (1996) 2673-2691; Cottle, Pang, Stone: The Linear Complementarity Problem (1992),
section 4.9. Accepts: d = 2, H positive definite; R, b may have any values that leave the matrix copositive
(symmetric positive semidefinite Delassus blocks do). Promises: a solution or a ray in finitely many pivots; a
ray is a hint that there is no solution, not a proof.
"""

from __future__ import annotations

import math

import numpy as np

from rungwise.contact.linear import solve_in_place
from rungwise.contact.step.modes import BACKWARD, FORWARD, OPEN, STICK
from rungwise.contact.step.problem import ContactProblem
from rungwise.kernel import Ints, Reals, allocating_kernel, kernel

SOLVED, RAY, EXHAUSTED = 0, 1, 2
_PIVOT = 1e-11


@allocating_kernel
def solve_lemke(
    problem: ContactProblem,
    n: int,
    contacts: int,
    limited: int,
    mode: Ints,
    v: Reals,
    force: Reals,
    tau: Reals,
) -> int:
    """Fill mode, v, force and tau; returns SOLVED, RAY or EXHAUSTED. Allocates memory: it is called
    rarely."""
    rows, size = 2 * contacts + limited, 4 * contacts + 3 * limited
    x, y = _units(problem, n, contacts, limited)
    delassus, offset, response = _reduce(problem, n, contacts, limited, x, y)
    unit = 0.0
    for i in range(rows):
        unit = max(unit, abs(offset[i]))
    if not unit > 0.0:
        unit = 1.0
    z = np.zeros(size)
    status = _pivot(_tableau(problem, contacts, limited, delassus, offset, y, unit, size), z, size)
    if status != SOLVED:
        return status
    _unpack(contacts, limited, z, unit, mode, force, tau)
    for i in range(n):
        v[i] = x[i] * _respond(response, i, contacts, limited, force, tau)
    for r in range(limited):
        if math.isinf(problem.F[r]):
            tau[r] = _respond(response, n + r, contacts, limited, force, tau)
            mode[contacts + r] = STICK
    for r in range(2 * contacts):
        force[r] *= y[r]
    for r in range(limited):
        tau[r] *= y[2 * contacts + r]
    return SOLVED


@allocating_kernel
def _units(p: ContactProblem, n: int, contacts: int, limited: int) -> tuple[Reals, Reals]:
    """Units x of the velocities and y of the forces in which H has a unit diagonal and rows are about one.

    Both directions of a contact share one unit, so that friction coefficients stay the same.
    """
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
def _respond(response: Reals, i: int, contacts: int, limited: int, force: Reals, tau: Reals) -> float:
    """Unknown i of (v, joint forces) under the loads and these forces, all in their units."""
    total = response[i, 2 * contacts + limited]
    for r in range(2 * contacts):
        total += response[i, r] * force[r]
    for r in range(limited):
        total += response[i, 2 * contacts + r] * tau[r]
    return total


@allocating_kernel
def _reduce(
    p: ContactProblem, n: int, contacts: int, limited: int, x: Reals, y: Reals
) -> tuple[Reals, Reals, Reals]:
    """Delassus matrix and offset of contact and limited rows, and the response of (v, joint forces) to their
    forces.

    Everything is in the units x and y. Rows with infinite limit are joints: they are eliminated with v, and
    their own rows and columns come out zero.
    """
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
def _tableau(
    p: ContactProblem,
    contacts: int,
    limited: int,
    delassus: Reals,
    offset: Reals,
    y: Reals,
    unit: float,
    size: int,
) -> Reals:
    """Rows of w - M z - d z0 = q, columns [w, z, z0, q]; forces z are in units of y and `unit`."""
    sign = np.zeros(size)
    source = np.full(size, -1)
    for k in range(contacts):
        source[4 * k], sign[4 * k] = 2 * k, 1.0
        for s in range(2):
            source[4 * k + 1 + s], sign[4 * k + 1 + s] = 2 * k + 1, 1.0 - 2.0 * s
    for r in range(limited):
        for s in range(2):
            i = 4 * contacts + 3 * r + s
            source[i], sign[i] = 2 * contacts + r, 1.0 - 2.0 * s
    a = np.zeros((size, 2 * size + 2))
    for i in range(size):
        a[i, i] = 1.0
        a[i, 2 * size] = -1.0
        if source[i] >= 0:
            a[i, 2 * size + 1] = sign[i] * offset[source[i]] / unit
            for j in range(size):
                if source[j] >= 0:
                    a[i, size + j] -= sign[i] * sign[j] * delassus[source[i], source[j]]
    for k in range(contacts):
        gamma = 4 * k + 3
        a[gamma, size + 4 * k] -= p.mu[k]
        for s in range(1, 3):
            a[gamma, size + 4 * k + s] += 1.0
            a[4 * k + s, size + gamma] -= 1.0
    for r in range(limited):
        first = 4 * contacts + 3 * r
        bound = 0.0 if math.isinf(p.F[r]) else p.F[r] / (y[2 * contacts + r] * unit)
        a[first + 2, 2 * size + 1] = bound
        for s in range(2):
            a[first + 2, size + first + s] += 1.0
            a[first + s, size + first + 2] -= 1.0
    return a


@allocating_kernel
def _pivot(a: Reals, z: Reals, size: int) -> int:
    """Lemke's method on the tableau; fills z."""
    last = 2 * size + 1
    basis = np.arange(size)
    row = -1
    for i in range(size):
        if a[i, last] < 0.0 and (row < 0 or a[i, last] < a[row, last]):
            row = i
    if row < 0:
        return SOLVED
    entering = 2 * size
    for _ in range(50 + 20 * size):
        _eliminate(a, row, entering, size)
        leaving = basis[row]
        basis[row] = entering
        if leaving == 2 * size:
            for i in range(size):
                if basis[i] >= size:
                    z[basis[i] - size] = a[i, last]
            return SOLVED
        entering = leaving + size if leaving < size else leaving - size
        row = _ratio_test(a, entering, basis, size)
        if row < 0:
            return RAY
    return EXHAUSTED


@kernel
def _eliminate(a: Reals, row: int, column: int, size: int) -> None:
    width = 2 * size + 2
    inverse = 1.0 / a[row, column]
    for j in range(width):
        a[row, j] *= inverse
    a[row, column] = 1.0
    for i in range(size):
        factor = a[i, column]
        if i != row and factor != 0.0:
            for j in range(width):
                a[i, j] -= factor * a[row, j]
            a[i, column] = 0.0


@kernel
def _ratio_test(a: Reals, entering: int, basis: Ints, size: int) -> int:
    """The row that leaves: least lexicographic ratio of (q, B^-1) to the entering column; z0 first among
    equals."""
    last, best = 2 * size + 1, -1
    for i in range(size):
        if a[i, entering] > _PIVOT and (best < 0 or _less(a, i, best, entering, last, size)):
            best = i
    if best >= 0:
        for i in range(size):
            if basis[i] == 2 * size and a[i, entering] > _PIVOT:
                tie = a[i, last] / a[i, entering] - a[best, last] / a[best, entering]
                if tie <= _PIVOT:
                    return i
    return best


@kernel
def _less(a: Reals, i: int, j: int, entering: int, last: int, size: int) -> bool:
    x, y = a[i, last] / a[i, entering], a[j, last] / a[j, entering]
    if abs(x - y) > _PIVOT * max(1.0, abs(x), abs(y)):
        return x < y
    for c in range(size):
        x, y = a[i, c] / a[i, entering], a[j, c] / a[j, entering]
        if abs(x - y) > _PIVOT:
            return x < y
    return False


@kernel
def _unpack(contacts: int, limited: int, z: Reals, unit: float, mode: Ints, force: Reals, tau: Reals) -> None:
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
    if gamma > 0.0:
        return BACKWARD if plus > minus else FORWARD
    return STICK

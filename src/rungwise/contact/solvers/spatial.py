"""A step's problem in space: forces of contacts with an exact cone, from compiled code, judged there.

Algorithm: velocities are eliminated, v = H^-1 (c + W^T lambda + S^T tau), and the chain for small problems
(`small.solve_dense`) solves for the forces, from the forces of the last step. Accepts: H positive definite,
up to `MOST_LEFT` forces with limits. Promises: SOLVED only with a residual within `TOLERANCE`, computed from
the problem as it was given.
"""

from __future__ import annotations

import math

import numpy as np

from rungwise.contact.linear import factorise, solve_in_place, substitute
from rungwise.contact.solvers.gauss_seidel import DAMPINGS
from rungwise.contact.solvers.small import REFUSED, solve_dense
from rungwise.contact.step.modes import FORWARD, OPEN, STICK
from rungwise.contact.step.planar import GUESS, NO_SOLUTION, SOLVED, TOLERANCE
from rungwise.contact.step.problem import ContactProblem
from rungwise.contact.step.residual import residual
from rungwise.kernel import Ints, Reals, allocating_kernel, kernel

_FINER = 1e-6
"""Tolerance of the forces over the tolerance within which velocities are accepted; chosen by trial,
to a decade."""
_ROUNDS = 2
"""Times that velocities of holding rows are corrected; chosen by trial."""
_INSIDE = 1.0 - 1e-9
"""Part of the friction limit up to which a contact sticks; the gap to 1 is chosen by trial, to a decade."""


@allocating_kernel
def solve_spatial(
    problem: ContactProblem,
    n: int,
    contacts: int,
    limited: int,
    mode: Ints,
    v: Reals,
    force: Reals,
    tau: Reals,
) -> tuple[int, float, int]:
    """Solve, starting from `force` and `tau`, into these, v and the modes, where a contact that slips is
    FORWARD whatever its heading; returns (status, residual, stage)."""
    p, d = problem, problem.R.shape[1]
    rows = contacts * d
    size = rows + limited
    factors, order = p.H[:n, :n].copy(), np.empty(n, np.int64)
    if not factorise(factors, n, order):
        return NO_SOLUTION, math.inf, GUESS
    G, drift, answer = np.empty((size, n)), p.c[:n].copy(), np.empty((size, n))
    G[:rows], G[rows:] = p.W[:rows, :n], p.S[:limited, :n]
    substitute(factors, n, order, drift)
    for r in range(size):
        answer[r] = G[r]
        substitute(factors, n, order, answer[r])
    A, b = np.empty((size, size)), np.empty(size)
    for r in range(size):
        b[r] = p.w[r] if r < rows else p.w_s[r - rows]
        for i in range(n):
            b[r] += G[r, i] * drift[i]
        for s in range(size):
            A[r, s] = 0.0
            for i in range(n):
                A[r, s] += G[r, i] * answer[s, i]
    for k in range(contacts):
        A[k * d : k * d + d, k * d : k * d + d] += p.R[k]
    for r in range(limited):
        A[rows + r, rows + r] += p.R_s[r]
    start, x, y, found = np.empty(size), np.zeros(size), np.empty(size), np.empty(7)
    start[:rows], start[rows:] = force[:rows], tau[:limited]
    solver = REFUSED
    if size > 0:
        solver, _ = solve_dense(
            A, b, (p.mu[:contacts].copy(), d, -p.F[:limited], p.F[:limited].copy()), 0, start, True,
            _FINER * TOLERANCE, DAMPINGS, x, y, found,
        )  # fmt: skip
    v[:n] = drift
    for r in range(size):
        for i in range(n):
            v[i] += answer[r, i] * x[r]
    force[:rows], tau[:limited] = x[:rows], x[rows:]
    _tell_modes(p, contacts, limited, force, tau, mode)
    for _ in range(_ROUNDS):
        _hold(p, G, mode, force, tau[:limited], answer, v)
    error = residual(p, n, contacts, limited, v, force, tau)
    return SOLVED if error <= TOLERANCE and (solver != REFUSED or size == 0) else NO_SOLUTION, error, GUESS


@allocating_kernel
def _hold(p: ContactProblem, G: Reals, mode: Ints, force: Reals, tau: Reals, answer: Reals, v: Reals) -> None:
    """Add the least change of v, in the norm of H, that gives the holding rows of G their rates: v is a
    difference of forces, whose rounding would move these rows. `answer` is the change of v by each row's unit
    force."""
    rows, n = G.shape
    d, limited = p.R.shape[1], len(tau)
    of_contacts = rows - limited
    held, size = np.empty(rows, np.int64), 0
    for r in range(rows):
        of = mode[r // d] if r < of_contacts else mode[of_contacts // d + r - of_contacts]
        if of == STICK or (r < of_contacts and r % d == 0 and of != OPEN):
            held[size] = r
            size += 1
    a, order = np.empty((size, size + 1)), np.empty(size, np.int64)
    for i in range(size):
        r = held[i]
        b = r - of_contacts
        rate = p.w[r] if b < 0 else p.w_s[b] + p.R_s[b] * tau[b]
        for j in range(d if r < of_contacts else 0):
            rate += p.R[r // d, r % d, j] * force[r // d * d + j]
        for j in range(n):
            rate += G[r, j] * v[j]
        a[i, size] = -rate
        for s in range(size):
            a[i, s] = 0.0
            for j in range(n):
                a[i, s] += G[r, j] * answer[held[s], j]
    solve_in_place(a, size, 1, order)
    for i in range(size):
        for j in range(n):
            v[j] += answer[held[i], j] * a[i, size]


@kernel
def _tell_modes(p: ContactProblem, contacts: int, limited: int, force: Reals, tau: Reals, mode: Ints) -> None:
    d = p.R.shape[1]
    for k in range(contacts):
        rubs = 0.0
        for i in range(k * d + 1, k * d + d):
            rubs += force[i] * force[i]
        inside = math.sqrt(rubs) < _INSIDE * p.mu[k] * force[k * d]
        mode[k] = OPEN if force[k * d] <= 0.0 else STICK if inside else FORWARD
    for r in range(limited):
        mode[contacts + r] = STICK if abs(tau[r]) < _INSIDE * p.F[r] else FORWARD

"""Block Gauss-Seidel with exact local solves; for small systems in turn with Newton steps.

Algorithm: contacts (see `one_contact`) and limited rows in turn, each solved exactly while the others' forces
are held. Up to `SMALL` unknowns a few sweeps, which find the contacts that stick, slide and open, alternate
with the steps of `newton`, which finish fast where these modes are right, while a round halves the residual;
larger systems fall apart into their islands first. Source: Jourdan, Alart, Jean, Comput. Methods Appl. Mech.
Eng. 155 (1998) 31-47.
Accepts: any number of directions, A nonsymmetric, dense or sparse, with positive diagonal in normal and
limited rows, free unknowns eliminated; not large systems of few velocities, which Newton steps solve sooner,
nor a few planar contacts or limited rows, which pivoting does.
Promises: the iterate of least residual among the checked iterates; linear convergence where the problem is
well posed, none where it is badly rank deficient.
"""

from __future__ import annotations

import math

import numpy as np

from rungwise.contact.judge.natural import natural_map
from rungwise.contact.prepare.islands import Islands, islands
from rungwise.contact.prepare.product import FEW
from rungwise.contact.prepare.system import System
from rungwise.contact.prepare.units import expand
from rungwise.contact.problem import Array
from rungwise.contact.solvers.measure import distance, rates, row_times
from rungwise.contact.solvers.newton_dense import VECTORS, descend_dense
from rungwise.contact.solvers.one_contact import solve_contact
from rungwise.contact.solvers.work import Work
from rungwise.kernel import Ints, Reals, copy, inner_kernel, kernel

NAME = "gauss-seidel"
SMALL, SWEEPS = 200, 40
"""Unknowns up to which sweeps alternate with Newton steps; sweeps of larger systems. Chosen by trial."""
_FEW_VELOCITIES = 150
"""Unknowns from which on systems of few velocities are solved sooner by steps in the velocities."""
_ROUNDS, _STEPS = 8, 6
"""Most rounds of sweeps and Newton steps, and most steps of a round; chosen by trial."""
_NEAR, _ROUGH, _EXACT = 1e-2, 0.3, 1e-8
"""A residual, in scaled units, that is near; relative errors from which one more step, which squares them, is
enough for the slip of a contact, in first rounds and later. Chosen by trial; the last squares to rounding."""
DAMPINGS = np.array([1e-8, 1e-4])
"""Multiples of |F| on the diagonal where Newton steps fail: the two lightest of `newton`, by trial."""
_WINDOW = 20
"""Sweeps over which the rate of decrease is measured; chosen by trial."""
_PATIENCE, _FEW = 300, 12
"""Most sweeps where the rate of decrease promises an end; unfolded unknowns of the problems that are left to
pivoting. Chosen by trial."""
_CHECK = 10
"""Sweeps from one residual to the next; chosen by trial."""


def accepts(system: System) -> bool:
    if (
        system.condensed is not None
        and system.condensed.own.shape[0] <= system.size // FEW
        and system.size > _FEW_VELOCITIES
    ):
        apart = islands(system)
        if apart is None or np.diff(apart.first).max() > _FEW_VELOCITIES:
            return False
    return bool(accepts_rows(system.directions, system.blocks, system.diagonal))


@kernel
def accepts_rows(d: int, blocks: Reals, diagonal: Reals) -> bool:
    """Whether the solver accepts these rows, as `accepts`, but for any size."""
    if (len(blocks) == 0 or d == 2) and 4 * len(blocks) + len(diagonal) <= _FEW:
        return False
    damped = True
    for k in range(len(blocks)):
        damped = damped and blocks[k, 0, 0] > 0.0
    for j in range(len(diagonal)):
        damped = damped and diagonal[j] > 0.0
    return damped


def solve(system: System, start: Array, tol: float, work: Work) -> tuple[Array, int]:
    """The best iterate x (N,) from `start`, and its sweeps (and steps), or the most that an island took."""
    s, n = system, system.size
    if n > SMALL and (apart := islands(system)) is not None:
        best, sweeps = _solve_apart(apart, start, tol)
        work.spend(sweeps * len(s.value))
        return best, sweeps
    x, best = start.copy(), start.copy()
    if 0 < n <= SMALL:
        done = alternate(
            s.row_start, s.column, s.value, s.dense(), s.blocks, s.diagonal, s.b, s.mu, s.lower, s.upper, x,
            best, tol, *workspace(n),
        )  # fmt: skip
        return best, done
    sweeps = sweep_until(
        s.row_start, s.column, s.value, s.blocks, s.diagonal, s.b, 0.0, s.mu, s.lower, s.upper, x, best,
        np.empty((3, max(s.size, 3))), tol, SWEEPS, _PATIENCE,
    )  # fmt: skip
    work.spend(sweeps * len(s.value))
    return best, sweeps


def _solve_apart(apart: Islands, start: Array, tol: float) -> tuple[Array, int]:
    a, x = apart, apart.inwards(start)
    best = x.copy()
    n = min(int(np.diff(a.first).max()), SMALL)
    done = each(
        a.first, a.contacts, a.row_start, a.column, a.value, a.blocks, a.diagonal, a.b, a.mu, a.lower,
        a.upper, x, best, a.goals(tol), DAMPINGS, np.empty(2 * n * n),
        np.empty(max(VECTORS * n, 3 * len(x))), np.empty(4 * n, np.int64),
    )  # fmt: skip
    return a.outwards(best), done


def smooth(system: System, start: Array, b: Array, shift: float, tol: float, sweeps: int) -> Array:
    """The best iterate of A + shift, with this offset b, in `sweeps` sweeps at most."""
    s = system
    x, best = start.copy(), start.copy()
    sweep_until(
        s.row_start, s.column, s.value, s.blocks, s.diagonal, b, shift, s.mu, s.lower, s.upper, x, best,
        np.empty((3, max(s.size, 3))), tol, sweeps, sweeps,
    )  # fmt: skip
    return best


def workspace(n: int) -> tuple[Array, Array, Array, Ints]:
    """Dampings and scratch for `alternate` with n unknowns."""
    return DAMPINGS, np.empty((n, n)), np.empty((VECTORS, n)), np.empty(4 * n, np.int64)


@kernel
def each(
    first: Ints,
    contacts: Ints,
    row_start: Ints,
    column: Ints,
    value: Reals,
    blocks: Reals,
    diagonal: Reals,
    b: Reals,
    mu: Reals,
    lower: Reals,
    upper: Reals,
    x: Reals,
    best: Reals,
    tol: Reals,
    dampings: Reals,
    square: Reals,
    vectors: Reals,
    order: Ints,
) -> int:
    """Improve x, of which `best` is a copy, island by island; returns the most sweeps and steps of one.

    square (2 n^2,), vectors (16 n or more,) and order (4 n,) are scratch, n the size of the largest island or
    `SMALL` at most.
    """
    d, most = blocks.shape[1], 0
    for i in range(len(tol)):
        low, high, c, e = first[i], first[i + 1], contacts[i], contacts[i + 1]
        n, f, g = high - low, low - d * c, high - d * e
        rows, own, free = row_start[low : high + 1], blocks[c:e], diagonal[f:g]
        if n > SMALL:
            scratch = vectors[: 3 * max(n, 3)].reshape(3, max(n, 3))
            done = sweep_until(
                rows, column, value, own, free, b[low:high], 0.0, mu[c:e], lower[f:g], upper[f:g],
                x[low:high], best[low:high], scratch, tol[i], SWEEPS, _PATIENCE,
            )  # fmt: skip
        else:
            A = square[: n * n].reshape(n, n)
            for k in range(n * n):
                square[k] = 0.0
            expand(rows, column, value, A)
            done = alternate(
                rows, column, value, A, own, free, b[low:high], mu[c:e], lower[f:g], upper[f:g], x[low:high],
                best[low:high], tol[i], dampings, square[n * n : 2 * n * n].reshape(n, n),
                vectors[: VECTORS * n].reshape(VECTORS, n), order[: 4 * n],
            )  # fmt: skip
        most = max(most, done)
    return most


@inner_kernel
def alternate(
    row_start: Ints,
    column: Ints,
    value: Reals,
    A: Reals,
    blocks: Reals,
    diagonal: Reals,
    b: Reals,
    mu: Reals,
    lower: Reals,
    upper: Reals,
    x: Reals,
    best: Reals,
    tol: float,
    dampings: Reals,
    factors: Reals,
    vectors: Reals,
    order: Ints,
) -> int:
    """Improve x (N,), of which `best` is a copy, until its residual is within tol; returns sweeps and steps.

    In space the kernel begins with Newton steps where x is near a solution, and goes back to no forces where
    these steps end on a kink: no start is worse than none. Where most contacts will stick, one step is tried
    first and often is enough (in the plane sweeps cost less).
    """
    d, n, done = blocks.shape[1], len(x), 0
    coupled = row_start[n] > row_start[0] + d * n
    least, near = math.inf, False
    if d == 3:
        least = distance(row_start, column, value, b, 0.0, x, mu, d, lower, upper, vectors)
        near = least < _NEAR
    given = least
    if d == 3 and not near and _mostly_sticks(x, vectors[0], mu):
        start = vectors[VECTORS - 1]
        copy(x, start)
        done += descend_dense(
            row_start, column, value, A, b, 0.0, mu, d, lower, upper, x, 0.3 * tol, 1, dampings, factors,
            vectors, order,
        )  # fmt: skip
        found = distance(row_start, column, value, b, 0.0, x, mu, d, lower, upper, vectors)
        if found < least:
            least = found
            copy(x, best)
        if least <= tol:
            return done
        copy(start, x)
    for afresh in range(2 if near else 1):
        reached = given
        if afresh:
            reached = math.inf
            for i in range(n):
                x[i] = 0.0
        for turn in range(_ROUNDS):
            before, warm = reached, turn == 0 and near and not afresh
            if not warm:
                accuracy = _ROUGH if turn < 2 and coupled else _EXACT
                for _ in range(1 << turn):
                    _sweep(
                        row_start, column, value, blocks, diagonal, b, 0.0, mu, lower, upper, accuracy, x,
                        vectors[3],
                    )  # fmt: skip
                done += 1 << turn
            if warm or turn > 0:
                done += descend_dense(
                    row_start, column, value, A, b, 0.0, mu, d, lower, upper, x, 0.3 * tol, _STEPS, dampings,
                    factors, vectors, order,
                )  # fmt: skip
            found = distance(row_start, column, value, b, 0.0, x, mu, d, lower, upper, vectors)
            reached = min(reached, found)
            if found < least:
                least = found
                copy(x, best)
            if least <= tol:
                return done
            if turn > 1 and not reached < 0.5 * before:
                break
    return done


@inner_kernel
def _mostly_sticks(x: Reals, y: Reals, mu: Reals) -> bool:
    """Whether, by forces x (N,) less rates y (N,), several contacts stick, and at least as many as slide."""
    stick, slide = 0, 0
    for k in range(len(mu)):
        n = x[3 * k] - y[3 * k]
        if n > 0.0:
            s, t = x[3 * k + 1] - y[3 * k + 1], x[3 * k + 2] - y[3 * k + 2]
            if s * s + t * t <= (mu[k] * n) ** 2:
                stick += 1
            else:
                slide += 1
    return stick > 1 and stick >= slide


@kernel
def sweep_until(
    row_start: Ints,
    column: Ints,
    value: Reals,
    blocks: Reals,
    diagonal: Reals,
    b: Reals,
    shift: float,
    mu: Reals,
    lower: Reals,
    upper: Reals,
    x: Reals,
    best: Reals,
    scratch: Reals,
    tol: float,
    sweeps: int,
    patience: int,
) -> int:
    """Sweep until the residual of x is within tol; `best` (N,) gets the best iterate. Returns the sweeps.

    There are up to `sweeps` of them, or up to `patience` where the last rate of decrease would then suffice.
    """
    d, y, out = blocks.shape[1], scratch[0], scratch[1]
    least, before = math.inf, math.inf
    for done in range(1, patience + 1):
        _sweep(row_start, column, value, blocks, diagonal, b, shift, mu, lower, upper, _EXACT, x, scratch[2])
        if done > 3 and done % _CHECK:
            continue
        rates(row_start, column, value, b, shift, x, y)
        found = natural_map(x, y, mu, d, lower, upper, out)
        if found < least:
            least = found
            for i in range(len(x)):
                best[i] = x[i]
        if found <= tol or not found < math.inf:
            return done
        if done % _WINDOW == 0:
            if done >= sweeps and not (patience - done) / _WINDOW * math.log(before / least) > math.log(
                least / tol
            ):
                return done
            before = least
    return patience


@inner_kernel
def _sweep(
    row_start: Ints,
    column: Ints,
    value: Reals,
    blocks: Reals,
    diagonal: Reals,
    b: Reals,
    shift: float,
    mu: Reals,
    lower: Reals,
    upper: Reals,
    accuracy: float,
    x: Reals,
    local: Reals,
) -> None:
    """Solve each contact and limited row once, the slip of contacts in space to this relative accuracy."""
    d, rows = blocks.shape[1], blocks.shape[1] * len(mu)
    for c in range(len(mu)):
        first = c * d
        for i in range(d):
            total = b[first + i] + row_times(row_start, column, value, first + i, x)
            for j in range(d):
                total -= blocks[c, i, j] * x[first + j]
            local[i] = total
        solve_contact(blocks[c], shift, local, mu[c], accuracy, x[first : first + d])
    for j in range(len(lower)):
        i = rows + j
        total = b[i] + row_times(row_start, column, value, i, x)
        x[i] = min(max((diagonal[j] * x[i] - total) / (diagonal[j] + shift), lower[j]), upper[j])

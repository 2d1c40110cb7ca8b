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
from rungwise.contact.prepare.system import Form, System
from rungwise.contact.prepare.units import Sparse, expand
from rungwise.contact.problem import Array, Laws
from rungwise.contact.solvers.measure import distance, rates, row_times
from rungwise.contact.solvers.newton.dense import VECTORS, Scratch, descend_dense, scratch_for
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
    return bool(accepts_rows(system.directions, system.form.blocks, system.form.diagonal))


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
        best, sweeps = _solve_apart(apart, start, tol, work.halt)
        work.spend(sweeps * len(s.form.entries.value))
        return best, sweeps
    x, best = start.copy(), start.copy()
    if 0 < n <= SMALL:
        done = alternate(s.form, s.dense(), s.b, s.laws, x, best, tol, DAMPINGS, scratch_for(n))
        return best, done
    scratch = np.empty((3, max(n, 3)))
    sweeps = sweep_until(s.form, s.b, 0.0, s.laws, x, best, scratch, tol, SWEEPS, _PATIENCE, work.halt)
    work.spend(sweeps * len(s.form.entries.value))
    return best, sweeps


def _solve_apart(apart: Islands, start: Array, tol: float, halt: Ints) -> tuple[Array, int]:
    a, x = apart, apart.inwards(start)
    best = x.copy()
    n = min(int(np.diff(a.first).max()), SMALL)
    vectors = np.empty(max(VECTORS * n, 3 * len(x)))
    scratch = Scratch(np.empty(2 * n * n), vectors, np.empty(4 * n, np.int64))
    done = each(a.first, a.contacts, a.form, a.b, a.laws, x, best, a.goals(tol), DAMPINGS, scratch, halt)
    return a.outwards(best), done


def smooth(
    system: System, start: Array, b: Array, shift: float, tol: float, sweeps: int, halt: Ints
) -> Array:
    """The best iterate of A + shift, with this offset b, in `sweeps` sweeps at most; see `sweep_until`."""
    s = system
    x, best = start.copy(), start.copy()
    scratch = np.empty((3, max(s.size, 3)))
    sweep_until(s.form, b, shift, s.laws, x, best, scratch, tol, sweeps, sweeps, halt)
    return best


@kernel
def each(
    first: Ints,
    contacts: Ints,
    form: Form,
    b: Reals,
    laws: Laws,
    x: Reals,
    best: Reals,
    tol: Reals,
    dampings: Reals,
    scratch: Scratch,
    halt: Ints,
) -> int:
    """Improve x, of which `best` is a copy, island by island; returns the most sweeps and steps of one.

    The scratch is flat: factors (2 n^2,), vectors (16 n or more,) and order (4 n,), n the size of the largest
    island or `SMALL` at most.
    """
    square, vectors, order = scratch
    entries, d, most = form.entries, laws.d, 0
    for i in range(len(tol)):
        if halt[0] != 0:
            break
        low, high, c, e = first[i], first[i + 1], contacts[i], contacts[i + 1]
        n, f, g = high - low, low - d * c, high - d * e
        rows = Sparse(entries.start[low : high + 1], entries.place, entries.value)
        own = Form(rows, form.blocks[c:e], form.diagonal[f:g])
        its = Laws(laws.mu[c:e], d, laws.lower[f:g], laws.upper[f:g])
        if n > SMALL:
            done = sweep_until(
                own, b[low:high], 0.0, its, x[low:high], best[low:high],
                vectors[: 3 * max(n, 3)].reshape(3, max(n, 3)), tol[i], SWEEPS, _PATIENCE,
                halt,
            )  # fmt: skip
        else:
            A = square[: n * n].reshape(n, n)
            for k in range(n * n):
                square[k] = 0.0
            expand(rows, A)
            factors = square[n * n : 2 * n * n].reshape(n, n)
            done = alternate(
                own, A, b[low:high], its, x[low:high], best[low:high], tol[i], dampings,
                Scratch(factors, vectors[: VECTORS * n].reshape(VECTORS, n), order[: 4 * n]),
            )  # fmt: skip
        most = max(most, done)
    return most


@inner_kernel
def alternate(
    form: Form,
    A: Reals,
    b: Reals,
    laws: Laws,
    x: Reals,
    best: Reals,
    tol: float,
    dampings: Reals,
    scratch: Scratch,
) -> int:
    """Improve x (N,), of which `best` is a copy, until its residual is within tol; returns sweeps and steps.

    In space the kernel begins with Newton steps where x is near a solution, and goes back to no forces where
    these steps end on a kink: no start is worse than none. Where most contacts will stick, one step is tried
    first and often is enough (in the plane sweeps cost less).
    """
    entries, vectors = form.entries, scratch.vectors
    d, n, done = laws.d, len(x), 0
    coupled = entries.start[n] > entries.start[0] + d * n
    least, near = math.inf, False
    if d == 3:
        least = distance(entries, b, 0.0, x, laws, vectors)
        near = least < _NEAR
    given = least
    if d == 3 and not near and _mostly_sticks(x, vectors[0], laws.mu):
        start = vectors[VECTORS - 1]
        copy(x, start)
        done += descend_dense(entries, A, b, 0.0, laws, x, 0.3 * tol, 1, dampings, scratch)
        found = distance(entries, b, 0.0, x, laws, vectors)
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
                    _sweep(form, b, 0.0, laws, accuracy, x, vectors[3])
                done += 1 << turn
            if warm or turn > 0:
                done += descend_dense(entries, A, b, 0.0, laws, x, 0.3 * tol, _STEPS, dampings, scratch)
            found = distance(entries, b, 0.0, x, laws, vectors)
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
    form: Form,
    b: Reals,
    shift: float,
    laws: Laws,
    x: Reals,
    best: Reals,
    scratch: Reals,
    tol: float,
    sweeps: int,
    patience: int,
    halt: Ints,
) -> int:
    """Sweep until the residual of x is within tol; `best` (N,) gets the best iterate. Returns the sweeps.

    There are up to `sweeps` of them, or up to `patience` where the last rate of decrease would then suffice;
    none follows once halt (1,) is set.
    """
    y, out = scratch[0], scratch[1]
    least, before = math.inf, math.inf
    for done in range(1, patience + 1):
        if halt[0] != 0:
            return done
        _sweep(form, b, shift, laws, _EXACT, x, scratch[2])
        if done > 3 and done % _CHECK:
            continue
        rates(form.entries, b, shift, x, y)
        found = natural_map(x, y, laws, out)
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
def _sweep(form: Form, b: Reals, shift: float, laws: Laws, accuracy: float, x: Reals, local: Reals) -> None:
    """Solve each contact and limited row once, the slip of contacts in space to this relative accuracy."""
    (entries, blocks, diagonal), (mu, d, lower, upper) = form, laws
    rows = d * len(mu)
    for c in range(len(mu)):
        first = c * d
        for i in range(d):
            total = b[first + i] + row_times(entries, first + i, x)
            for j in range(d):
                total -= blocks[c, i, j] * x[first + j]
            local[i] = total
        solve_contact(blocks[c], shift, local, mu[c], accuracy, x[first : first + d])
    for j in range(len(lower)):
        i = rows + j
        total = b[i] + row_times(entries, i, x)
        x[i] = min(max((diagonal[j] * x[i] - total) / (diagonal[j] + shift), lower[j]), upper[j])

"""Nonsmooth Newton steps on the map of Alart and Curnier, globalised.

Algorithm: F(x) = x - Q(x - rho y) with Q the projection on the half-line of normal forces, on the disc of
radius mu max(0, x_n - rho y_n), and on the limits of other unknowns. A step of the generalised Jacobian is
shortened until |F| decreases; where the Jacobian is singular or the step leads nowhere, steps with a multiple
of |F| added to its diagonal, as if contacts yielded, are tried instead. Sources: Alart and Curnier, Comput.
Methods Appl. Mech. Eng. 92 (1991) 353-375; Qi and Sun, Math. Program. 58 (1993) 353-367.
Solvers finish with these steps. Accepts: everything: mixed forms with singular H, nonsymmetric, dense or
sparse. Promises: |F| never grows;
locally quadratic convergence, also to one of many solutions; from afar it may stall, and then ends early.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import scipy.sparse as sp

from rungwise.contact.prepare import rank
from rungwise.contact.prepare.system import System
from rungwise.contact.problem import Array, Matrix
from rungwise.contact.solvers.measure import all_rates, natural
from rungwise.contact.solvers.newton.condensed import solver
from rungwise.contact.solvers.newton.dense import (
    LEAST,
    WINDOW,
    alart_curnier,
    descend_dense,
    scratch_for,
)
from rungwise.contact.solvers.newton.factors import SMALL, factors
from rungwise.contact.solvers.settings import CHORDS, HALVINGS
from rungwise.contact.solvers.work import Work

Solve = Callable[[Array], Array]
Linear = Callable[[float], Solve | None]
DAMPINGS = (1e-8, 1e-4, 1e-2, 1.0, 1e2)
"""Multiples of |F| that are tried on the diagonal, in turn, where Newton steps fail; chosen by trial, two to
four decades apart."""
_LAST, _LIGHT, _ROUNDS, _FALL = 5, (1e-8, 1e-4), 4, 0.1
"""Steps and dampings of iterates that are near and must be finished; rounds of these steps, and the factor by
which each round must lower the residual. Chosen by trial."""


def finish(
    system: System, A: Matrix | None, start: Array, tol: float, work: Work, early: bool = False
) -> tuple[Array, float]:
    """The point to which a few steps from `start` lead, and the residual there; A as `form` gives it. More
    steps follow while they lead fast to a solution; with `early` only one step is made at first.
    """
    x, least = start, natural(system, start)
    steps, dampings = (1, ()) if early else (_LAST, _LIGHT)
    for _ in range(_ROUNDS):
        before = least
        x, _ = descend(system, A, x, system.b, 0.0, tol, steps, work, dampings)
        least = natural(system, x)
        if not tol < least < _FALL * before:
            break
        steps, dampings = _LAST, _LIGHT
    return x, least


def form(system: System) -> Matrix | None:
    """A in the form for the steps: dense when small; None where the system has a product."""
    if system.product is not None:
        return None
    return system.dense() if system.size <= SMALL else system.matrix()


def descend(
    system: System,
    A: Matrix | None,
    start: Array,
    b: Array,
    shift: float,
    tol: float,
    steps: int,
    work: Work,
    dampings: tuple[float, ...] = DAMPINGS,
) -> tuple[Array, int]:
    """Newton on the system A + shift with offset b; `dampings`, times |F|, are tried where its steps fail."""
    if isinstance(A, np.ndarray):
        x, done = _descend_small(system, A, start, b, shift, tol, steps, dampings)
        work.spend((done + 1) * float(len(x)) ** 3)
        return x, done
    s, x = system, start
    y, F = np.empty(s.size), np.empty(s.size)
    derivative = np.zeros((s.size, 3))
    rho = 1.0 / (1.0 + shift)

    def merit(x: Array) -> float:
        all_rates(s, x, b, shift, y)
        return alart_curnier(x, y, s.laws, rho, F, derivative)

    size = earlier = merit(x)
    for done in range(steps):
        if size <= tol or work.is_spent or not math.isfinite(size):
            return x, done
        if done and done % WINDOW == 0:
            if size > 0.5 * earlier:
                return x, done
            earlier = size
        linear = _linear(system, A, derivative.copy(), rho, shift, work)
        found = _step(linear, F.copy(), x, size, merit, dampings)
        if found is None:
            return x, done
        moved, newer, solve = found
        ratio, x, size = newer / size, moved, newer
        # Again with the same factors, if these steps are likely to be enough.
        for _ in range(CHORDS if size * ratio**CHORDS <= tol < size else 0):
            moved = x - solve(F)
            newer = merit(moved)
            if not newer < size:
                merit(x)
                break
            x, size = moved, newer
            if size <= tol:
                break
    return x, steps


def _descend_small(
    system: System,
    A: Array,
    start: Array,
    b: Array,
    shift: float,
    tol: float,
    steps: int,
    dampings: tuple[float, ...],
) -> tuple[Array, int]:
    x, scratch = start.copy(), scratch_for(system.size)
    done = descend_dense(
        system.form.entries, A, b, shift, system.laws, x, tol, steps, np.array(dampings), scratch
    )
    return x, done


def _step(
    linear: Linear,
    F: Array,
    x: Array,
    size: float,
    merit: Callable[[Array], float],
    dampings: tuple[float, ...],
) -> tuple[Array, float, Solve] | None:
    """The point where a shorter Newton step, or a damped step, makes |F| smaller, and the solver of that
    step; None when no step does."""
    solve = linear(0.0)
    if solve is not None and np.isfinite(step := solve(F)).all():
        length = 1.0
        for _ in range(HALVINGS):
            moved = x - length * step
            newer = merit(moved)
            if newer <= (1.0 - 1e-2 * length) * size:
                return moved, newer, solve
            length *= 0.5
    for damping in dampings:
        solve = linear(damping * size)
        if solve is None or not np.isfinite(step := solve(F)).all():
            continue
        moved = x - step
        newer = merit(moved)
        if newer <= (1.0 - 1e-4) * size:
            return moved, newer, solve
    return None


def _linear(
    system: System, A: Matrix | None, derivative: Array, rho: float, shift: float, work: Work
) -> Linear:
    """How to solve with I + damping - D + rho D (A + shift), D the derivative of the projections, in blocks.

    Where contacts stick, a damped step is the Newton step of a problem in which they yield a little.
    """
    s, d, kept = system, system.directions, 1.0 - rho * shift
    i = np.arange(s.size)
    own = np.where(i < s.rows, i % d, 0)
    if (condensed := rank.parts(s)) is not None:
        E = -kept * derivative
        E[i, own] += 1.0

        def lifted(damping: float) -> Solve | None:
            yielding = E.copy()
            yielding[i, own] += max(damping, LEAST)
            made = solver(condensed, s.rows, d, yielding, rho * derivative)
            if made is None:
                return None
            work.spend_factors(made.entries)
            return made.solve

        return lifted
    width = np.where(i < s.rows, d, 1)
    row = np.repeat(i, width)
    place = np.arange(len(row)) - np.repeat(np.cumsum(width) - width, width)
    D = sp.csr_array((derivative[row, place], (row, row - own[row] + place)), shape=(s.size, s.size))
    J = sp.eye_array(s.size) - kept * D + rho * (D @ A)

    def sparse(damping: float) -> Solve | None:
        made = factors(J + max(damping, LEAST) * sp.eye_array(s.size), "COLAMD")
        if made is None:
            return None
        work.spend_factors(made.entries)
        return made.solve

    return sparse

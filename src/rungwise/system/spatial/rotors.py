"""Joined bodies that turn: inertial forces by which a step adds no energy, however fast rotors are.

With v where a step begins and v' where it ends, inertial forces B(v, v) are those of its begin: they turn
the speeds of a fast rotor's axis, explicitly, so that these grow in each step. Here they are B(v, v'), to
second order those of the middle: W. Kahan's method for quadratic equations of motion (M. Petrera, A. Pfadler,
Y. B. Suris, Regular and Chaotic Dynamics 16, 2011, 245-289). v' is that of a step with all loads, springs,
dampers and servos, but without contacts, which keep their own directions: B(v, v' - v) is found before it.
At rest it is nothing. Free bodies keep their momentum in another way (see `spins`).
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from rungwise.contact.linear import factorise, substitute
from rungwise.kernel import Ints, Reals, kernel, steady
from rungwise.system.moving import Moment
from rungwise.system.terms import Terms

if TYPE_CHECKING:
    import mujoco

_REPEATS, _SETTLED = 12, 1e-6
"""Repetitions at most, beyond which linear equations are solved, and the change of v', over v, that ends
them."""


class Rotors:
    """What adds these forces to the terms of a model whose velocities are `joined` (n,) if they are not those
    of free bodies."""

    def __init__(self, model: mujoco.MjModel, joined: Ints) -> None:
        import mujoco

        self._mujoco, self._model, self._joined = mujoco, model, joined
        n, trees = model.nv, np.stack([model.tree_dofadr, model.tree_dofnum], axis=1).astype(np.int64)
        self._trees = trees[joined[trees[:, 0]] == 1]
        side = int(self._trees[:, 1].max(initial=0))
        self._matrix, self._order = np.zeros((len(self._trees), side, side)), np.zeros((len(trees), side), int)
        self._given, self._still = np.zeros(n), np.zeros(n)
        self._forward, self._backward, self._row = np.zeros(n), np.zeros(n), np.zeros(n)
        self._old, self._change, self._before = np.zeros(n), np.zeros(n), np.zeros(n)
        self._prepare, self._solve = steady(prepare), steady(solve)

    def fill(self, data: mujoco.MjData, moment: Moment, pace: Reals, terms: Terms, taken: Reals) -> bool:
        """Take eps B(v, v' - v) off the load, and add it to `taken` (n,), of terms that are filled but for
        it; `pace` (n,): speeds, nan where free. False where nothing joined moves."""
        old, change, eps = self._old, self._change, float(moment.inertia)
        np.multiply(moment.v, self._joined, out=old)
        if not old.any():
            return False
        self._prepare(self._trees, moment.h, eps, old, pace, terms, self._matrix, self._given, self._order)
        self._solve_for(self._still, pace, change)
        size, last = float(np.abs(old).max()), math.inf
        for _ in range(_REPEATS):
            force, self._before[:] = eps * self._turned(data, old, change), change
            self._solve_for(force, pace, change)
            moved = float(np.abs(change - self._before).max())
            if moved <= _SETTLED * size:
                break
            if not moved < 0.5 * last:
                self._prepare(
                    self._trees, moment.h, eps, old, pace, terms, self._matrix, self._given, self._order[:0]
                )
                force = self._turned_directly(data, old, eps, pace)
                break
            last = moved
        if not np.isfinite(force).all():
            return False
        terms.load[:] -= force
        taken += force
        return True

    def _solve_for(self, force: Reals, pace: Reals, change: Reals) -> None:
        self._solve(self._trees, self._matrix, self._order, self._given, force, pace, self._row, change)

    def _turned(self, d: mujoco.MjData, v: Reals, w: Reals) -> Reals:
        """B(v, w): as B is of second degree in speeds, a quarter of its difference at v + w and v - w."""
        self._inertial(d, v + w, self._forward)
        self._inertial(d, v - w, self._backward)
        return np.asarray(0.25 * (self._forward - self._backward))

    def _inertial(self, d: mujoco.MjData, v: Reals, force: Reals) -> None:
        d.qvel[:] = v
        self._mujoco.mj_comVel(self._model, d)
        self._mujoco.mj_rne(self._model, d, 0, force)

    def _turned_directly(self, d: mujoco.MjData, v: Reals, eps: float, pace: Reals) -> Reals:
        """eps B(v, v' - v) by the linear equations for v' - v."""
        n, unit, size = len(v), np.zeros(len(v)), float(np.abs(v).max())
        turns, whole = np.zeros((n, n)), np.eye(n)
        for i in np.flatnonzero(self._joined):
            unit[i] = size
            turns[:, i] = eps * self._turned(d, v, unit) / size
            unit[i] = 0.0
        for (first, count), matrix in zip(self._trees.tolist(), self._matrix, strict=True):
            whole[first : first + count, first : first + count] = matrix[:count, :count]
        free = np.isnan(pace)
        whole[free] += turns[free]
        return np.asarray(turns @ np.linalg.solve(whole, self._given), float)


@kernel
def prepare(
    trees: Ints, h: float, eps: float, v: Reals, pace: Reals, terms: Terms, matrix: Reals, given: Reals,
    order: Ints,
) -> None:  # fmt: skip
    """Fill in the equations for the change w of velocities v (n,) in a step of length h: matrix (t, k, k), a
    block for each of the trees (t, 2), and given (n,). Where `order` (t, k) is not empty, blocks become their
    factors (see `factorise`). Servos are taken as within their limits where they are so at v."""
    given[:] = 0.0
    for t in range(trees.shape[0]):
        first, count, a = trees[t, 0], trees[t, 1], matrix[t]
        for i in range(count):
            at, total = first + i, terms.load[first + i]
            for j in range(count):
                held = h * terms.stiffness[at, first + j] + terms.damping[at, first + j]
                total -= held * v[first + j]
                a[i, j] = eps / h * terms.inertia[at, first + j] + held
            given[at] = total
        for r in range(terms.limit.shape[0]):
            _enter_servo(terms, r, h, v, first, count, a, given)
        for i in range(count):
            if not math.isnan(pace[first + i]):
                a[i, :] = 0.0
                a[i, i], given[first + i] = 1.0, pace[first + i] - v[first + i]
        if order.shape[0] > 0:
            factorise(a, count, order[t])


@kernel
def _enter_servo(
    terms: Terms, r: int, h: float, v: Reals, first: int, count: int, a: Reals, given: Reals
) -> None:
    """Add limited row r to the equations of a tree, where it is a servo."""
    gain, row = h * terms.gains[r, 0] + terms.gains[r, 1], terms.limited[r]
    if gain == 0.0 or math.isinf(gain):
        return
    force = terms.gains[r, 0] * terms.error[r, 0] + terms.gains[r, 1] * terms.error[r, 1]
    for i in range(count):
        force -= gain * row[first + i] * v[first + i]
    limit = terms.limit[r]
    for i in range(count):
        given[first + i] += row[first + i] * min(max(force, -limit), limit)
        if abs(force) < limit and row[first + i] != 0.0:
            for j in range(count):
                a[i, j] += gain * row[first + i] * row[first + j]


@kernel
def solve(
    trees: Ints, factors: Reals, order: Ints, given: Reals, force: Reals, pace: Reals, row: Reals, change: Reals
) -> None:
    """Fill change (n,) with the solution of these equations where forces (n,) act against it; row (n,) is
    scratch."""
    change[:] = 0.0
    for t in range(trees.shape[0]):
        first, count = trees[t, 0], trees[t, 1]
        for i in range(count):
            row[i] = given[first + i] - (force[first + i] if math.isnan(pace[first + i]) else 0.0)
        substitute(factors[t], count, order[t], row)
        for i in range(count):
            change[first + i] = row[i]

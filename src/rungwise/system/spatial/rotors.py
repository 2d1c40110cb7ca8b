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

from rungwise.block import Block
from rungwise.contact.linear import factorise, substitute
from rungwise.contact.step import stretch
from rungwise.kernel import Ints, Reals, copy, kernel, rare_kernel
from rungwise.system.moving import Moment
from rungwise.system.spatial.loads import Loads, fill_fall
from rungwise.system.spatial.native import DATA, MODEL, mj_comVel, mj_rne
from rungwise.system.terms import Terms

if TYPE_CHECKING:
    import mujoco

_REPEATS, _SETTLED = 12, 1e-8
"""Repetitions at most, beyond which linear equations are solved, and the change of v', over v, that ends
them."""


class Rotors(Block):
    """Joined bodies. trees (t, 2): the first and the number of the velocities of each mechanism of these;
    matrix (t, k, k), order (t, k) and given (n,): the equations for the change of velocities in a step;
    speed, change, last, force, forward, backward and row (n,): see `turn_joined`."""

    trees: Ints
    matrix: Reals
    order: Ints
    given: Reals
    speed: Reals
    change: Reals
    last: Reals
    force: Reals
    forward: Reals
    backward: Reals
    row: Reals


def rotors(model: mujoco.MjModel, joined: Ints) -> Rotors:
    """Those of a model whose velocities are `joined` (n,) if they are not those of free bodies."""
    trees = np.stack([model.tree_dofadr, model.tree_dofnum], axis=1).astype(np.int64)
    own = np.ascontiguousarray(trees[joined[trees[:, 0]] == 1])
    side, n = int(own[:, 1].max(initial=0)), model.nv
    names = ("given", "speed", "change", "last", "force", "forward", "backward", "row")
    return Rotors(
        trees=own, matrix=np.zeros((len(own), side, side)), order=np.zeros((len(own), side), np.int64),
        **{name: np.zeros(n) for name in names},
    )  # fmt: skip


@kernel
def turn_joined(of: Rotors, loads: Loads, moment: Moment, terms: Terms) -> None:
    """Take eps B(v, v' - v) off the load of terms that are filled but for it."""
    size, eps, last = 0.0, moment.inertia, math.inf
    for i in range(len(of.speed)):
        of.speed[i] = moment.v[i] if loads.joined[i] else 0.0
        of.force[i] = 0.0
        size = max(size, abs(of.speed[i]))
    if not 0.0 < size < math.inf:
        return
    _prepare(of, loads, moment, terms, True)
    _solve(of, loads)
    for repeat in range(_REPEATS + 1):
        copy(of.change, of.last)
        _turn(of, loads, of.change, eps)
        copy(of.row, of.force)
        _solve(of, loads)
        moved = 0.0
        for i in range(len(of.change)):
            moved = max(moved, abs(of.change[i] - of.last[i]))
        if moved <= _SETTLED * size:
            break
        if repeat == _REPEATS or not moved < 0.5 * last:
            _solve_directly(of, loads, moment, terms, size)
            break
        last = moved
    for i in range(len(of.force)):
        terms.load[i] -= of.force[i]
        loads.taken[i] += of.force[i]
    fill_fall(loads, terms)


@kernel
def _turn(of: Rotors, loads: Loads, change: Reals, eps: float) -> None:
    """Fill row (n,) with eps B(v, w): as B is of second degree in speeds, a quarter of its difference at v +
    w and v - w."""
    for i in range(len(change)):
        loads.v[i] = of.speed[i] + change[i]
    _put_inertial(loads, of.forward)
    for i in range(len(change)):
        loads.v[i] = of.speed[i] - change[i]
    _put_inertial(loads, of.backward)
    for i in range(len(change)):
        of.row[i] = 0.25 * eps * (of.forward[i] - of.backward[i])


@kernel
def _put_inertial(loads: Loads, force: Reals) -> None:
    mj_comVel(loads.address[MODEL], loads.address[DATA])
    mj_rne(loads.address[MODEL], loads.address[DATA], 0, force.ctypes.data)


@kernel
def _prepare(of: Rotors, loads: Loads, moment: Moment, terms: Terms, factors: bool) -> None:
    """Fill in the equations, or with `factors` those of their matrix. Servos are taken as within their limits
    where they are so at v, and prescribed speeds as steady."""
    h, v = moment.h, of.speed
    for t in range(of.trees.shape[0]):
        first, count, a = of.trees[t, 0], of.trees[t, 1], of.matrix[t]
        for i in range(count):
            at, total = first + i, terms.load[first + i]
            low, _ = stretch(terms.entries.matrices, at, len(v))
            for j in range(count):
                own = first + j - low
                held = h * terms.stiffness[at, own] + terms.damping[at, own]
                total -= held * v[first + j]
                a[i, j] = moment.inertia / h * terms.inertia[at, own] + held
            of.given[at] = total
        for r in range(terms.limit.shape[0]):
            _enter_servo(terms, r, h, v, first, count, a, of.given)
        for i in range(count):
            if loads.free[first + i] == 0:
                a[i, :] = 0.0
                a[i, i], of.given[first + i] = 1.0, 0.0
        if factors:
            factorise(a, count, of.order[t])


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
def _solve(of: Rotors, loads: Loads) -> None:
    """Fill the change of velocities where `force` acts against it."""
    for t in range(of.trees.shape[0]):
        first, count = of.trees[t, 0], of.trees[t, 1]
        for i in range(count):
            own = of.given[first + i]
            of.row[i] = own - of.force[first + i] if loads.free[first + i] else own
        substitute(of.matrix[t], count, of.order[t], of.row)
        for i in range(count):
            of.change[first + i] = of.row[i]


@rare_kernel
def _solve_directly(of: Rotors, loads: Loads, moment: Moment, terms: Terms, size: float) -> None:
    """The force with the change that the linear equations have as their solution."""
    _prepare(of, loads, moment, terms, False)
    for i in range(len(of.last)):
        of.last[i] = of.force[i] = 0.0
    for t in range(of.trees.shape[0]):
        first, count = of.trees[t, 0], of.trees[t, 1]
        for j in range(count):
            of.last[first + j] = size
            _turn(of, loads, of.last, moment.inertia / size)
            of.last[first + j] = 0.0
            for i in range(count):
                if loads.free[first + i]:
                    of.matrix[t, i, j] += of.row[first + i]
        if not factorise(of.matrix[t], count, of.order[t]):
            return
    _solve(of, loads)
    _turn(of, loads, of.change, moment.inertia)
    copy(of.row, of.force)

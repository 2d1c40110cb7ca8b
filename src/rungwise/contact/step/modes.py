"""Contact modes: which stratum of the state space a contact is on, and the linear system of each.

A force-limited row uses the same numbers: STICK it holds, FORWARD and BACKWARD it slips at its limit.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rungwise.contact.step.problem import ContactProblem, Sizes, Unknowns
from rungwise.kernel import kernel

CLOSED, ANY, OPEN, STICK, FORWARD, BACKWARD = -2, -1, 0, 1, 2, 3
NAMES = ("open", "stick", "forward", "backward")
"""FORWARD slips along the tangent (friction acts backward), BACKWARD against it. ANY is not decided; CLOSED
leaves only the slip undecided."""

_FORCE_SIGN = {FORWARD: -1.0, BACKWARD: 1.0}

Inequalities = tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]
"""E, e, G, g of the system E x = e, G x >= g."""


@kernel
def clear(d: int, sizes: Sizes, unknowns: Unknowns) -> None:
    """Set forces and velocities to zero, contacts of d directions open."""
    for r in range(d * sizes.contacts):
        unknowns.force[r] = 0.0
    for r in range(sizes.limited):
        unknowns.tau[r], unknowns.mode[sizes.contacts + r] = 0.0, STICK
    for k in range(sizes.contacts):
        unknowns.mode[k] = OPEN
    for i in range(sizes.n):
        unknowns.v[i] = 0.0


def yielding(problem: ContactProblem) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Which contacts, and which limited rows, give way to their own force: no motion is impossible there."""
    return (problem.R != 0.0).any(axis=(1, 2)), problem.R_s > 0.0


def choices(problem: ContactProblem, held: bool = False) -> list[tuple[int, ...]]:
    """The modes that each contact, then each limited row, of a planar problem can be in.

    With `held`, a contact or row that yields has one mode, STICK: in every mode its force is in the cone or
    interval that `linear_system` then gives it.
    """
    soft, soft_rows = yielding(problem)
    soft, soft_rows = soft & held, soft_rows & held
    modes: list[tuple[int, ...]] = []
    for k, mu in enumerate(problem.mu):
        rigid = (OPEN, STICK, FORWARD, BACKWARD) if mu > 0.0 else (OPEN, FORWARD)
        modes.append((STICK,) if soft[k] else rigid)
    for r, F in enumerate(problem.F):
        holds = soft_rows[r] or np.isinf(F)
        modes.append((STICK,) if holds else (STICK, FORWARD, BACKWARD) if F > 0.0 else (FORWARD,))
    return modes


def parts(options: tuple[int, ...], mode: int) -> tuple[int, ...]:
    """The modes of which an undecided mode consists; `options` are the modes that there are."""
    if mode == ANY:
        return (OPEN, CLOSED) if OPEN in options and STICK in options else options
    return options[1:] if mode == CLOSED else ()


def contains(whole: int, part: int) -> bool:
    """Whether `part` is `whole` or one of its parts."""
    return whole in (ANY, part) or (whole == CLOSED and part in (STICK, FORWARD, BACKWARD))


class Units(NamedTuple):
    """Natural units of a problem: the sizes of each coordinate's speed, of a contact's speed and of a contact
    force that count as one."""

    coordinates: NDArray[np.float64]
    velocity: float
    force: float


def natural_units(problem: ContactProblem) -> Units:
    """Units from the problem's own rates and loads, whatever units its coordinates have.

    A coordinate moves at its unit when it moves some row at most by `velocity`, the greatest demanded rate,
    or, where none is demanded, the rate that the loads give to the heaviest body. A coordinate that no row
    feels has the unit that its inertia gives beside the others' inertia, or 1 where it has none. Rates that
    are rounding are not demanded.
    """
    p = problem
    inertia = np.sqrt(np.diag(p.H))
    lever = np.abs(np.vstack([p.W, p.S])).max(axis=0, initial=0.0)
    resists = inertia > 0.0
    longest = float((lever[resists] / inertia[resists]).max(initial=0.0)) or 1.0
    lever = np.where(lever > 1e-9 * longest * inertia, lever, np.where(resists, longest * inertia, 1.0))
    load = float((np.abs(p.c) / lever).max(initial=0.0))
    heaviest = float((inertia / lever).max(initial=0.0))
    demand = max(float(np.abs(p.w).max(initial=0.0)), float(np.abs(p.w_s).max(initial=0.0)))
    demand = 0.0 if demand <= p.quantum[0] else demand
    yields = max(float(np.abs(p.R).max(initial=0.0)), float(p.R_s.max(initial=0.0)))
    demand = max(demand, yields * load)
    resist = heaviest * heaviest
    velocity = demand or (load / resist if resist > 0.0 else 0.0) or 1.0
    return Units(
        velocity / lever,
        velocity,
        max(load, resist * velocity) or 1.0,
    )


def linear_system(problem: ContactProblem, mode: tuple[int, ...], held: bool = False) -> Inequalities:
    """Equations and inequalities that a planar solution in this mode satisfies; where the mode is ANY or
    CLOSED, the equations and inequalities common to its parts. With `held`, this holds for rows that yield,
    and their rates are left out: to a force so large that a float no longer tells the difference, they give
    way to any motion.

    Unknowns are x = (v, lambda, tau), and rows rates and forces, in `natural_units`: the system is free of
    units. Without friction a closed contact slides, whichever closed mode it is given; a limit of zero never
    holds.
    """
    p = problem
    n, contacts, limited = len(p.c), len(p.mu), len(p.F)
    unit_v, velocity, force = natural_units(p)
    size = n + 2 * contacts + limited
    rates = np.zeros((2 * contacts + limited, size))
    rates[:, :n] = np.vstack([p.W, p.S]) * (unit_v / velocity)
    for k in range(contacts):
        rates[2 * k : 2 * k + 2, n + 2 * k : n + 2 * k + 2] = p.R[k] * (force / velocity)
    for r in range(limited):
        rates[2 * contacts + r, n + 2 * contacts + r] = p.R_s[r] * (force / velocity)
    offset = np.concatenate([p.w, p.w_s]) / velocity
    per_force = unit_v / (velocity * force)
    equal = [np.hstack([p.H * unit_v * per_force[:, None], -rates[:, :n].T])]
    value = [p.c * per_force]
    least: list[NDArray[np.float64]] = []
    bound: list[float] = []
    own_force = np.eye(size)[n:]

    def add(row: NDArray[np.float64], right: float, inequality: bool = False) -> None:
        if inequality:
            least.append(row)
            bound.append(right)
        else:
            equal.append(row[None, :])
            value.append(np.array([right]))

    soft, soft_rows = yielding(p)
    soft, soft_rows = soft & held, soft_rows & held
    for k in range(contacts):
        normal, tangent = own_force[2 * k], own_force[2 * k + 1]
        if mode[k] in (ANY, CLOSED) or soft[k]:
            if not soft[k]:
                add(rates[2 * k], -offset[2 * k], mode[k] == ANY)
            add(normal, 0.0, True)
            if p.mu[k] > 0.0:
                add(p.mu[k] * normal - tangent, 0.0, True)
                add(p.mu[k] * normal + tangent, 0.0, True)
            else:
                add(tangent, 0.0)
        elif mode[k] == OPEN:
            add(normal, 0.0)
            add(tangent, 0.0)
            add(rates[2 * k], -offset[2 * k], True)
        elif mode[k] == STICK and p.mu[k] > 0.0:
            add(rates[2 * k], -offset[2 * k])
            add(normal, 0.0, True)
            add(rates[2 * k + 1], -offset[2 * k + 1])
            add(p.mu[k] * normal - tangent, 0.0, True)
            add(p.mu[k] * normal + tangent, 0.0, True)
        else:
            add(rates[2 * k], -offset[2 * k])
            add(normal, 0.0, True)
            sign = _FORCE_SIGN.get(mode[k], 0.0)
            add(tangent - sign * p.mu[k] * normal, 0.0)
            if p.mu[k] > 0.0:
                add(-sign * rates[2 * k + 1], sign * offset[2 * k + 1], True)
    for r in range(limited):
        row, own, limit = rates[2 * contacts + r], own_force[2 * contacts + r], p.F[r] / force
        right = -offset[2 * contacts + r]
        if soft_rows[r] or (mode[contacts + r] in (ANY, STICK) and limit > 0.0):
            if mode[contacts + r] == STICK and not soft_rows[r]:
                add(row, right)
            if np.isfinite(limit):
                add(own, -limit, True)
                add(-own, -limit, True)
        else:
            sign = _FORCE_SIGN.get(mode[contacts + r], 0.0)
            add(own, sign * limit)
            if limit > 0.0:
                add(-sign * row, -sign * right, True)
    return np.vstack(equal), np.concatenate(value), np.array(least).reshape(-1, size), np.array(bound)

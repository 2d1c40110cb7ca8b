"""The linear system of each contact mode of a planar step, written out once more."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rungwise.contact.step.modes import BACKWARD, FORWARD, OPEN, STICK, natural_units
from rungwise.contact.step.problem import ContactProblem

_FORCE_SIGN = {FORWARD: -1.0, BACKWARD: 1.0}

Inequalities = tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]
"""E, e, G, g of the system E x = e, G x >= g."""


def choices(problem: ContactProblem) -> list[tuple[int, ...]]:
    """The modes that each contact, then each limited row, of a planar problem can be in."""
    modes: list[tuple[int, ...]] = []
    for mu in problem.mu:
        modes.append((OPEN, STICK, FORWARD, BACKWARD) if mu > 0.0 else (OPEN, FORWARD))
    for F in problem.F:
        limited = (STICK, FORWARD, BACKWARD) if F > 0.0 else (FORWARD,)
        modes.append((STICK,) if np.isinf(F) else limited)
    return modes


def linear_system(problem: ContactProblem, mode: tuple[int, ...]) -> Inequalities:
    """Equations and inequalities that a planar solution in this mode satisfies.

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

    for k in range(contacts):
        normal, tangent = own_force[2 * k], own_force[2 * k + 1]
        if mode[k] == OPEN:
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
        if mode[contacts + r] == STICK and limit > 0.0:
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

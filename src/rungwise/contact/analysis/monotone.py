"""Modes whose solutions all have the motion of a known solution, and the independent check of this.

For two solutions x and x*, with the symmetric part of A positive, the sum over all laws of (x - x*)(y - y*)
is (x - x*) A (x - x*) >= 0. A law that is monotone adds no more than 0 to it: without friction, or within
limits. A law with friction adds no more than 0

    at rest in x*:      where r*_t = 0, or x sticks too, or x slips along r*_t;
    open in x*:         where y*_n >= mu |y*_t| against every slip that x may have, or x is open too;
    slipping in x*:     where r* = 0, and x is open or slips the other way.

Where this holds for all laws the sum vanishes, and with it (x - x*) A (x - x*); if that leaves no freedom to
the motion, all solutions of the mode have the motion of x*, and lie in the piece of the widest mode of x*.
Source: uniqueness by monotonicity, as in Rockafellar, Convex Analysis (1970), section 24; with friction that
carries no load, as in Moreau, in Nonsmooth Mechanics and Applications (1988), 1-82.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rungwise.contact.judge import farkas
from rungwise.contact.judge.farkas import Mode
from rungwise.contact.prepare.system import System
from rungwise.contact.problem import Array

TIGHT, RANK, SAME = 1e-8, 1e-9, 1e-6
"""Zero for rates and forces, over 1 plus the scaled point's size; for eigenvalues, over the greatest, and
singular values of rows of length 1; for the motion of a unit direction, over the motion's greatest
coefficient, and for the difference of two points, as for rates. Chosen by trial, to a decade."""


class Demands(NamedTuple):
    """Conditions on a solution under which all solutions of a mode have its motion: unknowns that are zero,
    unknowns that are not negative, and unknowns that are not positive."""

    zero: tuple[int, ...]
    positive: tuple[int, ...]
    negative: tuple[int, ...]

    def met(self, point: Array) -> bool:
        """Whether the scaled point meets the demands, to rounding."""
        room = TIGHT * (1.0 + float(np.abs(point).max(initial=0.0)))
        return bool(
            (np.abs(point[list(self.zero)]) <= room).all()
            and (point[list(self.positive)] >= -room).all()
            and (point[list(self.negative)] <= room).all()
        )


def is_monotone(system: System, motion: Array) -> bool:
    """Whether the symmetric part of A is positive, and changes on which it vanishes move nothing."""
    if system.size == 0:
        return False
    A = system.matrix().toarray()
    values, axes = np.linalg.eigh(0.5 * (A + A.T))
    least = RANK * max(float(np.abs(values).max()), 1e-300)
    idle = axes[:, values <= least]
    largest = np.abs(motion).max(axis=1, initial=0.0)
    moved = (motion / np.where(largest > 0.0, largest, 1.0)[:, None]) @ idle
    return bool(values[0] >= -least and np.abs(moved).max(initial=0.0) <= SAME)


def widest(system: System, point: Array) -> Mode:
    """The mode, dividing no further, that leaves most to forces at the rates of the scaled point."""
    s, d = system, system.directions
    y = s.matrix() @ point + s.b
    room = TIGHT * (1.0 + float(np.abs(point).sum()))
    mode: list[int] = []
    for k, mu in enumerate(s.mu):
        normal, slip = y[k * d], y[k * d + 1 : (k + 1) * d]
        if normal > room:
            mode.append(farkas.OPEN)
        elif mu == 0.0 or d == 1:
            mode.append(farkas.CLOSED)
        elif (np.abs(slip) <= room).all():
            mode.append(farkas.STICK)
        else:
            pieces = farkas.SLIPS[d].items()
            mode.append(next(piece for piece, sign in pieces if (slip * sign >= 0.0).all()))
    for j, (lower, upper) in enumerate(zip(s.lower, s.upper, strict=True)):
        rate = y[s.rows + j]
        if np.isneginf(lower) and np.isposinf(upper):
            mode.append(farkas.HULL)
        elif lower == upper:
            mode.append(farkas.LOWER)
        else:
            mode.append(farkas.INSIDE if abs(rate) <= room else farkas.LOWER if rate > 0.0 else farkas.UPPER)
    return tuple(mode)


def demands(system: System, point: Array, own: Mode, mode: Mode) -> Demands | None:
    """What a point of the piece `own`, with the rates of `point`, must have so that all solutions in `mode`
    have its motion; None if no point will do. In space, with friction, no point will do."""
    s, d = system, system.directions
    if d > 2 and (s.mu > 0.0).any():
        return None
    y = s.matrix() @ point + s.b
    found: dict[int, list[int]] = {0: [], 1: [], -1: []}
    for k, mu in enumerate(s.mu):
        if mu == 0.0 or d == 1 or own[k] == mode[k] == farkas.OPEN:
            continue
        normal, tangent = k * d, k * d + 1
        slips = [int(sign) for (sign,) in farkas.SLIPS[2].values()]
        if mode[k] in farkas.SLIPS[2]:
            slips = [int(farkas.SLIPS[2][mode[k]][0])]
        if own[k] == farkas.STICK:
            if mode[k] != farkas.STICK:
                found[slips[0] if len(slips) == 1 else 0].append(tangent)
        elif own[k] == farkas.OPEN:
            if any(y[normal] < mu * slip * y[tangent] for slip in slips):
                return None
        elif mode[k] == farkas.OPEN or (mode[k] in farkas.SLIPS[2] and mode[k] != own[k]):
            found[0].append(normal)
        else:
            return None
    return Demands(*(tuple(found[sign]) for sign in (0, 1, -1)))

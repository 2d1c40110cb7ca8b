"""Coulomb's cone of friction, with torsion and rolling: 0 <= x_n _|_ y_n >= 0, |x_t| <= mu x_n against the
slip.

law = (mu,). Rows of torsion and of rolling come in units in which their limits are mu as well. Source:
Alart and Curnier, Comput. Methods Appl. Mech. Eng. 92 (1991) 353-375.
"""

from __future__ import annotations

import math

from rungwise.contact.kinds.smooth import maximum, onto_disc
from rungwise.contact.step.modes import BACKWARD, FORWARD, OPEN, STICK
from rungwise.kernel import Reals, inner_kernel, kernel

KIND = 2


@kernel
def natural_map(law: Reals, d: int, x: Reals, u: Reals, F: Reals, S: Reals) -> int:
    """See `kinds.natural_map`."""
    ahead = x[0] - u[0]
    for i in range(d):
        for j in range(d):
            S[i, j] = 0.0
    if not ahead > 0.0:
        for i in range(d):
            F[i] = x[i]
        return OPEN
    F[0], S[0, 0] = u[0], 1.0
    length, radius = 0.0, law[0] * ahead
    for i in range(1, d):
        length += (x[i] - u[i]) ** 2
    length = math.sqrt(length)
    if length <= radius and radius > 0.0:
        for i in range(1, d):
            F[i], S[i, i] = u[i], 1.0
        return STICK
    shrink = radius / length if length > 0.0 else 0.0
    for i in range(1, d):
        along = (x[i] - u[i]) / length if length > 0.0 else 0.0
        F[i], S[i, 0] = x[i] - radius * along, law[0] * along
        for j in range(1, d):
            S[i, j] = -shrink * along * (x[j] - u[j]) / length if length > 0.0 else 0.0
        S[i, i] += shrink
    return BACKWARD if d == 2 and x[1] - u[1] > 0.0 else FORWARD


@kernel
def smooth_map(law: Reals, d: int, x: Reals, u: Reals, s: float, F: Reals, S: Reals) -> None:
    """See `kinds.smooth_map`."""
    normal, rises = maximum(x[0] - u[0], 0.0, s)
    length = 0.0
    for i in range(1, d):
        length += (x[i] - u[i]) ** 2
    length = math.sqrt(length)
    factor, by_radius, by_length = onto_disc(law[0] * normal, length, law[0] * s)
    for i in range(d):
        for j in range(d):
            S[i, j] = 0.0
    F[0], S[0, 0] = x[0] - normal, rises
    for i in range(1, d):
        ahead = x[i] - u[i]
        F[i], S[i, 0] = x[i] - factor * ahead, ahead * by_radius * law[0] * rises
        for j in range(1, d):
            S[i, j] = ahead * by_length * (x[j] - u[j]) / length if length > 0.0 else 0.0
        S[i, i] += factor


@inner_kernel
def violation(law: Reals, unit: float, d: int, x: Reals, y: Reals) -> float:
    """See `kinds.violation`."""
    length, radius, total = 0.0, law[0] * max(x[0], 0.0), 0.0
    for i in range(1, d):
        length += (x[i] - y[i]) ** 2
    length = math.sqrt(length)
    for i in range(1, d):
        # where a force sticks the difference is the rate, which a large force would round away
        total += y[i] ** 2 if length <= radius else (x[i] - radius / length * (x[i] - y[i])) ** 2
    opens, slides = abs(float(min(x[0], y[0]))), math.sqrt(total)
    return opens if slides <= opens else slides  # also where it is not a number

"""A force in a ball: |x| <= r against the motion. Friction of a support, whose rows come in units in which
its limit surface is a ball.

law = (r,).
"""

from __future__ import annotations

import math

from rungwise.contact.kinds.smooth import onto_disc
from rungwise.contact.step.modes import FORWARD, STICK
from rungwise.kernel import Reals, inner_kernel, kernel

KIND = 3


@kernel
def natural_map(law: Reals, d: int, x: Reals, u: Reals, F: Reals, S: Reals) -> int:
    """See `kinds.natural_map`."""
    length = 0.0
    for i in range(d):
        length += (x[i] - u[i]) ** 2
    length = math.sqrt(length)
    shrink = law[0] / length if length > law[0] else 1.0
    for i in range(d):
        ahead = x[i] - u[i]
        F[i] = u[i] if shrink == 1.0 else x[i] - shrink * ahead
        for j in range(d):
            S[i, j] = 0.0 if shrink == 1.0 else -shrink * (ahead / length) * ((x[j] - u[j]) / length)
        S[i, i] += shrink
    return STICK if shrink == 1.0 else FORWARD


@kernel
def smooth_map(law: Reals, d: int, x: Reals, u: Reals, s: float, F: Reals, S: Reals) -> None:
    """See `kinds.smooth_map`."""
    length = 0.0
    for i in range(d):
        length += (x[i] - u[i]) ** 2
    length = math.sqrt(length)
    factor, _, by_length = onto_disc(law[0], length, s)
    for i in range(d):
        ahead = x[i] - u[i]
        F[i] = x[i] - factor * ahead
        for j in range(d):
            S[i, j] = ahead * by_length * (x[j] - u[j]) / length if length > 0.0 else 0.0
        S[i, i] += factor


@inner_kernel
def violation(law: Reals, unit: float, d: int, x: Reals, y: Reals) -> float:
    """See `kinds.violation`."""
    length, radius, total = 0.0, unit * law[0], 0.0
    for i in range(d):
        length += (x[i] - y[i]) ** 2
    length = math.sqrt(length)
    shrink = radius / length if length > radius else 1.0
    for i in range(d):
        total += (x[i] - shrink * (x[i] - y[i])) ** 2
    return math.sqrt(total)

"""A force between limits: lo <= x <= hi against the rate. Drives with limits, dry friction in joints, stops.

law = (lo, hi).
"""

from __future__ import annotations

import math

from rungwise.contact.kinds.smooth import maximum
from rungwise.contact.step.modes import BACKWARD, FORWARD, STICK
from rungwise.kernel import Reals, inner_kernel

KIND = 1


@inner_kernel
def natural_map(law: Reals, d: int, x: Reals, u: Reals, F: Reals, S: Reals) -> int:
    """See `kinds.natural_map`."""
    ahead = x[0] - u[0]
    if law[0] < ahead < law[1] or law[0] == ahead == law[1]:
        F[0], S[0, 0] = u[0], 1.0
        return STICK
    S[0, 0] = 0.0
    if ahead <= law[0]:
        F[0] = x[0] - law[0]
        return FORWARD
    F[0] = x[0] - law[1]
    return BACKWARD


@inner_kernel
def smooth_map(law: Reals, d: int, x: Reals, u: Reals, s: float, F: Reals, S: Reals) -> None:
    """See `kinds.smooth_map`."""
    force, slope = x[0] - u[0], 1.0
    if law[0] > -math.inf:
        force, slope = maximum(force, law[0], s)
    if law[1] < math.inf:
        less, falls = maximum(-force, -law[1], s)
        force, slope = -less, slope * falls
    F[0], S[0, 0] = x[0] - force, slope


@inner_kernel
def violation(law: Reals | tuple[float, float], unit: float, d: int, x: Reals, y: Reals) -> float:
    """See `kinds.violation`."""
    ahead, lower, upper = x[0] - y[0], unit * law[0], unit * law[1]
    if ahead < lower:
        return abs(float(x[0] - lower))
    return abs(float(x[0] - upper if ahead > upper else y[0]))

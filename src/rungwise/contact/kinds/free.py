"""A force without limit, so that the rate is zero. Joints."""

from __future__ import annotations

from rungwise.contact.step.modes import STICK
from rungwise.kernel import Reals, inner_kernel

KIND = 0


@inner_kernel
def natural_map(law: Reals, d: int, x: Reals, u: Reals, F: Reals, S: Reals) -> int:
    """See `kinds.natural_map`."""
    for i in range(d):
        for j in range(d):
            S[i, j] = 1.0 if i == j else 0.0
        F[i] = u[i]
    return STICK


@inner_kernel
def violation(law: Reals, unit: float, d: int, x: Reals, y: Reals) -> float:
    """See `kinds.violation`."""
    worst = 0.0
    for i in range(d):
        worst = max(worst, abs(y[i]))
    return worst

"""Answers without what is undetermined: forces beyond their limits, and unknowns that are rounding.

What no row feels may have any size: it is brought within its limits (`clip`). What is rounding beside the
largest unknown, each in its own magnitude, is zero (`calm`): then rows that have no other terms hold exactly.
Promises: limits and signs of normal forces hold exactly. Whether the rows then hold is for the judge to say.
"""

from __future__ import annotations

import numpy as np

from rungwise.contact.judge.residuals import magnitudes_of
from rungwise.contact.prepare.magnitudes import Magnitudes, largest
from rungwise.contact.problem import Array, Laws, Problem
from rungwise.kernel import Reals, kernel

NOTHING = 2.0**-49
"""Share of the largest unknown that is rounding, in magnitudes: sixteen roundings of double precision."""


@kernel
def clip(x: Reals, laws: Laws) -> None:
    """Bring each x within its limits; a contact that pulls has no force."""
    mu, d, lower, upper = laws
    rows = d * len(mu)
    for first in range(0, rows, d):
        if x[first] < 0.0:
            for i in range(first, first + d):
                x[i] = 0.0
    for j in range(len(lower)):
        x[rows + j] = min(max(x[rows + j], lower[j]), upper[j])


def calmed(problem: Problem, x: Array, share: float = NOTHING) -> Array:
    """x (N,) without what is at most this share of the largest unknown."""
    sizes, size, x = magnitudes_of(problem), np.empty(2 * len(x)), x.copy()
    largest(problem.b, x, sizes, size)
    calm(sizes, size, problem.laws, share, x)
    return x


@kernel
def calm(sizes: Magnitudes, size: Reals, laws: Laws, share: float, x: Reals) -> None:
    """Make what is rounding zero in x (N,), where that is within limits; `size` as `largest` fills it. A
    normal force is zero only with the others of its contact."""
    mu, d, lower, upper = laws
    rows, n = d * len(mu), len(x)
    for i in range(n - 1, -1, -1):  # a normal force after the others of its contact
        within = True
        if i >= rows:
            within = lower[i - rows] <= 0.0 <= upper[i - rows]
        elif i % d == 0:
            for k in range(i + 1, i + d):
                within = within and x[k] == 0.0
        greatest = min(sizes.column[i] * size[sizes.label[n + i]], sizes.most[i])
        if within and abs(x[i]) <= share * greatest:
            x[i] = 0.0

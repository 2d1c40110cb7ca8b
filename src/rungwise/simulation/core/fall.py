"""Falls along parabolas, in steps of controlled length in which nothing touches: where they end."""

from __future__ import annotations

import numpy as np

from rungwise.kernel import Reals
from rungwise.system.terms import Terms

CLOSED = 1e-12
"""Part of the time until a contact closes that is rounding."""


def landing(terms: Terms, force: Reals, v: Reals, h: float) -> float:
    """The longest step from velocities v (n_v,) after which none of the open contacts has closed that push,
    by forces (c d,), at the end of one of length h; 0 where none does."""
    d, rounding = terms.contact_stiffness.shape[1], float(terms.rounding[0])
    count = len(force) // d
    pushes = (force[::d] > 0.0) & (terms.gap[:count] > rounding)
    rows, gaps = terms.rows[: count * d : d][pushes], terms.gap[:count][pushes]
    rate, falls = -rows @ v, -rows @ terms.fall
    with np.errstate(divide="ignore", invalid="ignore"):
        ends = 2.0 * gaps / (rate + np.sqrt(rate * rate + 4.0 * falls * gaps))
    least = (1.0 - CLOSED) * float(ends[ends > 0.0].min(initial=h))
    return least if least < (1.0 - CLOSED) * h else 0.0

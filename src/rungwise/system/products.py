"""Products of rows of which a number of entries is in use."""

from __future__ import annotations

from rungwise.kernel import Reals, inner_kernel


@inner_kernel
def dot(a: Reals, b: Reals, d: int) -> float:
    """The product of the first d entries."""
    total = 0.0
    for i in range(d):
        total += a[i] * b[i]
    return total

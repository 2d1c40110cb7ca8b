"""The maximum of two numbers without its corner: Chen and Harker, Kanzow, Smale."""

from __future__ import annotations

import math

from rungwise.kernel import inner_kernel


@inner_kernel
def maximum(a: float, b: float, s: float) -> tuple[float, float]:
    """max(a, b) to about s > 0, and its slope by a; the slope by b is 1 less that."""
    root = math.sqrt((a - b) * (a - b) + 4.0 * s * s)
    return 0.5 * (a + b + root), 0.5 * (1.0 + (a - b) / root)


@inner_kernel
def onto_disc(radius: float, length: float, s: float) -> tuple[float, float, float]:
    """What a vector of this length is multiplied with to lie in a disc, to about s > 0, and the slopes of the
    factor by radius and by length."""
    top, by_radius = maximum(radius, length, s)
    factor = radius / top
    return factor, (1.0 - factor * by_radius) / top, -factor * (1.0 - by_radius) / top

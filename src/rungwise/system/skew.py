"""Friction that differs by direction, as data: the ellipse of a contact as a disc.

Sliding friction with the coefficients mu_1 and mu_2 along two axes is the force of the greatest dissipation
in an ellipse. Rows of slip s' = B s, B = diag(mu_1, mu_2) / mu in the tangents that a contact has, mu the
greater of the two, make a disc of it, of the radius mu times the normal force: forces are B f', deformations
d' = B d, and so a stiffness K is B^-1 K B^-1. Within a step all is counted so; what is kept and told is not.
"""

from __future__ import annotations

from rungwise.kernel import Reals, inner_kernel

XX, XY, YY = 0, 1, 2
"""Columns of `terms.skew`: entries of B, symmetric."""


@inner_kernel
def is_skew(skew: Reals) -> bool:
    """Whether contacts may have friction that differs by direction."""
    return bool(skew.shape[0] > 0)


@inner_kernel
def squeezed(skew: Reals, k: int, x: float, y: float) -> tuple[float, float]:
    """B (x, y) of contact k: a slip or deformation along its tangents as rows count it, and a force that rows
    count as it is."""
    return skew[k, XX] * x + skew[k, XY] * y, skew[k, XY] * x + skew[k, YY] * y


@inner_kernel
def widened(skew: Reals, k: int, x: float, y: float) -> tuple[float, float]:
    """B^-1 (x, y) of contact k: the other way round."""
    size = skew[k, XX] * skew[k, YY] - skew[k, XY] * skew[k, XY]
    return (skew[k, YY] * x - skew[k, XY] * y) / size, (skew[k, XX] * y - skew[k, XY] * x) / size

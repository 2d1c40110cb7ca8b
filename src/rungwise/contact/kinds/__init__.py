"""The kinds of groups: one file each, with its projection P, the slope of P, and what violates it."""

from __future__ import annotations

import math

from rungwise.contact.kinds import associated, ball, cone, free, interval, pressure
from rungwise.kernel import Reals, inner_kernel


@inner_kernel
def forces_of(kind: int) -> int:
    """How many numbers of a kind's law, the first ones, are forces."""
    if kind == interval.KIND:
        return 2
    return 1 if kind == ball.KIND or kind == pressure.KIND else 0


@inner_kernel
def restricts_rates(kind: int, law: Reals) -> bool:
    """Whether a law asks for anything of rates: not where it leaves a force no choice."""
    return kind != interval.KIND or bool(law[0] < law[1])


@inner_kernel
def natural_map(kind: int, law: Reals, numbers: Reals, d: int, x: Reals, u: Reals, F: Reals, S: Reals) -> int:
    """F = x - P(x - u) and the slope S of P there, of a group of d rows with forces x and rates u, in
    units in which both are alike. Returns the mode of the group. `numbers` are those that laws refer to."""
    if kind == cone.KIND:
        return cone.natural_map(law, d, x, u, F, S)
    if kind == interval.KIND:
        return interval.natural_map(law, d, x, u, F, S)
    if kind == free.KIND:
        return free.natural_map(law, d, x, u, F, S)
    if kind == associated.KIND:
        return associated.natural_map(law, d, x, u, F, S)
    if kind == pressure.KIND:
        return pressure.natural_map(law, numbers, x, u, F, S)
    return ball.natural_map(law, d, x, u, F, S)


@inner_kernel
def smooth_map(
    kind: int, law: Reals, numbers: Reals, d: int, x: Reals, u: Reals, s: float, F: Reals, S: Reals
) -> None:
    """As `natural_map`, with a projection P_s whose slope does not jump, and which tends to P with s, a
    force in the units of x."""
    if kind == cone.KIND:
        cone.smooth_map(law, d, x, u, s, F, S)
    elif kind == interval.KIND:
        interval.smooth_map(law, d, x, u, s, F, S)
    elif kind == ball.KIND:
        ball.smooth_map(law, d, x, u, s, F, S)
    else:  # a law without corners, or one that needs no path
        natural_map(kind, law, numbers, d, x, u, F, S)


@inner_kernel
def violation(kind: int, law: Reals, numbers: Reals, unit: float, d: int, x: Reals, y: Reals) -> float:
    """How far a group of d rows with forces x and rates y is from its law, in units in which both are
    alike, and in which a force of the law is `unit`; inf if something is not finite."""
    if kind == cone.KIND:
        worst = cone.violation(law, unit, d, x, y)
    elif kind == interval.KIND:
        worst = interval.violation(law, unit, d, x, y)
    elif kind == free.KIND:
        worst = free.violation(law, unit, d, x, y)
    elif kind == associated.KIND:
        worst = associated.violation(law, unit, d, x, y)
    elif kind == pressure.KIND:
        worst = pressure.violation(law, numbers, unit, x, y)
    else:
        worst = ball.violation(law, unit, d, x, y)
    return worse(0.0, worst + nothing(d, x, y))


@inner_kernel
def nothing(d: int, x: Reals, y: Reals) -> float:
    """0, or not a number where something is not finite, which min and max may drop."""
    total = 0.0
    for i in range(d):
        total += 0.0 * (float(x[i]) + float(y[i]))
    return total


@inner_kernel
def worse(a: float, b: float) -> float:
    """The larger of two violations; inf when b is not a number."""
    if b <= a:
        return a
    return b if b < math.inf else math.inf

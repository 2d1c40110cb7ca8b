"""Islands and points of them, and the residual of a point.

The residual is as of `contact.step.step_residual`, measured against the island's own forces and velocities.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from rungwise.contact.solvers.space.rows import Bodies, Groups
from rungwise.contact.step.step_residual import FLOOR, REST, ROUNDING
from rungwise.kernel import Ints, Reals, inner_kernel, kernel


class Span(NamedTuple):
    """An island: its coordinates from `low` to `high` and groups from `first` to `last`, exclusive."""

    low: int
    high: int
    first: int
    last: int


class Island(NamedTuple):
    """Bodies that touch, among all bodies and groups of a problem, with the quantum of the problem; halt (1,)
    is set from outside where the work is to end."""

    bodies: Bodies
    groups: Groups
    span: Span
    quantum: float
    halt: Ints


class Point(NamedTuple):
    """Sorted velocities v (n,) and forces x (rows,), the map F (rows,), rates u (rows,), imbalance G (n,)."""

    v: Reals
    x: Reals
    F: Reals
    u: Reals
    G: Reals


@kernel
def measure(island: Island, point: Point, scale: Reals) -> float:
    """The residual (see `contact.step.step_residual`) of an island whose rates, without hold, are known;
    `scale` (n,) is scratch. It is measured against the island's own forces and velocities: no less than
    there."""
    bodies, groups, (low, high, first, last), quantum, _ = island
    v, x, u = point.v, point.x, point.u
    speed, largest, rest, floor = quantum, 0.0, 0.0, math.inf
    for r in range(groups.row[first], groups.row[last]):
        speed, largest = max(speed, abs(groups.w[r])), max(largest, abs(x[r]))
    for g in range(first, last):
        row, end, at, begin = groups.row[g], groups.row[g + 1], groups.entry[g], groups.column[g]
        peak, most, wide = 0.0, 0.0, groups.column[g + 1] - begin
        for entry in groups.W[at : at + wide]:
            peak = max(peak, entry * entry)
        for entry in groups.W[at : at + wide * (end - row)]:
            most = max(most, entry * entry)
        if most > 0.0:
            rest, floor = max(rest, peak), min(floor, most)
        for i in range(row, end):
            bend = 0.0
            for j in range(row, end):
                bend += groups.R[g, i - row, j - row] * x[j]
            speed = max(speed, abs(bend))
            for j in range(begin, groups.column[g + 1]):
                speed = max(speed, abs(groups.W[at] * v[groups.touched[j]]))
                at += 1
    per_rate = 1.0 / speed if speed > 0.0 else 0.0
    if speed < ROUNDING * rest * largest:
        speed = REST * rest * largest
    if floor < math.inf:
        largest = max(largest, FLOOR * speed / floor)
    worst = 0.0
    for i in range(low, high):
        scale[i - low] = abs(bodies.c[i])
        for j in range(bodies.first[i], bodies.last[i]):
            scale[i - low] = max(scale[i - low], abs(bodies.H[bodies.at[i] + j] * v[j]))
    per_speed = 1.0 / speed if speed > 0.0 else 0.0
    per_force = 1.0 / largest if largest > 0.0 else 0.0
    for g in range(first, last):
        row, end, at, begin = groups.row[g], groups.row[g + 1], groups.entry[g], groups.column[g]
        for _ in range(row, end):
            for j in range(begin, groups.column[g + 1]):
                place = groups.touched[j] - low
                scale[place] = max(scale[place], abs(groups.W[at]) * largest)
                at += 1
        joint = groups.mu[g] < 0.0 and math.isinf(groups.limit[g])
        worst = max(worst, _miss(groups, g, row, end, x, u, per_rate if joint else per_speed, per_force))
    for i in range(low, high):
        if not abs(point.G[i]) <= worst * scale[i - low]:
            worst = abs(point.G[i]) / scale[i - low]
    return worst if math.isfinite(worst) else math.inf


@inner_kernel
def _miss(
    groups: Groups, g: int, row: int, end: int, x: Reals, u: Reals, per_speed: float, per_force: float
) -> float:
    force, rate, length, total = x[row] * per_force, u[row] * per_speed, 0.0, 0.0
    limited = groups.mu[g] < 0.0
    radius = groups.mu[g] * max(force, 0.0)
    if limited:
        radius = groups.limit[g] * per_force if per_force > 0.0 else math.inf
    first = row if limited else row + 1
    for i in range(first, end):
        length += (x[i] * per_force - u[i] * per_speed) ** 2
    length = math.sqrt(length)
    shrink = 1.0 if length <= radius else radius / length
    for i in range(first, end):
        force_i = x[i] * per_force
        total += (force_i - shrink * (force_i - u[i] * per_speed)) ** 2
    if limited:
        return math.sqrt(total)
    return max(abs(min(rate, force)) + 0.0 * rate, math.sqrt(total))

"""Gauss-Seidel on an island: each group in turn moves the bodies that it touches.

Algorithm: a contact's normal force, given its friction, then its friction, projected on the disc of its
normal force, a few times in turn; a limited row is cut off at its limits. Source: Jourdan, Alart, Jean,
Comput. Methods Appl. Mech. Eng. 155 (1998) 31-47. Accepts: what `spatial_newton` accepts. Promises: nothing;
sweeps find which contacts carry, stick and slide, and leave the rest to Newton's method.
"""

from __future__ import annotations

import math

from rungwise.contact.solvers.spatial_newton import Point, Span, reach
from rungwise.contact.solvers.spatial_rows import Bodies, Groups, substitute_bodies
from rungwise.kernel import Reals, inner_kernel, kernel

_TURNS = 3
"""Turns of normal force and friction in a contact; chosen by trial."""
_LEAST = 1e-12
"""Least yield of a force over the mean yield of its group: a thousand roundings."""


@kernel
def accelerate(bodies: Bodies, groups: Groups, span: Span, point: Point) -> None:
    """Velocities of the forces x: v = H^-1 (c + W^T x)."""
    v, x = point.v, point.x
    for i in range(span.low, span.high):
        v[i] = bodies.c[i]
    for g in range(span.first, span.last):
        at = groups.entry[g]
        for r in range(groups.row[g], groups.row[g + 1]):
            for j in range(groups.column[g], groups.column[g + 1]):
                v[groups.touched[j]] += groups.W[at] * x[r]
                at += 1
    substitute_bodies(bodies, span.low, span.high, v)


@kernel
def sweep(
    groups: Groups, span: Span, hold: float, centre: Reals, sweeps: int, point: Point, dx: Reals
) -> None:
    """Sweep so often over the island, forces and velocities in place; dx (rows,) is scratch."""
    v, x, u = point.v, point.x, point.u
    for _ in range(sweeps):
        for g in range(span.first, span.last):
            row, end, at, begin = groups.row[g], groups.row[g + 1], groups.entry[g], groups.column[g]
            n = end - row
            give = hold / reach(groups, g, n)
            for i in range(n):
                total = groups.w[row + i] + give * (x[row + i] - centre[row + i])
                for j in range(n):
                    total += groups.R[g, i, j] * x[row + j]
                for j in range(begin, groups.column[g + 1]):
                    total += groups.W[at] * v[groups.touched[j]]
                    at += 1
                u[row + i], dx[row + i] = total, x[row + i]
            _solve_group(groups, g, row, n, give, x, u, point.F)
            at = groups.entry[g]
            for i in range(n):
                change = x[row + i] - dx[row + i]
                for j in range(begin, groups.column[g + 1]):
                    v[groups.touched[j]] += groups.Y[at] * change
                    at += 1


@inner_kernel
def _solve_group(
    groups: Groups, g: int, row: int, n: int, give: float, x: Reals, u: Reals, moved: Reals
) -> None:
    """Move the group's forces x; u is kept up to date. `moved` (rows,) is scratch."""
    own, R, limit = groups.own[g], groups.R[g], groups.limit[g]
    least = _LEAST / reach(groups, g, n)
    if n == 1:
        newer = x[row] - u[row] / max(own[0, 0] + R[0, 0] + give, least)
        x[row] = min(max(newer, -limit if groups.mu[g] < 0.0 else 0.0), limit)
        return
    stiff = least
    for i in range(1, n):
        total = give
        for j in range(1, n):
            total += abs(own[i, j] + R[i, j])
        stiff = max(stiff, total)
    for _ in range(_TURNS):
        newer = max(0.0, x[row] - u[row] / max(own[0, 0] + R[0, 0] + give, least))
        change = newer - x[row]
        x[row] = newer
        for i in range(n):
            u[row + i] += (own[i, 0] + R[i, 0] + (give if i == 0 else 0.0)) * change
        length = 0.0
        for i in range(1, n):
            length += (x[row + i] - u[row + i] / stiff) ** 2
        length = math.sqrt(length)
        shrink = 1.0 if length <= groups.mu[g] * newer else groups.mu[g] * newer / length
        for j in range(1, n):
            newer = shrink * (x[row + j] - u[row + j] / stiff)
            moved[row + j] = newer - x[row + j]
            x[row + j] = newer
        for j in range(1, n):
            for i in range(n):
                u[row + i] += (own[i, j] + R[i, j] + (give if i == j else 0.0)) * moved[row + j]

"""Gauss-Seidel on an island: each group in turn moves the bodies that it touches.

Algorithm: a contact's normal force, given its friction, then its friction, projected on the disc of its
normal force, a few times in turn; limited rows are cut off at their limits. Source: Jourdan, Alart, Jean,
Comput. Methods Appl. Mech. Eng. 155 (1998) 31-47. Accepts: what `space.newton` accepts. Promises: nothing;
sweeps find which contacts carry, stick and slide, and leave the rest to Newton's method.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from rungwise.contact.solvers.space.measure import Island, Point
from rungwise.contact.solvers.space.newton import reach
from rungwise.contact.solvers.space.rows import Groups, substitute_bodies
from rungwise.kernel import Ints, Reals, inner_kernel, kernel

_TURNS = 3
"""Turns of normal force and friction in a contact; chosen by trial."""
_LEAST = 1e-12
"""Least yield of a force over the mean yield of its group: a thousand roundings."""


class Answers(NamedTuple):
    """What the bodies do about forces: column (g + 1,) and entry (g + 1,), first entries of `moved`, the
    coordinates of all blocks that a group touches, and of Y = H^-1 W^T, row by row; own (g, d, d) = W Y."""

    column: Ints
    entry: Ints
    moved: Ints
    Y: Reals
    own: Reals


@kernel
def respond(island: Island, answers: Answers) -> None:
    """Fill the answers of an island; those of an island start where its rows' entries would in a full W."""
    bodies, groups, span, _, _ = island
    n, L, begin_at = len(bodies.c), bodies.factor, bodies.at
    first, last = bodies.first, bodies.last
    answers.column[span.first], answers.entry[span.first] = n * span.first, n * groups.row[span.first]
    for g in range(span.first, span.last):
        size, begin, end = groups.row[g + 1] - groups.row[g], groups.column[g], groups.column[g + 1]
        moved, width, done = answers.moved[answers.column[g] :], 0, span.low
        for j in range(begin, end):
            for place in range(first[groups.touched[j]], last[groups.touched[j]]):
                if place >= done:
                    moved[width] = place
                    width += 1
            done = max(done, last[groups.touched[j]])
        answers.column[g + 1] = answers.column[g] + width
        answers.entry[g + 1] = answers.entry[g] + size * width
        W = groups.W[groups.entry[g] : groups.entry[g + 1]].reshape(size, end - begin)
        Z = answers.Y[answers.entry[g] : answers.entry[g + 1]].reshape(size, width)
        for r in range(size):
            at = 0
            for j in range(width):
                Z[r, j] = 0.0
                if at < end - begin and groups.touched[begin + at] == moved[j]:
                    Z[r, j] = W[r, at]
                    at += 1
            for j in range(width):
                place = moved[j]
                for k in range(first[place], place):
                    Z[r, j] -= L[begin_at[place] + k] * Z[r, j - place + k]
                Z[r, j] *= L[begin_at[place] + place]
            for s in range(r + 1):
                total = 0.0
                for j in range(width):
                    total += Z[r, j] * Z[s, j]
                answers.own[g, r, s] = answers.own[g, s, r] = total
        for r in range(size):
            for j in range(width - 1, -1, -1):
                place = moved[j]
                for k in range(place + 1, last[place]):
                    Z[r, j] -= L[begin_at[k] + place] * Z[r, j - place + k]
                Z[r, j] *= L[begin_at[place] + place]


@kernel
def accelerate(island: Island, point: Point) -> None:
    """Velocities of the forces x: v = H^-1 (c + W^T x)."""
    bodies, groups, span, _, _ = island
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
def sweep(island: Island, answers: Answers, sweeps: int, point: Point, dx: Reals) -> None:
    """Sweep so often over the island, forces and velocities in place; dx (rows,) is scratch."""
    groups, span = island.groups, island.span
    v, x, u = point.v, point.x, point.u
    for _ in range(sweeps):
        for g in range(span.first, span.last):
            row, end, at, begin = groups.row[g], groups.row[g + 1], groups.entry[g], groups.column[g]
            n = end - row
            for i in range(n):
                total = groups.w[row + i]
                for j in range(n):
                    total += groups.R[g, i, j] * x[row + j]
                for j in range(begin, groups.column[g + 1]):
                    total += groups.W[at] * v[groups.touched[j]]
                    at += 1
                u[row + i], dx[row + i] = total, x[row + i]
            _solve_group(groups, g, row, n, answers.own[g], x, u, point.F)
            at = answers.entry[g]
            for i in range(n):
                change = x[row + i] - dx[row + i]
                for j in range(answers.column[g], answers.column[g + 1]):
                    v[answers.moved[j]] += answers.Y[at] * change
                    at += 1


@inner_kernel
def _solve_group(
    groups: Groups, g: int, row: int, n: int, own: Reals, x: Reals, u: Reals, moved: Reals
) -> None:
    """Move the group's forces x; u is kept up to date. `moved` (rows,) is scratch."""
    R, limit = groups.R[g], groups.limit[g]
    least = _LEAST / reach(groups, g, n)
    if n == 1:
        newer = x[row] - u[row] / max(own[0, 0] + R[0, 0], least)
        x[row] = min(max(newer, -limit if groups.mu[g] < 0.0 else 0.0), limit)
        return
    stiff, first = least, 0 if groups.mu[g] < 0.0 else 1
    for i in range(first, n):
        total = 0.0
        for j in range(first, n):
            total += abs(own[i, j] + R[i, j])
        stiff = max(stiff, total)
    if groups.mu[g] < 0.0:
        length = 0.0
        for i in range(row, row + n):
            x[i] -= u[i] / stiff
            length += x[i] * x[i]
        shrink = min(limit / math.sqrt(length), 1.0) if length > 0.0 else 1.0
        for i in range(row, row + n):
            x[i] *= shrink
        return
    for _ in range(_TURNS):
        newer = max(0.0, x[row] - u[row] / max(own[0, 0] + R[0, 0], least))
        change = newer - x[row]
        x[row] = newer
        for i in range(n):
            u[row + i] += (own[i, 0] + R[i, 0]) * change
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
                u[row + i] += (own[i, j] + R[i, j]) * moved[row + j]

"""Newton's method on the natural map, within a step of the proximal point method.

    F = x - P(x - pace (y + weight / pace (x - x_c)))      G = H v + weight hold (v - v_c) - C^T x - c

Each step eliminates the forces group by group, dx = -M^-1 (F + pace S W dv) with M = 1 - S + S (pace R +
weight) and S the slope of P, and solves (H + weight hold + C^T E W) dv = -G - C^T M^-1 F, E = M^-1 pace S.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from rungwise.contact.block_factors import Factors, add, add_product, clear, plan
from rungwise.contact.block_factors import factorise as factorise_blocks
from rungwise.contact.block_factors import substitute as substitute_blocks
from rungwise.contact.kinds import natural_map, smooth_map
from rungwise.contact.least_degree import Pattern
from rungwise.contact.linear import factorise, substitute
from rungwise.contact.solver.groups import Counts, Groups
from rungwise.contact.solver.settings import WIDE
from rungwise.kernel import Ints, Reals, allocating_kernel, inner_kernel, kernel


class Room(NamedTuple):
    """Scratch: map F (rows,), G (n,), rates y (rows,), slopes S and E (g, d, d), M^-1 F (rows,), steps dx
    (rows,) and dv (n,), trials xt and vt, rows a and b (d,), systems M (d, 2 d + 1), matrix (n, n) and order
    (n,) of few velocities, blocks of many, push (d n,); pace (g,), hold (n,), mode (g,) of the groups; lever
    (n,), and scale (2,), see `residual`; the unknowns x and v, where they began, the centre of the proximal
    term, and the best met, with its residual in least (1,)."""

    F: Reals
    G: Reals
    y: Reals
    S: Reals
    E: Reals
    solved: Reals
    dx: Reals
    dv: Reals
    xt: Reals
    vt: Reals
    a: Reals
    b: Reals
    M: Reals
    matrix: Reals
    order: Ints
    blocks: Factors
    push: Reals
    pace: Reals
    hold: Reals
    scale: Reals
    mode: Ints
    lever: Reals
    least: Reals
    first_x: Reals
    first_v: Reals
    centre_x: Reals
    centre_v: Reals
    best_x: Reals
    best_v: Reals
    x: Reals
    v: Reals


@inner_kernel
def room_of(k: Counts) -> int:
    """Numbers that `room_in` takes its parts from, for these counts or less."""
    side = min(k.n, WIDE - 1)
    return 9 * k.n + 9 * k.rows + k.groups * (2 * k.d * k.d + 1) + k.d * (2 * k.d + 3 + k.n) + side * side + 3


@inner_kernel
def room_in(reals: Reals, integers: Ints, k: Counts, blocks: Factors) -> Room:
    """Scratch whose arrays are parts of one of numbers and of one (n + groups,) of integers."""
    n, rows, groups, d = k.n, k.rows, k.groups, k.d
    side, square = (0 if n >= WIDE else n), groups * d * d
    r = reals
    F, y, solved, r = r[:rows], r[rows : 2 * rows], r[2 * rows : 3 * rows], r[3 * rows :]
    dx, xt, x, r = r[:rows], r[rows : 2 * rows], r[2 * rows : 3 * rows], r[3 * rows :]
    first_x, centre_x, best_x, r = r[:rows], r[rows : 2 * rows], r[2 * rows : 3 * rows], r[3 * rows :]
    G, dv, vt, hold, lever = r[:n], r[n : 2 * n], r[2 * n : 3 * n], r[3 * n : 4 * n], r[4 * n : 5 * n]
    r = r[5 * n :]
    first_v, centre_v, best_v, v = r[:n], r[n : 2 * n], r[2 * n : 3 * n], r[3 * n : 4 * n]
    r = r[4 * n :]
    S, E, r = r[:square].reshape(groups, d, d), r[square : 2 * square].reshape(groups, d, d), r[2 * square :]
    pace, r = r[:groups], r[groups:]
    a, b, M = r[:d], r[d : 2 * d], r[2 * d : 2 * d + d * (2 * d + 1)].reshape(d, 2 * d + 1)
    r = r[2 * d + d * (2 * d + 1) :]
    push, r = r[: d * n], r[d * n :]
    matrix, r = r[: side * side].reshape(side, side), r[side * side :]
    return Room(
        F, G, y, S, E, solved, dx, dv, xt, vt, a, b, M, matrix, integers[groups : groups + side], blocks,
        push, pace, hold, r[:2], integers[:groups], lever, r[2:3], first_x, first_v, centre_x, centre_v,
        best_x, best_v, x, v,
    )  # fmt: skip


@inner_kernel
def no_blocks(integers: Ints, reals: Reals) -> Factors:
    """Factors of no matrix."""
    none, no = integers[:0], reals[:0].reshape(0, 9)
    return Factors(none, none, none, none, none, none, none, none, no, no, no, none, reals[:0])


@allocating_kernel
def plan_blocks(integers: Ints, k: Counts) -> Factors:
    """Factors of the matrix of groups with many velocities, whose integers, as in `groups_in`, these are:
    code that allocates may not take arrays from code that does not."""
    H_first, i = integers[: k.n + 1], integers[k.n + 1 :]
    H_column, i = i[: k.filled], i[k.filled + k.groups :]
    first, column = i[k.groups + 1 : 2 * k.groups + 2], i[3 * k.groups + 3 : 3 * k.groups + 3 + k.touched]
    return plan(Pattern(H_first, H_column, first, column))


@inner_kernel
def multiplications(blocks: Factors, n: int) -> float:
    """What the factors of a matrix of n velocities take, roughly, dense or by blocks."""
    if n < WIDE:
        return float(n) ** 3 / 3.0 + 1.0
    total = 1.0
    for p in range(len(blocks.size)):
        total += 54.0 * float(blocks.start[p + 1] - blocks.start[p] + 1) ** 2
    return total


@kernel
def evaluate(
    g: Groups, weight: float, smooth: float, x: Reals, v: Reals, xc: Reals, vc: Reals, room: Room
) -> float:
    """Fill the map and its slopes, smoothed to about the force `smooth`; returns the square of its size."""
    F, G, y, S, a, b, pace = room.F, room.G, room.y, room.S, room.a, room.b, room.pace
    total = 0.0
    for i in range(len(v)):
        own = weight * room.hold[i] * (v[i] - vc[i]) - g.c[i]
        for e in range(g.H_first[i], g.H_first[i + 1]):
            own += g.H[e] * v[g.H_column[e]]
        G[i] = own
    for k in range(len(g.kind)):
        first, d, at, low, high = g.row[k], g.row[k + 1] - g.row[k], g.entry[k], g.first[k], g.first[k + 1]
        for i in range(d):
            force = x[first + i]
            own = g.w[first + i] + weight / pace[k] * (force - xc[first + i])
            for e in range(low, high):
                own += g.W[at] * v[g.column[e]]
                G[g.column[e]] -= g.C[at] * force
                at += 1
            for j in range(d):
                own += g.R[k, i, j] * x[first + j]
            y[first + i] = own
            a[i], b[i] = force, pace[k] * own
        if smooth > 0.0:
            smooth_map(g.kind[k], g.law[k], g.numbers, d, a, b, smooth, F[first:], S[k])
        else:
            room.mode[k] = natural_map(g.kind[k], g.law[k], g.numbers, d, a, b, F[first:], S[k])
        for i in range(d):
            total += F[first + i] * F[first + i]
    for i in range(len(v)):
        total += G[i] * G[i]
    return total


@kernel
def find_step(g: Groups, weight: float, room: Room) -> bool:
    """Fill dx and dv from the map; False where the system is singular."""
    n, E, solved, dv = len(g.c), room.E, room.solved, room.dv
    for i in range(n):
        dv[i] = -room.G[i]
    for k in range(len(g.kind)):
        if not _eliminate(g, k, room.pace[k], weight, room):
            return False
        at = g.entry[k]
        for r in range(g.row[k], g.row[k + 1]):
            for e in range(g.first[k], g.first[k + 1]):
                dv[g.column[e]] -= g.C[at] * solved[r]
                at += 1
    if n >= WIDE:
        if not _assemble_blocks(g, weight, room):
            return False
        substitute_blocks(room.blocks, dv)
    elif n > 0:
        _assemble(g, weight, room)
        if not factorise(room.matrix, n, room.order):
            return False
        substitute(room.matrix, n, room.order, dv)
    for k in range(len(g.kind)):
        first, d, at = g.row[k], g.row[k + 1] - g.row[k], g.entry[k]
        for i in range(d):
            room.dx[first + i] = -solved[first + i]
        for j in range(d):
            rate = 0.0
            for e in range(g.first[k], g.first[k + 1]):
                rate += g.W[at] * dv[g.column[e]]
                at += 1
            for i in range(d):
                room.dx[first + i] -= E[k, i, j] * rate
    return True


@inner_kernel
def _eliminate(g: Groups, k: int, pace: float, weight: float, room: Room) -> bool:
    """Fill E and M^-1 F of a group: Gauss and Jordan."""
    first, d, S, M, E = g.row[k], g.row[k + 1] - g.row[k], room.S[k], room.M, room.E[k]
    idle = True
    for i in range(d):
        for j in range(d):
            own = S[i, j] * (weight - 1.0)
            idle &= S[i, j] == 0.0
            for q in range(d):
                own += pace * S[i, q] * g.R[k, q, j]
            M[i, j], M[i, d + j] = own + (1.0 if i == j else 0.0), pace * S[i, j]
        M[i, 2 * d] = room.F[first + i]
    if idle:
        for i in range(d):
            room.solved[first + i] = room.F[first + i]
            for j in range(d):
                E[i, j] = 0.0
        return True
    for q in range(d):
        best = q
        for i in range(q + 1, d):
            if abs(M[i, q]) > abs(M[best, q]):
                best = i
        if not abs(M[best, q]) > 0.0:
            return False
        if best != q:
            for j in range(q, 2 * d + 1):
                M[q, j], M[best, j] = M[best, j], M[q, j]
        per = 1.0 / M[q, q]
        for j in range(q + 1, 2 * d + 1):
            M[q, j] *= per
        for i in range(d):
            factor = M[i, q]
            if i != q and factor != 0.0:
                for j in range(q + 1, 2 * d + 1):
                    M[i, j] -= factor * M[q, j]
    for i in range(d):
        for j in range(d):
            E[i, j] = M[i, d + j]
        room.solved[first + i] = M[i, 2 * d]
    return True


@inner_kernel
def _pushes(E: Reals, d: int) -> bool:
    """Whether E has an entry."""
    found = False
    for i in range(d):
        for j in range(d):
            found |= E[i, j] != 0.0
    return found


@kernel
def _assemble(g: Groups, weight: float, room: Room) -> None:
    """Fill the matrix H + weight hold + C^T E W."""
    n, K, E, a = len(g.c), room.matrix, room.E, room.a
    for i in range(n):
        for j in range(n):
            K[i, j] = 0.0
        for e in range(g.H_first[i], g.H_first[i + 1]):
            K[i, g.H_column[e]] = g.H[e]
        K[i, i] += weight * room.hold[i]
    for k in range(len(g.kind)):
        d, low, width = g.row[k + 1] - g.row[k], g.first[k], g.first[k + 1] - g.first[k]
        if not _pushes(E[k], d):
            continue
        W = g.W[g.entry[k] : g.entry[k + 1]].reshape(d, width)
        C = g.C[g.entry[k] : g.entry[k + 1]].reshape(d, width)
        for i in range(width):
            pushes = False
            for q in range(d):
                own = 0.0
                for j in range(d):
                    own += C[j, i] * E[k, j, q]
                a[q], pushes = own, pushes or own != 0.0
            if pushes:
                row = K[g.column[low + i]]
                for j in range(width):
                    own = 0.0
                    for q in range(d):
                        own += a[q] * W[q, j]
                    row[g.column[low + j]] += own


@kernel
def _assemble_blocks(g: Groups, weight: float, room: Room) -> bool:
    """Factorise as `_assemble`, by blocks."""
    blocks = room.blocks
    clear(blocks)
    for i in range(len(g.c)):
        for e in range(g.H_first[i], g.H_first[i + 1]):
            add(blocks, i, g.H_column[e], g.H[e])
        add(blocks, i, i, weight * room.hold[i])
    for k in range(len(g.kind)):
        d, low, width = g.row[k + 1] - g.row[k], g.first[k], g.first[k + 1] - g.first[k]
        if _pushes(room.E[k], d):
            W = g.W[g.entry[k] : g.entry[k + 1]].reshape(d, width)
            C = g.C[g.entry[k] : g.entry[k + 1]].reshape(d, width)
            add_product(blocks, g.column[low : low + width], C, room.E[k, :d, :d], W, room.push)
    return factorise_blocks(blocks)


@kernel
def descend(
    g: Groups,
    weight: float,
    smooth: float,
    lengths: int,
    most: int,
    goal: float,
    size: float,
    x: Reals,
    v: Reals,
    xc: Reals,
    vc: Reals,
    room: Room,
    halt: Ints,
    count: Ints,
) -> float:
    """From where the map has just been evaluated, with the square of its size, take at most so many Newton
    steps, each of the first of so many lengths, halved one by one, that lets the map fall (whole steps, if
    one), until its size is within `goal`, or falls along none of them, or halt (1,) is set. Returns the size;
    count[0] counts the steps."""
    for step in range(most):
        if size == 0.0 or (step > 0 and not size > goal * goal) or halt[0] != 0:
            break
        count[0] += 1
        if not find_step(g, weight, room):
            return math.inf
        length, best, chosen, newer = 1.0, math.inf, 0.0, math.inf
        for _ in range(lengths):
            _move(x, v, length, room)
            newer = evaluate(g, weight, smooth, room.xt, room.vt, xc, vc, room)
            if newer < best:
                best, chosen = newer, length
            if newer <= (1.0 - 1e-4 * length) * size:
                break
            length *= 0.5
        if not best < math.inf:
            return math.inf
        if best >= size and lengths > 1:
            return math.sqrt(size)
        if chosen != length:
            _move(x, v, chosen, room)
            newer = evaluate(g, weight, smooth, room.xt, room.vt, xc, vc, room)
        for r in range(len(x)):
            x[r] = room.xt[r]
        for i in range(len(v)):
            v[i] = room.vt[i]
        size = newer
    return math.sqrt(size)


@inner_kernel
def _move(x: Reals, v: Reals, length: float, room: Room) -> None:
    for r in range(len(x)):
        room.xt[r] = x[r] + length * room.dx[r]
    for i in range(len(v)):
        room.vt[i] = v[i] + length * room.dv[i]

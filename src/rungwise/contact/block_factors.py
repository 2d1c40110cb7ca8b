"""Factors of a matrix of which few entries are not zero, in blocks of at most three velocities.

Algorithm: velocities that groups always touch together make a node, as those of a body do; nodes are
eliminated in the order of their least degree; then L D U, column by column, with pivots chosen in the blocks
on the diagonal alone. Source: George and Liu, Computer Solution of Large Sparse Positive Definite Systems
(1981). Accepts: any matrix with the pattern of H + W^T W + S^T S; promises little where it is far from
positive definite: the equations are corrected by their remainder, and the residual judges.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rungwise.contact.least_degree import Pattern, eliminate, joined
from rungwise.kernel import Ints, Reals, allocating_kernel, inner_kernel, kernel

_WIDE = 3
"""Velocities of a node, at most: those of a free body."""


class Factors(NamedTuple):
    """Pattern and blocks (3 x 3, row by row) of the factors of a matrix of N nodes, by order of elimination.

    position (n,): place of each velocity's node in that order; slot (n,): its place in the node; size (N,) of
    the nodes; start (N + 1,) and later: the nodes after each that its column has blocks for; back (N + 1,)
    and source: the blocks before, whose row is the node, with owner, the node whose column they are in;
    diagonal (N, 9), inverted once it is factored, lower and upper (blocks, 9); where (N,), column (3 N,):
    scratch.
    """

    position: Ints
    slot: Ints
    size: Ints
    start: Ints
    later: Ints
    back: Ints
    source: Ints
    owner: Ints
    diagonal: Reals
    lower: Reals
    upper: Reals
    where: Ints
    column: Reals


@allocating_kernel
def plan(pattern: Pattern) -> Factors:
    """Factors of a pattern, their blocks yet to be filled."""
    n = len(pattern.H_first) - 1
    node, slot, count = _nodes(pattern)
    place, start, later = eliminate(joined(pattern, node, count))
    size = np.zeros(count, np.int64)
    for i in range(n):
        node[i] = place[node[i]]
        size[node[i]] += 1
    blocks = len(later)
    back, source, owner = (
        np.zeros(count + 1, np.int64),
        np.empty(blocks, np.int64),
        np.empty(blocks, np.int64),
    )
    for e in range(blocks):
        back[later[e] + 1] += 1
    for p in range(count):
        back[p + 1] += back[p]
    at = back.copy()
    for p in range(count):
        for e in range(start[p], start[p + 1]):
            source[at[later[e]]], owner[at[later[e]]] = e, p
            at[later[e]] += 1
    return Factors(
        node, slot, size, start, later, back, source, owner, np.empty((count, 9)), np.empty((blocks, 9)),
        np.empty((blocks, 9)), np.empty(count, np.int64), np.empty(_WIDE * count),
    )  # fmt: skip


@allocating_kernel
def _nodes(pattern: Pattern) -> tuple[Ints, Ints, int]:
    """The node of each velocity, its place there, and how many nodes there are."""
    n = len(pattern.H_first) - 1
    all_of, both, count = np.zeros(n, np.int64), np.zeros(n, np.int64), 0
    for g in range(len(pattern.first) - 1):
        for e in range(pattern.first[g], pattern.first[g + 1]):
            all_of[pattern.column[e]] += 1
            if e > pattern.first[g] and pattern.column[e - 1] == pattern.column[e] - 1:
                both[pattern.column[e]] += 1
    node, slot = np.empty(n, np.int64), np.zeros(n, np.int64)
    for i in range(n):
        joins = i > 0 and slot[i - 1] < _WIDE - 1 and all_of[i] == both[i] == all_of[i - 1]
        if joins:
            slot[i] = slot[i - 1] + 1
        else:
            count += 1
        node[i] = count - 1
    return node, slot, count


@inner_kernel
def add(factors: Factors, i: int, j: int, value: float) -> None:
    """Add to entry (i, j) of the matrix."""
    a, b = factors.position[i], factors.position[j]
    at = 3 * factors.slot[i] + factors.slot[j]
    if a == b:
        factors.diagonal[a, at] += value
    elif a > b:
        factors.lower[_block(factors, b, a), at] += value
    else:
        factors.upper[_block(factors, a, b), at] += value


@inner_kernel
def add_product(factors: Factors, touched: Ints, C: Reals, E: Reals, W: Reals, push: Reals) -> None:
    """Add C^T E W to the matrix, where column j of C and W (d, w) stands for velocity touched[j]. `push` (w
    d,) is scratch."""
    size, width = W.shape
    for m in range(width):
        for c in range(size):
            total = 0.0
            for r in range(size):
                total += C[r, m] * E[r, c]
            push[m * size + c] = total
    i = 0
    while i < width:
        a, i_end = _node_at(factors, touched, i)
        j = 0
        while j < width:
            b, j_end = _node_at(factors, touched, j)
            if a == b:
                block = factors.diagonal[a]
            elif a > b:
                block = factors.lower[_block(factors, b, a)]
            else:
                block = factors.upper[_block(factors, a, b)]
            for m in range(i, i_end):
                row = 3 * factors.slot[touched[m]]
                for k in range(j, j_end):
                    total = 0.0
                    for c in range(size):
                        total += push[m * size + c] * W[c, k]
                    block[row + factors.slot[touched[k]]] += total
            j = j_end
        i = i_end


@inner_kernel
def _node_at(factors: Factors, touched: Ints, i: int) -> tuple[int, int]:
    """The place of the node of touched[i], and where its velocities end in `touched`."""
    node, end = factors.position[touched[i]], i + 1
    while end < len(touched) and factors.position[touched[end]] == node:
        end += 1
    return node, end


@inner_kernel
def _block(factors: Factors, owner: int, other: int) -> int:
    """The block of two nodes, the first of which is eliminated first."""
    low, high = factors.start[owner], factors.start[owner + 1] - 1
    while low < high:
        middle = (low + high) // 2
        if factors.later[middle] < other:
            low = middle + 1
        else:
            high = middle
    return int(low)


@kernel
def clear(factors: Factors) -> None:
    """Let all entries be zero, and one on the diagonal of what nodes lack in size."""
    for p in range(len(factors.size)):
        for m in range(9):
            factors.diagonal[p, m] = 0.0
        for m in range(factors.size[p], _WIDE):
            factors.diagonal[p, 4 * m] = 1.0
    for e in range(len(factors.later)):
        for m in range(9):
            factors.lower[e, m] = factors.upper[e, m] = 0.0


@kernel
def factorise(factors: Factors) -> bool:
    """Factor the matrix in place; False where a block on the diagonal is singular."""
    start, later, where = factors.start, factors.later, factors.where
    lower, upper, diagonal = factors.lower, factors.upper, factors.diagonal
    for p in range(len(factors.size)):
        for e in range(start[p], start[p + 1]):
            where[later[e]] = e
        for s in range(factors.back[p], factors.back[p + 1]):
            own, end = factors.source[s], start[factors.owner[s] + 1]
            _subtract(lower[own], upper[own], diagonal[p])
            for e in range(own + 1, end):
                target = where[later[e]]
                _subtract(lower[e], upper[own], lower[target])
                _subtract(lower[own], upper[e], upper[target])
        if not _invert(diagonal[p]):
            return False
        for e in range(start[p], start[p + 1]):
            _scale(lower[e], diagonal[p])
    return True


@inner_kernel
def _subtract(a: Reals, b: Reals, target: Reals) -> None:
    """target -= a b, of blocks."""
    for i in range(0, 9, 3):
        for j in range(3):
            target[i + j] -= a[i] * b[j] + a[i + 1] * b[3 + j] + a[i + 2] * b[6 + j]


@inner_kernel
def _scale(a: Reals, b: Reals) -> None:
    """a = a b, of blocks."""
    for i in range(0, 9, 3):
        x, y, z = a[i], a[i + 1], a[i + 2]
        for j in range(3):
            a[i + j] = x * b[j] + y * b[3 + j] + z * b[6 + j]


@kernel
def _invert(a: Reals) -> bool:
    """Invert a block in place: Gauss and Jordan, with pivots chosen by size in each column."""
    order = 0
    for k in range(3):
        pivot = k
        for i in range(k + 1, 3):
            if abs(a[3 * i + k]) > abs(a[3 * pivot + k]):
                pivot = i
        if a[3 * pivot + k] == 0.0:
            return False
        order = 3 * order + pivot
        for j in range(3):
            a[3 * k + j], a[3 * pivot + j] = a[3 * pivot + j], a[3 * k + j]
        part = 1.0 / a[4 * k]
        a[4 * k] = 1.0
        for j in range(3):
            a[3 * k + j] *= part
        for i in range(3):
            if i != k:
                factor = a[3 * i + k]
                a[3 * i + k] = 0.0
                for j in range(3):
                    a[3 * i + j] -= factor * a[3 * k + j]
    for k in range(2, -1, -1):
        pivot = order % 3
        order //= 3
        for i in range(3):
            a[3 * i + k], a[3 * i + pivot] = a[3 * i + pivot], a[3 * i + k]
    return True


@kernel
def substitute(factors: Factors, x: Reals) -> None:
    """Solve for the right-hand side x (n,), in place."""
    start, later, y = factors.start, factors.later, factors.column
    lower, upper, diagonal = factors.lower, factors.upper, factors.diagonal
    for m in range(len(y)):
        y[m] = 0.0
    for i in range(len(x)):
        y[3 * factors.position[i] + factors.slot[i]] = x[i]
    for p in range(len(factors.size)):
        for e in range(start[p], start[p + 1]):
            _take(lower[e], y, 3 * p, 3 * later[e])
    for p in range(len(factors.size) - 1, -1, -1):
        for e in range(start[p], start[p + 1]):
            _take(upper[e], y, 3 * later[e], 3 * p)
        a, x0, x1, x2 = diagonal[p], y[3 * p], y[3 * p + 1], y[3 * p + 2]
        for i in range(3):
            y[3 * p + i] = a[3 * i] * x0 + a[3 * i + 1] * x1 + a[3 * i + 2] * x2
    for i in range(len(x)):
        x[i] = y[3 * factors.position[i] + factors.slot[i]]


@inner_kernel
def _take(a: Reals, y: Reals, source: int, target: int) -> None:
    """Take a times the block of y at `source` from the one at `target`."""
    x0, x1, x2 = y[source], y[source + 1], y[source + 2]
    for i in range(3):
        y[target + i] -= a[3 * i] * x0 + a[3 * i + 1] * x1 + a[3 * i + 2] * x2

"""The order in which the unknowns of a matrix are eliminated, so that few entries become other than zero.

Algorithm: of the nodes that are left, the one of least degree is next, and what it was joined with is joined
from then on. Source: George and Liu, Computer Solution of Large Sparse Positive Definite Systems (1981). Rows
of the graph are bits of words, so that joining is one operation for many nodes.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rungwise.kernel import Ints, allocating_kernel, inner_kernel

_NONE = -1
_LAST = 2**62
"""Rank of nodes that are eliminated."""
_BITS = 62
"""Bits of a word that are used: with as many its sums and its negative are exact."""


class Pattern(NamedTuple):
    """Where a matrix has entries: H_first (n + 1,), where the rows of H begin in H_column; first (g + 1,),
    where the velocities begin in `column` that groups touch, each of which couples all of its own."""

    H_first: Ints
    H_column: Ints
    first: Ints
    column: Ints


@allocating_kernel
def joined(pattern: Pattern, node: Ints, count: int) -> Ints:
    """Which of so many nodes are joined by H or by a group: a row of bits (N, words) for each; `node` is that
    of each velocity."""
    near = np.zeros((count, (count + _BITS - 1) // _BITS), np.int64)
    for i in range(len(pattern.H_first) - 1):
        for e in range(pattern.H_first[i], pattern.H_first[i + 1]):
            join(near, node[i], node[pattern.H_column[e]])
    for g in range(len(pattern.first) - 1):
        first = pattern.first[g]
        for e in range(first, pattern.first[g + 1]):
            own = node[pattern.column[e]]
            if e == first or node[pattern.column[e - 1]] != own:
                for f in range(first, e):
                    join(near, own, node[pattern.column[f]])
    return near


@inner_kernel
def join(near: Ints, a: int, b: int) -> None:
    """Note that two nodes are joined, if they are two."""
    if a != b:
        near[a, b // _BITS] |= 1 << b % _BITS
        near[b, a // _BITS] |= 1 << a % _BITS


@allocating_kernel
def eliminate(near: Ints) -> tuple[Ints, Ints, Ints]:
    """Places of nodes in the order of least degree, the first of equals first, and the nodes after each that
    it is joined with then: start (N + 1,) and later. Fills `near`, whose bits say which nodes are joined."""
    count = len(near)
    place, start = np.full(count, _NONE), np.zeros(count + 1, np.int64)
    later, least = np.empty(8 * count, np.int64), _contest(near)
    for p in range(count):
        pivot = least[1] % count
        place[pivot] = p
        _rank(least, pivot, _LAST)
        row = near[pivot]
        later = _with_room(later, start[p], count)
        start[p + 1] = _write_members(row, later, start[p])
        for a in later[start[p] : start[p + 1]]:
            degree = _spread(row, near[a], a, pivot)
            _rank(least, a, degree * count + a)
    later = later[: start[count]].copy()
    for e in range(len(later)):
        later[e] = place[later[e]]
    for p in range(count):
        later[start[p] : start[p + 1]].sort()
    return place, start, later


@allocating_kernel
def _with_room(array: Ints, used: int, more: int) -> Ints:
    """The array, or a copy of what is used of it that has room for more."""
    if used + more <= len(array):
        return array
    longer = np.empty(2 * (used + more), np.int64)
    longer[:used] = array[:used]
    return longer


@allocating_kernel
def _contest(near: Ints) -> Ints:
    """A tree whose root, at 1, is the least of the ranks of nodes, degree times their count plus number."""
    count, leaves = len(near), 1
    while leaves < count:
        leaves *= 2
    least = np.full(2 * leaves, _LAST)
    for a in range(count):
        degree = 0
        for w in range(near.shape[1]):
            degree += _members(near[a, w])
        least[leaves + a] = degree * count + a
    for k in range(leaves - 1, 0, -1):
        least[k] = min(least[2 * k], least[2 * k + 1])
    return least


@inner_kernel
def _rank(least: Ints, a: int, rank: int) -> None:
    """Give a node another rank."""
    k = len(least) // 2 + a
    least[k] = rank
    while k > 1:
        k //= 2
        lesser = min(least[2 * k], least[2 * k + 1])
        if least[k] == lesser:
            break
        least[k] = lesser


@inner_kernel
def _members(word: int) -> int:
    """How many bits of a word are set."""
    word -= (word >> 1) & 0x5555555555555555
    word = (word & 0x3333333333333333) + ((word >> 2) & 0x3333333333333333)
    word = (word + (word >> 4)) & 0x0F0F0F0F0F0F0F0F
    word += word >> 8
    word += word >> 16
    word += word >> 32
    return word & 0x7F


@inner_kernel
def _write_members(row: Ints, out: Ints, at: int) -> int:
    """Write the nodes of a row from place `at` on; returns where they end."""
    for w in range(len(row)):
        word = row[w]
        while word != 0:
            lowest = word & -word
            out[at] = _BITS * w + _members(lowest - 1)
            word ^= lowest
            at += 1
    return at


@inner_kernel
def _spread(source: Ints, target: Ints, own: int, pivot: int) -> int:
    """Join the node `own`, whose row is `target`, with all that `source`, the row of the pivot, is, but not
    with the pivot; returns its degree."""
    target[pivot // _BITS] ^= 1 << pivot % _BITS
    degree = -1
    for w in range(len(source)):
        target[w] |= source[w]
        degree += _members(target[w])
    target[own // _BITS] ^= 1 << own % _BITS
    return degree

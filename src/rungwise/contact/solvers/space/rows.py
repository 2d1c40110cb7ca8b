"""A step's rows in space, sorted by what they couple: blocks of H, and islands of bodies that touch.

Coordinates that H couples (a body, a hand) are a block; blocks that rows couple are an island. Coordinates
are sorted by island and block, and counted in units in which H has a unit diagonal; rows are grouped by
contact, or one by one where they are limited, sorted by island, and kept with the coordinates of the blocks
they touch only. A contact without friction has its normal row alone.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from rungwise.contact.step.problem import ContactProblem, Sizes
from rungwise.kernel import Ints, Reals, allocating_kernel, inner_kernel, kernel

_DEMANDED = 1e3
"""Rate over the problem's quantum from which on it is a demand, not rounding; chosen by trial, to a
decade."""


class Bodies(NamedTuple):
    """n coordinates, sorted: H (n, n), its factors L L^T by blocks (n, n), first and last (n,) coordinate of
    the own block, the latter excluded, load c (n,), place (n,) in the problem, unit (n,): a velocity of the
    problem over one here."""

    H: Reals
    factor: Reals
    first: Ints
    last: Ints
    c: Reals
    place: Ints
    unit: Reals


class Groups(NamedTuple):
    """g groups of rows, sorted: row (g + 1,) and column (g + 1,), their first rows and first entries of
    `touched`, the coordinates they touch; entry (g + 1,): first entries of W, row by row; source (g,):
    contact, or number of contacts plus limited row.

    mu (g,) of a contact, -1 of a limited row; limit (g,) of its force; R (g, d, d); w (rows,); scale (g,):
    mean yield of bodies to forces, as if no coordinates were coupled; ahead (g,): the yield with which the
    map looks ahead.
    """

    row: Ints
    column: Ints
    entry: Ints
    source: Ints
    mu: Reals
    limit: Reals
    R: Reals
    w: Reals
    touched: Ints
    W: Reals
    scale: Reals
    ahead: Reals


@allocating_kernel
def sort_rows(p: ContactProblem, sizes: Sizes, bodies: Bodies, island: Ints, order: Ints) -> int:
    """Fill the bodies, the ends (islands, 2) of each island's coordinates and groups in `island`, and the
    groups' order in `order` (groups,). Returns the number of islands; -1 where H is not positive definite."""
    n, contacts, limited = sizes
    block, isle = np.empty(n, np.int64), np.empty(n, np.int64)
    groups, d = contacts + limited, p.R.shape[1]
    for i in range(n):
        block[i] = i
        for j in range(i):
            if p.H[i, j] != 0.0:
                _join(block, i, j)
    for i in range(n):
        isle[i] = _root(block, i)
    home = np.empty(groups, np.int64)
    for g in range(groups):
        home[g] = -1
        if g < contacts:
            for r in range(g * d, g * d + _size(p, g, contacts)):
                home[g] = _touch(p.W[r, :n], isle, home[g])
        else:
            home[g] = _touch(p.S[g - contacts, :n], isle, home[g])
    count, done, placed = 0, 0, 0
    for top in range(n):
        if _root(isle, top) != top:
            continue
        for i in range(n):
            if _root(block, i) != i or _root(isle, i) != top:
                continue
            begin = done
            for j in range(i, n):
                if _root(block, j) == i:
                    bodies.place[done] = j
                    done += 1
            for j in range(begin, done):
                bodies.first[j], bodies.last[j] = begin, done
        for g in range(groups):
            if home[g] >= 0 and _root(isle, home[g]) == top:
                order[placed] = g
                placed += 1
        island[count, 0], island[count, 1] = done, placed
        count += 1
    for g in range(groups):
        if home[g] < 0:
            order[placed] = g
            placed += 1
            island[count, 0], island[count, 1] = done, placed
            count += 1
    return count if _fill_bodies(p, n, bodies) else -1


@inner_kernel
def _size(p: ContactProblem, g: int, contacts: int) -> int:
    return p.R.shape[1] if g < contacts and p.mu[g] > 0.0 else 1


@inner_kernel
def _root(label: Ints, i: int) -> int:
    while label[i] != i:
        label[i] = label[label[i]]
        i = label[i]
    return i


@inner_kernel
def _join(label: Ints, i: int, j: int) -> None:
    """Join two sets; the least member is the root."""
    a, b = _root(label, i), _root(label, j)
    label[max(a, b)] = min(a, b)


@inner_kernel
def _touch(row: Reals, isle: Ints, home: int) -> int:
    """Join the coordinates of a row; returns one of them, or `home`."""
    for i in range(len(row)):
        if row[i] != 0.0:
            if home >= 0:
                _join(isle, home, i)
            home = i
    return home


@kernel
def _fill_bodies(p: ContactProblem, n: int, bodies: Bodies) -> bool:
    """Scale, sort and factorise; whether H is positive definite."""
    H, L, first, last, c, place, unit = bodies
    for i in range(n):
        own = p.H[place[i], place[i]]
        if not own > 0.0:
            return False
        unit[i] = 1.0 / math.sqrt(own)
        c[i] = unit[i] * p.c[place[i]]
    for i in range(n):
        for j in range(first[i], last[i]):
            H[i, j] = unit[i] * unit[j] * p.H[place[i], place[j]]
        for j in range(first[i], i + 1):
            total = H[i, j]
            for k in range(first[i], j):
                total -= L[i, k] * L[j, k]
            if j < i:
                L[i, j] = total * L[j, j]
            elif not total > 0.0:
                return False
            else:
                L[i, i] = 1.0 / math.sqrt(total)
    return True


@inner_kernel
def substitute_bodies(bodies: Bodies, low: int, high: int, x: Reals) -> None:
    """Replace x (n,) by H^-1 x from coordinate `low` up to `high`, which are ends of blocks."""
    L, first, last = bodies.factor, bodies.first, bodies.last
    for i in range(low, high):
        total = x[i]
        for j in range(first[i], i):
            total -= L[i, j] * x[j]
        x[i] = total * L[i, i]
    for i in range(high - 1, low - 1, -1):
        total = x[i]
        for j in range(i + 1, last[i]):
            total -= L[j, i] * x[j]
        x[i] = total * L[i, i]


@kernel
def fill_groups(
    p: ContactProblem, n: int, contacts: int, bodies: Bodies, order: Ints, groups: Groups
) -> None:
    """Fill the groups, in this order."""
    d = p.R.shape[1]
    groups.row[0] = groups.column[0] = groups.entry[0] = 0
    for g in range(len(order)):
        source = order[g]
        r = source - contacts
        groups.source[g] = source
        if r < 0:
            size = _size(p, source, contacts)
            groups.mu[g], groups.limit[g] = p.mu[source], math.inf
            rows = p.W[source * d : source * d + size, :n]
            for i in range(size):
                groups.w[groups.row[g] + i] = p.w[source * d + i]
                for j in range(size):
                    groups.R[g, i, j] = p.R[source, i, j]
        else:
            size, rows = 1, p.S[r : r + 1, :n]
            groups.mu[g], groups.limit[g] = -1.0, p.F[r]
            groups.w[groups.row[g]], groups.R[g, 0, 0] = p.w_s[r], p.R_s[r]
        groups.row[g + 1] = groups.row[g] + size
        _compress(rows, bodies, g, groups)


@kernel
def demanded_yield(p: ContactProblem, sizes: Sizes) -> float:
    """The greatest rate that is demanded over the greatest force that a load calls for; 0 where there is
    none of either."""
    n, contacts, limited = sizes
    rate, force, rows = 0.0, 0.0, contacts * p.R.shape[1]
    for r in range(rows):
        rate = max(rate, abs(p.w[r]))
    for r in range(limited):
        rate = max(rate, abs(p.w_s[r]))
    for i in range(n):
        lever = 0.0
        for r in range(rows):
            lever = max(lever, abs(p.W[r, i]))
        for r in range(limited):
            lever = max(lever, abs(p.S[r, i]))
        if lever > 0.0:
            force = max(force, abs(p.c[i]) / lever)
    return rate / force if force > 0.0 and rate > _DEMANDED * p.quantum[0] else 0.0


@inner_kernel
def _compress(rows: Reals, bodies: Bodies, g: int, groups: Groups) -> None:
    """Keep the columns in which a row has an entry."""
    size, n = rows.shape
    touched = groups.touched[groups.column[g] :]
    width, total = 0, 0.0
    for i in range(n):
        found = False
        for r in range(size):
            found |= rows[r, bodies.place[i]] != 0.0
        if found:
            touched[width] = i
            width += 1
    groups.column[g + 1], groups.entry[g + 1] = groups.column[g] + width, groups.entry[g] + size * width
    at = groups.entry[g]
    for r in range(size):
        for j in range(width):
            groups.W[at] = rows[r, bodies.place[touched[j]]] * bodies.unit[touched[j]]
            total += groups.W[at] * groups.W[at]
            at += 1
    groups.scale[g] = groups.ahead[g] = total / size

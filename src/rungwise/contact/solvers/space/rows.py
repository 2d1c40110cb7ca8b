"""A step's rows in space, sorted by what they couple: blocks of H, and islands of bodies that touch.

Coordinates that H couples (a body, a hand) are a block; blocks that rows couple are an island. Coordinates
are sorted by island and block, and counted in units in which H has a unit diagonal; rows are grouped by
contact, or one by one where they are limited, sorted by island, and kept with the coordinates of the blocks
they touch only. A contact without friction has its normal row alone; limited rows that share a ball, |x| <=
limit, are one group, in the unit of the first one's force.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from rungwise.contact.step.problem import ContactProblem, Sizes
from rungwise.contact.step.touched import Touched
from rungwise.kernel import Ints, Reals, allocating_kernel, inner_kernel, kernel

_DEMANDED = 1e3
"""Rate over the problem's quantum from which on it is a demand, not rounding; chosen by trial, to a
decade."""


_END = -1


class Order(NamedTuple):
    """Coordinates (n,), sorted: place in the problem, rank of a place among the sorted, first and last
    coordinate of the own block, the latter excluded."""

    place: Ints
    rank: Ints
    first: Ints
    last: Ints


class Bodies(NamedTuple):
    """n coordinates, sorted: H and its factors L L^T, by blocks, whose entry (i, j) stands at[i] + j; first
    and last (n,) coordinate of the own block, the latter excluded, load c (n,), place (n,) in the problem,
    unit (n,): a velocity of the problem over one here."""

    H: Reals
    factor: Reals
    at: Ints
    first: Ints
    last: Ints
    c: Reals
    place: Ints
    unit: Reals


class Groups(NamedTuple):
    """g groups of rows, sorted: row (g + 1,) and column (g + 1,), their first rows and first entries of
    `touched`, the coordinates they touch; entry (g + 1,): first entries of W, row by row; source (g,):
    contact, or number of contacts plus limited row; origin (rows,): row of the problem, limited ones after
    those of all contacts, and share (rows,): a force of the problem over one here.

    mu (g,) of a contact, -1 of limited rows; limit (g,) of their force; R (g, d, d); w (rows,); scale (g,):
    mean yield of bodies to forces, as if no coordinates were coupled; ahead (g,): the yield with which the
    map looks ahead.
    """

    row: Ints
    column: Ints
    entry: Ints
    source: Ints
    origin: Ints
    share: Reals
    mu: Reals
    limit: Reals
    R: Reals
    w: Reals
    touched: Ints
    W: Reals
    scale: Reals
    ahead: Reals


@allocating_kernel
def lead_rows(surface: Ints, limited: int) -> Ints:
    """The first row of each limited row's ball (limited,): of those with the same number in `surface`
    (limited,), the row itself where that is negative, or `surface` is empty."""
    lead = np.empty(limited, np.int64)
    for r in range(limited):
        lead[r] = r
        for first in range(r if len(surface) > 0 and surface[r] >= 0 else 0):
            if surface[first] == surface[r]:
                lead[r] = first
                break
    return lead


@inner_kernel
def leads_group(awake: Ints, lead: Ints, g: int) -> bool:
    """Whether a contact, or limited row after them, is a group or the first of one: contacts that are not
    `awake` (contacts,) are none."""
    contacts = len(awake)
    return bool(awake[g] != 0 if g < contacts else lead[g - contacts] == g - contacts)


@inner_kernel
def count_groups(awake: Ints, lead: Ints) -> int:
    """Groups of a problem."""
    count = 0
    for g in range(len(awake) + len(lead)):
        count += 1 if leads_group(awake, lead, g) else 0
    return count


@allocating_kernel
def sort_rows(
    p: ContactProblem,
    sizes: Sizes,
    touched: Touched,
    awake: Ints,
    lead: Ints,
    sorted_by: Order,
    island: Ints,
    order: Ints,
) -> int:
    """Fill the order of coordinates, the ends (islands, 2) of each island's coordinates and groups in
    `island`, and the groups' order in `order` (groups,). Returns the number of islands."""
    n, contacts, limited = sizes
    block, isle = np.empty(n, np.int64), np.empty(n, np.int64)
    groups, d = contacts + limited, p.R.shape[1]
    place, rank, first, last = sorted_by
    for i in range(n):
        block[i] = i
    for i in range(n):
        for j in range(touched.begin[i], min(touched.end[i], i)):
            if p.H[i, j] != 0.0:
                _join(block, i, j)
    for i in range(n):
        isle[i] = _root(block, i)
    home = np.empty(groups, np.int64)
    for g in range(groups):
        home[g] = _END
        rows = (
            p.W[g * d : g * d + _size(p, g, contacts)]
            if g < contacts
            else p.S[g - contacts : g - contacts + 1]
        )
        joins = g >= contacts or awake[g] != 0
        for e in range(touched.first[g], touched.first[g + 1] if joins else touched.first[g]):
            if _meets(rows, touched.coordinate[e]):
                if home[g] != _END:
                    _join(isle, home[g], touched.coordinate[e])
                home[g] = touched.coordinate[e]
    for r in range(limited):
        g, leader = contacts + r, contacts + lead[r]
        if home[leader] == _END:
            home[leader] = home[g]
        elif home[g] != _END:
            _join(isle, home[leader], home[g])
    # Chains: members of blocks by their least, blocks of islands by theirs, groups of islands.
    members, blocks = np.full((2, n), _END), np.full((2, n), _END)
    owned = np.full((2, max(n, groups)), _END)
    tails = np.empty((3, n), np.int64)
    for i in range(n):
        _append(members, tails[0], _root(block, i), i)
    for i in range(n):
        if _root(block, i) == i:
            _append(blocks, tails[1], _root(isle, i), i)
    for g in range(groups):
        if home[g] != _END and leads_group(awake, lead, g):
            _append(owned, tails[2], _root(isle, home[g]), g)
    count, done, placed = 0, 0, 0
    for top in range(n):
        if blocks[0, top] == _END:
            continue
        i = blocks[0, top]
        while i != _END:
            begin, j = done, members[0, i]
            while j != _END:
                place[done], rank[j] = j, done
                done, j = done + 1, members[1, j]
            first[begin:done], last[begin:done] = begin, done
            i = blocks[1, i]
        g = owned[0, top]
        while g != _END:
            order[placed] = g
            placed, g = placed + 1, owned[1, g]
        island[count, 0], island[count, 1] = done, placed
        count += 1
    for g in range(groups):
        if home[g] == _END and leads_group(awake, lead, g):
            order[placed] = g
            placed += 1
            island[count, 0], island[count, 1] = done, placed
            count += 1
    return count


@inner_kernel
def _append(chains: Ints, tail: Ints, top: int, own: int) -> None:
    """Append to the chain of `top`, which begins with chains[0, top], and goes on from i to chains[1, i]."""
    if chains[0, top] == _END:
        chains[0, top] = own
    else:
        chains[1, tail[top]] = own
    tail[top] = own


@inner_kernel
def _size(p: ContactProblem, g: int, contacts: int) -> int:
    return p.R.shape[1] if g < contacts and p.mu[g] > 0.0 else 1


@inner_kernel
def _meets(rows: Reals, j: int) -> bool:
    """Whether one of the rows has an entry in this column."""
    found = False
    for r in range(rows.shape[0]):
        found |= rows[r, j] != 0.0
    return found


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


@kernel
def fill_bodies(p: ContactProblem, n: int, bodies: Bodies) -> bool:
    """Scale, sort and factorise; whether H is positive definite."""
    H, L, at, first, last, c, place, unit = bodies
    for i in range(n):
        own = p.H[place[i], place[i]]
        if not own > 0.0:
            return False
        unit[i] = 1.0 / math.sqrt(own)
        c[i] = unit[i] * p.c[place[i]]
    for i in range(n):
        for j in range(first[i], last[i]):
            H[at[i] + j] = unit[i] * unit[j] * p.H[place[i], place[j]]
        for j in range(first[i], i + 1):
            total = H[at[i] + j]
            for k in range(first[i], j):
                total -= L[at[i] + k] * L[at[j] + k]
            if j < i:
                L[at[i] + j] = total * L[at[j] + j]
            elif not total > 0.0:
                return False
            else:
                L[at[i] + i] = 1.0 / math.sqrt(total)
    return True


@inner_kernel
def substitute_bodies(bodies: Bodies, low: int, high: int, x: Reals) -> None:
    """Replace x (n,) by H^-1 x from coordinate `low` up to `high`, which are ends of blocks."""
    L, at, first, last = bodies.factor, bodies.at, bodies.first, bodies.last
    for i in range(low, high):
        total = x[i]
        for j in range(first[i], i):
            total -= L[at[i] + j] * x[j]
        x[i] = total * L[at[i] + i]
    for i in range(high - 1, low - 1, -1):
        total = x[i]
        for j in range(i + 1, last[i]):
            total -= L[at[j] + i] * x[j]
        x[i] = total * L[at[i] + i]


@kernel
def fill_groups(
    p: ContactProblem,
    contacts: int,
    touched: Touched,
    lead: Ints,
    sorted_by: Order,
    bodies: Bodies,
    order: Ints,
    groups: Groups,
) -> None:
    """Fill the groups, in this order."""
    d = p.R.shape[1]
    groups.row[0] = groups.column[0] = groups.entry[0] = 0
    for g in range(len(order)):
        source, first = order[g], groups.row[g]
        r, end = source - contacts, first
        groups.source[g] = source
        if r < 0:
            groups.mu[g], groups.limit[g] = p.mu[source], math.inf
            end += _size(p, source, contacts)
            for i in range(end - first):
                groups.origin[first + i], groups.share[first + i] = source * d + i, 1.0
                groups.w[first + i] = p.w[source * d + i]
                for j in range(end - first):
                    groups.R[g, i, j] = p.R[source, i, j]
        else:
            groups.mu[g], groups.limit[g] = -1.0, p.F[r]
            for m in range(r, len(lead)):
                if lead[m] == r:
                    share = p.F[m] / p.F[r] if m > r else 1.0
                    groups.origin[end], groups.share[end] = contacts * d + m, share
                    groups.w[end] = share * p.w_s[m]
                    for i in range(end - first):
                        groups.R[g, i, end - first] = groups.R[g, end - first, i] = 0.0
                    groups.R[g, end - first, end - first] = share * share * p.R_s[m]
                    end += 1
        groups.row[g + 1] = end
        _compress(p, contacts, touched, sorted_by.rank, bodies, g, groups)


@allocating_kernel
def demanded_yield(p: ContactProblem, sizes: Sizes, touched: Touched) -> float:
    """The greatest rate that is demanded over the greatest force that a load calls for; 0 where there is
    none of either."""
    n, contacts, limited = sizes
    rate, force, d = 0.0, 0.0, p.R.shape[1]
    for r in range(contacts * d):
        rate = max(rate, abs(p.w[r]))
    for r in range(limited):
        rate = max(rate, abs(p.w_s[r]))
    lever = np.zeros(n)
    for g in range(contacts + limited):
        for e in range(touched.first[g], touched.first[g + 1]):
            i = touched.coordinate[e]
            if g >= contacts:
                lever[i] = max(lever[i], abs(p.S[g - contacts, i]))
            for r in range(g * d, g * d + d if g < contacts else g * d):
                lever[i] = max(lever[i], abs(p.W[r, i]))
    for i in range(n):
        if lever[i] > 0.0:
            force = max(force, abs(p.c[i]) / lever[i])
    return rate / force if force > 0.0 and rate > _DEMANDED * p.quantum[0] else 0.0


@inner_kernel
def _compress(
    p: ContactProblem, contacts: int, touched: Touched, rank: Ints, bodies: Bodies, g: int, groups: Groups
) -> None:
    """Keep the columns in which a row has an entry, sorted."""
    first, end, total, width = groups.row[g], groups.row[g + 1], 0.0, 0
    own, rows = groups.touched[groups.column[g] :], p.R.shape[1] * contacts
    for r in range(first, end):
        source = groups.source[g] if groups.mu[g] >= 0.0 else groups.origin[r] - rows + contacts
        for e in range(touched.first[source], touched.first[source + 1]):
            if _entry(p, rows, groups.origin[r], touched.coordinate[e]) != 0.0:
                width = _insert(rank[touched.coordinate[e]], own, width)
    groups.column[g + 1] = groups.column[g] + width
    groups.entry[g + 1] = groups.entry[g] + (end - first) * width
    at = groups.entry[g]
    for r in range(first, end):
        for j in range(width):
            entry = _entry(p, rows, groups.origin[r], bodies.place[own[j]])
            groups.W[at] = groups.share[r] * entry * bodies.unit[own[j]]
            total += groups.W[at] * groups.W[at]
            at += 1
    groups.scale[g] = groups.ahead[g] = total / (end - first)


@inner_kernel
def _entry(p: ContactProblem, rows: int, r: int, j: int) -> float:
    """Entry of a row, where limited ones come after so many of contacts."""
    return float(p.W[r, j] if r < rows else p.S[r - rows, j])


@inner_kernel
def _insert(rank: int, sorted_ranks: Ints, count: int) -> int:
    """Insert a rank among so many, unless it is there; returns how many there are then."""
    at = count
    while at > 0 and sorted_ranks[at - 1] > rank:
        at -= 1
    if at > 0 and sorted_ranks[at - 1] == rank:
        return count
    for i in range(count, at, -1):
        sorted_ranks[i] = sorted_ranks[i - 1]
    sorted_ranks[at] = rank
    return count + 1

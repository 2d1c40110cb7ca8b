"""Problems of any origin as the solver sees them: a balance of forces where there is one, or else a copy.

    y = A x + b,        x = P(x - y) group by group

Velocities of a mixed form are the solver's own, where their block H has a diagonal that is positive and
each group depends on no force but its own. Elsewhere (an LCP, a circuit, a Delassus form) the velocities are
a copy of all unknowns, v = x: then H = C = 1 and W = A, and a free unknown is a force without limits.
"""

from __future__ import annotations

import math

import numpy as np

from rungwise.contact.block_factors import Factors
from rungwise.contact.kinds import cone, free, interval
from rungwise.contact.prepare.units import Sparse
from rungwise.contact.problem import Laws
from rungwise.contact.solver.groups import (
    Counts,
    Groups,
    count_in_units,
    groups_in,
    integers_of,
    reals_of,
)
from rungwise.contact.solver.islands import cut_island, label_islands
from rungwise.contact.solver.newton import multiplications, no_blocks, plan_blocks, room_in, room_of
from rungwise.contact.solver.settings import WIDE
from rungwise.contact.solver.solve import rests, solve
from rungwise.kernel import Ints, Reals, allocating_kernel, inner_kernel, kernel


@kernel
def is_balance(A: Sparse, laws: Laws, velocities: int) -> bool:
    """Whether so many free unknowns after the contacts are velocities that a balance of forces moves."""
    rows = laws.d * len(laws.mu)
    for i in range(len(A.start) - 1):
        own = 0.0
        for e in range(A.start[i], A.start[i + 1]):
            j = A.place[e]
            if rows <= i < rows + velocities:
                own += A.value[e] if i == j else 0.0
            elif not rows <= j < rows + velocities and A.value[e] != 0.0:
                together = i < rows and j < rows and i // laws.d == j // laws.d
                if i != j and not together:
                    return False
        if rows <= i < rows + velocities and not own > 0.0:
            return False
    return velocities > 0


@allocating_kernel
def solve_grouped(
    A: Sparse, back: Sparse, b: Reals, laws: Laws, velocities: int, noise: float, x: Reals, work: Reals,
    halt: Ints, count: Ints,
) -> float:  # fmt: skip
    """Solve from x (N,), into it; returns the greatest residual of an island. `back` holds the columns of A.

    With `velocities` the problem is a balance; with 0, A and b come in units in which forces and rates are
    alike. `noise` is a rate that is rounding. It ends early when halt (1,) is set, or when the
    multiplications of `work` (1,) are made, which are taken off; count (5,): see `solve`."""
    whole = _count(A, back, laws, velocities, np.empty(len(b), np.int64))
    reals, integers = np.empty(reals_of(whole)), np.empty(integers_of(whole), np.int64)
    members, n = whole.n + whole.groups, whole.n
    scratch, room = np.empty(2 * members + 2 * n + 2 * len(b), np.int64), np.empty(room_of(whole))
    order = np.empty(members, np.int64)
    apart = _begin(A, back, b, laws, velocities, noise, reals, integers, whole, scratch)
    own_reals, own_integers, worst = np.empty(len(reals)), np.empty(len(integers), np.int64), 0.0
    rows = laws.d * len(laws.mu)
    for which in range(apart):
        part = cut_island(reals, integers, whole, reals[:0], scratch, which, own_reals, own_integers)
        own = scratch[2 * members : 2 * members + n]
        if part.n < WIDE:
            found = _solve_few(
                own_reals, own_integers, part, own, rows, velocities, room, order, x, work, halt, count
            )
        else:
            blocks = plan_blocks(own_integers, part)
            found = _solve_island(
                own_reals,
                own_integers,
                part,
                own,
                rows,
                velocities,
                room,
                order,
                blocks,
                x,
                work,
                halt,
                count,
            )
        worst = max(worst, found)
    return worst


@inner_kernel
def _rows_of(laws: Laws, velocities: int, k: int) -> tuple[int, int]:
    """The first unknown of group k, and the one after its last."""
    contacts = len(laws.mu)
    if k < contacts:
        return k * laws.d, (k + 1) * laws.d
    first = contacts * laws.d + velocities + k - contacts
    return first, first + 1


@inner_kernel
def _velocity(j: int, rows: int, velocities: int) -> int:
    """The velocity that unknown j is, or copies; -1 for another."""
    if velocities == 0:
        return j
    return j - rows if rows <= j < rows + velocities else -1


@kernel
def _mark(A: Sparse, back: Sparse, laws: Laws, velocities: int, k: int, seen: Ints) -> int:
    """Mark with k the velocities that group k touches; returns how many there are."""
    first, end = _rows_of(laws, velocities, k)
    rows, width = laws.d * len(laws.mu), 0
    for i in range(first, end):
        own = _velocity(i, rows, velocities)
        if own >= 0 and seen[own] != k:
            seen[own], width = k, width + 1
        for e in range(A.start[i], A.start[i + 1]):
            j = _velocity(A.place[e], rows, velocities)
            if j >= 0 and seen[j] != k:
                seen[j], width = k, width + 1
        for e in range(back.start[i], back.start[i + 1] if velocities > 0 else back.start[i]):
            j = _velocity(back.place[e], rows, velocities)
            if j >= 0 and seen[j] != k:
                seen[j], width = k, width + 1
    return width


@kernel
def _count(A: Sparse, back: Sparse, laws: Laws, velocities: int, seen: Ints) -> Counts:
    """What `_fill` will need room for; seen (N,) is scratch."""
    rows, contacts = laws.d * len(laws.mu), len(laws.mu)
    groups, touched, entries = contacts + len(laws.lower) - velocities, 0, 0
    n = velocities if velocities > 0 else len(seen)
    filled = n if velocities == 0 else A.start[rows + n] - A.start[rows]
    for i in range(len(seen)):
        seen[i] = -1
    for k in range(groups):
        first, end = _rows_of(laws, velocities, k)
        width = _mark(A, back, laws, velocities, k, seen)
        touched, entries = touched + width, entries + (end - first) * width
    d = laws.d if contacts > 0 else 1
    return Counts(n, groups, len(seen) - velocities, filled, touched, entries, d, entries)


@kernel
def _begin(
    A: Sparse, back: Sparse, b: Reals, laws: Laws, velocities: int, noise: float, reals: Reals,
    integers: Ints, whole: Counts, scratch: Ints,
) -> int:  # fmt: skip
    """Fill the groups, and label islands in `scratch`; returns how many there are."""
    g, members = groups_in(reals, integers, whole, reals[:0]), whole.n + whole.groups
    spare = scratch[2 * members + 2 * whole.n :]
    g.noise[0] = noise
    _fill_balance(A, b, laws, velocities, g)
    _fill(A, back, b, laws, velocities, spare[: len(b)], spare[len(b) :], g)
    return label_islands(g, scratch[:members], scratch[members : 2 * members])


@kernel
def _fill_balance(A: Sparse, b: Reals, laws: Laws, velocities: int, g: Groups) -> None:
    rows, at = laws.d * len(laws.mu), 0
    g.H_first[0] = 0
    for i in range(len(g.c)):
        g.c[i], g.diagonal[i] = (-b[rows + i], 0.0) if velocities > 0 else (0.0, 1.0)
        if velocities == 0:
            g.H_column[at], g.H[at] = i, 1.0
            at += 1
        else:
            for e in range(A.start[rows + i], A.start[rows + i + 1]):
                j = A.place[e] - rows
                if 0 <= j < velocities:
                    g.H_column[at], g.H[at] = j, A.value[e]
                    g.diagonal[i] += A.value[e] if i == j else 0.0
                    at += 1
        g.H_first[i + 1] = at


@kernel
def _fill(
    A: Sparse, back: Sparse, b: Reals, laws: Laws, velocities: int, seen: Ints, place: Ints, g: Groups
) -> None:
    """Fill the groups' rows; seen and place (N,) are scratch."""
    rows, d = laws.d * len(laws.mu), g.R.shape[1]
    g.row[0] = g.first[0] = g.entry[0] = 0
    for i in range(len(b)):
        seen[i] = -1
    for k in range(len(g.kind)):
        first, end = _rows_of(laws, velocities, k)
        _set_law(laws, velocities, k, g)
        _mark(A, back, laws, velocities, k, seen)
        at = g.first[k]
        for j in range(len(g.c)):
            if seen[j] == k:
                g.column[at], place[j] = j, at - g.first[k]
                at += 1
        row, width, entry = g.row[k], at - g.first[k], g.entry[k]
        g.row[k + 1], g.first[k + 1] = row + end - first, at
        g.entry[k + 1] = entry + (end - first) * width
        for e in range(entry, g.entry[k + 1]):
            g.W[e] = g.C[e] = 0.0
        for i in range(d):
            for j in range(d):
                g.R[k, i, j] = 0.0
        for i in range(first, end):
            r, at = row + i - first, entry + (i - first) * width
            g.w[r], g.force[r], g.origin[r] = b[i], 1.0, i
            for e in range(A.start[i], A.start[i + 1]):
                j = _velocity(A.place[e], rows, velocities)
                if j >= 0:
                    g.W[at + place[j]] = A.value[e]
                else:
                    g.R[k, i - first, A.place[e] - first] = A.value[e]
            if velocities == 0:
                g.C[at + place[i]] = 1.0
            for e in range(back.start[i], back.start[i + 1] if velocities > 0 else back.start[i]):
                j = _velocity(back.place[e], rows, velocities)
                if j >= 0:
                    g.C[at + place[j]] = -back.value[e]


@inner_kernel
def _set_law(laws: Laws, velocities: int, k: int, g: Groups) -> None:
    contacts = len(laws.mu)
    if k < contacts:
        g.kind[k], g.law[k, 0], g.law[k, 1] = cone.KIND, laws.mu[k], 0.0
        return
    lower, upper = laws.lower[k - contacts + velocities], laws.upper[k - contacts + velocities]
    g.kind[k], g.law[k, 0], g.law[k, 1] = interval.KIND, lower, upper
    if lower == -math.inf and upper == math.inf:
        g.kind[k], g.law[k, 0], g.law[k, 1] = free.KIND, 0.0, 0.0


@kernel
def _solve_few(
    reals: Reals, integers: Ints, part: Counts, own: Ints, rows: int, velocities: int, room: Reals,
    order: Ints, x: Reals, work: Reals, halt: Ints, count: Ints,
) -> float:  # fmt: skip
    """As `_solve_island`, where the matrix is dense."""
    blocks = no_blocks(integers, reals)
    found = _solve_island(
        reals, integers, part, own, rows, velocities, room, order, blocks, x, work, halt, count
    )
    return float(found)


@kernel
def _solve_island(
    reals: Reals, integers: Ints, part: Counts, own: Ints, rows: int, velocities: int, room: Reals,
    order: Ints, blocks: Factors, x: Reals, work: Reals, halt: Ints, count: Ints,
) -> float:  # fmt: skip
    """Solve an island from x (N,), into it; returns the residual. Its velocities are `own` (n,) of all, which
    are unknowns after the `rows` of contacts in a balance, and copies elsewhere."""
    g, here = groups_in(reals, integers, part, reals[:0]), room_in(room, order, part, blocks)
    if velocities > 0:
        count_in_units(g)
    else:
        for r in range(part.rows):
            g.rate[r] = 1.0
        for i in range(part.n):
            g.unit[i] = 1.0
    first = rows if velocities > 0 else 0
    for r in range(part.rows):
        here.x[r] = x[g.origin[r]] / g.force[r]
    for i in range(part.n):
        here.v[i] = x[first + own[i]] / g.unit[i]
    cost, before = multiplications(blocks, part.n), count[0]
    count[3] = before + int(max(work[0], 0.0) / cost)
    stays = rests(g, here.x, here.v, here)
    found = here.least[0] if stays else solve(g, here.x, here.v, here, halt, count)
    work[0] -= cost * (count[0] - before)
    for r in range(part.rows):
        x[g.origin[r]] = here.x[r] * g.force[r]
    for i in range(part.n if velocities > 0 else 0):
        x[first + own[i]] = here.v[i] * g.unit[i]
    return float(found)

"""A problem as the solver sees it: a balance of forces and groups of rows, each of one kind.

    H v - C^T x = c,        y = W v + R x + w,        x = P(x - y) group by group

C is W, but for problems whose rates are not those of what their forces move: an LCP, a circuit, a Delassus
form.

Velocities and forces are counted in units that are powers of two, so that counting rounds nothing: in them H
has a diagonal of about one, each group yields by about one, and the greatest load or demanded rate is one.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from rungwise.contact.kinds import ball, forces_of, free, interval, pressure, restricts_rates
from rungwise.contact.step.problem import (
    EXACT_BEGIN,
    EXACT_COS,
    EXACT_ROW,
    EXACT_SIN,
    ContactProblem,
    Sizes,
    Surfaces,
)
from rungwise.contact.step.spans import span, stretch
from rungwise.kernel import Ints, Reals, inner_kernel, kernel

LAW = 4
"""Numbers of a law, at most."""
FEEBLE = 2.0**-900
"""Greatest load or demanded rate, in units of the groups, below which there is none: of numbers so small
products lose their digits, and then no equation holds."""
_ROOT = math.sqrt(0.5)


class Counts(NamedTuple):
    """How many velocities, groups and rows there are, entries of H, velocities that groups touch, entries
    of W, rows of a group at most, and entries of C where it is not W."""

    n: int
    groups: int
    rows: int
    filled: int
    touched: int
    entries: int
    d: int
    apart: int = 0


class Groups(NamedTuple):
    """n velocities, g groups, and their rows.

    H_first (n + 1,), H_column, H: the matrix H, row by row; diagonal (n,) of H; c (n,); kind (g,); law (g,
    LAW); numbers that laws refer to; row (g + 1,): where the rows of groups begin; first (g + 1,): where the
    velocities begin in `column` that a group touches; entry (g + 1,): where its part of W and of C begins,
    row by row; R (g, d, d); w (rows,); origin (rows,): row of the problem, limited ones after those of
    contacts; unit (n,), force and rate (rows,): a velocity, force and rate of the problem over one here;
    noise (1,): a rate of the problem that is rounding.
    """

    H_first: Ints
    H_column: Ints
    H: Reals
    diagonal: Reals
    c: Reals
    kind: Ints
    law: Reals
    numbers: Reals
    row: Ints
    first: Ints
    column: Ints
    entry: Ints
    W: Reals
    C: Reals
    R: Reals
    w: Reals
    origin: Ints
    unit: Reals
    force: Reals
    rate: Reals
    noise: Reals


@inner_kernel
def reals_of(k: Counts) -> int:
    """Numbers that `groups_in` takes its parts from."""
    return k.filled + 3 * k.n + k.groups * (LAW + k.d * k.d) + k.entries + k.apart + 3 * k.rows + 1


@inner_kernel
def integers_of(k: Counts) -> int:
    """Integers that `groups_in` takes its parts from."""
    return k.n + 1 + k.filled + 4 * k.groups + 3 + k.touched + k.rows


@inner_kernel
def groups_in(reals: Reals, integers: Ints, k: Counts, numbers: Reals) -> Groups:
    """Groups whose arrays are parts of two, but for the numbers that laws refer to: to allocate them one by
    one takes longer than to solve."""
    n, groups, rows, d = k.n, k.groups, k.rows, k.d
    i = integers
    H_first, i = i[: n + 1], i[n + 1 :]
    H_column, i = i[: k.filled], i[k.filled :]
    kind, i = i[:groups], i[groups:]
    row, first, entry = i[: groups + 1], i[groups + 1 : 2 * groups + 2], i[2 * groups + 2 : 3 * groups + 3]
    i = i[3 * groups + 3 :]
    column, origin = i[: k.touched], i[k.touched : k.touched + rows]
    r = reals
    H, r = r[: k.filled], r[k.filled :]
    diagonal, c, unit, r = r[:n], r[n : 2 * n], r[2 * n : 3 * n], r[3 * n :]
    law, r = r[: LAW * groups].reshape(groups, LAW), r[LAW * groups :]
    R, r = r[: groups * d * d].reshape(groups, d, d), r[groups * d * d :]
    W, r = r[: k.entries], r[k.entries :]
    C, r = (r[: k.apart], r[k.apart :]) if k.apart > 0 else (W, r)
    w, force, rate, noise = r[:rows], r[rows : 2 * rows], r[2 * rows : 3 * rows], r[3 * rows : 3 * rows + 1]
    return Groups(
        H_first, H_column, H, diagonal, c, kind, law, numbers, row, first, column, entry, W, C, R, w, origin,
        unit, force, rate, noise,
    )  # fmt: skip


@kernel
def count_groups(
    p: ContactProblem, sizes: Sizes, surfaces: Surfaces, columns: Ints, couplings: Ints
) -> Counts:
    """What `fill_groups` will need room for."""
    n, contacts, limited = sizes
    surface = surfaces.number
    d, filled, touched, entries, groups = p.R.shape[1], 0, 0, 0, contacts
    most = d if contacts > 0 else 1
    for i in range(n):
        low, high = stretch(couplings, i, n)
        for j in range(low, high):
            filled += 1 if p.H[i, j - low] != 0.0 else 0
    for k in range(contacts):
        width = 0
        for side in range(2):
            low, high, shift = span(columns, k, side, n)
            for j in range(low, high):
                width += 1 if _touches(p.W, d * k, d * k + d, j - shift) else 0
        touched, entries = touched + width, entries + d * width
    for r in range(limited):
        size = _shared(surface, r, limited)
        if size == 0:
            continue
        width, groups, most = 0, groups + 1, max(most, size)
        for j in range(n):
            width += 1 if _joins(p.S, surface, r, size, j) else 0
        touched, entries = touched + width, entries + size * width
    return Counts(n, groups, d * contacts + limited, filled, touched, entries, most, 0)


@kernel
def fill_groups(
    p: ContactProblem,
    sizes: Sizes,
    law: int,
    surfaces: Surfaces,
    columns: Ints,
    couplings: Ints,
    g: Groups,
) -> None:
    """The groups of a step's problem: contacts of the kind `law`, then limited rows, of which those of one
    surface share a force. The problem keeps what W has in the spans `columns` (k, 4), and H in the stretches
    `couplings` (n, 2), or all, where these are empty (see `step.spans`)."""
    n, contacts, limited = sizes
    surface = surfaces.number
    d, at = p.R.shape[1], 0
    g.noise[0] = p.quantum[0]
    g.H_first[0] = g.row[0] = g.first[0] = g.entry[0] = 0
    for i in range(n):
        low, high = stretch(couplings, i, n)
        for j in range(low, high):
            if p.H[i, j - low] != 0.0:
                g.H_column[at], g.H[at] = j, p.H[i, j - low]
                at += 1
        g.H_first[i + 1], g.c[i], g.diagonal[i] = at, p.c[i], p.H[i, i - low]
    for k in range(contacts):
        g.kind[k], g.law[k, 0], g.law[k, 1] = law, p.mu[k], 0.0
        at = middle = g.first[k]
        for side in range(2):
            low, high, shift = span(columns, k, side, n)
            middle = at
            for j in range(low, high):
                if _touches(p.W, d * k, d * k + d, j - shift):
                    g.column[at] = j
                    at += 1
        _close(g, k, d, at)
        for i in range(d):
            row = g.row[k] + i
            g.w[row], g.origin[row], g.force[row] = p.w[k * d + i], k * d + i, 1.0
            at = g.entry[k] + i * (g.first[k + 1] - g.first[k])
            for side in range(2):
                _, _, shift = span(columns, k, side, n)
                first, end = (g.first[k], middle) if side == 0 else (middle, g.first[k + 1])
                for e in range(first, end):
                    g.W[at] = p.W[k * d + i, g.column[e] - shift]
                    at += 1
            for j in range(d):
                g.R[k, i, j] = p.R[k, i, j]
    count = contacts
    for r in range(limited):
        size = _shared(surface, r, limited)
        if size == 0:
            continue
        at = g.first[count]
        for j in range(n):
            if _joins(p.S, surface, r, size, j):
                g.column[at] = j
                at += 1
        _close(g, count, size, at)
        i = 0
        for m in range(r, limited if size > 1 else r + 1):
            if m > r and surface[m] != surface[r]:
                continue
            row, part = g.row[count] + i, p.F[m] / p.F[r] if m > r else 1.0
            g.w[row], g.origin[row], g.force[row] = part * p.w_s[m], contacts * d + m, part
            _fill(g, count, i, p.S[m], part)
            for j in range(i):
                g.R[count, i, j] = g.R[count, j, i] = 0.0
            g.R[count, i, i] = part * part * p.R_s[m]
            i += 1
        if len(surface) > 0 and surface[r] >= 0:
            _take_surface(surfaces, r, p.F[r], g, count)
        elif math.isfinite(p.F[r]):
            g.kind[count], g.law[count, 0], g.law[count, 1] = interval.KIND, -p.F[r], p.F[r]
        else:
            g.kind[count], g.law[count, 0], g.law[count, 1] = free.KIND, 0.0, 0.0
        count += 1


@inner_kernel
def _take_surface(surfaces: Surfaces, r: int, radius: float, g: Groups, k: int) -> None:
    """Let group k, whose first limited row is r, be a ball, or the limit surface of a pressure."""
    g.kind[k], g.law[k, 0] = ball.KIND, radius
    for m in range(surfaces.exact.shape[0]):
        if surfaces.exact[m, EXACT_ROW] == r:
            g.kind[k] = pressure.KIND
            g.law[k, pressure.COS] = surfaces.exact[m, EXACT_COS]
            g.law[k, pressure.SIN] = surfaces.exact[m, EXACT_SIN]
            g.law[k, pressure.BEGIN] = surfaces.exact[m, EXACT_BEGIN]


@inner_kernel
def _touches(rows: Reals, first: int, last: int, j: int) -> bool:
    """Whether one of these rows has an entry in this column."""
    found = False
    for r in range(first, last):
        found |= rows[r, j] != 0.0
    return found


@inner_kernel
def _shared(surface: Ints, r: int, limited: int) -> int:
    """How many limited rows share the surface whose first row is r, 1 for a row without one; 0 for another
    row of a surface."""
    if len(surface) == 0 or surface[r] < 0:
        return 1
    count = 0
    for m in range(limited):
        if surface[m] == surface[r]:
            if m < r:
                return 0
            count += 1
    return count


@inner_kernel
def _joins(S: Reals, surface: Ints, r: int, size: int, j: int) -> bool:
    """Whether a row of the group of limited rows whose first is r has an entry in this column."""
    found = bool(S[r, j] != 0.0)
    if size > 1:
        for m in range(r + 1, len(surface)):
            found |= bool(surface[m] == surface[r]) and bool(S[m, j] != 0.0)
    return found


@inner_kernel
def _close(g: Groups, k: int, size: int, at: int) -> None:
    g.first[k + 1], g.row[k + 1] = at, g.row[k] + size
    g.entry[k + 1] = g.entry[k] + size * (at - g.first[k])


@inner_kernel
def _fill(g: Groups, k: int, i: int, row: Reals, part: float) -> None:
    """Fill row i of a group's part of W, with a part of the row of a problem."""
    width = g.first[k + 1] - g.first[k]
    for e in range(width):
        g.W[g.entry[k] + i * width + e] = part * row[g.column[g.first[k] + e]]


@inner_kernel
def power_of_two(x: float) -> float:
    """The power of two that is nearest to x > 0, by its logarithm; 1 for another x."""
    if not 0.0 < x < math.inf:
        return 1.0
    part, exponent = math.frexp(x)
    return math.ldexp(1.0, exponent if part > _ROOT else exponent - 1)


@kernel
def count_in_units(g: Groups) -> None:
    """Choose units, and count in them."""
    n = len(g.c)
    for i in range(n):
        g.unit[i] = power_of_two(1.0 / math.sqrt(g.diagonal[i]))
    greatest = 0.0
    for i in range(n):
        greatest = max(greatest, g.unit[i] * abs(g.c[i]))
    for k in range(len(g.kind)):
        d, width, at, total = g.row[k + 1] - g.row[k], g.first[k + 1] - g.first[k], g.entry[k], 0.0
        for i in range(d):
            total += g.R[k, i, i]
            for e in range(width):
                total += abs(g.W[at] * g.C[at]) * g.unit[g.column[g.first[k] + e]] ** 2
                at += 1
        force = power_of_two(1.0 / math.sqrt(total / d)) if total > 0.0 else 1.0
        asked = force if restricts_rates(g.kind[k], g.law[k]) else 0.0
        for i in range(g.row[k], g.row[k + 1]):
            greatest = max(greatest, abs(g.w[i]) * asked)
            g.force[i] *= force
    feeble = greatest < FEEBLE
    size = 1.0 if feeble else power_of_two(greatest)
    part = 0.0 if feeble else 1.0 / size
    for i in range(n):
        for e in range(g.H_first[i], g.H_first[i + 1]):
            g.H[e] *= g.unit[i] * g.unit[g.H_column[e]]
        g.c[i] *= g.unit[i] * part
        g.diagonal[i] *= g.unit[i] * g.unit[i]
    for k in range(len(g.kind)):
        first, at, force = g.row[k], g.entry[k], g.force[g.row[k]]
        own = part if restricts_rates(g.kind[k], g.law[k]) else 1.0 / size
        for i in range(first, g.row[k + 1]):
            g.w[i] *= force * own
            for e in range(g.first[k], g.first[k + 1]):
                here, there = g.W[at], g.C[at]  # which may be the same place
                g.W[at] = here * (force * g.unit[g.column[e]])
                g.C[at] = there * (force * g.unit[g.column[e]])
                at += 1
            for j in range(g.row[k + 1] - first):
                g.R[k, i - first, j] *= force * force
            g.rate[i] = size / g.force[i]
            g.force[i] *= size
        for i in range(forces_of(g.kind[k])):
            g.law[k, i] /= force * size
    for i in range(n):
        g.unit[i] *= size

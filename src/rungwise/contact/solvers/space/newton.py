"""Newton's method on the laws of contact, in as many unknowns as an island has velocities.

Algorithm: forces x and velocities v satisfy H v = W^T x + c, and the natural map x - P(x - r u) = 0 of each
group, u = W v + R x + w; P projects a contact's force on the friction disc of its own normal force, limited
rows on their interval or ball, and r is one over the yield of bodies and contact. Each step eliminates the
changes of forces group by group, where each force yields a little more than R (what forces redundant contacts
have is not determined by the rest), and solves (H + W^T E W) dv = ... by Gaussian elimination. Old factors
serve while they bring the map down fast.
With `hold` > 0 forces yield in u as well, about `centre`: a subproblem of the proximal point method.
Sources: Alart and Curnier, Comput. Methods Appl. Mech. Eng. 92 (1991) 353-375; Rockafellar, SIAM J. Control
Optim. 14 (1976) 877-898.
Accepts: H positive definite, groups of up to four rows. Promises: the map does not grow.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from rungwise.contact.block_factors import Factors, add, add_product, clear, plan
from rungwise.contact.block_factors import factorise as factorise_blocks
from rungwise.contact.block_factors import substitute as substitute_blocks
from rungwise.contact.least_degree import Pattern
from rungwise.contact.linear import factorise, substitute
from rungwise.contact.solvers.settings import CHORDS, HALVINGS
from rungwise.contact.solvers.space.measure import Island, Point, measure
from rungwise.contact.solvers.space.rows import Groups
from rungwise.kernel import Ints, Reals, allocating_kernel, inner_kernel, kernel, rare_kernel

GIVE = 1e-6
"""Yield of a force, over the yield of its bodies and contact, with which steps are computed: steps err by as
much, and forces by rounding over it. Chosen by trial, to a decade."""
_FIRMER, _LEAST = 1e-3, 1e-14
"""Factor on the yield where whole steps are slow, as where a light body carries a heavy one, and the least
yield. Chosen by trial, to a decade."""
_FALL = 1e-2
"""The least fall of the map over the length of a step. Chosen by trial."""
_WIDE = 60
"""Coordinates of an island from which on its matrix is kept by its blocks, which is faster then."""
_FAST = 0.2
"""Factor by which each step with old factors must bring the map down. Chosen by trial."""


class Steps(NamedTuple):
    """Scratch: step dv (n,) and dx (rows,); slope (g, d, 2 d) of each group's projection beside scratch;
    inverse (g, d, 2 d): M^-1 and E of each group; centre (rows,); and the room for factors of an island's
    matrix: matrix (n n,) and order (n,) of few coordinates, `blocks` and push (d n,) of many."""

    matrix: Reals
    order: Ints
    blocks: Factors
    push: Reals
    dv: Reals
    dx: Reals
    slope: Reals
    inverse: Reals
    centre: Reals


@kernel
def evaluate(island: Island, hold: float, point: Point, steps: Steps) -> float:
    """Fill rates, imbalance, map and its slopes at a point; returns the size of the map, in the norm of
    yields: energy."""
    bodies, groups, (low, high, first, last), _, _ = island
    v, x, F, u, G = point
    centre, slope = steps.centre, steps.slope
    for i in range(low, high):
        total = -bodies.c[i]
        for j in range(bodies.first[i], bodies.last[i]):
            total += bodies.H[bodies.at[i] + j] * v[j]
        G[i] = total
    size = 0.0
    for g in range(first, last):
        row, end, at, begin = groups.row[g], groups.row[g + 1], groups.entry[g], groups.column[g]
        width, n = groups.column[g + 1] - begin, end - row
        pace = reach(groups, g, n)
        for i in range(n):
            total, force = groups.w[row + i] + hold / pace * (x[row + i] - centre[row + i]), x[row + i]
            for j in range(n):
                total += groups.R[g, i, j] * x[row + j]
            for j in range(width):
                place = groups.touched[begin + j]
                total += groups.W[at] * v[place]
                G[place] -= groups.W[at] * force
                at += 1
            u[row + i] = total
        _project(groups.mu[g], groups.limit[g], pace, row, n, x, u, F, slope[g])
        for i in range(row, end):
            size += F[i] * F[i] / pace
    return math.sqrt(size)


@inner_kernel
def reach(groups: Groups, g: int, n: int) -> float:
    """Force per rate with which the map looks ahead: one over the mean yield."""
    total = groups.ahead[g]
    for i in range(n):
        total += groups.R[g, i, i] / n
    return 1.0 / total if total > 0.0 else 1.0


@inner_kernel
def _project(
    mu: float, limit: float, pace: float, row: int, n: int, x: Reals, u: Reals, F: Reals, slope: Reals
) -> None:
    """Fill F and the slope (n, n) of the projection."""
    for i in range(n):
        for j in range(n):
            slope[i, j] = 0.0
    ahead = x[row] - pace * u[row]
    if mu < 0.0 and n == 1:
        kept = min(max(ahead, -limit), limit)
        F[row], slope[0, 0] = x[row] - kept, 1.0 if kept == ahead else 0.0
        return
    if mu < 0.0:
        _project_on_ball(limit, pace, row, n, x, u, F, slope)
        return
    if ahead <= 0.0:
        for i in range(n):
            F[row + i] = x[row + i]
        return
    F[row], slope[0, 0] = pace * u[row], 1.0
    length = 0.0
    for i in range(row + 1, row + n):
        F[i] = x[i] - pace * u[i]
        length += F[i] * F[i]
    length = math.sqrt(length)
    if length <= mu * ahead:
        for i in range(1, n):
            F[row + i], slope[i, i] = pace * u[row + i], 1.0
        return
    shrink = mu * ahead / length
    for i in range(1, n):
        along = F[row + i] / length
        slope[i, 0] = mu * along
        for j in range(1, n):
            slope[i, j] = -shrink * along * F[row + j] / length
        slope[i, i] += shrink
    for i in range(1, n):
        F[row + i] = x[row + i] - shrink * F[row + i]


@inner_kernel
def _project_on_ball(
    limit: float, pace: float, row: int, n: int, x: Reals, u: Reals, F: Reals, slope: Reals
) -> None:
    length = 0.0
    for i in range(row, row + n):
        F[i] = x[i] - pace * u[i]
        length += F[i] * F[i]
    length = math.sqrt(length)
    shrink = limit / length if length > limit else 1.0
    for i in range(n):
        for j in range(n if shrink < 1.0 else 0):
            slope[i, j] = -shrink * F[row + i] / length * F[row + j] / length
        slope[i, i] += shrink
    for i in range(row, row + n):
        F[i] = x[i] - shrink * F[i] if shrink < 1.0 else pace * u[i]


@inner_kernel
def is_idle(inverse: Reals, n: int, d: int) -> bool:
    """Whether the forces of a group of n rows answer to no rate."""
    idle = True
    for i in range(n):
        idle &= inverse[i, d + i] == 0.0
    return idle


@inner_kernel
def _linearise(groups: Groups, g: int, give: float, slope: Reals, inverse: Reals) -> None:
    """inverse[:n, :n] = M^-1 and inverse[:n, n:] = E = M^-1 slope pace, M = 1 - slope (1 - pace B), B = R +
    give."""
    n = groups.row[g + 1] - groups.row[g]
    pace, d = reach(groups, g, n), groups.R.shape[1]
    M = slope[:, d:]
    for i in range(n):
        for j in range(n):
            total = slope[i, j] * (pace * give - 1.0)
            for k in range(n):
                total += slope[i, k] * pace * groups.R[g, k, j]
            M[i, j] = total + (1.0 if i == j else 0.0)
            inverse[i, j], inverse[i, d + j] = 1.0 if i == j else 0.0, pace * slope[i, j]
    eliminate(M, inverse, n, d)


@inner_kernel
def eliminate(M: Reals, right: Reals, n: int, d: int) -> None:
    """Replace both parts (n, n) of `right`, the second from column d, by M^-1 times them; M is lost."""
    for k in range(n):
        best = k
        for i in range(k + 1, n):
            if abs(M[i, k]) > abs(M[best, k]):
                best = i
        if best != k:
            for j in range(d):
                M[k, j], M[best, j] = M[best, j], M[k, j]
            for j in range(2 * d):
                right[k, j], right[best, j] = right[best, j], right[k, j]
        per = 1.0 / M[k, k]
        for j in range(n):
            M[k, j] *= per
            right[k, j] *= per
            right[k, d + j] *= per
        for i in range(n):
            factor = M[i, k]
            if i != k and factor != 0.0:
                for j in range(n):
                    M[i, j] -= factor * M[k, j]
                    right[i, j] -= factor * right[k, j]
                    right[i, d + j] -= factor * right[k, d + j]


@inner_kernel
def added_yield(groups: Groups, g: int, n: int, give: float, hold: float) -> float:
    """Yield of each force of a group in the equations of a step, beside R."""
    least = groups.R[g, 0, 0]
    for i in range(1, n):
        least = min(least, groups.R[g, i, i])
    pace = 1.0 / reach(groups, g, n)
    return max(hold * pace, give * pace - least)


@kernel
def prepare(island: Island, give: float, hold: float, steps: Steps) -> bool:
    """Factorise at the slopes in `steps`; False where that is singular."""
    groups, span = island.groups, island.span
    for g in range(span.first, span.last):
        added = added_yield(groups, g, groups.row[g + 1] - groups.row[g], give, hold)
        _linearise(groups, g, added, steps.slope[g], steps.inverse[g])
    return bool(assemble(island, steps))


@kernel
def assemble(island: Island, steps: Steps) -> bool:
    """Factorise H + W^T E W; False where it is singular."""
    bodies, groups, (low, high, first, last), _, _ = island
    if is_wide(high - low):
        return bool(_assemble_blocks(island, steps))
    n, d = high - low, groups.R.shape[1]
    K = steps.matrix[: n * n].reshape(n, n)
    for i in range(n):
        for j in range(n):
            K[i, j] = 0.0
        for j in range(bodies.first[low + i], bodies.last[low + i]):
            K[i, j - low] = bodies.H[bodies.at[low + i] + j]
    for g in range(first, last):
        size, begin = groups.row[g + 1] - groups.row[g], groups.column[g]
        width = groups.column[g + 1] - begin
        if is_idle(steps.inverse[g], size, d):
            continue
        W = groups.W[groups.entry[g] : groups.entry[g + 1]].reshape(size, width)
        for a in range(size):
            for i in range(width):
                push = 0.0
                for b in range(size):
                    push += W[b, i] * steps.inverse[g, b, d + a]
                if push != 0.0:
                    own = K[groups.touched[begin + i] - low]
                    for j in range(width):
                        own[groups.touched[begin + j] - low] += push * W[a, j]
    return n == 0 or bool(factorise(K, n, steps.order))


@inner_kernel
def is_wide(n: int) -> bool:
    """Whether the matrix of an island of n coordinates is kept by its blocks."""
    return n >= _WIDE


@rare_kernel
def _assemble_blocks(island: Island, steps: Steps) -> bool:
    """Factorise as `assemble`, where each group couples few of many coordinates."""
    bodies, groups, (low, high, first, last), _, _ = island
    d, blocks = groups.R.shape[1], steps.blocks
    clear(blocks)
    for i in range(low, high):
        for j in range(bodies.first[i], bodies.last[i]):
            add(blocks, i - low, j - low, bodies.H[bodies.at[i] + j])
    for g in range(first, last):
        size, begin = groups.row[g + 1] - groups.row[g], groups.column[g]
        width = groups.column[g + 1] - begin
        if is_idle(steps.inverse[g], size, d):
            continue
        W = groups.W[groups.entry[g] : groups.entry[g + 1]].reshape(size, width)
        touched, E = groups.touched[begin : begin + width], steps.inverse[g, :size, d : d + size]
        add_product(blocks, touched, low, E, W, steps.push)
    return bool(factorise_blocks(blocks, False))


@allocating_kernel
def plan_blocks(island: Island) -> Factors:
    """Room for the factors of a wide island; none of a narrow one."""
    bodies, groups, (low, high, first, last), _, _ = island
    n, count = (high - low, last - first) if is_wide(high - low) else (0, 0)
    H_first, rows = np.zeros(n + 1, np.int64), np.zeros(count + 1, np.int64)
    for i in range(n):
        H_first[i + 1] = H_first[i] + bodies.last[low + i] - bodies.first[low + i]
    for g in range(count):
        rows[g + 1] = groups.column[first + g + 1] - groups.column[first]
    H_column, column = np.empty(H_first[n], np.int64), np.empty(rows[count], np.int64)
    for i in range(n):
        for e in range(H_first[i], H_first[i + 1]):
            H_column[e] = bodies.first[low + i] - low + e - H_first[i]
    for e in range(rows[count]):
        column[e] = groups.touched[groups.column[first] + e] - low
    return plan(Pattern(H_first, H_column, rows, column))


@kernel
def find_step(island: Island, point: Point, steps: Steps) -> None:
    """Fill dv and dx, from the map at the point and the last factors."""
    _, groups, (low, high, first, last), _, _ = island
    n, d = high - low, groups.R.shape[1]
    dv, dx, inverse, F = steps.dv, steps.dx, steps.inverse, point.F
    for i in range(low, high):
        dv[i - low] = -point.G[i]
    for g in range(first, last):
        row, end, at, begin = groups.row[g], groups.row[g + 1], groups.entry[g], groups.column[g]
        width = groups.column[g + 1] - begin
        for i in range(row, end):
            total = 0.0
            for j in range(row, end):
                total += inverse[g, i - row, j - row] * F[j]
            dx[i] = -total
            for j in range(width):
                dv[groups.touched[begin + j] - low] -= groups.W[at] * total
                at += 1
    if is_wide(n):
        substitute_blocks(steps.blocks, dv[:n])
    else:
        substitute(steps.matrix[: n * n].reshape(n, n), n, steps.order, dv)
    for g in range(first, last):
        row, end, at, begin = groups.row[g], groups.row[g + 1], groups.entry[g], groups.column[g]
        width = groups.column[g + 1] - begin
        if is_idle(inverse[g], end - row, d):
            continue
        for i in range(row, end):
            total = 0.0
            for j in range(width):
                total += groups.W[at] * dv[groups.touched[begin + j] - low]
                at += 1
            for j in range(row, end):
                dx[j] -= inverse[g, j - row, d + i - row] * total


@kernel
def descend(island: Island, tol: float, most: int, point: Point, trial: Point, steps: Steps) -> None:
    """Move the point by Newton steps while the map falls, until the residual is within `tol`."""
    give = GIVE
    size = evaluate(island, 0.0, point, steps)
    for _ in range(most):
        if not prepare(island, give, 0.0, steps):
            return
        for attempt in range(1 + CHORDS):
            find_step(island, point, steps)
            length, newer = 1.0, math.inf
            for _ in range(HALVINGS if attempt == 0 else 1):
                move(island, point, length, steps, trial)
                newer = evaluate(island, 0.0, trial, steps)
                if newer <= ((1.0 - _FALL * length) if attempt == 0 else _FAST) * size:
                    break
                length, newer = 0.5 * length, math.inf
            if not newer < math.inf:
                evaluate(island, 0.0, point, steps)
                if attempt == 0 and give <= _LEAST:
                    return
                give = max(give * _FIRMER, _LEAST) if attempt == 0 else give
                break
            if length == 1.0 and newer > _FAST * size:
                give = max(give * _FIRMER, _LEAST)
            size = newer
            _take(island, trial, point)
            if measure(island, point, steps.dv) <= tol:
                return
            if length < 1.0:
                break


@inner_kernel
def move(island: Island, point: Point, length: float, steps: Steps, trial: Point) -> None:
    """Let the trial be the point after a step of this length."""
    groups, span = island.groups, island.span
    for i in range(span.low, span.high):
        trial.v[i] = point.v[i] + length * steps.dv[i - span.low]
    for r in range(groups.row[span.first], groups.row[span.last]):
        trial.x[r] = point.x[r] + length * steps.dx[r]


@inner_kernel
def _take(island: Island, trial: Point, point: Point) -> None:
    groups, span = island.groups, island.span
    for i in range(span.low, span.high):
        point.v[i], point.G[i] = trial.v[i], trial.G[i]
    for r in range(groups.row[span.first], groups.row[span.last]):
        point.x[r], point.F[r], point.u[r] = trial.x[r], trial.F[r], trial.u[r]

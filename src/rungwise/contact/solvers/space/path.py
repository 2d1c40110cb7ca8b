"""A primal-dual interior point method on an island, in as many unknowns as it has velocities.

Algorithm: as `interior_point`: forces z and rates w stay inside Lorentz's cones and follow the path on which
their product is a multiple of the unit, down to zero, with Nesterov and Todd's scaling and a predictor; w_n
is the normal rate plus mu times the slip, which is linearised with the rest. A limited row stays between two
limits, rows on a ball in the cone whose axis is the limit; a row without limits yields a little about its
last force. Changes of forces are eliminated group by group, as in `space.newton`, whose equations serve.
Sources: those of `interior_point`.
Accepts: what `space.newton` accepts. Promises: some twenty factorisations however redundant contacts are,
where friction does not couple too strongly; among many solutions one in the midst of them.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from rungwise.contact.solvers.settings import FORCE, RATE, RETAINED, SHORT, TO_THE_BOUNDARY
from rungwise.contact.solvers.space.measure import Island, Point
from rungwise.contact.solvers.space.newton import (
    GIVE,
    Steps,
    added_yield,
    assemble,
    eliminate,
    evaluate,
    find_step,
    reach,
)
from rungwise.contact.solvers.space.rows import Groups
from rungwise.contact.solvers.space.sweeps import accelerate
from rungwise.kernel import Reals, inner_kernel, kernel

_TINY = 1e-300


class Duals(NamedTuple):
    """Rates in the cones, w (rows,), of a limited row at its lower limit, and other (rows,) at its upper, or
    in the first row of a ball along the axis of its cone; aim and toward (rows,): what dw and d(other) must
    be, but for the part linear in dx."""

    w: Reals
    other: Reals
    aim: Reals
    toward: Reals


@kernel
def begin(island: Island, point: Point, duals: Duals, steps: Steps) -> None:
    """Forces and rates on the axes of the cones, as large as the rates without forces are."""
    groups, span = island.groups, island.span
    for r in range(groups.row[span.first], groups.row[span.last]):
        point.x[r] = 0.0
    accelerate(island, point)
    evaluate(island, 0.0, point, steps)
    energy = 0.0
    for g in range(span.first, span.last):
        row, end = groups.row[g], groups.row[g + 1]
        for r in range(row, end):
            energy += point.u[r] ** 2 * reach(groups, g, end - row)
    begin_on_axes(island, math.sqrt(max(energy, _TINY) / max(span.last - span.first, 1)), point, duals)
    accelerate(island, point)


@kernel
def begin_on_axes(island: Island, unit: float, point: Point, duals: Duals) -> None:
    """Set forces and rates on the axes of the cones: as large as rates are whose energy is unit squared."""
    groups, span = island.groups, island.span
    x, w, other = point.x, duals.w, duals.other
    for g in range(span.first, span.last):
        row, end, mu, limit = groups.row[g], groups.row[g + 1], groups.mu[g], groups.limit[g]
        pace = math.sqrt(reach(groups, g, end - row))
        for r in range(row, end):
            x[r] = w[r] = other[r] = duals.toward[r] = 0.0
        if mu >= 0.0:
            x[row] = FORCE * unit * pace / (mu if mu > 0.0 else 1.0)
            w[row] = RATE * unit / pace
        elif 0.0 < limit < math.inf:
            other[row] = FORCE * RATE * unit * unit / limit
            w[row] = other[row] if end - row == 1 else 0.0


@kernel
def advance(island: Island, point: Point, duals: Duals, steps: Steps) -> bool:
    """Take one predicted and centred step along the path; False where it cannot be computed."""
    groups, span = island.groups, island.span
    product, cones = product_ahead(island, point.x, duals, 0.0, steps)
    product /= max(cones, 1)
    length, turning = 0.0, 1.0
    for _ in range(2):
        evaluate(island, 0.0, point, steps)
        for g in range(span.first, span.last):
            _linearise(groups, g, point.x, turning, duals, steps.slope[g], steps.inverse[g])
        if not assemble(island, steps):
            return False
        centring, repaired = 0.0, 1.0
        for predicts in (True, False):
            _find(island, centring * product, repaired, turning, point, duals, steps)
            length = _longest(island, point.x, duals, steps)
            if predicts and product > 0.0:
                ahead, _ = product_ahead(island, point.x, duals, min(1.0, length), steps)
                centring = min(1.0, max(ahead / (max(cones, 1) * product), 0.0)) ** 3
                repaired = 1.0 - RETAINED * centring
        if length >= SHORT:
            break
        turning = 0.0
    if not length > 0.0:
        return False
    length = min(1.0, TO_THE_BOUNDARY * length)
    for i in range(span.low, span.high):
        point.v[i] += length * steps.dv[i - span.low]
    for r in range(groups.row[span.first], groups.row[span.last]):
        point.x[r] += length * steps.dx[r]
        duals.w[r] += length * duals.aim[r]
        duals.other[r] += length * duals.toward[r]
    return True


@inner_kernel
def _linearise(
    groups: Groups, g: int, x: Reals, turning: float, duals: Duals, slope: Reals, inverse: Reals
) -> None:
    """slope[:n, :n] = S; inverse[:n, :n] = D^-1 Q^-1 and inverse[:n, d:] = D^-1 Q^-1 D^-1, with Q = (1 - e
    turn^T) S + D^-1 R D^-1."""
    row, n, d = groups.row[g], groups.row[g + 1] - groups.row[g], groups.R.shape[1]
    mu, limit, w = groups.mu[g], groups.limit[g], duals.w
    if n == 1:
        S = 0.0
        if mu >= 0.0:
            S = w[row] / x[row]
        elif limit == math.inf:
            S = added_yield(groups, g, 1, GIVE, 0.0)
        elif limit > 0.0:
            S = w[row] / (limit + x[row]) + duals.other[row] / (limit - x[row])
        slope[0, 0] = S
        held = mu < 0.0 and limit == 0.0
        inverse[0, 0] = inverse[0, d] = 0.0 if held else 1.0 / (S + groups.R[g, 0, 0])
        return
    if mu < 0.0:
        _linearise_ball(groups, g, x, duals, slope, inverse)
        return
    slip, pull, dot = 0.0, 0.0, mu * x[row] * w[row]
    for i in range(1, n):
        slip += w[row + i] ** 2
        pull += x[row + i] ** 2
        dot += x[row + i] * w[row + i]
    slip, pull, top = math.sqrt(slip), math.sqrt(pull), mu * x[row]
    size_z = math.sqrt(max((top - pull) * (top + pull), _TINY))
    size_w = math.sqrt(max((w[row] - slip) * (w[row] + slip), _TINY))
    per = 1.0 / (2.0 * math.sqrt(0.5 * (1.0 + dot / (size_z * size_w))))
    ratio = size_w / size_z
    for i in range(n):
        sign = 1.0 if i == 0 else -1.0
        mine = per * (w[row + i] / size_w + sign * (top if i == 0 else x[row + i]) / size_z)
        for j in range(n):
            other = per * (w[row + j] / size_w + (top if j == 0 else -x[row + j]) / size_z)
            slope[i, j] = 2.0 * ratio * mine * other
        slope[i, i] -= sign * ratio
    Q = slope[:, d:]
    for j in range(n):
        for i in range(n):
            Q[i, j] = slope[i, j] + groups.R[g, i, j] / ((mu if i == 0 else 1.0) * (mu if j == 0 else 1.0))
            inverse[i, j] = 1.0 if i == j else 0.0
            inverse[i, d + j] = inverse[i, j] / (mu if j == 0 else 1.0)
        for i in range(1, n):
            Q[0, j] -= (turning * w[row + i] / slip if slip > 0.0 else 0.0) * slope[i, j]
    eliminate(Q, inverse, n, d)
    for j in range(n):
        inverse[0, j] /= mu
        inverse[0, d + j] /= mu


@inner_kernel
def _linearise_ball(groups: Groups, g: int, x: Reals, duals: Duals, slope: Reals, inverse: Reals) -> None:
    """slope[:n, :n] = S, its row n that of the axis; both parts of `inverse` are Q^-1, Q = S + R."""
    row, n, d = groups.row[g], groups.row[g + 1] - groups.row[g], groups.R.shape[1]
    limit, w, axis = groups.limit[g], duals.w, duals.other[groups.row[g]]
    slip, pull, dot = 0.0, 0.0, limit * axis
    for i in range(row, row + n):
        slip += w[i] ** 2
        pull += x[i] ** 2
        dot += x[i] * w[i]
    slip, pull = math.sqrt(slip), math.sqrt(pull)
    size_z = math.sqrt(max((limit - pull) * (limit + pull), _TINY))
    size_w = math.sqrt(max((axis - slip) * (axis + slip), _TINY))
    per = 1.0 / (2.0 * math.sqrt(0.5 * (1.0 + dot / (size_z * size_w))))
    ratio, Q = size_w / size_z, slope[:, d:]
    for i in range(n):
        mine = per * (w[row + i] / size_w - x[row + i] / size_z)
        for j in range(n):
            slope[i, j] = 2.0 * ratio * mine * per * (w[row + j] / size_w - x[row + j] / size_z)
        slope[i, i] += ratio
        slope[n, i] = 2.0 * ratio * mine * per * (axis / size_w + limit / size_z)
    for i in range(n):
        for j in range(n):
            Q[i, j] = slope[i, j] + groups.R[g, i, j]
            inverse[i, j] = inverse[i, d + j] = 1.0 if i == j and limit > 0.0 else 0.0
    eliminate(Q, inverse, n, d)


@kernel
def _find(
    island: Island,
    target: float,
    repaired: float,
    turning: float,
    point: Point,
    duals: Duals,
    steps: Steps,
) -> None:
    """Fill dv and dx, and into aim and toward the changes of w and other, towards products `target`."""
    groups, span = island.groups, island.span
    x, u, F, w, aim = point.x, point.u, point.F, duals.w, duals.aim
    for g in range(span.first, span.last):
        row, end = groups.row[g], groups.row[g + 1]
        mu, limit = groups.mu[g], groups.limit[g]
        if mu < 0.0 and end - row > 1:
            inside = limit * limit
            for r in range(row, end):
                inside -= x[r] ** 2
            inside = max(inside, _TINY)
            duals.toward[row] = target * limit / inside - duals.other[row]
            for r in range(row, end):
                aim[r] = -target * x[r] / inside - w[r]
                F[r] = repaired * (u[r] - w[r]) - aim[r]
            continue
        if mu < 0.0:
            aim[row] = duals.toward[row] = 0.0
            if 0.0 < limit < math.inf:
                aim[row] = target / (limit + x[row]) - w[row]
                duals.toward[row] = target / (limit - x[row]) - duals.other[row]
            fault = u[row] - w[row] + duals.other[row]
            F[row] = repaired * fault - aim[row] + duals.toward[row]
            continue
        if end - row == 1:
            aim[row] = target / x[row] - w[row]
            F[row] = repaired * (u[row] - w[row]) - aim[row]
            continue
        slip, inside = 0.0, (mu * x[row]) ** 2
        for r in range(row + 1, end):
            slip += w[r] ** 2
            inside -= x[r] ** 2
        slip, inside = math.sqrt(slip), max(inside, _TINY)
        aim[row] = target * mu * x[row] / inside - w[row]
        F[row] = repaired * (u[row] / mu + slip - w[row]) - aim[row]
        for r in range(row + 1, end):
            aim[r] = -target * x[r] / inside - w[r]
            F[r] = repaired * (u[r] - w[r]) - aim[r]
            F[row] += (turning * w[r] / slip if slip > 0.0 else 0.0) * aim[r]
    find_step(island, point, steps)
    dx = steps.dx
    for g in range(span.first, span.last):
        row, end = groups.row[g], groups.row[g + 1]
        mu, limit = groups.mu[g], groups.limit[g]
        if mu < 0.0 and end - row == 1:
            if 0.0 < limit < math.inf:
                aim[row] -= w[row] / (limit + x[row]) * dx[row]
                duals.toward[row] += duals.other[row] / (limit - x[row]) * dx[row]
            continue
        for j in range(row, end):
            scale = mu if mu >= 0.0 and j == row and end - row > 1 else 1.0
            for i in range(row, end):
                aim[i] -= steps.slope[g, i - row, j - row] * scale * dx[j]
            if mu < 0.0:
                duals.toward[row] -= steps.slope[g, end - row, j - row] * dx[j]


@kernel
def product_ahead(island: Island, x: Reals, duals: Duals, length: float, steps: Steps) -> tuple[float, int]:
    """The sum of products after a step of this length, and the number of cones."""
    groups, span = island.groups, island.span
    w, other, total, cones = duals.w, duals.other, 0.0, 0
    for g in range(span.first, span.last):
        row, mu, limit = groups.row[g], groups.mu[g], groups.limit[g]
        if mu < 0.0 and not 0.0 < limit < math.inf:
            continue
        single = groups.row[g + 1] - row == 1
        cones += 2 if mu < 0.0 and single else 1
        for r in range(row, groups.row[g + 1]):
            force, rate, more = x[r], w[r], other[r]
            if length > 0.0:
                force += length * steps.dx[r]
                rate += length * duals.aim[r]
                more += length * duals.toward[r]
            if mu < 0.0 and single:
                total += (limit + force) * rate + (limit - force) * more
            elif mu < 0.0:
                total += force * rate + (limit * more if r == row else 0.0)
            else:
                total += (mu if mu > 0.0 and r == row else 1.0) * force * rate
    return total, cones


@kernel
def _longest(island: Island, x: Reals, duals: Duals, steps: Steps) -> float:
    """The greatest step that keeps forces and rates in the cones."""
    groups, span = island.groups, island.span
    least = math.inf
    for g in range(span.first, span.last):
        row, end, mu, limit = groups.row[g], groups.row[g + 1], groups.mu[g], groups.limit[g]
        if mu < 0.0 and end - row > 1:
            if limit > 0.0:
                axis, rise = duals.other[row], duals.toward[row]
                least = min(least, until_outside(limit, 0.0, x, steps.dx, row, end))
                least = min(least, until_outside(axis, rise, duals.w, duals.aim, row, end))
            continue
        if mu < 0.0:
            if 0.0 < limit < math.inf:
                least = min(least, _reach(limit + x[row], steps.dx[row]))
                least = min(least, _reach(limit - x[row], -steps.dx[row]))
                least = min(least, _reach(duals.w[row], duals.aim[row]))
                least = min(least, _reach(duals.other[row], duals.toward[row]))
            continue
        scale = mu if end - row > 1 else 1.0
        least = min(least, until_outside(scale * x[row], scale * steps.dx[row], x, steps.dx, row + 1, end))
        least = min(least, until_outside(duals.w[row], duals.aim[row], duals.w, duals.aim, row + 1, end))
    return least


@inner_kernel
def _reach(z: float, dz: float) -> float:
    return -z / dz if dz < 0.0 else math.inf


@inner_kernel
def until_outside(top: float, rise: float, z: Reals, dz: Reals, first: int, end: int) -> float:
    """The step at which a point leaves the cone, with `top` along its axis, which has the rate `rise`, and
    the rows from first to end of z across."""
    least = _reach(top, rise)
    a, half, left = rise * rise, top * rise, top * top
    for i in range(first, end):
        a -= dz[i] * dz[i]
        half -= z[i] * dz[i]
        left -= z[i] * z[i]
    left = max(left, 0.0)
    inside = half * half - a * left
    if end > first and inside >= 0.0 and (a < 0.0 or half < 0.0):
        below = math.sqrt(inside) - half
        if below > 0.0:
            least = min(least, left / below)
    return least

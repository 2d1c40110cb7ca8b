"""Forces z and rates w in friction cones: coordinates, scaling, and the linear systems of paths inside.

In these coordinates the friction cone is Lorentz's, its own dual; w_n is the normal rate plus mu times the
slip. An upper limit is one more unknown, the force that holds it. Source: Vandenberghe, The CVXOPT
linear and quadratic cone program solvers (2010).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

from rungwise.contact.prepare import rank
from rungwise.contact.prepare.product import Condensed
from rungwise.contact.prepare.system import System
from rungwise.contact.problem import Array, Matrix
from rungwise.contact.solvers.measure import all_rates
from rungwise.contact.solvers.newton.condensed import solver as condensed_solver
from rungwise.contact.solvers.newton.factors import SMALL, Factors, diagonal_factors, factors
from rungwise.contact.solvers.work import Work
from rungwise.kernel import Ints, Reals, inner_kernel, kernel


class Layout(NamedTuple):
    """Cone i has dim[i] rows from first[i]; other rows are free, or dead (zero)."""

    first: Ints
    dim: Ints
    dead: Ints


class Scaling(NamedTuple):
    """What cones are at a point (z, w), with `nesterov_todd`: S (N, 3), row by row of blocks, with S z = w;
    the inverse of z, the direction of the slip times its weight in the linear system, and the slip in normal
    rows (N,)."""

    S: Reals
    inverse: Reals
    turn: Reals
    slip: Reals


class Cones(NamedTuple):
    """w = A (z + offset) + b, x = (z + offset) / D.

    The first `size` are the unknowns of the system, of which `rows` are of contacts with d directions. A is
    None where the system has a product.
    """

    system: System
    A: Matrix | None
    b: Array
    D: Array
    offset: Array
    layout: Layout
    size: int
    rows: int
    d: int
    condensed: Condensed | None
    idle: Array
    weight: Array
    """Rows (N, 3) of blocks: the identity where unknowns are dead, and the identity where they are not."""

    def rates(self, z: Array) -> Array:
        """A (z + offset) + b."""
        if self.A is not None:
            return np.asarray(self.A @ (z + self.offset) + self.b)
        y = np.empty(self.size)
        all_rates(self.system, self.unknowns(z), self.system.b, 0.0, y)
        return y / self.D

    def change(self, dz: Array) -> Array:
        """A dz."""
        if self.A is not None:
            return np.asarray(self.A @ dz)
        y = np.empty(self.size)
        all_rates(self.system, dz / self.D, np.zeros(self.size), 0.0, y)
        return y / self.D

    def unknowns(self, z: Array) -> Array:
        """x (size,) of the system."""
        return ((z + self.offset) / self.D)[: self.size]


def cones_of(system: System) -> Cones:
    s, d = system, system.directions
    slides, size = s.mu > 0.0, s.size + int(np.isfinite(s.upper).sum())
    D = np.ones(size)
    D[: s.rows : d][slides] = s.mu[slides]
    limited = np.flatnonzero(np.isfinite(s.lower))
    offset = np.zeros(size)
    offset[s.rows + limited] = s.lower[limited]
    tangents = np.arange(s.rows).reshape(-1, d)[~slides, 1:]
    first = np.concatenate([np.arange(0, s.rows, d), s.rows + limited, np.arange(s.size, size)])
    dim = np.concatenate([np.where(slides, d, 1), np.ones(len(limited) + size - s.size, np.int64)])
    parts = None if size > s.size else rank.parts(s)
    if parts is not None:
        parts = parts.scaled(1.0 / D, s.rows, d)
    dead, i = tangents.ravel(), np.arange(size)
    idle, weight, own = np.zeros((size, 3)), np.zeros((size, 3)), np.where(i < s.rows, i % d, 0)
    weight[i, own] = 1.0
    weight[dead], idle[dead, own[dead]] = 0.0, 1.0
    A, b = (None, s.b / D) if s.product is not None and size == s.size else _with_limits(s, D)
    return Cones(s, A, b, D, offset, Layout(first, dim, dead), s.size, s.rows, d, parts, idle, weight)


def _with_limits(system: System, D: Array) -> tuple[Matrix, Array]:
    """A and b in the cones' coordinates; for each upper limit a row upper - x >= 0, whose force resists x."""
    capped = np.flatnonzero(np.isfinite(system.upper))
    if len(capped) == 0 and system.size <= SMALL:
        return system.dense() / D[:, None] / D, system.b / D
    A, b = system.matrix(), system.b
    if len(capped):
        shape = (system.size, len(capped))
        hold = sp.csr_array(
            (np.ones(len(capped)), (system.rows + capped, np.arange(len(capped)))), shape=shape
        )
        A = sp.block_array([[A, hold], [-hold.T, None]], format="csr")
        b = np.concatenate([b, system.upper[capped]])
    scale = sp.diags_array(1.0 / D)
    A = sp.csr_array(scale @ A @ scale)
    return (A.toarray() if len(b) <= SMALL else A), b / D


def centre(cones: Cones) -> Array:
    """The unit of the cones over the root of their number."""
    unit = np.zeros(len(cones.b))
    first = cones.layout.first
    unit[first] = 1.0 / math.sqrt(max(len(first), 1))
    return unit


class Linear(NamedTuple):
    """Linear equations for steps dz, dw at a point (z, w) inside the cones."""

    layout: Layout
    scaling: Scaling
    factors: Factors

    def toward(self, w: Array, target: float) -> Array:
        """target z^-1 - w, the value that dw + S dz must have for products to become `target`."""
        aim = np.zeros(len(w))
        toward(w, self.scaling, target, self.layout, aim)
        return aim

    def step(self, aim: Array, fault: Array, repaired: float = 1.0) -> Array:
        """dz, with S dz + dw = aim, which becomes dw, that takes this part of the fault away."""
        right = np.empty(len(aim))
        lean(aim, fault, repaired, self.scaling, self.layout, right)
        dz = self.factors.solve(right)
        apply_scaling(self.scaling.S, dz, self.layout, aim)
        return dz


def linearise(cones: Cones, z: Array, w: Array, turning: float, work: Work) -> Linear | None:
    """The equations at a point, `turning` the weight of the slips' directions; None where they are
    singular."""
    size = len(z)
    scaling = Scaling(np.zeros((size, 3)), np.zeros(size), np.zeros(size), np.zeros(size))
    nesterov_todd(z, w, turning, cones.layout, scaling)
    made = factorise(cones, scaling)
    if made is None:
        return None
    work.spend_factors(made.entries)
    return Linear(cones.layout, scaling, made)


def factorise(cones: Cones, scaling: Scaling) -> Factors | None:
    """Factors of A + (I - e turn^T) S, rows of dead unknowns replaced by rows of the identity."""
    A, (first, dim, dead) = cones.A, cones.layout
    if cones.condensed is not None:
        E = cones.idle.copy()
        add_scaling(E, scaling, cones.layout, False)
        return condensed_solver(cones.condensed, cones.rows, cones.d, E, cones.weight)
    if isinstance(A, np.ndarray):
        J = A.copy()
        add_scaling(J, scaling, cones.layout, True)
        J[dead] = 0.0
        J[dead, dead] = 1.0
        return factors(J)
    size = len(scaling.S)
    blocks = np.zeros((size, 3))
    add_scaling(blocks, scaling, cones.layout, False)
    width, start = np.repeat(dim, dim), np.repeat(first, dim)
    row = start + np.arange(len(start)) - np.repeat(np.cumsum(dim) - dim, dim)
    used = np.arange(3) < width[:, None]
    column = (start[:, None] + np.arange(3))[used]
    J = A + sp.csr_array((blocks[row][used], (np.repeat(row, width), column)), shape=(size, size))
    if len(dead):
        alive = np.ones(size)
        alive[dead] = 0.0
        J = sp.diags_array(alive) @ J + sp.diags_array(1.0 - alive)
    if cones.system.has_free and (J.diagonal() > 0.0).all():
        return diagonal_factors(J)
    return factors(J)


@kernel
def nesterov_todd(z: Reals, w: Reals, turning: float, layout: Layout, out: Scaling) -> None:
    """Fill the scaling at (z, w), with the direction of the slip times `turning`; other rows are left."""
    first, dim, _ = layout
    scaling, inverse, turn, slips = out
    for c in range(len(first)):
        i, d = first[c], dim[c]
        if d == 1:
            scaling[i, 0], inverse[i] = w[i] / z[i], 1.0 / z[i]
            continue
        slip = math.sqrt(w[i + 1] ** 2 + (w[i + 2] ** 2 if d > 2 else 0.0))
        pull = math.sqrt(z[i + 1] ** 2 + (z[i + 2] ** 2 if d > 2 else 0.0))
        size_z = math.sqrt(max((z[i] - pull) * (z[i] + pull), 1e-300))
        size_w = math.sqrt(max((w[i] - slip) * (w[i] + slip), 1e-300))
        dot = 0.0
        for j in range(d):
            dot += z[i + j] * w[i + j]
        per = 1.0 / (2.0 * math.sqrt(0.5 * (1.0 + dot / (size_z * size_w))))
        for j in range(d):
            sign = 1.0 if j == 0 else -1.0
            inverse[i + j] = sign * z[i + j] / (size_z * size_z)
            turn[i + j] = turning * w[i + j] / slip if j > 0 and slip > 0.0 else 0.0
            mine = per * (w[i + j] / size_w + sign * z[i + j] / size_z)
            for l in range(d):
                other = per * (w[i + l] / size_w + (1.0 if l == 0 else -1.0) * z[i + l] / size_z)
                scaling[i + j, l] = size_w / size_z * 2.0 * mine * other
            scaling[i + j, j] -= sign * size_w / size_z
        slips[i] = slip


@kernel
def beyond(z: Reals, w: Reals, dz: Reals, dw: Reals, layout: Layout, scratch: Reals, out: Reals) -> None:
    """The part of the products of z + dz and w + dw that is not linear, in the terms of `toward`; scratch is
    (4, 3)."""
    first, dim, _ = layout
    v, a, b, c = scratch[0], scratch[1], scratch[2], scratch[3]
    for k in range(len(first)):
        i, d = first[k], dim[k]
        if d == 1:
            out[i] = dz[i] * dw[i] / z[i]
            continue
        # W dz, dw / W and W z = w / W, W being the root of the scaling.
        root = _half(z, w, i, d, v)
        _turned(v, 1.0, root, dz[i : i + d], a)
        _turned(v, -1.0, 1.0 / root, dw[i : i + d], b)
        _turned(v, 1.0, root, z[i : i + d], c)
        product, along, inside = a[0] * b[0], 0.0, c[0] * c[0]
        for j in range(1, d):
            product += a[j] * b[j]
            a[j] = a[0] * b[j] + b[0] * a[j]
            along += c[j] * a[j]
            inside -= c[j] * c[j]
        b[0] = (c[0] * product - along) / inside
        for j in range(1, d):
            b[j] = (a[j] - b[0] * c[j]) / c[0]
        _turned(v, 1.0, root, b[:d], out[i : i + d])


@inner_kernel
def _half(z: Reals, w: Reals, i: int, d: int, v: Reals) -> float:
    """v and r of the root r (2 v v^T - J) of the scaling, J the reflection that keeps the first entry."""
    slip, pull, dot = 0.0, 0.0, 0.0
    for j in range(i, i + d):
        dot += z[j] * w[j]
        slip += w[j] * w[j] if j > i else 0.0
        pull += z[j] * z[j] if j > i else 0.0
    slip, pull = math.sqrt(slip), math.sqrt(pull)
    size_z = math.sqrt(max((z[i] - pull) * (z[i] + pull), 1e-300))
    size_w = math.sqrt(max((w[i] - slip) * (w[i] + slip), 1e-300))
    per = 1.0 / (2.0 * math.sqrt(0.5 * (1.0 + dot / (size_z * size_w))))
    for j in range(d):
        v[j] = per * (w[i + j] / size_w + (1.0 if j == 0 else -1.0) * z[i + j] / size_z)
    v[0] += 1.0
    per = 1.0 / math.sqrt(2.0 * v[0])
    for j in range(d):
        v[j] *= per
    return math.sqrt(size_w / size_z)


@inner_kernel
def _turned(v: Reals, sign: float, factor: float, x: Reals, out: Reals) -> None:
    """out = factor (2 v v^T - J) x, where `sign` multiplies all but the first entry of v."""
    dot = v[0] * x[0]
    for j in range(1, len(x)):
        dot += sign * v[j] * x[j]
    out[0] = factor * (2.0 * v[0] * dot - x[0])
    for j in range(1, len(x)):
        out[j] = factor * (2.0 * sign * v[j] * dot + x[j])


@kernel
def toward(w: Reals, scaling: Scaling, target: float, layout: Layout, aim: Reals) -> None:
    """aim = target z^-1 - w, the value that dw + S dz must have."""
    first, dim, _ = layout
    for c in range(len(first)):
        for i in range(first[c], first[c] + dim[c]):
            aim[i] = target * scaling.inverse[i] - w[i]


@kernel
def lean(aim: Reals, fault: Reals, repaired: float, scaling: Scaling, layout: Layout, right: Reals) -> None:
    """right = aim - repaired fault, less the slip that `aim` brings with it in normal rows; nothing in dead
    rows."""
    (first, dim, dead), turn = layout, scaling.turn
    for i in range(len(right)):
        right[i] = aim[i] - repaired * fault[i]
    for c in range(len(first)):
        for i in range(first[c] + 1, first[c] + dim[c]):
            right[first[c]] -= turn[i] * aim[i]
    for i in range(len(dead)):
        right[dead[i]] = 0.0


@kernel
def add_scaling(J: Reals, scaling: Scaling, layout: Layout, whole: bool) -> None:
    """Add (I - e turn^T) S to J, which is whole (N, N) or has rows of blocks (N, 3)."""
    (first, dim, _), S, turn = layout, scaling.S, scaling.turn
    for c in range(len(first)):
        i = first[c]
        for l in range(dim[c]):
            column = i + l if whole else l
            for j in range(dim[c]):
                J[i + j, column] += S[i + j, l]
            for j in range(1, dim[c]):
                J[i, column] -= turn[i + j] * S[i + j, l]


@kernel
def apply_scaling(S: Reals, dz: Reals, layout: Layout, out: Reals) -> None:
    """out -= S dz."""
    first, dim, _ = layout
    for c in range(len(first)):
        for j in range(dim[c]):
            for l in range(dim[c]):
                out[first[c] + j] -= S[first[c] + j, l] * dz[first[c] + l]


@kernel
def longest(z: Reals, dz: Reals, w: Reals, dw: Reals, layout: Layout) -> float:
    """The greatest step for which z + step dz and w + step dw are in all cones."""
    return min(_longest(z, dz, layout), _longest(w, dw, layout))


@inner_kernel
def _longest(z: Reals, dz: Reals, layout: Layout) -> float:
    first, dim, _ = layout
    least = math.inf
    for c in range(len(first)):
        i = first[c]
        least = min(least, _until_outside(z[i], dz[i], z, dz, i + 1, i + dim[c]))
    return least


@inner_kernel
def _reach(z: float, dz: float) -> float:
    return -z / dz if dz < 0.0 else math.inf


@inner_kernel
def _until_outside(top: float, rise: float, z: Reals, dz: Reals, first: int, end: int) -> float:
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

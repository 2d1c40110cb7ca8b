"""A primal-dual interior point method on the exact law, finished by Newton steps.

Algorithm: in coordinates in which the friction cone is Lorentz's, forces z and rates w stay inside it and its
dual (the same), w_n being the normal rate plus mu times the slip, and follow the path on which their product
is a multiple of the unit, down to zero; the slip is linearised with the rest. Nesterov and Todd's scaling; a
predictor chooses the next multiple, one factorisation serves both. At the start, and whenever the residual
has fallen tenfold, `newton` tries to finish. Sources: Nesterov and Todd, Math. Oper. Res. 22 (1997) 1-42;
Vandenberghe, The CVXOPT linear and quadratic cone program solvers (2010); Acary, Armand, Nguyen, Optim.
Methods Softw. (2023), for friction. An upper limit is one more unknown, the force that holds it. Accepts:
everything. Promises: tens of iterations whatever the rank of A, where A is monotone and friction does not
couple too strongly; among many solutions one in the midst of them.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from scipy.linalg.lapack import dgetrf, dgetrs
from scipy.sparse.linalg import splu

from rungwise.contact.elimination import Condensed
from rungwise.contact.mixed import Array, Matrix
from rungwise.contact.solvers import newton
from rungwise.contact.solvers.condensed import solver as condensed_solver
from rungwise.contact.solvers.measure import natural
from rungwise.contact.system import System
from rungwise.kernel import Ints, Reals, kernel

NAME = "interior-point"
_STEPS = 100
_DENSE = 200
_FORCE, _RATE = 10.0, 1.0
"""The first z and w, times the unit of the cones, over the root of their number."""
_TO_THE_BOUNDARY, _RETAINED = 0.95, 0.7
_FINISH, _NEWTON, _DAMPINGS = 1e-2, 5, (1e-8, 1e-4)
_SHORT = 0.1
"""A step shorter than this is repeated with slips held: where they turn fast, their derivative misleads."""
_STALLED, _WINDOW = 0.7, 8


Eliminated = tuple[Condensed, int, int] | None


class Cones(NamedTuple):
    """x = (z + offset) / D (N,); cone i has dim[i] rows from first[i]; others are free, or dead (zero)."""

    D: Array
    offset: Array
    first: Ints
    dim: Ints
    dead: Ints


def accepts(_system: System) -> bool:
    return True


@np.errstate(all="ignore")  # iterates that run away are judged, not warned about
def solve(system: System, start: Array, tol: float) -> tuple[Array, int]:
    """The best x (N,) met, or `start`; and the iterations. The path begins where it must, not at `start`."""
    whole = newton.form(system)
    best, least, finish = start, natural(system, start), _FINISH
    if least < finish:
        best, _ = newton.descend(system, whole, start, system.b, 0.0, tol, _NEWTON, _DAMPINGS)
        least = natural(system, best)
    if least <= tol:
        return best, 0
    cones = _cones(system)
    A, b = _with_limits(system, cones.D)
    condensed = _condensed(system, cones)
    centre = np.zeros(len(b))
    centre[cones.first] = 1.0 / math.sqrt(max(len(cones.first), 1))
    z, w = _FORCE * centre, _RATE * centre
    _start_between(system, z, w)
    history: list[tuple[float, float]] = []
    for done in range(_STEPS):
        x = ((z + cones.offset) / cones.D)[: system.size]
        found = natural(system, x)
        if found < least:
            best, least = x, found
        if found < finish:
            finish = 0.1 * found
            trial, _ = newton.descend(system, whole, x, system.b, 0.0, tol, _NEWTON, _DAMPINGS)
            reached = natural(system, trial)
            if reached < least:
                best, least = trial, reached
        history.append((float(z @ w), found))
        if least <= tol or _stalled(history):
            return best, done
        moved = _advance(A, b, z, w, cones, condensed)
        if moved is None:
            return best, done
        z, w = moved
    return best, _STEPS


def _stalled(history: list[tuple[float, float]]) -> bool:
    """Whether neither product nor residual fell enough, or either is no number."""
    if not np.isfinite(history[-1]).all():
        return True
    if len(history) < 2 * _WINDOW:
        return False
    (product, found), (later, now) = history[-_WINDOW], history[-1]
    return later > _STALLED * product and now > _STALLED * found


def _with_limits(system: System, D: Array) -> tuple[Matrix, Array]:
    """A and b in the cones' coordinates; for each upper limit a row upper - x >= 0, whose force resists x."""
    capped = np.flatnonzero(np.isfinite(system.upper))
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
    return (A.toarray() if len(b) <= _DENSE else A), b / D


def _start_between(system: System, z: Array, w: Array) -> None:
    """Begin midway between two limits."""
    capped = np.flatnonzero(np.isfinite(system.upper))
    half = 0.5 * (system.upper - system.lower)[capped]
    inside = np.isfinite(half) & (half > 0.0)
    z[system.rows + capped[inside]] = w[system.size :][inside] = half[inside]


def _cones(system: System) -> Cones:
    s, d = system, system.directions
    slides, size = s.mu > 0.0, s.size + int(np.isfinite(s.upper).sum())
    D = np.ones(size)
    D[: s.rows : d][slides] = s.mu[slides]
    limited = np.flatnonzero(np.isfinite(s.lower))
    offset = np.zeros(size)
    offset[s.rows + limited] = s.lower[limited]
    tangents = np.arange(s.rows).reshape(-1, d)[~slides, 1:]
    return Cones(
        D,
        offset,
        np.concatenate([np.arange(0, s.rows, d), s.rows + limited, np.arange(s.size, size)]),
        np.concatenate([np.where(slides, d, 1), np.ones(len(limited) + size - s.size, np.int64)]),
        tangents.ravel(),
    )


def _advance(
    A: Matrix,
    b: Array,
    z: Array,
    w: Array,
    cones: Cones,
    condensed: Eliminated,
    turning: float = 1.0,
) -> tuple[Array, Array] | None:
    """One predicted and centred step; None when the linear system is singular.

    `turning` is the weight of the derivative of the slips' directions.
    """
    first, dim, dead = cones.first, cones.dim, cones.dead
    scaling, inverse, turn = np.zeros((len(z), 3)), np.zeros(len(z)), np.zeros(len(z))
    fault = A @ (z + cones.offset) + b - w
    nesterov_todd(z, w, first, dim, scaling, inverse, turn, fault)
    turn *= turning
    solve_linear = _factorise(A, scaling, turn, cones, condensed)
    if solve_linear is None:
        return None
    product = float(z @ w) / max(len(first), 1)

    def step(target: float, repaired: float) -> tuple[Array, Array, float]:
        """dz, dw and the longest step towards the product `target`, repairing so much of the fault."""
        aim = np.zeros(len(z))
        toward(w, inverse, first, dim, target, aim)
        right = -repaired * fault + aim
        lean(right, aim, turn, first, dim)
        right[dead] = 0.0
        dz = solve_linear(right)
        dw = aim
        apply_scaling(scaling, dz, first, dim, dw)
        return dz, dw, min(longest(z, dz, first, dim), longest(w, dw, first, dim))

    dz, dw, length = step(0.0, 1.0)
    length = min(1.0, length)
    predicted = float((z + length * dz) @ (w + length * dw)) / max(len(first), 1)
    centring = min(1.0, max(predicted / product, 0.0)) ** 3 if product > 0.0 else 0.0
    dz, dw, length = step(centring * product, 1.0 - _RETAINED * centring)
    if length < _SHORT and turning > 0.0:
        return _advance(A, b, z, w, cones, condensed, 0.0)
    length = min(1.0, _TO_THE_BOUNDARY * length)
    return z + length * dz, w + length * dw


def _condensed(system: System, cones: Cones) -> Eliminated:
    """The parts of A in the cones' coordinates, rows and directions; None with upper limits, or no parts."""
    if system.condensed is None or len(cones.D) > system.size:
        return None
    return system.condensed.scaled(1.0 / cones.D), system.rows, system.directions


def _factorise(
    A: Matrix, scaling: Array, turn: Array, cones: Cones, condensed: Eliminated
) -> Callable[[Array], Array] | None:
    """Solver of A + (I - e turn^T) scaling, rows of dead unknowns replaced by those of the identity."""
    if condensed is not None:
        parts, rows, d = condensed
        E, L, i = np.zeros((len(scaling), 3)), np.zeros((len(scaling), 3)), np.arange(len(scaling))
        lean_rows(scaling, turn, cones.first, cones.dim, E)
        own = np.where(i < rows, i % d, 0)
        L[i, own] = 1.0
        E[cones.dead], L[cones.dead], E[cones.dead, own[cones.dead]] = 0.0, 0.0, 1.0
        return condensed_solver(parts, rows, d, E, L)
    if not sp.issparse(A):
        J = A.copy()
        add_scaling(J, scaling, turn, cones.first, cones.dim)
        J[cones.dead] = 0.0
        J[cones.dead, cones.dead] = 1.0
        factor, exchanges, fault = dgetrf(J)
        return None if fault else lambda right: np.asarray(dgetrs(factor, exchanges, right)[0])
    blocks = np.zeros((len(scaling), 3))
    lean_rows(scaling, turn, cones.first, cones.dim, blocks)
    width = np.repeat(cones.dim, cones.dim)
    start = np.repeat(cones.first, cones.dim)
    row = start + np.arange(len(start)) - np.repeat(np.cumsum(cones.dim) - cones.dim, cones.dim)
    used = np.arange(3) < width[:, None]
    column = (start[:, None] + np.arange(3))[used]
    shape = (len(scaling), len(scaling))
    J = A + sp.csr_array((blocks[row][used], (np.repeat(row, width), column)), shape=shape)
    if len(cones.dead):
        alive = np.ones(len(scaling))
        alive[cones.dead] = 0.0
        J = sp.diags_array(alive) @ J + sp.diags_array(1.0 - alive)
    try:
        return splu(sp.csc_array(J), permc_spec="MMD_AT_PLUS_A").solve
    except RuntimeError:
        return None


@kernel
def nesterov_todd(
    z: Reals, w: Reals, first: Ints, dim: Ints, scaling: Reals, inverse: Reals, turn: Reals, fault: Reals
) -> None:
    """Fill the scaling S with S z = w, the inverse of z, the direction of slip; add the slip to the fault."""
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
            turn[i + j] = w[i + j] / slip if j > 0 and slip > 0.0 else 0.0
            mine = per * (w[i + j] / size_w + sign * z[i + j] / size_z)
            for l in range(d):
                other = per * (w[i + l] / size_w + (1.0 if l == 0 else -1.0) * z[i + l] / size_z)
                scaling[i + j, l] = size_w / size_z * 2.0 * mine * other
            scaling[i + j, j] -= sign * size_w / size_z
        fault[i] += slip


@kernel
def toward(w: Reals, inverse: Reals, first: Ints, dim: Ints, target: float, aim: Reals) -> None:
    """aim = target z^-1 - w, what dw + S dz is to be."""
    for c in range(len(first)):
        for i in range(first[c], first[c] + dim[c]):
            aim[i] = target * inverse[i] - w[i]


@kernel
def lean(right: Reals, aim: Reals, turn: Reals, first: Ints, dim: Ints) -> None:
    """The slip that `aim` brings with it, taken from the normal rows."""
    for c in range(len(first)):
        for i in range(first[c] + 1, first[c] + dim[c]):
            right[first[c]] -= turn[i] * aim[i]


@kernel
def lean_rows(scaling: Reals, turn: Reals, first: Ints, dim: Ints, out: Reals) -> None:
    """out = (I - e turn^T) S, block by block."""
    for c in range(len(first)):
        i = first[c]
        for l in range(dim[c]):
            for j in range(dim[c]):
                out[i + j, l] = scaling[i + j, l]
            for j in range(1, dim[c]):
                out[i, l] -= turn[i + j] * scaling[i + j, l]


@kernel
def add_scaling(J: Reals, scaling: Reals, turn: Reals, first: Ints, dim: Ints) -> None:
    """Add (I - e turn^T) S to J."""
    for c in range(len(first)):
        i = first[c]
        for l in range(dim[c]):
            for j in range(dim[c]):
                J[i + j, i + l] += scaling[i + j, l]
            for j in range(1, dim[c]):
                J[i, i + l] -= turn[i + j] * scaling[i + j, l]


@kernel
def apply_scaling(scaling: Reals, dz: Reals, first: Ints, dim: Ints, out: Reals) -> None:
    """out -= S dz."""
    for c in range(len(first)):
        for j in range(dim[c]):
            for l in range(dim[c]):
                out[first[c] + j] -= scaling[first[c] + j, l] * dz[first[c] + l]


@kernel
def longest(z: Reals, dz: Reals, first: Ints, dim: Ints) -> float:
    """The greatest step for which z + step dz is in all cones."""
    least = math.inf
    for c in range(len(first)):
        i = first[c]
        if dz[i] < 0.0:
            least = min(least, -z[i] / dz[i])
        a, half, left = dz[i] * dz[i], z[i] * dz[i], z[i] * z[i]
        for j in range(i + 1, i + dim[c]):
            a -= dz[j] * dz[j]
            half -= z[j] * dz[j]
            left -= z[j] * z[j]
        left = max(left, 0.0)
        inside = half * half - a * left
        if dim[c] > 1 and inside >= 0.0 and (a < 0.0 or half < 0.0):
            below = math.sqrt(inside) - half
            if below > 0.0:
                least = min(least, left / below)
    return least

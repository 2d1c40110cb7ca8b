"""The active pieces of a solution: first-order changes still open to each contact and limited row.

Near a solution the change of the forces is df = B x + limits dlimit, with unknowns x of which each obeys

    C^T du + D x = 0                    a contact that holds, or slides on
    0 <= x  _|_  C^T du + D x >= 0      one-sided: where the mode may change
    the whole law of a contact          where force, gap and slip are all zero

and limit = (mu, F). A contact that slides along s = u_t / |u_t| with force -mu lambda_n s may also turn:
across s its force changes by -(mu lambda_n / |u_t|) du_t. On the edge of the cone without slip, the force mu
lambda_n e may leave the edge by x >= 0, or the contact begin to slip against e.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rungwise.contact.problem import Array
from rungwise.contact.solver.residual import FLOOR, REST, ROUNDING
from rungwise.contact.step.problem import ContactProblem


class Part(NamedTuple):
    """The pieces of one contact or row: B, C (d, m), D (m,), limits (d,); `free` (m,) False where x is
    one-sided; `cone` where x obeys the whole law; `undefined` where there is no derivative with respect to a
    limit of zero."""

    B: Array
    C: Array
    D: Array
    limits: Array
    free: NDArray[np.bool_]
    cone: bool = False
    undefined: bool = False


@dataclass(frozen=True)
class Pieces:
    """All parts, contacts first: B, C (N, m), D, free (m,), limits (N, k + b) for N = k d + b forces.

    `cones` holds, for each contact at which the whole law applies, its index and its columns.
    """

    B: Array
    C: Array
    D: Array
    limits: Array
    free: NDArray[np.bool_]
    cones: tuple[tuple[int, NDArray[np.int64]], ...]
    weak: NDArray[np.bool_]
    undefined: NDArray[np.bool_]


def pieces(problem: ContactProblem, v: Array, force: Array, tau: Array, tol: float) -> Pieces:
    """The pieces at a solution; values below `tol` of their scale count as zero, forces first."""
    p, d, k = problem, problem.R.shape[1], len(problem.mu)
    rates, scale, unit = scales(p, v, force, tau)
    parts = []
    for i in range(k):
        own = slice(i * d, i * d + d)
        parts.append(_contact(p.mu[i], force[own], rates[own], tol * unit, tol * scale[own].max()))
    for r in range(len(p.F)):
        at = k * d + r
        parts.append(_row(p.F[r], tau[r], rates[at], tol * unit, tol * scale[at]))
    size = [len(part.D) for part in parts]
    first = np.concatenate([[0], np.cumsum(size)]).astype(np.int64)
    B, C = np.zeros((2, len(rates), first[-1]))
    limits = np.zeros((len(rates), len(parts)))
    cones = []
    for i, part in enumerate(parts):
        own = slice(i * d, i * d + d) if i < k else slice(k * d + i - k, k * d + i - k + 1)
        columns = slice(first[i], first[i + 1])
        B[own, columns], C[own, columns], limits[own, i] = part.B, part.C, part.limits
        if part.cone:
            cones.append((i, np.arange(first[i], first[i + 1])))
    none: list[Array] = [np.zeros(0)]
    return Pieces(
        B,
        C,
        np.concatenate([part.D for part in parts] or none),
        limits,
        np.concatenate([part.free for part in parts] or none).astype(bool),
        tuple(cones),
        np.array([not part.free.all() for part in parts], bool),
        np.array([part.undefined for part in parts], bool),
    )


def scales(p: ContactProblem, v: Array, force: Array, tau: Array) -> tuple[Array, Array, float]:
    """Rates of all rows, the size of the terms of each row, and the unit of force."""
    d = p.R.shape[1]
    rows, offset = np.vstack([p.W, p.S]), np.concatenate([p.w, p.w_s])
    yielded = np.concatenate([np.einsum("kij,kj->ki", p.R, force.reshape(-1, d)).ravel(), p.R_s * tau])
    terms = np.abs(rows * v)
    scale = np.maximum.reduce([terms.max(axis=1, initial=0.0), np.abs(offset), np.abs(yielded)])
    scale = np.maximum(scale, p.quantum[0])
    yields = (rows**2 / np.diag(p.H)).max(axis=1, initial=0.0)
    unit = float(max(np.abs(force).max(initial=0.0), np.abs(tau).max(initial=0.0)))
    push = yields * unit
    scale = np.where(scale < ROUNDING * push, REST * push, scale)
    contacts = yields[: len(p.W)].reshape(-1, d).max(axis=1, initial=0.0)
    most = np.concatenate([np.repeat(contacts, d), yields[len(p.W) :]])
    light = most > 0.0
    unit = max(unit, float((FLOOR * scale[light] / most[light]).max(initial=0.0)))
    return rows @ v + yielded + offset, scale, unit


def _contact(mu: float, force: Array, rate: Array, no_force: float, no_rate: float) -> Part:
    d = len(force)
    slip = float(np.linalg.norm(rate[1:]))
    grip = float(np.linalg.norm(force[1:]))
    closed, slips = force[0] > no_force, slip > no_rate
    along = rate[1:] / slip if slips else np.zeros(d - 1)
    normal = np.eye(d)[:, :1]
    if not closed:
        if rate[0] > no_rate:
            return _part(np.zeros((d, 0)), np.zeros((d, 0)))
        if slips or mu == 0.0:
            return _part(np.concatenate([[1.0], -mu * along])[:, None], normal, one_sided=1)
        return Part(np.eye(d), np.eye(d), np.zeros(d), np.zeros(d), np.zeros(d, bool), cone=True)
    if mu * force[0] - grip > no_force:
        return _part(np.eye(d), np.eye(d))
    if slips or mu == 0.0 or d == 1:
        turning = _across(along) if slips and mu > 0.0 else np.zeros((d, 0))
        B = np.hstack([np.concatenate([[1.0], -mu * along])[:, None], turning])
        stiff = np.full(turning.shape[1], slip / (mu * force[0]) if mu > 0.0 else 0.0)
        limits = np.concatenate([[0.0], -force[0] * along])
        part = _part(B, np.hstack([normal, turning]), limits=limits)
        return part._replace(D=np.concatenate([[0.0], stiff]), undefined=not slips and d > 1)
    edge = force[1:] / grip
    back, across = np.concatenate([[0.0], -edge])[:, None], _across(edge)
    B = np.hstack([np.concatenate([[1.0], mu * edge])[:, None], across, back])
    limits = np.concatenate([[0.0], force[0] * edge])
    return _part(B, np.hstack([normal, across, back]), limits=limits, one_sided=1)


def _row(limit: float, tau: float, rate: float, no_force: float, no_rate: float) -> Part:
    one = np.ones((1, 1))
    if limit - abs(tau) > min(no_force, 0.5 * limit):
        return _part(one, one)
    sign = -np.sign(rate) if abs(rate) > no_rate else np.sign(tau) if limit > 0.0 else 0.0
    if abs(rate) > no_rate or limit == 0.0:
        part = _part(np.zeros((1, 0)), np.zeros((1, 0)), limits=np.array([sign]))
        return part._replace(undefined=sign == 0.0)
    return _part(-sign * one, -sign * one, limits=np.array([sign]), one_sided=1)


def _part(B: Array, C: Array, limits: Array | None = None, one_sided: int = 0) -> Part:
    """A part without D whose last `one_sided` unknowns are one-sided."""
    d, m = B.shape
    return Part(B, C, np.zeros(m), np.zeros(d) if limits is None else limits, np.arange(m) < m - one_sided)


def _across(along: Array) -> Array:
    """Tangents across a unit tangent as columns (d, d - 2), below a row for the normal, by a reflection."""
    m = len(along)
    mirror = along + np.copysign(np.eye(m)[0], along[0])
    tangents = np.eye(m)[:, 1:] - np.outer(mirror, mirror[1:]) / (1.0 + abs(along[0]))
    return np.vstack([np.zeros((1, m - 1)), tangents])

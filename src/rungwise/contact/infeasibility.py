"""Looking for proofs of infeasibility by linear programming (HiGHS, through scipy)."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from rungwise.contact.farkas import (
    OPEN,
    Infeasible,
    Mode,
    all_modes,
    check,
    cover,
    mode_count,
    range_of,
    signs,
)
from rungwise.contact.mixed import Array
from rungwise.contact.system import System

MAX_MODES = 128
MAX_SIZE = 3000
_SIDES = 16
_ROUNDING = 1e-9


def prove_infeasible(system: System) -> Infeasible | None:
    """A checked proof that no x solves the system, or None if none was found.

    First the convex hulls of all laws together; then, up to `MAX_MODES`, every mode.
    """
    if system.size > MAX_SIZE:
        return None
    p = _separate(system, cover(system))
    if p is not None:
        forced = (
            p[: system.rows : system.directions].any()
            or np.isfinite(system.lower[p[system.rows :] != 0.0]).any()
        )
        proof = Infeasible("jammed" if forced else "unsupported", (cover(system),), (p,))
        return proof if check(system, proof) else None
    if mode_count(system) > MAX_MODES:
        return None
    modes, vectors = tuple(all_modes(system)), []
    for mode in modes:
        p = _separate(system, mode)
        if p is None:
            return None
        vectors.append(p)
    proof = Infeasible("jammed", modes, tuple(vectors))
    return proof if check(system, proof) else None


def _separate(system: System, mode: Mode) -> Array | None:
    """Multipliers p, at most 1, whose p . y is negative for every x of the mode; None when there are none."""
    from scipy.optimize import linprog

    s = system
    A = s.matrix()
    least, most = signs(s, mode)
    lower, upper = range_of(s, mode)
    # (A^T p)_j = above - below: x_j wants to its upper or lower limit.
    other = sp.csr_array(A.T)[s.rows :]
    m = len(lower)
    equal = sp.hstack([other, -sp.eye_array(m), sp.eye_array(m)], format="csr")
    cone = _cone_rows(s, mode)
    padded = sp.hstack([cone, sp.csr_array((cone.shape[0], 2 * m))], format="csr")
    bounds = [(max(a, -1.0), min(c, 1.0)) for a, c in zip(least, most, strict=True)]
    bounds += [(0.0, 0.0 if np.isinf(c) else None) for c in upper]
    bounds += [(0.0, 0.0 if np.isinf(a) else None) for a in lower]
    cost = np.concatenate(
        [s.b, np.where(np.isinf(upper), 0.0, upper), np.where(np.isinf(lower), 0.0, -lower)]
    )
    found = linprog(
        cost,
        padded if cone.shape[0] else None,
        np.zeros(cone.shape[0]) if cone.shape[0] else None,
        equal if m else None,
        np.zeros(m) if m else None,
        bounds=bounds,
        method="highs",
        options={
            "primal_feasibility_tolerance": 1e-10,
            "dual_feasibility_tolerance": 1e-10,
            "time_limit": 10.0,
        },
    )
    if found.x is None or not found.fun < -_ROUNDING:
        return None
    return _sharpen(s, np.asarray(found.x)[: s.size], sp.vstack([padded[:, : s.size], equal[:, : s.size]]))


def _cone_rows(system: System, mode: Mode) -> sp.csr_array:
    """G with G p <= 0 sufficient for -(A^T p) to lie in the dual cone of each contact that may push."""
    s, d = system, system.directions
    angles = 2.0 * np.pi * np.arange(_SIDES) / _SIDES
    sides = {
        1: np.zeros((1, 0)),
        2: np.array([[1.0], [-1.0]]),
        3: np.column_stack([np.cos(angles), np.sin(angles)]) / np.cos(np.pi / _SIDES),
    }[d]
    pushing = [k for k in range(len(s.mu)) if mode[k] != OPEN]
    if not pushing:
        return sp.csr_array((0, s.size))
    back = sp.csr_array(s.matrix().T)
    faces = [np.column_stack([np.ones(len(sides)), s.mu[k] * sides]) for k in pushing]
    rows = np.concatenate([np.arange(k * d, (k + 1) * d) for k in pushing])
    return sp.csr_array(sp.block_diag(faces, format="csr") @ back[rows])


def _sharpen(system: System, p: Array, constraints: sp.csr_array) -> Array:
    """p with rounding removed: what is nearly zero is zero, and constraints nearly active are met."""
    p = np.where(np.abs(p) > _ROUNDING, p, 0.0)
    inside = np.abs(p) > 0.0
    active = np.abs(constraints @ p) < 1e-6
    rows = constraints[active][:, inside].toarray()
    for _ in range(2):
        p[inside] -= np.linalg.lstsq(rows, rows @ p[inside], rcond=None)[0]
    return p

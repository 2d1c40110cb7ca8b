"""Certificates that a problem has no solution, and the checker, which knows no solver.

* kinematic: normal forces lambda >= 0 (and forces of joints) that balance on every coordinate while the rates that
  the contacts demand are impossible: W^T lambda = 0 and w . lambda < 0.
* frictional: for every contact mode a Farkas vector (y, z >= 0) with y E + z G = 0 and y . e + z . g > 0.
* unsupported: a motion d along which the loads do work that contacts, friction and drives cannot resist:
  c . d > F |S d|, (W_n +- mu W_t) d >= 0 and H_0 d = 0.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rungwise.contact.modes import all_modes, linear_system
from rungwise.contact.problem import ContactProblem

TOLERANCE = 1e-7


@dataclass(frozen=True)
class Certificate:
    """Why there is no solution. `vectors` has one row (kinematic, unsupported) or one row per mode (frictional)."""

    kind: str
    vectors: tuple[NDArray[np.float64], ...]


def check(problem: ContactProblem, certificate: Certificate, resisting: NDArray[np.float64] | None = None) -> bool:
    """Whether the certificate proves that the problem has no solution (unsupported: no balance without inertia).

    `resisting` is H_0 (n, n), the part of H that is not inertia, for unsupported ones. Everything is measured
    relative to the sizes of the terms; `TOLERANCE` of them counts as zero.
    """
    match certificate.kind:
        case "kinematic":
            return _check_kinematic(problem, certificate.vectors[0])
        case "frictional":
            return _check_frictional(problem, certificate.vectors)
        case "unsupported":
            rest = np.zeros_like(problem.H) if resisting is None else resisting
            return _check_unsupported(problem, certificate.vectors[0], rest)
    return False


def rigid_rows(problem: ContactProblem) -> tuple[NDArray[np.float64], NDArray[np.float64], int]:
    """Rows and offsets of what cannot yield: rigid contacts' normals, then joints; and how many contacts."""
    d = problem.R.shape[1]
    rigid = np.array([not problem.R[k].any() for k in range(len(problem.mu))], bool)
    joints = np.isinf(problem.F) & (problem.R_s == 0.0)
    rows = np.vstack([problem.W[::d][rigid], problem.S[joints]])
    offset = np.concatenate([problem.w[::d][rigid], problem.w_s[joints]])
    return rows, offset, int(rigid.sum())


def _check_kinematic(problem: ContactProblem, force: NDArray[np.float64]) -> bool:
    rows, offset, contacts = rigid_rows(problem)
    if force.shape != offset.shape or not np.isfinite(force).all() or (force[:contacts] < 0.0).any():
        return False
    scale = np.abs(rows.T) @ np.abs(force)
    balanced = (np.abs(rows.T @ force) <= TOLERANCE * scale.max(initial=0.0)).all()
    return bool(balanced and force @ offset < -TOLERANCE * (np.abs(force) @ np.abs(offset)))


def _check_frictional(problem: ContactProblem, vectors: tuple[NDArray[np.float64], ...]) -> bool:
    modes = list(all_modes(problem))
    if len(modes) != len(vectors):
        return False
    for mode, vector in zip(modes, vectors, strict=True):
        equal, value, least, bound = linear_system(problem, mode)
        y, z = vector[: len(value)], vector[len(value) :]
        if len(z) != len(bound) or not np.isfinite(vector).all() or (z < 0.0).any():
            return False
        size = max(float(np.abs(vector).max(initial=0.0)), 1e-300)
        gain = float(y @ value + z @ bound)
        left = np.abs(y @ equal + z @ least).max(initial=0.0)
        if not (gain > TOLERANCE * size and left <= 1e-3 * gain):
            return False
        if left > TOLERANCE * size:
            return False
    return True


def _check_unsupported(
    problem: ContactProblem, motion: NDArray[np.float64], resisting: NDArray[np.float64]
) -> bool:
    if motion.shape != problem.c.shape or not np.isfinite(motion).all():
        return False
    d = problem.R.shape[1]
    size = float(np.abs(motion).max(initial=0.0))
    work = float(problem.c @ motion) - float(problem.F @ np.abs(problem.S @ motion)) if len(problem.F) else float(
        problem.c @ motion
    )
    normal, tangential = problem.W[::d] @ motion, [problem.W[i::d] @ motion for i in range(1, d)]
    slip = np.sqrt(sum(t**2 for t in tangential)) if tangential else np.zeros_like(normal)
    opens = (normal - problem.mu * slip >= -TOLERANCE * size).all()
    stiff = np.abs(resisting @ motion).max(initial=0.0)
    return bool(
        size > 0.0
        and work > TOLERANCE * float(np.abs(problem.c) @ np.abs(motion))
        and opens
        and stiff <= TOLERANCE * max(float(np.abs(problem.H).max(initial=0.0)) * size, 1e-300)
    )

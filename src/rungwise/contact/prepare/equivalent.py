"""A problem in contacts, velocities and joints alone: the unknowns that exchange formats and other solvers
know.

Compliance R = B B^T / h becomes velocities y of its own, h y = B^T r, u = W v + B y + w: eliminated, they
give R back. A limited unknown, |tau| <= F, becomes the tangential force of one more contact, of friction 1
and normal force F: a velocity h y = r_n - F of its own, which Signorini's law holds at zero. In space, the
contact's second tangent has h y = r_o, which holds r_o at zero. h is the median of the diagonal of H.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from rungwise.contact.problem import Matrix, Problem

_ROUNDING = 1e-12
"""Eigenvalue of a compliance, over its greatest entry, that counts as zero: about ten thousand roundings of
double precision. Chosen by trial, to a decade."""
_SKEW = 1e-9
"""Asymmetry of a compliance, over its greatest entry, that is accepted as error of the given numbers. Chosen
by trial, to a decade."""


def in_contacts(problem: Problem) -> Problem:
    """An equivalent of a problem made by `Problem.balance`: its contacts, then one for each limited unknown
    in their order; its velocities, then the velocities y and r_n - F above; its joints.

    Raises ValueError, naming the field, where A has another form, R is not symmetric and positive, or limits
    are not symmetric.
    """
    # Limits become contacts with friction also where there are no contacts, in whatever many directions.
    p, d, rows, n = problem, max(problem.directions, 2), problem.rows, problem.velocities
    A, b = sp.csr_array(p.A), p.b
    contact, speed, other = slice(0, rows), slice(rows, rows + n), slice(rows + n, None)
    H, W, S = A[speed, speed], A[contact, speed], A[other, speed]
    apart = (A[contact, other], A[other, contact], A[speed, contact] + W.T, A[speed, other] + S.T)
    if any(abs(part).sum() > 0.0 for part in apart):
        raise ValueError("A: forces must act where rates are read, and contacts and others not on each other")
    limit = p.upper[n:]
    if np.isfinite(p.lower[:n]).any() or np.isfinite(p.upper[:n]).any() or (p.lower[n:] != -limit).any():
        raise ValueError("lower: velocities must be free, and the limits of forces symmetric")
    h = (float(np.median(np.abs(H.diagonal()))) if n else 0.0) or 1.0
    soft = _root(A[contact, contact] * h, d, "R")
    give = _root(A[other, other] * h, 1, "R_s")
    bound, joint = np.flatnonzero(np.isfinite(limit)), np.flatnonzero(np.isinf(limit))
    count = len(bound)
    # Velocities: of H, of soft contacts, of yielding others, of normals and second tangents of limits.
    sizes = (n, soft.shape[1], give.shape[1], count, count if d == 3 else 0)
    one = sp.eye_array(count)
    lines = [
        _line(sizes, count, {3: one}),
        _line(sizes, count, {0: S[bound], 2: give[bound]}),
        _line(sizes, count, {4: one}),
    ][:d]
    contact_by_contact = np.arange(count * d).reshape(d, count).T.ravel()
    grips = sp.vstack(lines, format="csr")[contact_by_contact]
    offsets = np.zeros((count, d))
    offsets[:, 1] = b[other][bound]
    return Problem.balance(
        sp.block_diag([H, h * sp.eye_array(sum(sizes[1:]))], format="csr"),
        np.concatenate([-b[speed], np.zeros(sizes[1] + sizes[2]), -limit[bound], np.zeros(sizes[4])]),
        sp.vstack([_line(sizes, rows, {0: W, 1: soft}), grips], format="csr"),
        np.concatenate([b[contact], offsets.ravel()]),
        np.concatenate([p.mu, np.ones(count)]),
        directions=d,
        S=_line(sizes, len(joint), {0: S[joint], 2: give[joint]}),
        w_s=b[other][joint],
    )


def _line(sizes: tuple[int, ...], rows: int, blocks: dict[int, Matrix]) -> Matrix:
    """A block row of `rows` rows; blocks that are not named are zero."""
    return sp.hstack(
        [blocks.get(k, sp.csr_array((rows, size))) for k, size in enumerate(sizes)], format="csr"
    )


def _root(R: Matrix, d: int, name: str) -> Matrix:
    """B with B B^T = R, block by block of d rows, without columns of zeros."""
    own = [np.zeros((0, 0))]
    R = sp.coo_array(R)
    row, column = R.coords
    if (row // d != column // d).any():
        raise ValueError(f"{name}: contacts must not yield to the forces of others")
    blocks = np.zeros((R.shape[0] // d, d, d))
    blocks[row // d, row % d, column % d] = R.data
    for block in blocks:
        size = np.abs(block).max()
        values, axes = np.linalg.eigh(0.5 * (block + block.T))
        if np.abs(block - block.T).max() > _SKEW * size or values[0] < -_ROUNDING * size:
            raise ValueError(f"{name}: must be symmetric and positive")
        kept = values > _ROUNDING * size
        own.append(axes[:, kept] * np.sqrt(values[kept]))
    return sp.block_diag(list(map(sp.coo_array, own)), format="csr") if R.shape[0] else sp.csr_array((0, 0))

"""Velocities of bodies that contacts hold, taken from the contacts where forces leave rounding in them.

v = H^-1 (c + W^T lambda) is a difference of forces; where next to nothing resists a motion, H is so small
that their rounding moves bodies that rigid contacts hold. Given the modes, the rates of the rows that hold
are known, and the least change of v (in the norm of the diagonal of H) that gives these rates is added; the
forces for this change are below the rounding of the forces found, which stay. Accepts planar answers;
promises to leave v as it was where the rows that hold do not agree.
"""

from __future__ import annotations

import math

from rungwise.contact.linear import solve_in_place
from rungwise.contact.step.modes import OPEN, STICK
from rungwise.contact.step.problem import ContactProblem, Elimination, Sizes, Unknowns
from rungwise.kernel import Ints, Reals, kernel

_NOTICED = 1e-3
"""Rates of holding rows, over the problem's quantum, from which on they are corrected: they add up over
steps. Chosen by trial, to a decade."""
_ROUNDS = 2
"""Corrections, at most."""
_BETTER = 0.1
"""Part of the greatest rate before the correction that may remain after it, at most. Chosen by trial."""


@kernel
def correct_velocities(p: ContactProblem, sizes: Sizes, unknowns: Unknowns, room: Elimination) -> None:
    """Correct v (n,) of an answer in these modes if a row that holds moves by more than the rounding of v."""
    n, contacts = sizes.n, sizes.contacts
    mode, v = unknowns.mode, unknowns.v
    before = _greatest_rate(p, sizes, unknowns)
    if not before > _NOTICED * p.quantum[0]:
        return
    kept = room.matrix[room.matrix.shape[0] - 1]
    for i in range(n):
        kept[i] = v[i]
    for _ in range(_ROUNDS):
        _correct(p, sizes, unknowns, room)
    after, opening = _greatest_rate(p, sizes, unknowns), True
    for k in range(contacts):
        if mode[k] == OPEN:
            opening &= (
                _rate(p, 2 * k, contacts, n, v) >= min(0.0, _rate(p, 2 * k, contacts, n, kept)) - before
            )
    if not (after <= _BETTER * before and opening):
        for i in range(n):
            v[i] = kept[i]


@kernel
def _correct(p: ContactProblem, sizes: Sizes, unknowns: Unknowns, room: Elimination) -> None:
    """Add the least change of v that gives the holding rows their rates; W H^-1 W^T has a unit diagonal."""
    n, contacts, limited = sizes
    mode, v = unknowns.mode, unknowns.v
    matrix, size, rows = room.matrix, 0, 2 * contacts + limited
    for r in range(rows):
        if _holds(p, r, contacts, mode):
            at = 0
            for s in range(rows):
                if _holds(p, s, contacts, mode):
                    matrix[size, at] = _coupling(p, r, s, contacts, n)
                    at += 1
            matrix[size, at] = -_rate(p, r, contacts, n, v) / _length(p, r, contacts, n)
            size += 1
    solve_in_place(matrix, size, 1, room.order)
    at = 0
    for r in range(rows):
        if _holds(p, r, contacts, mode):
            push = matrix[at, size] / _length(p, r, contacts, n)
            for i in range(n):
                v[i] += _entry(p, r, contacts, i) * push / p.H[i, i]
            at += 1


@kernel
def _holds(p: ContactProblem, r: int, contacts: int, mode: Ints) -> bool:
    """Whether row r (of W, then of S) keeps a rate in this mode: nothing yields and nothing slips there."""
    if r >= 2 * contacts:
        return bool(mode[r - contacts] == STICK and p.R_s[r - 2 * contacts] == 0.0)
    k = r // 2
    closed = mode[k] != OPEN and p.R[k, 0, 0] == 0.0
    return bool(closed and (r % 2 == 0 or (mode[k] == STICK and p.mu[k] > 0.0)))


@kernel
def _entry(p: ContactProblem, r: int, contacts: int, i: int) -> float:
    entry: float = p.W[r, i] if r < 2 * contacts else p.S[r - 2 * contacts, i]
    return entry


@kernel
def _rate(p: ContactProblem, r: int, contacts: int, n: int, v: Reals) -> float:
    rate: float = p.w[r] if r < 2 * contacts else p.w_s[r - 2 * contacts]
    for i in range(n):
        rate += _entry(p, r, contacts, i) * v[i]
    return rate


@kernel
def _length(p: ContactProblem, r: int, contacts: int, n: int) -> float:
    """Norm of the row in the norm of H^-1; 1 for a row without entries."""
    total = 0.0
    for i in range(n):
        total += _entry(p, r, contacts, i) ** 2 / p.H[i, i]
    return math.sqrt(total) if total > 0.0 else 1.0


@kernel
def _coupling(p: ContactProblem, r: int, s: int, contacts: int, n: int) -> float:
    """Cosine between two rows in the norm of H^-1."""
    total = 0.0
    for i in range(n):
        total += _entry(p, r, contacts, i) * _entry(p, s, contacts, i) / p.H[i, i]
    return total / (_length(p, r, contacts, n) * _length(p, s, contacts, n))


@kernel
def _greatest_rate(p: ContactProblem, sizes: Sizes, unknowns: Unknowns) -> float:
    """Greatest rate of a row that holds."""
    n, contacts, limited = sizes
    mode, v = unknowns.mode, unknowns.v
    greatest = 0.0
    for r in range(2 * contacts + limited):
        if _holds(p, r, contacts, mode):
            greatest = max(greatest, abs(_rate(p, r, contacts, n, v)))
    return greatest

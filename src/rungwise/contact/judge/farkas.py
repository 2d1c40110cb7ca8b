"""Proofs that a problem has no solution, and their independent check.

A mode says of some laws which of their pieces holds, and leaves the others at their convex hull. Modes are
the leaves of a tree, and together they cover all solutions. For each there is a vector p of multipliers of
the rates y = A x + b: where the mode says y_i = 0, p_i is free, where y_i >= 0 or y_i <= 0, p_i has that
sign, elsewhere p_i is 0. So p . y >= 0 for every solution in the mode; and if p . b + p . A x < 0 for all x
that the mode allows, there is none. Source: Farkas' lemma for cones (Rockafellar, Convex Analysis, 1970,
section 22).

In floating point a remainder `left` multiplies x, and the proof says that no solution has a scaled norm below
gain / left; a proof counts when that bound is `REACH` (the scaled rates without forces have norm 1), beside
the forces that loads may make of contacts: a heavy body on a light one presses with many of its units.

A proof must also hold for the problem as it was given (`proves`): the multipliers of the rows of eliminated
unknowns follow from the multipliers of the others, p_g = -A_gg^-T A_kg^T p_k, and everything is summed again
from the given numbers: no solution has terms |p| |A| |x| below `REACH` times the sum of the terms |p| |b| of
the gain, where the terms of eliminated velocities count beside the largest of them, in units of energy, and
a kept unknown not at all where none of a scaled norm below `REACH` makes up half of the gain. As no
remainder is known better than to `_KNOWN` of its terms, the gain is more than 1e-9 of its own.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from rungwise.contact.prepare.system import System
from rungwise.contact.prepare.units import part
from rungwise.contact.problem import Array, Problem

REACH = 1e6
"""Norm of solutions that a proof must exclude, in units of scaled forces. Chosen by trial, to a decade; with
`_KNOWN` it asks for a gain of 1e-9 of its terms."""
_KNOWN = 1e-15
"""Share of its terms to which a sum of given numbers is known: a few roundings of double precision."""
_NOTHING = 1e-13
"""Share of an unknown's pull that is rounding of the other multipliers: about a thousand roundings of double
precision, as the multipliers come from a factorisation. Chosen by trial, to a decade."""
_ROUNDING = 2.0**-50
"""Rounding of a sum, over the sum of its terms' sizes: eight roundings of double precision."""
_SIDES, _AXIS = 16, 1e-12
"""Sides of the polygon around the disc of friction, which it exceeds by 2 percent: chosen by trial. Component
of a corner, over mu, that counts as zero: far above rounding, far below the other components."""

HULL = 0
"""A law's convex hull: in the cone and y_n >= 0; within limits."""
OPEN, CLOSED, STICK = 1, 2, 3
SLIPS: dict[int, dict[int, tuple[float, ...]]] = {
    1: {},
    2: {4: (1.0,), 5: (-1.0,)},
    3: {4: (1.0, 1.0), 5: (1.0, -1.0), 6: (-1.0, 1.0), 7: (-1.0, -1.0)},
}
"""A contact's pieces: no force; y_n = 0, which divides into no slip, and slip in each quadrant of signs. In
space a quadrant, and each arc of headings after it, divides into two: of piece i, 2 i and 2 i + 1."""
_QUADRANTS = {4: 0.0, 5: 3.0, 6: 1.0, 7: 2.0}
"""Where quadrants begin, in right angles."""
_FINEST = 512
"""Pieces below which arcs divide: into 128ths of a right angle, where the forces of an arc exceed the disc by
2e-5 of it."""
_WIDER = 1e-6
"""Angle by which arcs are taken wider where multipliers are sought, so that rounding leaves them valid;
chosen by trial, to a decade."""
LOWER, INSIDE, UPPER = 1, 2, 3
"""Pieces of another unknown: at a limit, or between limits, where its rate is zero."""

Mode = tuple[int, ...]


@dataclass(frozen=True, eq=False)
class Infeasible:
    """One vector p (N,) of the scaled system per mode; `kind` is jammed or unsupported."""

    kind: str
    modes: tuple[Mode, ...]
    vectors: tuple[Array, ...]


def hull(system: System) -> Mode:
    """The mode that says nothing: the root of the tree."""
    return (HULL,) * (len(system.mu) + len(system.lower))


def pieces(system: System, law: int, piece: int) -> tuple[int, ...]:
    """The parts into which `piece` of a law (contacts first) divides; empty when it does not divide."""
    contacts = len(system.mu)
    if law < contacts:
        if piece == HULL:
            return (OPEN, CLOSED)
        if piece == CLOSED and system.mu[law] > 0.0 and SLIPS[system.directions]:
            return (STICK, *SLIPS[system.directions])
        if system.directions == 3 and STICK < piece < _FINEST:
            return (2 * piece, 2 * piece + 1)
        return ()
    lower, upper = system.lower[law - contacts], system.upper[law - contacts]
    if piece != HULL or (np.isneginf(lower) and np.isposinf(upper)):
        return ()
    if lower == upper:
        return (LOWER,)
    ends = (LOWER,) * bool(np.isfinite(lower)) + (UPPER,) * bool(np.isfinite(upper))
    return (INSIDE, *ends)


def generators(system: System, k: int, piece: int) -> Array:
    """Rays (g, d) whose cone holds all forces of contact k in the piece; in space it is a little larger."""
    mu, d = system.mu[k], system.directions
    if piece == OPEN:
        return np.zeros((0, d))
    if d == 1:
        return np.ones((1, 1))
    ends = mu * np.vstack([np.eye(d - 1), -np.eye(d - 1)])
    if d == 3:
        # The corners of a polygon around the disc.
        angle = 2.0 * np.pi * np.arange(_SIDES) / _SIDES
        corners = mu / np.cos(np.pi / _SIDES) * np.column_stack([np.cos(angle), np.sin(angle)])
        ends = np.vstack([ends, corners])
    if d == 3 and piece > STICK and piece not in SLIPS[d]:
        first, last = arc(piece)
        outer = (first + last) / (1.0 + first @ last)
        ends = -mu * np.vstack([first, last, outer])
    slip = SLIPS[d].get(piece)
    if slip is not None:
        ends = ends[(ends * slip <= _AXIS * mu).all(axis=1)]
    return np.column_stack([np.ones(len(ends)), ends])


def arc(piece: int, wider: float = 0.0) -> tuple[Array, Array]:
    """The first and the last heading (2,) of an arc of slips in space, taken wider by an angle."""
    halvings = piece.bit_length() - 3
    quadrant = piece >> halvings
    width = 0.5 * np.pi / (1 << halvings)
    first = 0.5 * np.pi * _QUADRANTS[quadrant] + width * (piece - (quadrant << halvings))
    ends = np.array([first - wider, first + width + wider])
    return np.array([np.cos(ends[0]), np.sin(ends[0])]), np.array([np.cos(ends[1]), np.sin(ends[1])])


def headings(system: System, mode: Mode, wider: float = _WIDER) -> Array:
    """Rows (g, N): a multiplier's product with the first and the last heading of each arc of the mode, which
    may not be negative, as no product with a slip of the arc may be."""
    d, rows = system.directions, []
    for k, piece in enumerate(mode[: len(system.mu)]):
        if piece > STICK and piece not in SLIPS[d]:
            for heading in arc(piece, wider):
                row = np.zeros(system.size)
                row[k * d + 1 : (k + 1) * d] = heading
                rows.append(row)
    return np.array(rows).reshape(-1, system.size)


def signs(system: System, mode: Mode) -> tuple[Array, Array]:
    """Least and greatest multiplier (N,) that the mode allows, as 0 or infinite."""
    s, d = system, system.directions
    least, most = np.zeros(s.size), np.zeros(s.size)
    for k, piece in enumerate(mode[: len(s.mu)]):
        most[k * d] = np.inf
        least[k * d] = 0.0 if piece in (HULL, OPEN) else -np.inf
        tangents = slice(k * d + 1, (k + 1) * d)
        if piece >= STICK:
            least[tangents], most[tangents] = -np.inf, np.inf
        if piece in SLIPS[d]:
            slip = np.array(SLIPS[d][piece])
            least[tangents], most[tangents] = (
                np.where(slip < 0.0, -np.inf, 0.0),
                np.where(slip > 0.0, np.inf, 0.0),
            )
    for j, (a, b) in enumerate(zip(s.lower, s.upper, strict=True)):
        i, piece = s.rows + j, mode[len(s.mu) + j]
        if piece == INSIDE or (a < b and (piece == LOWER or (piece == HULL and np.isposinf(b)))):
            most[i] = np.inf
        if piece == INSIDE or (a < b and (piece == UPPER or (piece == HULL and np.isneginf(a)))):
            least[i] = -np.inf
    return least, most


def limits(system: System, mode: Mode) -> tuple[Array, Array]:
    """Limits of the other unknowns (m,) in the mode."""
    piece = np.array(mode[len(system.mu) :], int)
    return (
        np.where(piece == UPPER, system.upper, system.lower),
        np.where(piece == LOWER, system.lower, system.upper),
    )


def check(system: System, proof: Infeasible) -> bool:
    """Whether `proof` shows that the system has no solution of scaled norm below `REACH`."""
    if len(proof.modes) != len(proof.vectors) or not covers(system, hull(system), proof.modes):
        return False
    return all(excludes(system, mode, p) for mode, p in zip(proof.modes, proof.vectors, strict=True))


def covers(system: System, mode: Mode, leaves: tuple[Mode, ...]) -> bool:
    """Whether `mode` divides into these leaves, one law at a time."""
    if mode in leaves:
        return True
    for law, piece in enumerate(mode):
        parts = pieces(system, law, piece)
        if parts and all(leaf[law] != piece for leaf in leaves):
            below = {part: tuple(x for x in leaves if _within(system, law, x[law], part)) for part in parts}
            return all(
                bool(below[part]) and covers(system, (*mode[:law], part, *mode[law + 1 :]), below[part])
                for part in parts
            )
    return False


def _within(system: System, law: int, piece: int, part: int) -> bool:
    return piece == part or any(_within(system, law, piece, own) for own in pieces(system, law, part))


def excludes(system: System, mode: Mode, p: Array) -> bool:
    """Whether the multipliers p (N,) prove that no solution of norm below `REACH` is in the mode."""
    s, d = system, system.directions
    if p.shape != (s.size,) or not np.isfinite(p).all():
        return False
    least, most = signs(s, mode)
    if (p < least).any() or (p > most).any() or (headings(s, mode, 0.0) @ p < 0.0).any():
        return False
    A = s.matrix()
    pull = A.T @ p
    doubt = _ROUNDING * (abs(A).T @ np.abs(p))
    gain = -float(p @ s.b) - _ROUNDING * float(np.abs(p) @ np.abs(s.b))
    left = float(doubt.max(initial=0.0))
    for k, piece in enumerate(mode[: len(s.mu)]):
        own = pull[k * d : (k + 1) * d]
        if piece > STICK:
            left = max(left, float((generators(s, k, piece) @ own).max()))
        elif piece != OPEN:
            left = max(left, own[0] + s.mu[k] * float(np.linalg.norm(own[1:])))
    lower, upper = limits(s, mode)
    own = pull[s.rows :]
    bound = np.where(own > 0.0, upper, lower)
    inside = np.isfinite(bound)
    gain -= float((own[inside] * bound[inside]).sum())
    gain -= float((_ROUNDING * np.abs(own) + doubt[s.rows :])[inside] @ np.abs(bound[inside]))
    left = max(left, float(np.abs(own[~inside]).max(initial=0.0)))
    return gain > REACH * s.load * s.size * left


def proves(problem: Problem, system: System, proof: Infeasible) -> bool:
    """Whether `proof`, of a system of the problem, shows that the problem as it was given has no solution."""
    return check(system, proof) and all(
        excludes_given(problem, system, mode, p) for mode, p in zip(proof.modes, proof.vectors, strict=True)
    )


def excludes_given(problem: Problem, system: System, mode: Mode, p: Array) -> bool:
    """Whether the multipliers p (N,) of the system's rows, with the multipliers of other rows that follow
    from p, prove from the numbers of the problem as it was given that no solution is in the mode."""
    return any(_excludes(problem, system, mode, q) for q in _lift(problem, system)(p / system.rate))


def _excludes(problem: Problem, system: System, mode: Mode, q: Array) -> bool:
    """Whether multipliers q (N,) of all rows of the problem prove that no solution is in the mode."""
    s, d = system, system.directions
    A, b, size = sp.csr_array(problem.A), problem.b, np.abs(q)
    pull, terms = A.T @ q, abs(A).T @ size
    share = np.abs(pull) / np.where(terms > 0.0, terms, 1.0)
    kept, others = s.kept, s.kept[s.rows :]
    gone = np.delete(np.arange(len(b)), kept)
    own = A.diagonal()[gone]
    unit = 1.0 / np.sqrt(np.where(own > 0.0, own, np.inf))
    greatest = float((terms[gone] * unit).max(initial=0.0))
    beside = np.abs(pull[gone]) * unit / (greatest or 1.0)
    left = float(np.where(own > 0.0, beside, share[gone]).max(initial=0.0))
    for k, piece in enumerate(mode[: len(s.mu)]):
        own, most = pull[k * d : (k + 1) * d], float(terms[k * d : (k + 1) * d].max())
        if piece > STICK:
            left = max(left, float((generators(s, k, piece) @ own).max()) / (most or 1.0))
        elif piece != OPEN:
            left = max(left, (own[0] + s.mu[k] * float(np.linalg.norm(own[1:]))) / (most or 1.0))
    lower, upper = limits(s, mode)
    bound = np.where(pull[others] > 0.0, upper, lower) * s.force[s.rows :]
    inside = np.isfinite(bound)
    gains = np.concatenate([-q * b, -pull[others][inside] * bound[inside]])
    gain = float(gains.sum())
    # What no unknown of a scaled norm below `REACH` makes felt, though it is all that pulls it.
    felt = np.abs(pull[others]) * s.force[s.rows :] * REACH * s.load * s.size > 0.5 * gain
    left = max(left, float(share[others][~inside & felt].max(initial=0.0)))
    total = float(size @ np.abs(b)) + float(terms[others][inside] @ np.abs(bound[inside]))
    return gain > 2.0 * REACH * max(left, _KNOWN) * total


Lift = Callable[[Array], tuple[Array, ...]]
_lifts: WeakKeyDictionary[System, Lift] = WeakKeyDictionary()


def _lift(problem: Problem, system: System) -> Lift:
    """A function from multipliers of the kept rows to multipliers (N,) of all rows that pull no free unknown:
    with all of them, without multipliers that are rounding beside others that pull the same unknown, and with
    the kept rows alone: rates that exclude each other whatever the balance of forces is."""
    found = _lifts.get(system)
    if found is None:
        found = _lifts[system] = _lifting(problem, system)
    return found


def _lifting(problem: Problem, system: System) -> Lift:
    kept, size = system.kept, len(problem.b)
    if len(kept) == size:
        return lambda p: (p,)
    A, gone = sp.csr_array(problem.A), np.delete(np.arange(size), kept)
    own, back = part(A, gone, gone), part(A, kept, gone)
    factor, sizes = splu(sp.csc_array(own)), abs(own)

    def lift(p: Array) -> tuple[Array, ...]:
        q, push = np.zeros(size), back.T @ p
        q[kept], q[gone] = p, -factor.solve(push, "T")
        q[gone] -= factor.solve(own.T @ q[gone] + push, "T")
        terms = sizes.T @ np.abs(q[gone]) + abs(back).T @ np.abs(p)
        per = sp.diags_array(1.0 / np.where(terms > 0.0, terms, np.inf))
        share = sp.diags_array(np.abs(q[gone])) @ sizes @ per
        fewer = q.copy()
        fewer[gone[_least(share) < _NOTHING]] = 0.0
        alone = q.copy()
        alone[gone] = 0.0
        return q, fewer, alone

    return lift


def _least(share: sp.csr_array) -> Array:
    """The least stored entry of each row."""
    least = np.full(share.shape[0], np.inf)
    entries = share.tocoo()
    some = entries.data > 0.0
    np.minimum.at(least, entries.coords[0][some], entries.data[some])
    return least

"""All solutions of a problem as polyhedra, one for each contact mode, and their independent check.

The modes of `farkas` that divide no further are polyhedra {x: E x = e, G x >= g}. Some are excluded by a
Farkas vector; each other holds a `Piece` with evidence of its dimension: a point at which all but some of the
inequalities are strict, and multipliers p >= 0 of the exceptions, with p_E E + p_G G = 0 and p_E e + p_G g =
0, which prove that they hold as equations all over the piece. So the dimension of the piece is the dimension
of the null space of these rows. Source: Freund, Roundy and Todd, Identifying the set of always-active
constraints (MIT, 1985).

Everything is meant up to rounding: `TIGHT` in the scaled system, whose rates without forces have norm 1, and
relative to a point's own size; points closer than `SAME` count as one; and solutions are excluded up to the
norm that `farkas` states.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
import scipy.sparse as sp

from rungwise.contact.analysis.monotone import RANK, SAME, TIGHT, demands, is_monotone, widest
from rungwise.contact.judge.farkas import (
    CLOSED,
    HULL,
    INSIDE,
    LOWER,
    OPEN,
    SLIPS,
    STICK,
    UPPER,
    Infeasible,
    Mode,
    covers,
    excludes,
    excludes_given,
    hull,
)
from rungwise.contact.judge.residuals import in_own_terms
from rungwise.contact.prepare.system import System, scaled
from rungwise.contact.problem import Array, Problem
from rungwise.plain import brief

_NOTHING, _OWN = 2.0**-46, 1e-6
"""Motion that is rounding, over the coordinate's unit: 128 roundings of double precision. Violation of a row,
over its own terms, up to which a solution holds: chosen by trial, to a decade."""
_CONTACT = {OPEN: "open", CLOSED: "slide", STICK: "stick", 4: "forward", 5: "backward"}
_OTHER = {HULL: "free", LOWER: "lower", INSIDE: "inside", UPPER: "upper"}


class Kind(StrEnum):
    """UNIQUE one solution · FORCE_INDETERMINATE one motion, several forces · MOTION_INDETERMINATE several
    motions · NONE no solution · UNDECIDED some modes were neither excluded nor measured."""

    UNIQUE = "unique"
    FORCE_INDETERMINATE = "force-indeterminate"
    MOTION_INDETERMINATE = "motion-indeterminate"
    NONE = "none"
    UNDECIDED = "undecided"


@dataclass(frozen=True, eq=False)
class Piece:
    """The solutions in one mode.

    x (N,) is a solution in the problem's units, inside the piece; `motions` is the dimension of the piece's
    motions (velocities; rates where the problem has none), `forces` the dimension of the forces of one
    motion. `point` is x in the scaled system, `multipliers` belong to E x = e, then to G x >= g.
    """

    mode: Mode
    x: Array
    motions: int
    forces: int
    point: Array
    multipliers: Array

    __repr__ = brief


@dataclass(frozen=True, eq=False)
class Solutions:
    """All solutions of a `problem` of a `kind`: `pieces`, none within another; `covered`: pieces of other
    modes within one of `pieces`.

    `excluded` are the modes without solutions, each with multipliers that prove it; with no pieces they are
    the `certificate`. `held` are modes whose solutions all lie in one of the pieces, each with a solution, in
    the scaled system, that proves it (see `monotone`). `undecided` modes have no proof. `nodes` is the number
    of modes looked at. `massless` says that the scaled system is the system beside demanded rates.
    """

    problem: Problem
    kind: Kind
    pieces: tuple[Piece, ...]
    covered: tuple[Piece, ...]
    excluded: tuple[tuple[Mode, Array], ...]
    held: tuple[tuple[Mode, Array], ...]
    certificate: Infeasible | None
    undecided: tuple[Mode, ...]
    nodes: int
    massless: bool = False

    __repr__ = brief

    def names(self, piece: Piece) -> tuple[str, ...]:
        """The mode of a `piece` in words: one word for each contact, then one for each other unknown that is
        not eliminated."""
        contacts = len(self.problem.mu)
        return (
            *(_CONTACT[part] for part in piece.mode[:contacts]),
            *(_OTHER[part] for part in piece.mode[contacts:]),
        )


@dataclass(frozen=True, eq=False)
class Polyhedron:
    """E x = e, G x >= g in the unknowns of the scaled system."""

    E: Array
    e: Array
    G: Array
    g: Array

    def contains(self, x: Array) -> bool:
        """Whether x is in the polyhedron, to rounding."""
        room = TIGHT * (1.0 + float(np.abs(x).max(initial=0.0)))
        equal = np.abs(self.E @ x - self.e).max(initial=0.0) <= room
        return bool(equal and (self.G @ x - self.g).min(initial=0.0) >= -room)


def polyhedron(system: System, mode: Mode) -> Polyhedron:
    """The solutions in `mode`, which divides no further: without friction, or in the plane."""
    s, d = system, system.directions
    rates, own = s.matrix().toarray(), np.eye(s.size)
    equal: list[tuple[Array, float]] = []
    least: list[tuple[Array, float]] = []
    for k, piece in enumerate(mode[: len(s.mu)]):
        n, mu = k * d, s.mu[k]
        tangents = range(n + 1, n + d)
        (least if piece == OPEN else equal).append((rates[n], -s.b[n]))
        (equal if piece == OPEN else least).append((own[n], 0.0))
        if piece == STICK:
            equal += [(rates[t], -s.b[t]) for t in tangents]
            least += [(mu * own[n] + side * own[t], 0.0) for t in tangents for side in (1.0, -1.0)]
        elif piece in (OPEN, CLOSED):
            equal += [(own[t], 0.0) for t in tangents]
        else:
            for t, slip in zip(tangents, SLIPS[d][piece], strict=True):
                equal.append((own[t] + slip * mu * own[n], 0.0))
                least.append((slip * rates[t], -slip * s.b[t]))
    for j, piece in enumerate(mode[len(s.mu) :]):
        i, lower, upper = s.rows + j, float(s.lower[j]), float(s.upper[j])
        if piece in (HULL, INSIDE):
            equal.append((rates[i], -s.b[i]))
            least += [
                (side * own[i], side * b) for side, b in ((1.0, lower), (-1.0, upper)) if np.isfinite(b)
            ]
            continue
        side, bound = (1.0, lower) if piece == LOWER else (-1.0, upper)
        equal.append((own[i], bound))
        if lower < upper:
            least.append((side * rates[i], -side * s.b[i]))
    return Polyhedron(*_rows(equal, s.size), *_rows(least, s.size))


def _rows(rows: Sequence[tuple[Array, float]], size: int) -> tuple[Array, Array]:
    left = np.array([row for row, _ in rows]).reshape(len(rows), size)
    return left, np.array([right for _, right in rows], np.float64)


def freedom(shape: Polyhedron, point: Array, multipliers: Array) -> Array | None:
    """Orthonormal directions (N, dimension) that span the polyhedron, or None where the evidence fails."""
    s, equal = shape, len(shape.e)
    if multipliers.shape != (equal + len(s.g),) or point.shape != s.E.shape[1:]:
        return None
    if not (np.isfinite(multipliers).all() and np.isfinite(point).all() and s.contains(point)):
        return None
    own = multipliers[equal:]
    tight = own > 0.0
    size = 1.0 + float(np.abs(point).sum())
    if (own < 0.0).any() or not ((s.G @ point - s.g)[~tight] > TIGHT * size).all():
        return None
    if tight.any():
        left = multipliers @ np.vstack([s.E, s.G])
        gain = multipliers @ np.concatenate([s.e, s.g])
        slack = float(np.abs(left).max(initial=0.0)) * size + abs(float(gain))
        if not slack <= TIGHT * size * float(own[tight].min()):
            return None
    return _null_space(np.vstack([s.E, s.G[tight]]))


def _null_space(rows: Array) -> Array:
    if rows.shape[1] == 0:
        return np.zeros((0, 0))
    length = np.linalg.norm(rows, axis=1)
    _, values, basis = np.linalg.svd(rows / np.where(length > 0.0, length, 1.0)[:, None])
    return np.asarray(basis[int((values > RANK).sum()) :].T)


def motion_map(problem: Problem, system: System) -> tuple[Array, Array]:
    """L (m, N) and l (m,): the velocities, or where there are none the rates, are L x + l for scaled x."""
    whole = np.column_stack([np.zeros(system.size), np.eye(system.size)])
    x = np.column_stack([system.recover(column * system.force) for column in whole.T])
    if not problem.velocities:
        rates = problem.A @ x + problem.b[:, None]
        return rates[:, 1:] - rates[:, :1], rates[:, 0]
    own = slice(problem.rows, problem.rows + problem.velocities)
    motion, offset = x[own, 1:] - x[own, :1], x[own, 0]
    # Coordinates that joints hold move by rounding: nothing beside their terms, or beside a rate that counts.
    seen = abs(sp.csr_array(problem.A)[system.kept][:, own]).toarray() / system.rate[:, None]
    largest = seen.max(axis=0, initial=0.0)
    unit = np.where(largest > 0.0, 1.0 / np.where(largest > 0.0, largest, 1.0), 0.0)
    unit = np.maximum(unit, np.abs(offset))
    return np.where(np.abs(motion) > _NOTHING * unit[:, None], motion, 0.0), offset


def _in_own_units(motion: Array) -> Array:
    largest = np.abs(motion).max(axis=1, initial=0.0)
    return motion / np.where(largest > 0.0, largest, 1.0)[:, None]


def dimensions(motion: Array, directions: Array) -> tuple[int, int]:
    """Dimension of the motions L x along the directions, and of the directions left when the motion is
    held."""
    total = directions.shape[1]
    moved = int(np.linalg.matrix_rank(_in_own_units(motion) @ directions, RANK)) if total else 0
    return moved, total - moved


def holds_in_own_terms(problem: Problem, x: Array) -> bool:
    """Whether x (N,) is a solution also in rows that are tiny beside others (see `judge`)."""
    return bool(problem.free.any()) or in_own_terms(problem, x, problem.A @ x + problem.b) <= _OWN


def same(a: Array, b: Array, motion: Array | None = None) -> bool:
    """Whether two scaled points are the same, or have the same motion, to rounding."""
    step = b - a if motion is None else _in_own_units(motion) @ (b - a)
    return bool(np.abs(step).max(initial=0.0) <= SAME * (1.0 + float(np.abs(a).max(initial=0.0))))


def classify(motion: Array, leaves: Sequence[Piece], undecided: int) -> Kind:
    """The kind that the pieces of all modes make. Two motions are two, whichever modes are undecided."""
    if any(piece.motions for piece in leaves) or any(
        not same(leaves[0].point, piece.point, motion) for piece in leaves
    ):
        return Kind.MOTION_INDETERMINATE
    if undecided:
        return Kind.UNDECIDED
    if not leaves:
        return Kind.NONE
    several = any(piece.forces for piece in leaves) or any(
        not same(leaves[0].point, piece.point) for piece in leaves
    )
    return Kind.FORCE_INDETERMINATE if several else Kind.UNIQUE


def check(found: Solutions) -> bool:
    """Whether the evidence proves the kind and the dimensions of all pieces, from the problem alone."""
    problem, system = found.problem, scaled(found.problem, found.massless)
    leaves = (*found.pieces, *found.covered)
    proved = (mode for mode, _ in (*found.excluded, *found.held))
    modes = (*(piece.mode for piece in leaves), *proved, *found.undecided)
    if not covers(system, hull(system), modes) or not all(
        excludes(system, *pair) and excludes_given(problem, system, *pair) for pair in found.excluded
    ):
        return False
    motion, _ = motion_map(problem, system)
    for piece in leaves:
        directions = freedom(polyhedron(system, piece.mode), piece.point, piece.multipliers)
        if directions is None or dimensions(motion, directions) != (piece.motions, piece.forces):
            return False
        if not np.array_equal(piece.x, system.recover(piece.point * system.force)):
            return False
        if not holds_in_own_terms(problem, piece.x):
            return False
    if found.held and not is_monotone(system, motion):
        return False
    if not all(any(holds(system, piece, *pair) for piece in leaves) for pair in found.held):
        return False
    return found.kind == classify(motion, leaves, len(found.undecided))


def holds(system: System, piece: Piece, mode: Mode, point: Array) -> bool:
    """Whether a scaled point of the piece proves, in a monotone system, that the piece holds all solutions of
    a mode."""
    if piece.motions or piece.mode != widest(system, piece.point) or point.shape != piece.point.shape:
        return False
    needed = demands(system, piece.point, piece.mode, mode)
    return needed is not None and polyhedron(system, piece.mode).contains(point) and needed.met(point)

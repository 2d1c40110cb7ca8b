"""All solutions of a problem with few contacts, and the motions they allow.

Branch and bound over contact modes, as in `search`, to the end: a mode is held by a piece known
before, excluded by a Farkas vector or divided, and a mode that divides no further is measured. All linear
programs are solved by HiGHS, through scipy; their results count only if `pieces`, `farkas` and `monotone`,
which know no solver, agree.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations
from typing import Any

import numpy as np

from rungwise.contact import search
from rungwise.contact.analysis.monotone import Demands, demands, is_monotone, widest
from rungwise.contact.analysis.pieces import (
    Kind,
    Piece,
    Polyhedron,
    Solutions,
    classify,
    dimensions,
    freedom,
    holds_in_own_terms,
    motion_map,
    polyhedron,
    same,
)
from rungwise.contact.judge.farkas import Mode, excludes, excludes_given, hull
from rungwise.contact.measure import SMALL, rate_terms
from rungwise.contact.prepare.system import System, scaled
from rungwise.contact.problem import Array, Problem
from rungwise.contact.solution import Status
from rungwise.contact.solve import demands_little, is_kinematic, solve
from rungwise.contact.step.problem import ContactProblem
from rungwise.deadline import Deadline, TimeOver, seconds
from rungwise.keywords import keywords

NODES = 5000
"""Partial modes that are looked at before solutions are left undecided."""
_STRICT = 1e-6
"""Slack of an inequality, of at most 1 in scaled units, from which on it counts as strict. Chosen by trial,
to a decade, far above the tolerance 1e-10 of the linear programs."""
_INFEASIBLE, _UNBOUNDED = 2, 3


@keywords
def solutions(
    problem: Problem | ContactProblem, *, nodes: int = NODES, limit: float | None = None
) -> Solutions:
    """All solutions of `problem`, one piece for each contact mode that has any, and their `Kind`.

    For problems whose laws are polyhedral: frictionless, or planar (LCPs and boxes too). Work grows with the
    modes, 4 for each contact, of which most are excluded early, or held at once by the piece of a solution
    known before (`monotone`): a stack under its weight takes one mode, a stack that is pulled a few hundred.
    After `nodes` modes, or `limit` seconds, the rest is undecided; a limit may also leave pieces that lie
    within others. `pieces.check` verifies the answer without a solver.

    Raises ValueError for friction in space.
    """
    assembled, deadline = problem, Deadline(seconds(limit))
    problem = Problem.of(problem)
    if problem.directions > 2 and (problem.mu > 0.0).any():
        raise ValueError("problem: all solutions are found in the plane; with friction, directions must be 2")
    if not isinstance(nodes, int | np.integer) or nodes < 1:
        raise ValueError(f"nodes: must be at least 1, not {nodes!r}")
    system = scaled(problem)
    found = _all(assembled, problem, system, nodes, deadline)
    if demands_little(assembled, system) and not any(
        _moves(problem, system, piece) for piece in found.pieces
    ):
        slow = _all(assembled, problem, scaled(problem, massless=True), nodes, deadline)
        proof = slow.certificate
        if slow.pieces or (proof is not None and is_kinematic(problem, proof)):
            return replace(slow, massless=True)
    return found


def _moves(problem: Problem, system: System, piece: Piece) -> bool:
    """Whether the rates of the piece are seen beside the rates without forces."""
    return bool((rate_terms(problem, piece.x)[system.kept] >= SMALL * system.rate).any())


def _all(
    assembled: Problem | ContactProblem, problem: Problem, system: System, nodes: int, deadline: Deadline
) -> Solutions:
    motion, _ = motion_map(problem, system)
    waiting, done = [hull(system)], 0
    known = _known(assembled, problem, system, motion, deadline)
    leaves: list[Piece] = [] if known is None else [known]
    holding = None if known is None else _Holding(system, known, deadline)
    undecided: list[Mode] = []
    excluded: list[tuple[Mode, Array]] = []
    held: list[tuple[Mode, Array]] = []
    while waiting and done < nodes and not deadline.is_over:
        done += 1
        mode = waiting.pop()
        point, law = (None, None) if holding is None else holding.point(mode)
        if point is not None:
            held.append((mode, point))
            continue
        p, x = search.separate(system, mode, search.until(deadline)) if system.size else (None, None)
        if p is not None and excludes(system, mode, p) and excludes_given(problem, system, mode, p):
            excluded.append((mode, p))
            continue
        parts = search.divide(system, mode, np.zeros(system.size) if x is None else x, law)
        waiting += parts
        if not parts:
            piece = _measure(problem, system, motion, mode, deadline)
            if piece is None:
                undecided.append(mode)
            else:
                leaves.append(piece)
    undecided += waiting
    kind = classify(motion, leaves, len(undecided))
    pieces, covered = _merge(system, leaves, deadline)
    proof = search.proof(system, excluded) if kind == Kind.NONE else None
    return Solutions(
        problem, kind, pieces, covered, tuple(excluded), tuple(held), proof, tuple(undecided), done
    )


def _known(
    given: Problem | ContactProblem, problem: Problem, system: System, motion: Array, deadline: Deadline
) -> Piece | None:
    """The piece of one solution, in its widest mode, if the piece has one motion and the system is
    monotone."""
    if not is_monotone(system, motion) or deadline.is_over:
        return None
    solved = solve(given, limit=deadline.seconds)
    if solved.status != Status.SOLVED:
        return None
    mode = widest(system, solved.x[system.kept] / system.force)
    piece = _measure(problem, system, motion, mode, deadline)
    return piece if piece and not piece.motions and widest(system, piece.point) == mode else None


class _Holding:
    """Points of a piece that prove that the piece holds all solutions of a mode."""

    def __init__(self, system: System, piece: Piece, deadline: Deadline) -> None:
        self.system, self.piece, self.shape = system, piece, polyhedron(system, piece.mode)
        self._deadline = deadline
        self._seen: dict[Demands, tuple[Array | None, int | None]] = {}

    def point(self, mode: Mode) -> tuple[Array | None, int | None]:
        """A point that proves the mode held; else the contact that prevents this most, if forces prevent
        it."""
        needed = demands(self.system, self.piece.point, self.piece.mode, mode)
        if needed is None:
            return None, None
        if needed not in self._seen:
            self._seen[needed] = self._nearest(needed)
        return self._seen[needed]

    def _nearest(self, needed: Demands) -> tuple[Array | None, int | None]:
        """The point of the piece whose misses of the demands have the least sum, if they are zero; else where
        they are largest."""
        size, shape = self.system.size, self.shape
        over, under = (*needed.zero, *needed.negative), (*needed.zero, *needed.positive)
        # x_i - a <= 0 and x_i + a >= 0 with a >= 0 of least sum.
        rows = np.zeros((len(over) + len(under), 2 * size))
        for r, (i, side) in enumerate([*((i, -1.0) for i in over), *((i, 1.0) for i in under)]):
            rows[r, i], rows[r, size + i] = side, 1.0
        found = _program(
            np.concatenate([np.zeros(size), np.ones(size)]),
            np.hstack([shape.E, np.zeros(shape.E.shape)]), shape.e,
            np.vstack([np.hstack([shape.G, np.zeros(shape.G.shape)]), rows]),
            np.concatenate([shape.g, np.zeros(len(rows))]),
            [(None, None)] * size + [(0.0, None)] * size, self._deadline,
        )  # fmt: skip
        if not found.success:
            return None, None
        point = np.asarray(found.x[:size])
        if needed.met(point):
            return point, None
        return None, int(np.argmax(found.x[size:])) // self.system.directions


@keywords
def extreme_motions(
    found: Solutions, objects: Sequence[Sequence[int]] = (), *, limit: float | None = None
) -> Array:
    """Least and greatest of each velocity (rate, where the problem has none) over all solutions `found`: (m,
    2).

    In the plane, and in space without friction.

    `objects` names the velocities of each object. One for which rest is admissible rests: of the solutions
    only solutions count in which no further object could rest. Infinite where nothing bounds the motion.

    Raises ValueError where modes are undecided, there is no solution, or an object names no velocity, and
    LimitError where `limit` seconds are over first: bounds of some of the solutions bound nothing.
    """
    deadline = Deadline(seconds(limit))
    if not isinstance(found, Solutions):
        raise ValueError(f"found: must be what `solutions` gives, not {type(found).__name__}")
    if found.undecided or not found.pieces:
        raise ValueError(f"found: the solutions are {found.kind}, and have no motion to bound")
    system = scaled(found.problem, found.massless)
    motion, offset = motion_map(found.problem, system)
    if not isinstance(objects, Sequence) or not all(isinstance(one, Sequence) for one in objects):
        raise ValueError("objects: must be a list of the velocities of each object, such as [[0, 1, 2]]")
    for i in (i for coordinates in objects for i in coordinates):
        if isinstance(i, bool) or not isinstance(i, int | np.integer) or not 0 <= i < len(offset):
            raise ValueError(f"objects: velocity {i!r} is not one of 0 to {len(offset) - 1}")
    shapes = [polyhedron(system, piece.mode) for piece in found.pieces]
    unit = np.abs(motion).max(axis=1, initial=0.0)
    unit = np.where(unit > 0.0, unit, 1.0)
    interval = np.tile([np.inf, -np.inf], (len(offset), 1))
    with deadline.needed_for("all motions were bounded"):
        for rows in _resting(shapes, motion / unit[:, None], offset / unit, objects, deadline):
            for shape in rows:
                for i, row in enumerate(motion / unit[:, None]):
                    low, high = _least(shape, row, deadline), -_least(shape, -row, deadline)
                    interval[i] = min(interval[i, 0], low), max(interval[i, 1], high)
    return interval * unit[:, None] + offset[:, None]


def _resting(
    shapes: list[Polyhedron],
    motion: Array,
    offset: Array,
    objects: Sequence[Sequence[int]],
    deadline: Deadline,
) -> list[list[Polyhedron]]:
    """For each largest set of objects that may rest together, the solutions in which they do."""
    largest: list[set[int]] = []
    resting: list[list[Polyhedron]] = []
    for count in range(len(objects), -1, -1):
        for group in combinations(range(len(objects)), count):
            if any(set(group) <= other for other in largest):
                continue
            held = [i for k in group for i in objects[k]]
            still = [_with(shape, motion[held], -offset[held]) for shape in shapes]
            still = [
                shape for shape in still if np.isfinite(_least(shape, np.zeros(motion.shape[1]), deadline))
            ]
            if still:
                largest.append(set(group))
                resting.append(still)
    return resting


def _with(shape: Polyhedron, rows: Array, right: Array) -> Polyhedron:
    return Polyhedron(np.vstack([shape.E, rows]), np.concatenate([shape.e, right]), shape.G, shape.g)


def _least(shape: Polyhedron, cost: Array, deadline: Deadline) -> float:
    """The least value of cost . x: infinite if there is no x, minus infinity if nothing bounds the value.
    Raises TimeOver."""
    deadline.look()
    if len(cost) == 0:
        return 0.0
    found = _program(cost, shape.E, shape.e, shape.G, shape.g, [(None, None)] * len(cost), deadline)
    if found.status in (_INFEASIBLE, _UNBOUNDED):
        return np.inf if found.status == _INFEASIBLE else -np.inf
    if not found.success:
        deadline.look()
        raise ArithmeticError(f"a linear program of {len(cost)} unknowns failed: {found.message}")
    return float(found.fun)


def _program(
    cost: Array, E: Array, e: Array, G: Array, g: Array, bounds: Sequence[tuple[float | None, float | None]],
    deadline: Deadline,
) -> Any:  # fmt: skip
    """Minimise cost . x over E x = e, G x >= g."""
    from scipy.optimize import linprog

    return linprog(
        cost,
        -G if len(g) else None,
        -g if len(g) else None,
        E if len(e) else None,
        e if len(e) else None,
        bounds=bounds,
        method="highs",
        options=search.until(deadline),
    )


def _measure(problem: Problem, system: System, motion: Array, mode: Mode, deadline: Deadline) -> Piece | None:
    """The piece of a mode that divides no further, if the mode has a piece and its evidence holds."""
    shape = polyhedron(system, mode)
    found = _inside(shape, deadline)
    if found is None:
        return None
    point, multipliers = found
    tight = multipliers[len(shape.e) :] > 0.0
    rows, right = np.vstack([shape.E, shape.G[tight]]), np.concatenate([shape.e, shape.g[tight]])
    if system.size and len(rows):
        point = point - np.linalg.lstsq(rows, rows @ point - right, rcond=1e-12)[0]
    directions = freedom(shape, point, multipliers)
    if directions is None:
        return None
    x = system.recover(point * system.force)
    if not holds_in_own_terms(problem, x):
        return None
    return Piece(mode, x, *dimensions(motion, directions), point, multipliers)


def _inside(shape: Polyhedron, deadline: Deadline) -> tuple[Array, Array] | None:
    """A point where every inequality that can be strict is strict, and multipliers, at least 1, of the
    others.

    Each program maximises the sum of the slacks, up to 1, of the inequalities that are still tight. The last
    program finds no slack, and its dual is the proof; the mean of all points is inside.
    """
    size, slacks, equal = shape.E.shape[1], len(shape.g), len(shape.e)
    tight = np.ones(slacks, bool)
    points: list[Array] = []
    if size == 0:
        return np.zeros(0), np.zeros(equal + slacks)
    E, G = np.hstack([shape.E, np.zeros((equal, slacks))]), np.hstack([shape.G, -np.eye(slacks)])
    while True:
        cost = np.concatenate([np.zeros(size), -tight.astype(float)])
        bounds = [*[(None, None)] * size, *((0.0, float(row)) for row in tight)]
        found = _program(cost, E, shape.e, G, shape.g, bounds, deadline)
        if not found.success:
            return None
        points.append(np.asarray(found.x[:size]))
        strict = tight & (found.x[size:] > _STRICT)
        if not strict.any():
            break
        tight &= ~strict
    balance = np.asarray(found.eqlin.marginals) if equal else np.zeros(0)
    own = np.where(tight, -np.asarray(found.ineqlin.marginals), 0.0) if slacks else np.zeros(0)
    return np.mean(points, axis=0), np.concatenate([balance, own])


def _merge(
    system: System, leaves: list[Piece], deadline: Deadline
) -> tuple[tuple[Piece, ...], tuple[Piece, ...]]:
    """Pieces that are not within another piece, and the other pieces."""
    kept: list[tuple[Piece, Polyhedron]] = []
    covered: list[Piece] = []
    for piece in sorted(leaves, key=lambda piece: -(piece.motions + piece.forces)):
        shape = polyhedron(system, piece.mode)
        if any(_within(piece, shape, other, whole, deadline) for other, whole in kept):
            covered.append(piece)
        else:
            kept.append((piece, shape))
    return tuple(piece for piece, _ in kept), tuple(covered)


def _within(piece: Piece, shape: Polyhedron, other: Piece, whole: Polyhedron, deadline: Deadline) -> bool:
    """Whether every x of a piece is known to be in the polyhedron of another, to rounding."""
    if same(other.point, piece.point) and piece.motions + piece.forces == 0:
        return True
    if not whole.contains(piece.point):
        return False
    if piece.motions + piece.forces == 0:
        return True
    rows = np.vstack([whole.E, -whole.E, whole.G])
    right = np.concatenate([whole.e, -whole.e, whole.g])
    room = search.ROUNDING * (1.0 + float(np.abs(piece.point).max()))
    try:
        return all(
            _least(shape, row, deadline) >= bound - room for row, bound in zip(rows, right, strict=True)
        )
    except TimeOver:
        return False

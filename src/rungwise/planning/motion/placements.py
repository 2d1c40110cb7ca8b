"""The geometric rung: every body may be placed anywhere, and moves anywhere, but into no other body.

Places at the goal are found by projection: from many places, damped Gauss-Newton steps to where no part of
the goal is lacking and no bodies overlap (Nocedal and Wright, Numerical Optimization, 2006); where steps no
longer help, other places are drawn. Ways to them are grown by OMPL (`free_paths`).
"""

from __future__ import annotations

import ast
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rungwise.kernel import Ints, Reals
from rungwise.planning.motion.free_paths import CHECKS, always, cut_short, grown
from rungwise.planning.task.task import Task
from rungwise.scene.contract import AnyScene
from rungwise.scene.language.lasting import FOR, REST, lasting_of, parsed, written
from rungwise.world.find import world_of
from rungwise.world.margins import Question

STARTS, ITERATIONS = 48, 40
"""Places from which the goal is sought, and steps from each."""
LENGTHS = np.array([1.0, 0.5, 0.1, 0.01])
"""Parts of a step that are tried; the one after which least is lacking is taken."""
STALLED = 0.99
"""Part of what was lacking that is left after a step, if it did not help."""
DAMPING = 1e-9
"""Damping of steps, in parts of the trace of their matrix."""
ROUNDED = 1e-15
"""What steps aim beyond the bounds of the goal, so that rounding does not keep them out."""
DIFFERENCE, FINEST = 1e-2, 1e-10
"""Length of differences for gradients, in parts of what is lacking, and at least, in parts of the size."""
FARTHEST = 1e15
"""How far places are looked for, in parts of the size."""
YIELDED = 0.2
"""Overlap, in parts of the thinnest shape, that two contacts may yield before compliant rungs do not hold."""
GOALS, NEAREST = 32, 8
"""Places at the goal that are sought, and those to which ways are, the nearest first."""
CLEARED = (-2.5, 0.5)
"""Logarithms of how far from a contact trees begin, in parts of the size."""
RESOLUTION = 1e-3
"""Parts of a way that are not proved free are cut until bodies move by less than this part of the thinnest
shape."""
LOOKS = 0.1
"""The same, where a condition says what is unsafe: it has no distances that prove ways free."""
PARTS = 8
"""Parts into which every straight way is cut at least: bodies turn by less than half a turn in each."""
ROOM = 0.5
"""Room about all places of a way, in parts of its extent; angles have half a turn."""
NOT_PLACED = {"force", "impulse", "speed", "t", REST, FOR}
"""Names in conditions that places alone do not decide."""
JUMPS = {"floor", "sign"}
"""Functions that jump."""


class Goals(NamedTuple):
    """Places at a goal that were found (r, n), the nearest first; otherwise the place (n,) where least was
    lacking, and how much."""

    places: Reals
    nearest: Reals
    lack: float


def placed_part(condition: str) -> str | None:
    """The part of a condition that places decide: its terms without forces, speeds and time, also those that
    must hold for a time; None if there is none. Where the whole holds, the part does."""
    kept = [part for part in _parts(condition) if not NOT_PLACED & _named(part)]
    return " and ".join(f"({ast.unparse(part)})" for part in kept) or None


def jumps(condition: str) -> bool:
    """Whether a condition has parts that do not change for a while, and then at once: steps along differences
    say nothing of these."""
    return any(
        isinstance(node, ast.IfExp) or (isinstance(node, ast.Name) and node.id in JUMPS)
        for node in ast.walk(parsed(condition))
    )


def needs_forces(task: Task, q: Reals) -> bool:
    """Whether the goal cannot hold where no forces act: a term that depends on forces alone fails without
    them, at any place, as at q (n,)."""
    alone = [part for part in _parts(task.scene.file.goal or "") if _of_forces(part)]
    return not all(Question(task.scene, ast.unparse(p), task.parameters).ask(q[None]).holds[0] for p in alone)


def _of_forces(part: ast.expr) -> bool:
    """Whether a condition depends on forces, and on nothing else of a state."""
    dotted = any(isinstance(node, ast.Attribute) for node in ast.walk(part))
    named = _named(part)
    return bool(named & {"force", "impulse"}) and not dotted and not named & {"gap", "speed", "t", REST, FOR}


def _parts(condition: str) -> list[ast.expr]:
    """The conditions that must all hold, some of them for a time."""
    tree = parsed(condition)
    whole = lasting_of(tree)
    while whole is not None:
        tree = whole[0]
        whole = lasting_of(tree)
    parts = tree.values if isinstance(tree, ast.BoolOp) and isinstance(tree.op, ast.And) else [tree]
    found = list[ast.expr]()
    for part in parts:
        found += [part] if lasting_of(part) is None else _parts(written(part))
    return found


def _named(part: ast.expr) -> set[str]:
    return {node.id for node in ast.walk(part) if isinstance(node, ast.Name)}


class Placing:
    """Places and ways of all bodies of a scene at one instance of its task."""

    def __init__(
        self, task: Task, scene: AnyScene, q: Reals, without: str = "", yields: bool = False,
        loose: Ints | None = None,
    ) -> None:  # fmt: skip
        """From the place q (n_q,) on, as if the body `without` were not there; with `yields`, bodies may
        overlap as far as on compliant rungs. Only the velocities `loose` (k,) may change, where they are
        given. `scene` states the goal: the task's own, or the one with a
        reserve."""
        self.room = room = world_of(scene).configurations(task.parameters, task.size, without)
        if loose is not None:
            held = np.ones(len(room.unit), bool)
            held[loose] = False
            room.unit[held] = 0.0
        self._q, self._task = q, task
        goal = placed_part(scene.file.goal or "")
        self._goal = None if goal is None else Question(scene, goal, task.parameters)
        unsafe = task.search.file.unsafe
        decided = unsafe is not None and not NOT_PLACED & _named(parsed(unsafe))
        self._unsafe = Question(scene, unsafe, task.parameters) if decided else None
        least = YIELDED * room.thin if yields else room.rounding
        self._allowed = np.maximum(least, -self._gaps(q[None])[0])

    @property
    def asks(self) -> bool:
        """Whether the goal says anything of places."""
        return self._goal is not None

    def goals(
        self, rng: np.random.Generator, in_time: Callable[[], bool] = always, apart: bool = True,
        count: int = 1,
    ) -> Goals:  # fmt: skip
        """Places at the goal, sought from the start and from others about it until there are `count`, while
        there is time; with `apart`, where no bodies overlap, and nothing is unsafe."""
        x = self._tries(rng)
        best, least, found = x[0], np.inf, x[:0]
        lacks = self._lacks(x, apart)
        for _ in range(ITERATIONS):
            sums = lacks.sum(axis=1)
            k = int(sums.argmin())
            if sums[k] < least:
                best, least = x[k].copy(), float(sums[k])
            done = x[sums == 0.0]
            found = np.vstack([found, done[~self._barred(done, self._gaps(done))] if apart else done])
            if len(found) >= count or not in_time():
                break
            x, lacks = self._stepped(x, lacks, apart)
            stalled = np.flatnonzero(~(lacks.sum(axis=1) < STALLED * sums))
            x[stalled] = self._tries(rng)[stalled]
            lacks[stalled] = self._lacks(x[stalled], apart)
        order = np.argsort(self._task.away(found, self._q), kind="stable")
        return Goals(found[order], found[order[0]] if len(found) else best, 0.0 if len(found) else least)

    def _stepped(self, x: Reals, lacks: Reals, apart: bool) -> tuple[Reals, Reals]:
        """Places (m, n_q) after a step, and what is lacking there (m, p)."""
        m, slopes = len(x), self._slopes(x, lacks, apart)
        aims = np.where(np.isfinite(lacks) & (lacks > 0.0), lacks + ROUNDED, 0.0)
        step = _gauss_newton(slopes, aims)
        stopped = self._stopped(x, step)
        if stopped.any():
            step = _gauss_newton(np.where(stopped[:, None], 0.0, slopes), aims)
        trials = self._within(self.room.changed(x, -LENGTHS[:, None, None] * step * self.room.unit))
        found = self._lacks(trials.reshape(-1, x.shape[1]), apart).reshape(len(LENGTHS), m, -1)
        chosen = found.sum(axis=2).argmin(axis=0)
        return trials[chosen, np.arange(m)], found[chosen, np.arange(m)]

    def _stopped(self, x: Reals, step: Reals) -> NDArray[np.bool_]:
        """Which changes (m, n_v) a step against them would lead out of travels at places (m, n_q)."""
        room = self.room
        own, found = x[:, room.numbers], np.zeros(step.shape, bool)
        out = step[:, room.of_numbers]
        found[:, room.of_numbers] = ((own <= room.low) & (out > 0.0)) | ((own >= room.high) & (out < 0.0))
        return found

    def _slopes(self, x: Reals, lacks: Reals, apart: bool) -> Reals:
        """How what is lacking (m, p) changes at places (m, n) along each coordinate, in units of the size:
        (m, p, n)."""
        loose = np.flatnonzero(self.room.unit)
        m, n = len(x), len(loose)
        length = np.clip(DIFFERENCE * lacks.sum(axis=1), FINEST, DIFFERENCE)
        rows = self.room.changed(x[:, None], length[:, None, None] * np.diag(self.room.unit)[loose])
        there = self._lacks(rows.reshape(m * n, -1), apart).reshape(m, n, -1)
        slopes = np.zeros((m, len(self.room.unit), lacks.shape[1]))
        with np.errstate(invalid="ignore"):
            slopes[:, loose] = (there - lacks[:, None]) / length[:, None, None]
        return np.swapaxes(np.where(np.isfinite(slopes), slopes, 0.0), 1, 2)

    def lacking(self, q: Reals) -> str:
        """The terms of the goal that fail at a place (n,), and by how much."""
        assert self._goal is not None
        found = self._goal.ask(q[None])
        failing = [
            f"{term} (by {-value:.3g})"
            for term, value in zip(found.terms, found.values[0], strict=True) if not value >= 0.0
        ]  # fmt: skip
        return ", ".join(failing)

    def overlapping(self, q: Reals) -> str:
        """The two bodies that overlap most at a place (n,)."""
        room = self.room
        return " and ".join(room.names[body] for body in room.pairs[int(self._gaps(q[None])[0].argmin())])

    def way(self, goals: Reals, seed: int, in_time: Callable[[], bool]) -> Reals | None:
        """Places (k, n) from the start to the nearest of the goals (r, n), or to another one, sought while
        there is time; None where no way was found. Raises PlannerMissing."""
        q, room, nearest = self._q, self.room, goals[:NEAREST]
        for goal in nearest:
            if self.is_free(q, goal):
                return np.stack([q, goal])
        rng = np.random.default_rng(seed)
        begun, aims = self._cleared(q, rng), np.array([self._cleared(goal, rng) for goal in nearest])
        low, high = self._bounds(np.vstack([begun, aims])[:, room.numbers])
        for first, last in ((0, 1), (1, len(aims))):
            way = grown(
                begun, aims[first:last], room.numbers.tolist(), low, high, self.is_free, seed,
                lambda asked: asked <= CHECKS and in_time(), room.units, room.turns,
            )  # fmt: skip
            if way is not None:
                goal = nearest[first + np.linalg.norm(aims[first:last] - way[-1], axis=1).argmin()]
                whole = np.vstack([q, way, goal])
                return cut_short(whole, self.is_free, room, rng)
            if last == len(aims):
                break
        return None

    def _bounds(self, ends: Reals) -> tuple[Reals, Reals]:
        """Least and greatest numbers (p,) on ways between places whose numbers are these (m, p)."""
        room = self.room
        extent = float(np.ptp(ends[:, ~room.turning], axis=0).max(initial=0.0))
        about = np.where(room.turning, np.pi, ROOM * extent + 10.0 * room.units)
        low, high = ends.min(axis=0) - about, ends.max(axis=0) + about
        return np.maximum(low, room.low), np.minimum(high, room.high)

    def _cleared(self, place: Reals, rng: np.random.Generator) -> Reals:
        """A place from which the straight way to this one (n,) is free, with more room about it, for trees to
        grow from: where contacts are closed few ways lead on."""
        spread = 10.0 ** rng.uniform(*CLEARED, (STARTS, 1))
        unit, thin = self.room.unit, self.room.thin
        drawn = spread * unit * rng.standard_normal((STARTS, len(unit)))
        trials = self._within(self.room.changed(place, drawn))
        gaps = self._gaps(trials)
        clear = np.where(self._barred(trials, gaps), -np.inf, gaps.min(axis=1, initial=thin))
        order = np.argsort(-clear, kind="stable")
        wider = order[clear[order] > self._gaps(place[None]).min(initial=thin)]
        return next((trials[k] for k in wider if self.is_free(trials[k], place)), place)

    def is_free(self, a: Reals, b: Reals) -> bool:
        """Whether no bodies overlap on the straight way between places (n,), and nothing is unsafe.

        A part of the way is free for a pair of bodies if together they move by less than the gaps at its ends
        add up to; other parts are halved, until they are short beside the thinnest shape. So are parts near
        what is unsafe, as if that came no faster than bodies move, and parts that are long beside it."""
        room = self.room
        at = np.linspace(0.0, 1.0, PARTS + 1) if (a != b).any() else np.zeros(1)
        gaps, marks, lacks, barred = self._asked(a, b, at)
        while not barred.any():
            moved = room.moved(marks)
            together, most = moved[:, room.pairs].sum(axis=-1), moved.max(axis=1)
            unsure = ((gaps[1:] + gaps[:-1] < together) & (together > RESOLUTION * room.thin)).any(axis=1)
            near = (lacks[1:] + lacks[:-1]) * room.size < most
            unsure |= near & (most > RESOLUTION * room.thin)
            unsure |= np.isfinite(lacks[1:]) & (most > LOOKS * room.thin)
            cut = np.flatnonzero(unsure)
            if not len(cut):
                return True
            middle = 0.5 * (at[cut] + at[cut + 1])
            *more, barred = self._asked(a, b, middle)
            at = np.insert(at, cut + 1, middle)
            gaps, marks, lacks = (
                np.insert(old, cut + 1, new, axis=0)
                for old, new in zip((gaps, marks, lacks), more, strict=True)
            )
        return False

    def _asked(self, a: Reals, b: Reals, at: Reals) -> tuple[Reals, Reals, Reals, NDArray[np.bool_]]:
        """At parts `at` (m,) of the way from a to b: gaps (m, c), marks of `Configurations.look`, what
        lacks (m,) until something is unsafe, infinite where nothing is, and whether the rows are barred."""
        rows = self.room.between(a, b, at)
        gaps, marks = self.room.look(rows)
        lacks = np.full(len(at), np.inf) if self._unsafe is None else self._unsafe.ask(rows).lack
        return gaps, marks, lacks, self._barred(rows, gaps)

    def _gaps(self, rows: Reals) -> Reals:
        return self.room.look(rows)[0]

    def _barred(self, rows: Reals, gaps: Reals) -> NDArray[np.bool_]:
        """Whether bodies overlap at places (m, n), by their gaps (m, c), or the places are unsafe."""
        overlap: NDArray[np.bool_] = np.asarray((gaps < -self._allowed).any(axis=1))
        return overlap if self._unsafe is None else overlap | self._unsafe.ask(rows).holds

    def _tries(self, rng: np.random.Generator) -> Reals:
        """Places (m, n) to seek the goal from: the start, and others at all distances up to many times the
        size, every other one with all objects at the start, for they may not have to move."""
        spread = 10.0 ** rng.uniform(-2.0, 1.0, (STARTS, 1))
        drawn = spread * self.room.unit * rng.standard_normal((STARTS, len(self.room.unit)))
        drawn[1::2, self.room.objects] = 0.0
        drawn[0] = 0.0
        return self._within(self.room.changed(self._q, drawn))

    def _within(self, rows: Reals) -> Reals:
        """Places (..., n_q) within the travel of coordinates, and not beyond all measure."""
        room = self.room
        far, own = FARTHEST * room.units, room.numbers
        rows[..., own] = np.clip(rows[..., own], np.maximum(room.low, -far), np.minimum(room.high, far))
        return rows

    def _lacks(self, rows: Reals, apart: bool) -> Reals:
        """What is lacking (m, p) at places: of each part of the goal, and of gaps over the thinnest shape;
        infinite where it is not defined."""
        assert self._goal is not None
        lacks = self._goal.ask(rows).lacks
        if apart:
            overlaps = np.maximum(-self._gaps(rows) - self._allowed, 0.0) / self.room.thin
            lacks = np.hstack([lacks, overlaps])
        return np.where(np.isfinite(lacks), lacks, np.inf)


def _gauss_newton(slopes: Reals, aims: Reals) -> Reals:
    """Damped steps (m, n) against which what is lacking falls by `aims` (m, p)."""
    matrix = np.einsum("mpi,mpj->mij", slopes, slopes)
    damping = DAMPING * np.trace(matrix, axis1=1, axis2=2) + 1e-300
    pull = np.einsum("mpi,mp->mi", slopes, aims)
    eye = np.eye(slopes.shape[2])
    return np.linalg.solve(matrix + damping[:, None, None] * eye, pull[..., None])[..., 0]

"""What holds at given states: conditions with signed margins, gaps, collisions, poses."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from rungwise.kernel import Reals
from rungwise.keywords import keywords
from rungwise.models.ladder import KINEMATIC
from rungwise.plain import brief
from rungwise.scene import Scene, SceneError, load
from rungwise.scene.expression import STACK, Programs
from rungwise.scene.names import Names
from rungwise.scene.terms import ANGLE, LENGTH, Combination, Dimension, Term, terms_of
from rungwise.scene.values import shown
from rungwise.simulation.planar.loop import begin, slack
from rungwise.simulation.planar.questions import answer, read
from rungwise.simulation.planar.workspace import CONTROL, Workspace, allocate, in_memory
from rungwise.simulation.state import FARTHEST, State, StateError, check_state, digest, memory_of
from rungwise.system.planar.place import start, turns

States: TypeAlias = "State | Sequence[State] | Reals"
"""One state, many, or an array: places (m, n) of all coordinates, at rest, or places and velocities
(m, 2 n), at t = 0."""
LARGEST = 700.0
"""Largest logarithm of a scale, whatever the powers: its exponential is finite."""
SMALLEST = 5e-324
"""Smallest number greater than 0."""


@dataclass(frozen=True)
class Answers:
    """Whether a condition holds at states, and how clearly.

    holds (m,); margin (m,): at least 0 where the condition holds, the greatest or least of its terms as "or"
    and "and" combine them, each over its scale; lack (m,): by how much the condition fails, 0 where it holds,
    with the sum in place of the least; lacks (m, p): the same of each part that "and" joins. terms: the text
    of each comparison (k); values (m, k): each comparison's own signed margin, in its own unit; units: their
    dimensions ("length", "angle", ...); scales (k,): the scene's size for a length, 1 for an angle, its
    duration for a time, and the speeds and forces that follow with the heaviest body.
    """

    holds: NDArray[np.bool_]
    margin: Reals
    lack: Reals
    lacks: Reals
    terms: tuple[str, ...]
    values: Reals
    units: tuple[str, ...]
    scales: Reals

    __repr__ = brief


@dataclass(frozen=True)
class Geometry:
    """Where bodies are at states: gaps (m, c) between the bodies of `contacts`, negative where they overlap;
    collides (m,): whether bodies overlap, more than they did in the state's own run; poses (m, b, 3) of
    `bodies`: x, y of the centre and the angle, in -pi..pi."""

    contacts: tuple[tuple[str, str], ...]
    gaps: Reals
    collides: NDArray[np.bool_]
    bodies: tuple[str, ...]
    poses: Reals

    __repr__ = brief


@keywords
def ask(
    scene: Scene | str | Path | Mapping[str, Any],
    condition: str,
    states: States,
    parameters: Mapping[str, float] | None = None,
) -> Answers:
    """Whether a condition holds at states.

    `condition` is "goal", "unsafe" or "doomed" of the scene, or the text of a condition in its names. Forces
    and impulses are those that a state's run read there; without a run they are 0. Raises SceneError and
    StateError for wrong input.
    """
    return Question(load(scene), condition, parameters).ask(states)


@keywords
def geometry(
    scene: Scene | str | Path | Mapping[str, Any],
    states: States,
    parameters: Mapping[str, float] | None = None,
) -> Geometry:
    """Gaps, collisions and poses at states: the question of the geometric rung. Raises SceneError and
    StateError for wrong input."""
    return Question(load(scene), None, parameters).geometry(states)


class Question:
    """A condition of a scene at one set of parameters, read once, to be asked of states again and again; see
    `ask`. Without a condition, only `geometry` answers. `of_contacts`: whether it calls a function of
    contacts."""

    def __init__(
        self, scene: Scene, condition: str | None, parameters: Mapping[str, float] | None = None
    ) -> None:
        template = scene.template
        if not isinstance(condition, str | None):
            raise SceneError(f"condition: must be text, not {shown(condition)}")
        text = getattr(scene.file, condition) if condition in ("goal", "unsafe", "doomed") else condition
        if text is None and condition is not None:
            raise SceneError(f"{condition}: the scene states none")
        names = Names(template.parameters, template.coordinates, template.contacts)
        names.condition(text, "condition")
        self.of_contacts = any(names.read.values())
        self._scene, self._place = scene, _Place(scene, parameters)
        self._terms: list[Term] = []
        self._combined: Combination = 0
        if text is not None:
            self._terms, self._combined = terms_of(text, names, self._place.dimensions())
        self._programs = Programs([term.code for term in self._terms])
        self._scales = np.array([self._place.scale(term.dimension) for term in self._terms])

    def ask(self, states: States) -> Answers:
        """Whether the condition holds at states. Raises StateError for wrong input."""
        return self._answers(self._place.answers(self._place.rows(states), self._terms)[0])

    def read(self, numbers: Reals) -> Answers:
        """Whether the condition holds at rows (m, w) of the numbers that conditions read, as memories of runs
        hold them ("values" of `in_memory`), each with its own parameters. Scales are those of this question's
        parameters. Gaps are exact only of contacts that the scene's own conditions name."""
        values, programs = np.zeros((len(numbers), len(self._terms))), self._programs
        read((programs.code, programs.constants, programs.table), numbers, np.zeros(STACK), values)
        return self._answers(values)

    def _answers(self, values: Reals) -> Answers:
        truths, margins = values >= 0.0, _scaled(values, self._scales)
        return Answers(
            holds=_combined(self._combined, truths, np.logical_and, np.logical_or, np.logical_not),
            margin=_combined(self._combined, margins, np.minimum, np.maximum, _opposite),
            lack=_lack(self._combined, margins),
            lacks=np.stack([_lack(part, margins) for part in _joined(self._combined)], axis=1),
            terms=tuple(term.text for term in self._terms), values=values,
            units=tuple("number" if term.dimension is None else str(term.dimension) for term in self._terms),
            scales=self._scales,
        )  # fmt: skip

    def geometry(self, states: States) -> Geometry:
        """Gaps, collisions and poses at states. Raises StateError for wrong input."""
        place, template = self._place, self._scene.template
        rows = place.rows(states)
        _, gaps, poses = place.answers(rows, [])
        allowed = slack(place.workspace) + rows.overlaps
        return Geometry(
            contacts=template.contacts, gaps=gaps, collides=np.any(gaps < -allowed, axis=1),
            bodies=template.bodies,
            poses=np.concatenate([poses[..., :2], np.arctan2(poses[..., 3:], poses[..., 2:3])], axis=-1),
        )  # fmt: skip


class Rows(NamedTuple):
    """States as kernels take them: q, v (m, n); `rest` (m, 1 + 2 c + u), times, forces, impulses and inputs;
    `overlaps` (m, c) of contacts in the states' own runs."""

    q: Reals
    v: Reals
    rest: Reals
    overlaps: Reals


class _Place:
    """A scene at one set of parameters, ready to be asked."""

    def __init__(self, scene: Scene, parameters: Mapping[str, float] | None) -> None:
        self.scene, self.bound = scene, scene.bind(parameters)
        records, template = self.bound.records, scene.template
        self.columns = np.array([template.parameters.index(name) for name in template.inputs], np.int64)
        self.workspace: Workspace = allocate(records, self.bound.values, scene.template, 3)
        control = np.zeros(1, CONTROL)
        control["step"], control["tolerance"] = records.world[0]["step"], records.world[0]["tolerance"]
        start(records, self.workspace.state.q, self.workspace.state.v)
        begin(records, KINEMATIC.record(), control, self.workspace)

    def dimensions(self) -> tuple[Dimension, ...]:
        """Dimensions of the coordinates."""
        records = self.bound.records
        bodies = [records.bodies[c["body"]] for c in records.coordinates]
        return tuple(ANGLE if turns(body, i) else LENGTH for i, body in enumerate(bodies))

    def scale(self, dimension: Dimension | None) -> float:
        """The size of the scene in this dimension; 1 where there is none."""
        if dimension is None:
            return 1.0
        clock, world = self.workspace.state.clock[0], self.bound.records.world[0]
        length, time = max(float(clock["extent"]), float(clock["reach"])), float(world["duration"])
        masses = [float(body["mass"]) for body in self.bound.records.bodies]
        gravity = math.hypot(world["gravity_x"], world["gravity_y"])
        force = max(masses, default=0.0) * (gravity if gravity > 0.0 else length / time / time)
        sizes = [size if 0.0 < size < math.inf else 1.0 for size in (length, time, force)]
        logarithms = np.array(dimension) * np.log(sizes)
        if np.abs(logarithms).sum() < LARGEST:
            return float(np.prod(np.array(sizes) ** np.array(dimension)))
        return math.exp(float(np.clip(logarithms.sum(), -LARGEST, LARGEST)))

    def answers(self, rows: Rows, terms: list[Term]) -> tuple[Reals, Reals, Reals]:
        """Values of terms (m, k), gaps (m, c), poses (m, b, 4)."""
        m, records = len(rows.q), self.bound.records
        found = np.zeros((m, len(terms))), np.zeros((m, len(records.contacts)))
        poses = np.zeros((m, len(records.bodies), 4))
        programs = Programs([term.code for term in terms])
        conditions = (programs.code, programs.constants, programs.table)
        answer(
            records, conditions, self.workspace, rows.q, rows.v, rows.rest, self.columns, *found, poses
        )  # fmt: skip
        return *found, poses

    def rows(self, states: States) -> Rows:
        """States as kernels take them. Raises StateError."""
        n = len(self.scene.template.coordinates)
        if isinstance(states, np.ndarray):
            moving = _finite_rows(states, n)
            rows = self._at_rest(len(moving))
            rows.q[:], rows.v[:] = moving[:, :n], moving[:, n:]
            return rows
        many = [states] if isinstance(states, State) else states
        if not isinstance(many, Sequence):
            raise StateError(f"states: must be states, or an array of places, not {shown(states)}")
        rows, own, like = self._at_rest(len(many)), digest(self.scene), self.workspace.state
        for i, state in enumerate(many):
            check_state(state, self.scene)
            rows.q[i], rows.v[i], rows.rest[i, 0] = state.q, state.v, state.time
            memory = memory_of(state, own, like)
            if memory is not None:
                gaps, pushes, impulses, values = (
                    in_memory(like, name, memory.values[None])[0]
                    for name in ("gaps", "pushes", "impulses", "values")
                )
                rows.rest[i, 1 : 1 + 2 * len(pushes)] = np.concatenate([pushes, impulses])
                if memory.inputs:
                    rows.rest[i, 1 + 2 * len(pushes) :] = values[self.columns]
                rows.overlaps[i] = np.maximum(-gaps, 0.0)
        return rows

    def _at_rest(self, m: int) -> Rows:
        """m states without forces, with the inputs of the scene's start."""
        n, contacts = len(self.scene.template.coordinates), len(self.bound.records.contacts)
        rest = np.zeros((m, 1 + 2 * contacts + len(self.columns)))
        rest[:, 1 + 2 * contacts :] = self.bound.values[self.columns]
        return Rows(np.zeros((m, n)), np.zeros((m, n)), rest, np.zeros((m, contacts)))


def rows_of(states: NDArray[Any], n: int) -> Reals:
    """Places and velocities (m, 2 n) from an array of places (m, n), at rest, or of both. Raises
    StateError."""
    if states.dtype.kind not in "iuf":
        raise StateError(f"states: must be an array of real numbers, not of {states.dtype}")
    if states.ndim != 2 or states.shape[1] not in (n, 2 * n):
        raise StateError(f"states: must have the shape (m, {n}) or (m, {2 * n}), not {states.shape}")
    rows = np.zeros((len(states), 2 * n))
    rows[:, : states.shape[1]] = states
    return rows


def _finite_rows(states: NDArray[Any], n: int) -> Reals:
    """The same, where every number is finite and within bounds. Raises StateError."""
    rows = rows_of(states, n)
    for wrong, words in (
        (~np.isfinite(rows), "is not finite"),
        (np.abs(rows[:, :n]) > FARTHEST, f"is not within -{FARTHEST:g}..{FARTHEST:g}"),
    ):
        if wrong.any():
            raise StateError(f"states: row {int(np.flatnonzero(wrong.any(axis=1))[0])} {words}")
    return rows


def _scaled(values: Reals, scales: Reals) -> Reals:
    """Margins over their scales, on the same side of 0 also where they underflow."""
    with np.errstate(over="ignore", under="ignore"):
        scaled = values / scales
    return np.where(values >= 0.0, np.maximum(scaled, 0.0), np.minimum(scaled, -SMALLEST))


def _opposite(margins: Reals) -> Reals:
    """The margin of "not": negative where the margin is 0."""
    return np.where(margins == 0.0, -SMALLEST, -margins)


def _combined(
    combined: Combination, parts: NDArray[Any], both: Any, either: Any, opposite: Any
) -> NDArray[Any]:
    """Comparisons (m, k) combined into one column (m,)."""
    if isinstance(combined, int):
        return np.asarray(parts[:, combined])
    word, inner = combined
    found = [_combined(each, parts, both, either, opposite) for each in inner]
    if word == "not":
        return np.asarray(opposite(found[0]))
    return np.asarray((both if word == "and" else either).reduce(found))


def _joined(combined: Combination) -> list[Combination]:
    """The parts that "and" joins."""
    if isinstance(combined, int) or combined[0] != "and":
        return [combined]
    return [each for inner in combined[1] for each in _joined(inner)]


def _lack(combined: Combination, margins: Reals) -> Reals:
    """By how much the condition fails: "and" adds what its parts lack, "or" takes the least."""
    if isinstance(combined, int):
        return np.asarray(np.maximum(-margins[:, combined], 0.0))
    word, inner = combined
    if word == "not":
        holds = _combined(inner[0], margins, np.minimum, np.maximum, _opposite)
        return np.asarray(np.maximum(holds, 0.0))
    lacks = [_lack(each, margins) for each in inner]
    return np.asarray((np.add if word == "and" else np.minimum).reduce(lacks))

"""What holds at given states: conditions with signed margins, gaps, collisions, poses."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from rungwise.kernel import Reals
from rungwise.models.ladder import KINEMATIC
from rungwise.scene import Scene, SceneError
from rungwise.scene.expression import Programs
from rungwise.scene.names import Names
from rungwise.scene.terms import ANGLE, LENGTH, Combination, Dimension, Term, terms_of
from rungwise.scene.values import shown
from rungwise.simulation.planar.loop import CLOSED, begin
from rungwise.simulation.planar.questions import answer
from rungwise.simulation.planar.workspace import CONTROL, Workspace, allocate, in_memory
from rungwise.simulation.state import State, StateError, check_state, digest
from rungwise.system.planar.place import start, turns

States: TypeAlias = "State | Sequence[State] | Reals"
"""One state, many, or places (m, n) of all coordinates, at rest at t = 0."""


@dataclass(frozen=True)
class Answers:
    """Whether a condition holds at states, and how clearly.

    holds (m,); margin (m,): at least 0 where the condition holds, the greatest or least of its terms as "or"
    and "and" combine them, each over its scale. terms: the text of each comparison (k); values (m, k): each
    comparison's own signed margin, in its own unit; units: their dimensions ("length", "angle", ...); scales
    (k,): the scene's size for a length, 1 for an angle, its duration for a time, and the speeds and forces
    that follow with the heaviest body.
    """

    holds: NDArray[np.bool_]
    margin: Reals
    terms: tuple[str, ...]
    values: Reals
    units: tuple[str, ...]
    scales: Reals


@dataclass(frozen=True)
class Geometry:
    """Where bodies are at states: gaps (m, c) between the bodies of `contacts`, negative where they overlap;
    collides (m,); poses (m, b, 3) of `bodies`: x, y of the centre and the angle, in -pi..pi."""

    contacts: tuple[tuple[str, str], ...]
    gaps: Reals
    collides: NDArray[np.bool_]
    bodies: tuple[str, ...]
    poses: Reals


def ask(
    scene: Scene, condition: str, states: States, parameters: Mapping[str, float] | None = None
) -> Answers:
    """Whether a condition holds at states.

    `condition` is "goal", "unsafe" or "doomed" of the scene, or the text of a condition in its names. Forces
    and impulses are those that a state's run read there; without a run they are 0. Raises SceneError and
    StateError for wrong input.
    """
    template = scene.template
    if not isinstance(condition, str):
        raise SceneError(f"condition: must be text, not {shown(condition)}")
    text = getattr(scene.file, condition) if condition in ("goal", "unsafe", "doomed") else condition
    if text is None:
        raise SceneError(f"{condition}: the scene states none")
    names = Names(template.parameters, template.coordinates, template.contacts)
    names.condition(text, "condition")
    place = _Place(scene, parameters)
    terms, combined = terms_of(text, names, place.dimensions())
    values = place.answers(states, terms)[0]
    scales = np.array([place.scale(term.dimension) for term in terms])
    truths, margins = values >= 0.0, values / scales
    return Answers(
        holds=_combined(combined, truths, np.logical_and, np.logical_or, np.logical_not),
        margin=_combined(combined, margins, np.minimum, np.maximum, np.negative),
        terms=tuple(term.text for term in terms), values=values,
        units=tuple("number" if term.dimension is None else str(term.dimension) for term in terms),
        scales=scales,
    )  # fmt: skip


def geometry(scene: Scene, states: States, parameters: Mapping[str, float] | None = None) -> Geometry:
    """Gaps, collisions and poses at states: the question of the geometric rung. Raises SceneError and
    StateError for wrong input."""
    place = _Place(scene, parameters)
    _, gaps, poses = place.answers(states, [])
    slack = CLOSED * float(place.workspace.state.clock[0]["reach"])
    template = scene.template
    return Geometry(
        contacts=template.contacts, gaps=gaps, collides=gaps.min(axis=1, initial=math.inf) < -slack,
        bodies=template.bodies,
        poses=np.concatenate([poses[..., :2], np.arctan2(poses[..., 3:], poses[..., 2:3])], axis=-1),
    )  # fmt: skip


class _Place:
    """A scene at one set of parameters, ready to be asked."""

    def __init__(self, scene: Scene, parameters: Mapping[str, float] | None) -> None:
        self.scene, self.bound = scene, scene.bind(parameters)
        records = self.bound.records
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
        force = max(masses, default=0.0) * (gravity if gravity > 0.0 else length / time**2)
        sizes = [size if 0.0 < size < math.inf else 1.0 for size in (length, time, force)]
        return float(np.prod(np.array(sizes) ** np.array(dimension)))

    def answers(self, states: States, terms: list[Term]) -> tuple[Reals, Reals, Reals]:
        """Values of terms (m, k), gaps (m, c), poses (m, b, 4)."""
        q, v, rest = self._rows(states)
        m, records = len(q), self.bound.records
        found = np.zeros((m, len(terms))), np.zeros((m, len(records.contacts)))
        poses = np.zeros((m, len(records.bodies), 4))
        programs = Programs([term.code for term in terms])
        conditions = (programs.code, programs.constants, programs.table)
        answer(records, conditions, self.workspace, q, v, rest, *found, poses)
        return *found, poses

    def _rows(self, states: States) -> tuple[Reals, Reals, Reals]:
        """q, v (m, n), and times, forces and impulses (m, 1 + 2 c)."""
        n, contacts = len(self.scene.template.coordinates), len(self.bound.records.contacts)
        if isinstance(states, np.ndarray):
            if states.ndim != 2 or states.shape[1] != n:
                raise StateError(f"states: must have the shape (m, {n}), not {states.shape}")
            if not np.isfinite(states).all():
                row = int(np.flatnonzero(~np.isfinite(states).all(axis=1))[0])
                raise StateError(f"states: row {row} is not finite")
            q = np.ascontiguousarray(states, float)
            return q, np.zeros_like(q), np.zeros((len(q), 1 + 2 * contacts))
        many = [states] if isinstance(states, State) else states
        if not isinstance(many, Sequence):
            raise StateError(f"states: must be states, or an array of places, not {shown(states)}")
        for state in many:
            check_state(state, self.scene)
        rest, own = np.zeros((len(many), 1 + 2 * contacts)), digest(self.scene)
        for i, state in enumerate(many):
            rest[i, 0] = state.time
            if state.memory is not None and state.memory.scene == own:
                memory = state.memory.values[None]
                rest[i, 1 : 1 + contacts] = in_memory(self.workspace.state, "pushes", memory)[0]
                rest[i, 1 + contacts :] = in_memory(self.workspace.state, "impulses", memory)[0]
        q, v = (
            np.array([getattr(state, name) for state in many], float).reshape(len(many), n)
            for name in ("q", "v")
        )
        return q, v, rest


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

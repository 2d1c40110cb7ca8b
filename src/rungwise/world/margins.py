"""Margins of conditions at given states, and gaps, collisions and poses there."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rungwise.content import ByContent
from rungwise.deadline import NEVER, Deadline, seconds
from rungwise.kernel import Reals
from rungwise.keywords import keywords
from rungwise.plain import brief
from rungwise.scene import SceneError
from rungwise.scene.contract import AnyScene
from rungwise.scene.fields.values import shown
from rungwise.scene.language.expression import CONDITIONS, STACK, Programs
from rungwise.scene.language.lasting import momentary
from rungwise.scene.language.terms import Combination, Term, terms_of
from rungwise.scene.read import load
from rungwise.simulation.planar.questions import read
from rungwise.simulation.rows import States
from rungwise.simulation.state import State
from rungwise.world.find import world_of

ALL = "all states were looked at"
SMALLEST = 5e-324
"""Smallest number greater than 0."""


@dataclass(frozen=True, eq=False)
class Answers(ByContent):
    """Answers to a condition at m states: whether it holds, and by what margin.

    holds (m,); margin (m,): at least 0 where the condition holds; each comparison is divided by its scale,
    "and" takes the least and "or" the greatest; lack (m,): how much the condition fails, 0 where it holds,
    with the sum instead of the least at "and"; lacks (m, p): the lack of each part that "and" joins. terms:
    the text of each comparison (k); values (m, k): signed margin of each comparison, in its own unit; units:
    their dimensions ("length", "angle", ...); scales (k,): the scene's size for a length, 1 for an angle, its
    duration for a time, and speeds and forces made of these and the heaviest mass.
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


@dataclass(frozen=True, eq=False)
class Geometry(ByContent):
    """Where bodies are at states: gaps (m, c) between the bodies of `contacts`, negative where they overlap;
    collides (m,): whether bodies overlap, more than they did in the state's own run; poses (m, b, 3) of
    `bodies`: x, y of the centre and the angle, in -pi..pi; in space (m, b, 7): x, y, z of the body's origin
    and its quaternion, the real part first."""

    contacts: tuple[tuple[str, str], ...]
    gaps: Reals
    collides: NDArray[np.bool_]
    bodies: tuple[str, ...]
    poses: Reals

    __repr__ = brief


@keywords
def ask(
    scene: AnyScene | str | Path | Mapping[str, Any],
    condition: str,
    states: States,
    parameters: Mapping[str, float] | None = None,
    *,
    limit: float | None = None,
) -> Answers:
    """Tell whether a condition holds at states of a scene, at these `parameters`, and by what margin.

    `condition` is "goal", "unsafe" or "doomed" of the scene, or the text of a condition in its names. A state
    of a run keeps the forces and impulses of that run, and how long conditions with `for` have held; at other
    states all of these are 0. Raises SceneError and StateError for wrong input, and LimitError if `limit`
    seconds are over before all states are examined.
    """
    deadline = Deadline(seconds(limit))
    with deadline.needed_for(ALL):
        return Question(load(scene), condition, parameters).ask(states, deadline)


@keywords
def geometry(
    scene: AnyScene | str | Path | Mapping[str, Any],
    states: States,
    parameters: Mapping[str, float] | None = None,
    *,
    limit: float | None = None,
) -> Geometry:
    """Compute gaps, collisions and poses of a scene at states, at these `parameters`, without any run.

    Raises SceneError and StateError for wrong input, and LimitError if `limit` seconds are over before all
    states are examined.
    """
    deadline = Deadline(seconds(limit))
    with deadline.needed_for(ALL):
        return Question(load(scene), None, parameters).geometry(states, deadline)


class Question:
    """A condition of a scene at one set of parameters, read once, to be asked of states again and again; see
    `ask`. Without a condition, only `geometry` answers. `of_contacts`: whether it calls a function of
    contacts. With `now`, what must hold for a time is only asked to hold."""

    def __init__(
        self, scene: AnyScene, condition: str | None, parameters: Mapping[str, float] | None = None,
        now: bool = False,
    ) -> None:  # fmt: skip
        if not isinstance(condition, str | None):
            raise SceneError(f"condition: must be text, not {shown(condition)}")
        own = condition if condition in CONDITIONS[:-1] else ""
        text = getattr(scene.file, own) if own else condition
        if now and text is not None:
            text, own = momentary(text), ""
        if text is None and condition is not None:
            raise SceneError(f"{condition}: the scene states none")
        names = scene.template.names()
        names.condition(text, "condition", own)
        self.of_contacts = any(names.read.values())
        self._place = world_of(scene).place(parameters)
        self._terms: list[Term] = []
        self._combined: Combination = 0
        if text is not None:
            self._terms, self._combined = terms_of(text, names, *self._place.dimensions(), own)
        self._programs = Programs([term.code for term in self._terms])
        self._scales = np.array([self._place.scale(term.dimension) for term in self._terms])

    @property
    def parts(self) -> list[list[str]]:
        """The texts of the comparisons in each part that "and" joins."""
        return [[self._terms[k].text for k in _leaves(part)] for part in _joined(self._combined)]

    def ask(self, states: States, deadline: Deadline = NEVER) -> Answers:
        """Whether the condition holds at states. Raises StateError for wrong input, and TimeOver."""
        return self._answers(self._place.values(states, self._terms, deadline))

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

    def geometry(self, states: States, deadline: Deadline = NEVER) -> Geometry:
        """Gaps, collisions and poses at states. Raises StateError for wrong input, and TimeOver."""
        contacts, bodies = self._place.scene.template.contacts, self._place.scene.template.bodies
        gaps, collides, poses = self._place.geometry(states, deadline)
        return Geometry(contacts=contacts, gaps=gaps, collides=collides, bodies=bodies, poses=poses)

    def overlap(self, state: State) -> str:
        """Which bodies overlap at a state, and by how much; empty where none do. Raises StateError."""
        return self._place.overlap(state)


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


def _leaves(combined: Combination) -> list[int]:
    """The comparisons of a combination."""
    if isinstance(combined, int):
        return [combined]
    return [leaf for inner in combined[1] for leaf in _leaves(inner)]


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

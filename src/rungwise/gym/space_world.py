"""Copies of a scene in space, run over processes."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rungwise.errors import InputError
from rungwise.gym.world import Places
from rungwise.kernel import Ints, Reals
from rungwise.models.ladder import Rung
from rungwise.outcome import Code
from rungwise.planning.objects import BALL, FREE
from rungwise.scene.space import SpaceScene
from rungwise.simulation.crew import threads_of
from rungwise.simulation.inputs import Segment
from rungwise.simulation.questions import Answers, Question, ask
from rungwise.simulation.spatial.batch import BUDGET
from rungwise.simulation.spatial.crew import (
    Sample,
    Sampled,
    Terms,
    begin_samples,
    prepared,
    run_samples,
    simulation_of,
    spread,
)  # fmt: skip
from rungwise.simulation.spatial.memory import memory_parts
from rungwise.simulation.spatial.questions import forces_in
from rungwise.simulation.state import Memory, State, StateError, check_state, digest

if TYPE_CHECKING:
    import mujoco

PARTS = 2
"""Parts of a step of many environments for each process, so that those that are done early take more."""


@dataclass
class SpaceWorld:
    """Copies of a scene in space; fields as of `PlanarWorld`, but `threads` are processes."""

    scene: SpaceScene
    model: Rung
    nominal: dict[str, float]
    hold: float
    span: float
    ramp: bool = False
    step: float | None = None
    tol: float | None = None
    theta: float = 1.0
    threads: int | None = None
    _questions: dict[str, Question] = field(init=False, repr=False, default_factory=dict)

    def __post_init__(self) -> None:
        options = {"step": self.step, "tol": self.tol, "theta": self.theta, "span": self.span}
        self._terms = Terms(self.scene, self.model, options, BUDGET, keeps=False)
        self._processes = min(threads_of(self.threads), os.cpu_count() or 1)
        template = self.scene.template
        self._inputs = [template.parameters.index(name) for name in template.inputs]
        self._digest, self._values = digest(self.scene), memory_parts(self.scene).values

    def __reduce__(self) -> tuple[object, ...]:
        given = (self.scene, self.model, self.nominal, self.hold, self.span, self.ramp, self.step, self.tol)
        return SpaceWorld, (*given, self.theta, self.threads)

    def travel(self, parameters: Mapping[str, float]) -> Reals:
        return travel_in(prepared(self.scene, dict(parameters)).bound.model)

    def begin(self, points: Reals) -> Places:
        samples = [Sample(self._named(point), None, self._segments(None)) for point in points]
        return self._places(points, begin_samples(self._terms, samples), begins=True)

    def begin_at(self, state: State, parameters: Mapping[str, float]) -> Places:
        check_state(state, self.scene)
        given = self.scene.parameters(parameters)
        sample = Sample(given, state, self._segments(None))
        begun = simulation_of(self._terms, sample)
        if begun.outcome == Code.INVALID:
            raise StateError(begun.reason)
        goes_on = state.memory is not None and state.memory.scene == self._digest
        points = np.array([list(given.values())])
        return self._places(points, begin_samples(self._terms, [sample]), begins=not goes_on)

    def advance(self, places: Places, levels: Reals) -> Places:
        (still,) = self._segments(None)  # a state that follows inputs hands on their values
        samples = [
            Sample(self._named(point), self.state(places, row, still), self._segments(level))
            for row, (point, level) in enumerate(zip(places.points, levels, strict=True))
        ]
        m = len(samples)
        size = max(1, math.ceil(m / (PARTS * self._processes)))
        parts = [samples[at : at + size] for at in range(0, m, size)]
        found = [
            each for part in spread(run_samples, self._terms, parts, m, self._processes) for each in part
        ]
        for each in found:
            if each.fault:
                raise InputError(each.fault)
        return self._places(places.points, found, begins=False)

    def goal(self, places: Places) -> Answers:
        return self._question("goal").read(self._numbers(places))

    def holds(self, condition: str, places: Places) -> NDArray[np.bool_]:
        question = self._question(condition)
        if not question.of_contacts:
            return question.read(self._numbers(places)).holds
        # Memories hold gaps of only those bodies that the scene's own conditions name.
        rows = range(len(places.points))
        return np.array(
            [
                ask(self.scene, condition, self.state(places, row, None), self._named(places.points[row]))
                .holds[0]
                for row in rows
            ]
        )  # fmt: skip

    def inputs(self, places: Places) -> Reals:
        return np.asarray(self._numbers(places)[:, self._inputs])

    def forces(self, places: Places) -> Reals:
        return np.array(
            [
                forces_in(memory, self.scene, prepared(self.scene, self._named(point)))
                for memory, point in zip(places.memory, places.points, strict=True)
            ]
        )

    def state(self, places: Places, row: int, last: Segment | None) -> State:
        names, time = self.scene.template.coordinates, float(places.time[row])
        if places.begins[row]:
            return State(names, places.q[row], places.v[row], time)
        schedule = () if last is None else (last,)
        memory = Memory(places.memory[row], self._digest, self.model, self.theta, schedule)
        return State(names, places.q[row], places.v[row], time, memory)

    def _named(self, point: Reals) -> dict[str, float]:
        return dict(zip(self.scene.template.parameters, point.tolist(), strict=True))

    def _segments(self, level: Reals | None) -> tuple[Segment, ...]:
        """The schedule of one hold; without inputs (u,) they stay as they are."""
        values = {} if level is None else dict(zip(self.scene.template.inputs, level.tolist(), strict=True))
        return (Segment(values, self.hold, None, self.ramp),)

    def _places(self, points: Reals, found: list[Sampled], begins: bool) -> Places:
        m = len(found)
        outcome: Ints = np.array([each.outcome for each in found], np.int64)
        outcome[(outcome == Code.MISSED) | (outcome == Code.TIMEOUT)] = Code.RUNNING
        memory = np.empty(m, object)  # their lengths differ
        memory[:] = [each.memory for each in found]
        return Places(
            points=points, q=np.array([each.q for each in found]), v=np.array([each.v for each in found]),
            time=np.array([each.time for each in found]), memory=memory, begins=np.full(m, begins),
            outcome=outcome, residual=np.array([each.residual for each in found]),
        )  # fmt: skip

    def _numbers(self, places: Places) -> Reals:
        """The numbers (m, w) that conditions read (see `Question.read`)."""
        return np.array([memory[self._values] for memory in places.memory])

    def _question(self, condition: str) -> Question:
        if condition not in self._questions:
            self._questions[condition] = Question(self.scene, condition, self.nominal)
        return self._questions[condition]


def travel_in(model: mujoco.MjModel) -> Reals:
    """Least and greatest places (2, n_q) of a model's coordinates: travel limits of hinges and slides, and
    -1 and 1 for quaternions."""
    travel = np.full((model.nq, 2), [-math.inf, math.inf])
    for kind, first, limited, range_ in zip(
        model.jnt_type.tolist(), model.jnt_qposadr.tolist(), model.jnt_limited, model.jnt_range, strict=True
    ):
        if kind in (FREE, BALL):
            turn = first + (3 if kind == FREE else 0)
            travel[turn : turn + 4] = -1.0, 1.0
        elif limited:
            travel[first] = range_
    return np.ascontiguousarray(travel.T)

"""What environments need of a system: many copies of a scene that begin, go on with inputs, and are read."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from rungwise.kernel import Ints, Reals
from rungwise.models.ladder import Rung
from rungwise.outcome import Code
from rungwise.scene import Scene
from rungwise.simulation.crew import Crew
from rungwise.simulation.inputs import Segment
from rungwise.simulation.planar.workspace import in_memory
from rungwise.simulation.questions import Answers, Question, ask
from rungwise.simulation.run import Simulation
from rungwise.simulation.state import Memory, State, StateError


@dataclass
class Places:
    """Where m copies of a scene have come to.

    points (m, k): values of all parameters; q (m, n_q), v (m, n_v) and time (m,); memory (m, w): what a run
    hands on, or (m,) arrays where their lengths differ; begins (m,): whether a copy has not moved since it
    was placed, so that its memory is not one to go on from; outcome (m,) and residual (m,): of the last run,
    RUNNING where it may go on.
    """

    points: Reals
    q: Reals
    v: Reals
    time: Reals
    memory: NDArray[Any]
    begins: NDArray[np.bool_]
    outcome: Ints
    residual: Reals

    def take(self, rows: Ints) -> Places:
        """Copies of these rows."""
        return Places(**{each.name: getattr(self, each.name)[rows] for each in fields(self)})

    def put(self, rows: Ints, others: Places) -> None:
        """Overwrite these rows."""
        for each in fields(self):
            getattr(self, each.name)[rows] = getattr(others, each.name)


class World(Protocol):
    """Copies of one scene on one rung. A world holds no state of them: `Places` do."""

    def travel(self, parameters: Mapping[str, float]) -> Reals:
        """Least and greatest places (2, n_q) of coordinates, infinite where there are none."""

    def begin(self, points: Reals) -> Places:
        """The scene's start at values (m, k) of all its parameters; `invalid` where there is none."""

    def begin_at(self, state: State, parameters: Mapping[str, float]) -> Places:
        """One copy at a state. Raises StateError."""

    def advance(self, places: Places, levels: Reals) -> Places:
        """Where copies are after one hold with these inputs (m, u)."""

    def goal(self, places: Places) -> Answers:
        """Whether and how clearly the goal is reached, by each copy at its own parameters."""

    def holds(self, condition: str, places: Places) -> NDArray[np.bool_]:
        """Whether a condition in the scene's names holds (m,)."""

    def inputs(self, places: Places) -> Reals:
        """Inputs (m, u) as they are now."""

    def forces(self, places: Places) -> Reals:
        """Normal forces (m, c) of the scene's contacts."""

    def state(self, places: Places, row: int, last: Segment | None) -> State:
        """The state of one copy, whose last inputs were `last`."""


@dataclass
class PlanarWorld:
    """Copies of a planar scene, run by compiled threads.

    hold: seconds of one advance; ramp: whether inputs go to their values linearly; span: seconds of a whole
    run; step, tol, theta: as of `Simulation`; nominal: parameters at which scales are taken.
    """

    scene: Scene
    model: Rung
    nominal: dict[str, float]
    hold: float
    span: float
    ramp: bool = False
    step: float | None = None
    tol: float | None = None
    theta: float = 1.0
    threads: int | None = None
    _crew: Crew = field(init=False, repr=False)
    _questions: dict[str, Question] = field(init=False, repr=False, default_factory=dict)

    def __post_init__(self) -> None:
        self._crew = Crew(
            self.scene, self.model, self.scene.template.parameters, None, until=(None,), ramps=(self.ramp,),
            step=self.step, tol=self.tol, theta=self.theta, span=self.span, threads=self.threads,
        )  # fmt: skip
        template = self.scene.template
        self._inputs = [template.parameters.index(name) for name in template.inputs]

    def __reduce__(self) -> tuple[object, ...]:
        given = (self.scene, self.model, self.nominal, self.hold, self.span, self.ramp, self.step, self.tol)
        return PlanarWorld, (*given, self.theta, self.threads)

    def travel(self, parameters: Mapping[str, float]) -> Reals:
        c = self.scene.bind(parameters).records.coordinates
        return np.array([c["lower"], c["upper"]])

    def begin(self, points: Reals) -> Places:
        return self._run(points, None, None, None, 0.0)

    def begin_at(self, state: State, parameters: Mapping[str, float]) -> Places:
        begun = Simulation(
            self.scene, self.model, parameters=parameters, step=self.step, tol=self.tol, theta=self.theta,
            state=state, inputs=[], duration=state.time + self.span, frames=3,
        )  # fmt: skip
        if begun.workspace is None or begun.reason:
            raise StateError(f"state: {begun.reason}")
        points = np.array([list(begun.parameters.values())])
        if state.memory is None:
            return self._run(points, np.array([[*state.q, *state.v, state.time]]), None, None, 0.0)
        return Places(
            points=points, q=state.q[None].copy(), v=state.v[None].copy(), time=np.array([state.time]),
            memory=begun.workspace.state.memory[None].copy(),
            begins=np.zeros(1, bool), outcome=np.full(1, Code.RUNNING), residual=np.zeros(1),
        )  # fmt: skip

    def advance(self, places: Places, levels: Reals) -> Places:
        memory = np.where(places.begins, -1, np.arange(len(levels)))
        bodies = np.hstack([places.q, places.v, places.time[:, None]])
        return self._run(places.points, bodies, (places.memory, memory), levels, self.hold)

    def _run(
        self,
        points: Reals,
        bodies: Reals | None,
        memories: tuple[Reals, Ints] | None,
        levels: Reals | None,
        hold: float,
    ) -> Places:
        m, crew = len(points), self._crew
        rows, of = (None, None) if memories is None else memories
        samples = crew.run(
            points, bodies=bodies, memories=rows, memory=of, durations=np.full((1, 1), hold),
            levels=None if levels is None else levels[:, None], keeps=True,
            chunk=math.ceil(m / crew.threads),
        )  # fmt: skip
        found = samples.results
        outcome = found["outcome"].astype(np.int64)
        outcome[(outcome == Code.MISSED) | (outcome == Code.TIMEOUT)] = Code.RUNNING
        column, n = np.zeros(m, np.int64), samples.final.shape[1] // 2  # one segment
        return Places(
            points=points, q=samples.final[:, :n].copy(), v=samples.final[:, n:].copy(),
            time=found["time"].copy(), memory=samples.kept[np.arange(m), column],
            begins=np.full(m, levels is None), outcome=outcome, residual=found["worst_residual"].copy(),
        )  # fmt: skip

    def goal(self, places: Places) -> Answers:
        return self._question("goal").read(self._numbers(places))

    def holds(self, condition: str, places: Places) -> NDArray[np.bool_]:
        question, names = self._question(condition), self.scene.template.parameters
        if not question.of_contacts:
            return question.read(self._numbers(places)).holds
        # Memories hold exact gaps of only those contacts that the scene's own conditions name.
        return np.array(
            [
                ask(
                    self.scene, condition, self.state(places, row, None),
                    dict(zip(names, places.points[row].tolist(), strict=True)),
                ).holds[0]
                for row in range(len(places.points))
            ]
        )  # fmt: skip

    def _question(self, condition: str) -> Question:
        if condition not in self._questions:
            self._questions[condition] = Question(self.scene, condition, self.nominal)
        return self._questions[condition]

    def inputs(self, places: Places) -> Reals:
        return np.asarray(self._numbers(places)[:, self._inputs])

    def forces(self, places: Places) -> Reals:
        return np.asarray(in_memory(self._crew.workspace.state, "pushes", places.memory))

    def _numbers(self, places: Places) -> Reals:
        """The numbers (m, w) that conditions read (see `Question.read`)."""
        return np.asarray(in_memory(self._crew.workspace.state, "values", places.memory))

    def state(self, places: Places, row: int, last: Segment | None) -> State:
        names, q, v = self.scene.template.coordinates, places.q[row], places.v[row]
        time = float(places.time[row])
        if places.begins[row]:
            return State(names, q, v, time)
        schedule = () if last is None else (last,)
        memory = Memory(places.memory[row], self._crew.digest, self.model, self._crew.theta, schedule)
        return State(names, q, v, time, memory)

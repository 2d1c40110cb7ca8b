"""Copies of a scene that begin, go on with inputs, and are read: what environments need of a world."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rungwise.errors import InputError
from rungwise.kernel import Ints, Reals
from rungwise.models.ladder import Rung
from rungwise.outcome import Code
from rungwise.simulation.inputs import Segment
from rungwise.simulation.options import RunOptions
from rungwise.simulation.state import State
from rungwise.world.contract import Places, Ran, Runs
from rungwise.world.find import world_of
from rungwise.world.margins import Answers, Question, ask
from rungwise.world.nearest import accepted


@dataclass
class Standing:
    """Where m copies of a scene have come to.

    points (m, k): values of all parameters; q (m, n_q), v (m, n_v), time (m,), memory and goes_on (m,): see
    `Places`; outcome (m,) and residual (m,): of the last run, RUNNING where it may go on.
    """

    points: Reals
    q: Reals
    v: Reals
    time: Reals
    memory: NDArray[Any]
    goes_on: NDArray[np.bool_]
    outcome: Ints
    residual: Reals

    @property
    def places(self) -> Places:
        return Places(self.q, self.v, self.time, self.memory, self.goes_on)

    def take(self, rows: Ints) -> Standing:
        """Copies of these rows."""
        return Standing(**{each.name: getattr(self, each.name)[rows] for each in fields(self)})

    def put(self, rows: Ints, others: Standing) -> None:
        """Overwrite these rows."""
        for each in fields(self):
            getattr(self, each.name)[rows] = getattr(others, each.name)


@dataclass
class Copies:
    """Copies of one scene on one rung; it holds no state of them: `Standing` does.

    hold: seconds of one advance; ramp: whether inputs go to their values linearly; span: seconds of a whole
    run; steps: step, tol and theta of the runs; threads: as of `rollout`; nominal: parameters at which scales
    are taken.
    """

    scene: Any
    model: Rung
    nominal: dict[str, float]
    hold: float
    span: float
    ramp: bool = False
    steps: RunOptions = field(default_factory=RunOptions)
    threads: int | None = None
    _runs: Runs = field(init=False, repr=False)
    _questions: dict[str, Question] = field(init=False, repr=False, default_factory=dict)

    def __post_init__(self) -> None:
        template = self.scene.template
        self._runs = world_of(self.scene).runs(
            self.model, template.parameters, None, until=(None,), ramps=(self.ramp,), step=self.steps.step,
            tol=self.steps.tol, theta=self.steps.theta, span=self.span, threads=self.threads,
        )  # fmt: skip
        self._inputs = [template.parameters.index(name) for name in template.inputs]

    def __reduce__(self) -> tuple[object, ...]:
        given = (self.scene, self.model, self.nominal, self.hold, self.span, self.ramp, self.steps)
        return Copies, (*given, self.threads)

    def travel(self, parameters: Mapping[str, float]) -> Reals:
        """Least and greatest places (2, n_q) of coordinates, infinite where there are none, and -1 and 1 of
        quaternions."""
        own = world_of(self.scene).at(parameters)
        travel = own.travel.copy()
        travel[0, own.moved.turns], travel[1, own.moved.turns] = -1.0, 1.0
        return travel

    def begin(self, points: Reals) -> Standing:
        """The scene's start at values (m, k) of all its parameters; `invalid` where there is none."""
        return _standing(points, self._runs.begin(points))

    def begin_at(self, state: State, parameters: Mapping[str, float]) -> Standing:
        """One copy at a state. Raises StateError."""
        given = self.scene.parameters(parameters)
        places, outcome = self._runs.placed(accepted(self.scene, self.model, [state], given)[0], given)
        points = np.array([list(given.values())])
        return Standing(points, *places, np.full(1, outcome), np.zeros(1))

    def advance(self, standing: Standing, levels: Reals) -> Standing:
        """Where copies are after one hold with these inputs (m, u)."""
        found = self._runs.run(
            standing.points, standing.places, np.full((1, 1), self.hold), levels[:, None], keeps=True
        )
        for fault in found.faults.values():
            raise InputError(fault)
        return _standing(standing.points, found)

    def goal(self, standing: Standing) -> Answers:
        """Whether and how clearly the goal is reached, by each copy at its own parameters."""
        return self._question("goal").read(self._runs.numbers(standing.places))

    def holds(self, condition: str, standing: Standing) -> NDArray[np.bool_]:
        """Whether a condition in the scene's names holds (m,)."""
        question, names = self._question(condition), self.scene.template.parameters
        if not question.of_contacts:
            return question.read(self._runs.numbers(standing.places)).holds
        # Memories hold exact gaps of only those contacts that the scene's own conditions name.
        return np.array(
            [
                ask(
                    self.scene, condition, self.state(standing, row, None),
                    dict(zip(names, standing.points[row].tolist(), strict=True)),
                ).holds[0]
                for row in range(len(standing.points))
            ]
        )  # fmt: skip

    def _question(self, condition: str) -> Question:
        if condition not in self._questions:
            self._questions[condition] = Question(self.scene, condition, self.nominal)
        return self._questions[condition]

    def inputs(self, standing: Standing) -> Reals:
        """Inputs (m, u) as they are now."""
        return np.asarray(self._runs.numbers(standing.places)[:, self._inputs])

    def forces(self, standing: Standing) -> Reals:
        """Normal forces (m, c) of the scene's contacts."""
        return self._runs.forces(standing.points, standing.places)

    def state(self, standing: Standing, row: int, last: Segment | None) -> State:
        """The state of one copy, whose last inputs were `last`."""
        return self._runs.state(standing.places, row, () if last is None else (last,))


def _standing(points: Reals, ran: Ran) -> Standing:
    outcome = ran.outcome.copy()
    outcome[(outcome == Code.MISSED) | (outcome == Code.TIMEOUT)] = Code.RUNNING
    return Standing(points, *ran.places, outcome, ran.residual)

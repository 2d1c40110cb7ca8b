"""Many runs of whatever moves, one after another or over threads (see
`world.contract.Runs`)."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import fields
from typing import Any, ClassVar

import numpy as np

from rungwise.deadline import NEVER, Deadline
from rungwise.kernel import Ints, Reals
from rungwise.models.ladder import Rung
from rungwise.outcome import Code
from rungwise.scene.stated import StatedScene
from rungwise.simulation.inputs import Segment
from rungwise.simulation.moving.memory import memory_parts, values_in
from rungwise.simulation.moving.samples import (
    Make,
    Sample,
    Sampled,
    Stop,
    Terms,
    begin_samples,
    nothing,
    spread,
)
from rungwise.simulation.options import ModelError, RunOptions, count
from rungwise.simulation.state import Memory, PlaceError, State, StateError, check_state, digest
from rungwise.simulation.threads import BUDGET, threads_of
from rungwise.world.contract import Places, Ran, Told
from rungwise.world.find import world_of
from rungwise.world.rolled import Ended

WAITS = 300
"""Steps for which a search waits."""
MOST = 16
"""Most runs that one task takes, so that threads that are done early take more; chosen by trial."""
PARTS = 4
"""Tasks for each thread."""
FOLLOWED = (Segment({}, 1.0),)
"""Stands for the schedule that a run followed, or that it will follow from its start, whichever it is."""


def of_world(scene: StatedScene, model: Rung, **options: Any) -> Any:
    """A run before its first step, as the scene's world makes it."""
    return world_of(scene).simulation(model, **options)


def sampled(
    terms: Terms, samples: dict[int, Sample], m: int, threads: int, size: int, on_progress: Told | None
) -> list[Sampled]:
    """How m runs ended, of which those of these samples are made, `size` by one task; `on_progress` counts
    the others as done."""
    numbers, found = list(samples), [nothing(terms.scene, "")] * m
    for i in numbers:
        found[i] = nothing(terms.scene, "", Code.RUNNING)
    parts = [[samples[i] for i in numbers[at : at + size]] for at in range(0, len(numbers), size)]
    done = 0

    def look() -> None:
        if on_progress is not None:
            on_progress(m - len(numbers) + done)

    for part in spread(terms, parts, threads, look):
        for each in part:
            found[numbers[done]] = each
            done += 1
    look()
    return found


def columns(found: list[Sampled]) -> dict[str, Any]:
    """The fields of `Ended`, of runs that ended so."""
    real = {each.name: np.array([getattr(run, each.name) for run in found]) for each in fields(Ended)}
    return {name: x if name in ("margin", "time") else x.astype(np.int64) for name, x in real.items()}


class MovingRuns:
    """Runs of a scene on one rung; options as of `World.runs`."""

    make: ClassVar[Make] = of_world
    kind: ClassVar[str] = "scenes of this world"
    most: ClassVar[int] = 1
    """Most threads: a system in Python serves one."""

    def __init__(
        self, scene: StatedScene, model: Rung, over: Sequence[str], parameters: Mapping[str, float] | None, *,
        until: Sequence[str | None] = (), ramps: Sequence[bool] = (), budget: int | None = None,
        patience: int | None = None, threads: int | None = None, **options: Any,
    ) -> None:  # fmt: skip
        given = RunOptions(**options)
        if given.motion is not None:
            raise ModelError(f"motion: does not work for {self.kind}")
        self.scene, self.model, self._over, self._theta = scene, model, tuple(over), given.theta
        self._until, self._ramps = tuple(until), tuple(ramps)
        self.parameters = scene.parameters(parameters)
        self.threads = min(threads_of(threads), self.most)
        most = BUDGET if budget is None else count("budget", budget, 1)
        self.budget = most if patience is None else patience * WAITS
        self._terms = Terms(scene, model, type(self).make, options, self.budget, False, Stop())
        self._digest = digest(scene)

    def run(
        self, points: Reals, places: Places | None = None, durations: Reals | None = None,
        levels: Reals | None = None, *, wrong: Ints | None = None, keeps: bool = False,
        chunk: int | None = None, deadline: Deadline = NEVER, on_progress: Told | None = None,
    ) -> Ran:  # fmt: skip
        """See `Runs.run`."""
        samples = {
            i: self._sample(i, points, places, durations, levels)
            for i in range(len(points))
            if wrong is None or not wrong[i]
        }
        size = chunk or max(1, min(MOST, math.ceil(len(samples) / (PARTS * self.threads))))
        terms = self._terms._replace(deadline=deadline, keeps=keeps, stop=Stop())
        found = sampled(terms, samples, len(points), self.threads, size, on_progress)
        return self._ran(found, begins=False)

    def begin(self, points: Reals, places: Places | None = None) -> Ran:
        """See `Runs.begin`."""
        samples = [self._sample(i, points, places, np.ones((1, 1)), None) for i in range(len(points))]
        return self._ran(begin_samples(self._terms, samples), begins=True)

    def placed(self, state: State, parameters: Mapping[str, float]) -> tuple[Places, Code]:
        """See `Runs.placed`."""
        check_state(state, self.scene)
        sample = Sample(self.parameters | dict(parameters), state, FOLLOWED)
        begun = self._terms.made(sample)
        if begun.outcome == Code.INVALID:
            raise StateError(begun.reason)
        goes_on = state.memory is not None and state.memory.scene == self._digest
        return self._ran(begin_samples(self._terms, [sample]), begins=not goes_on).places, begun.outcome

    def proved(self, _points: Reals, found: Ran, _deadline: Deadline) -> Ints:
        """See `Runs.proved`: these are single runs."""
        return found.outcome

    def taken_over(self, place: Places, scene: StatedScene, levels: Reals) -> Places:
        """See `Runs.taken_over`: forces and deformations of contacts are kept."""
        template, own = self.scene.template, place.memory[0].copy()
        values = own[memory_parts(scene, own).values]
        values[[template.parameters.index(name) for name in template.inputs]] = levels
        memory = np.empty(1, object)
        memory[0] = own
        return Places(place.q.copy(), place.v.copy(), place.time.copy(), memory, np.ones(1, bool))

    def measured(self, q: Reals, v: Reals, levels: Reals) -> Places:
        """See `Runs.measured`."""
        sample = Sample(self.parameters, State(self.scene.template.coordinates, q, v), FOLLOWED)
        begun = self._ran(begin_samples(self._terms, [sample]), begins=False)
        if begun.faults or begun.outcome[0] == Code.INVALID:
            raise PlaceError(begun.faults.get(0, "state: no run begins there"))
        return self.taken_over(begun.places, self.scene, levels)

    def numbers(self, places: Places) -> Reals:
        return np.array([values_in(self.scene, memory) for memory in places.memory])

    def forces(self, points: Reals, places: Places) -> Reals:
        return np.array(
            [
                self.forces_in(memory, self._at(point))
                for memory, point in zip(places.memory, points, strict=True)
            ]
        )

    def forces_in(self, memory: Reals, parameters: dict[str, float]) -> Reals:
        """Normal forces (c,) of pairs of bodies in the last step of a run that left this memory."""
        simulation = self._terms.made(Sample(parameters, None, ()))
        simulation.recall(memory[memory_parts(self.scene, memory).core])
        return simulation.forces

    def state(self, places: Places, row: int, inputs: tuple[Segment, ...] = ()) -> State:
        memory = None
        if places.goes_on[row]:
            memory = Memory(places.memory[row], self._digest, self.model, self._theta, inputs)
        q, v, time = places.q[row], places.v[row], float(places.time[row])
        return State(self.scene.template.coordinates, q, v, time, memory)

    def _at(self, point: Reals) -> dict[str, float]:
        return self.parameters | dict(zip(self._over, point.tolist(), strict=True))

    def _sample(
        self, i: int, points: Reals, places: Places | None, durations: Reals | None, levels: Reals | None
    ) -> Sample:
        state = None if places is None else self.state(places, i, FOLLOWED)
        segments = tuple(self._segments(i, durations, levels)) if self._until else ()
        return Sample(self._at(points[i]), state, segments)

    def _segments(self, i: int, durations: Reals | None, levels: Reals | None) -> list[Segment]:
        names, s = self.scene.template.inputs, len(self._until)
        lengths = np.zeros(s) if durations is None else durations[min(i, len(durations) - 1)]
        rows = np.full((s, len(names)), math.nan) if levels is None else levels[min(i, len(levels) - 1)]
        return [
            Segment(
                {name: x for name, x in zip(names, row, strict=True) if x == x}, length, self._until[k],
                bool(self._ramps[k]),
            )
            for k, (length, row) in enumerate(zip(lengths.tolist(), rows.tolist(), strict=True))
        ]  # fmt: skip

    def _ran(self, found: list[Sampled], begins: bool) -> Ran:
        memory = np.empty(len(found), object)  # their lengths differ
        memory[:] = [each.memory for each in found]
        n_q, n_v = len(self.scene.template.coordinates), len(self.scene.template.velocities)
        q = np.array([each.q for each in found]).reshape(len(found), n_q)
        v = np.array([each.v for each in found]).reshape(len(found), n_v)
        known = np.array([len(each.memory) > 0 for each in found], bool)

        def at(segment: int, rows: Ints) -> Places:
            ends = [found[i].ends for i in rows.tolist()]
            there = np.empty(len(ends), object)
            there[:] = [None if end is None else end.memory[segment] for end in ends]
            parts = [np.array([getattr(end, name)[segment] for end in ends]) for name in ("q", "v", "time")]
            return Places(parts[0], parts[1], parts[2], there, np.ones(len(ends), bool))

        own = columns(found)
        return Ran(
            **own, residual=np.array([each.residual for each in found]),
            work=np.array([each.drive_work for each in found]),
            places=Places(q, v, own["time"], memory, known & (not begins)),
            faults={i: each.fault for i, each in enumerate(found) if each.fault}, at=at,
        )  # fmt: skip

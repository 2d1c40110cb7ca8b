"""Many runs of a planar scene, in compiled threads (see `world.contract.Runs`)."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields, replace
from typing import Any

import numpy as np

from rungwise.deadline import NEVER, Deadline
from rungwise.kernel import Ints, Reals, RecordArray
from rungwise.models.ladder import Rung
from rungwise.outcome import Code
from rungwise.scene import Scene
from rungwise.simulation.inputs import Segment
from rungwise.simulation.planar.samples import Samples
from rungwise.simulation.planar.state.workspace import in_memory
from rungwise.simulation.reasons.reasons import JAM
from rungwise.simulation.result import Run
from rungwise.simulation.run import Simulation
from rungwise.simulation.state import Memory, PlaceError, State, StateError, digest
from rungwise.simulation.threads import BUDGET, CHUNK, Starts, Workers
from rungwise.world.contract import Places, Ran, Told
from rungwise.world.nearest import Nearest
from rungwise.world.planar.place import PlanarPlace
from rungwise.world.rolled import Ended
from rungwise.world.run import finished

LONGEST, SHORT = 1000, 1e-1
"""Steps for which a search waits, and the part of the accuracy by which something must be able to move in
one."""


def columns(found: RecordArray) -> dict[str, Any]:
    """The fields of `Ended`, from results of samples."""
    return {each.name: found[each.name].copy() for each in fields(Ended)}


def proved(
    model: Rung, outcome: Ints, steps: Ints, budget: int, again: Callable[[int], Run], deadline: Deadline
) -> Ints:
    """Outcomes (m,) of runs without momentum that did not converge, within `budget` steps, as `again` says
    them, which makes one once more by itself: a proof that nothing supports what no step can follow is
    sought in single runs alone. One that goes on, from a balance that it found, changes nothing here."""
    named = outcome.copy()
    if model.inertia > 0.0 or not model.loads:
        return named
    for i in np.flatnonzero((outcome == Code.NOT_CONVERGED) & (steps < budget)).tolist():
        if deadline.is_over:
            break
        run = again(i)
        if run.steps == steps[i] and run.outcome.code != Code.RUNNING:
            named[i] = run.outcome.code
    return named


class PlanarRuns:
    """Runs of a planar scene on one rung; options as of `World.runs`."""

    def __init__(
        self, scene: Scene, model: Rung, over: Sequence[str], parameters: Mapping[str, float] | None, *,
        tol: float | None = None, patience: int | None = None, **options: Any,
    ) -> None:  # fmt: skip
        if patience is not None and tol is not None:
            tolerance = scene.bind(parameters).tolerance
            options |= {"budget": patience * LONGEST, "jam": max(JAM, SHORT * tol / tolerance)}
        self.scene, self.model = scene, model
        self._options = {"tol": tol} | {name: options[name] for name in ("step", "theta") if name in options}
        self._whole: float | None = options.get("span")
        self.budget: int = options.get("budget") or BUDGET
        self._own = {name: options[name] for name in ("duration", "motion") if name in options}
        self._workers = Workers(scene, model, over, parameters, tol=tol, **options)
        self.threads, self.parameters = self._workers.threads, self._workers.parameters

    def run(
        self, points: Reals, places: Places | None = None, durations: Reals | None = None,
        levels: Reals | None = None, *, wrong: Ints | None = None, keeps: bool = False,
        chunk: int | None = None, deadline: Deadline = NEVER, on_progress: Told | None = None,
    ) -> Ran:  # fmt: skip
        """See `Runs.run`."""
        bodies = memories = memory = None
        m, before = len(points), np.zeros(len(points))
        if places is not None:
            bodies = np.hstack([places.q, places.v, places.time[:, None]])
            if places.goes_on.any():
                memories, memory = places.memory, np.where(places.goes_on, np.arange(m), -1)
                before = np.where(places.goes_on, self._read("drive_work", places.memory), 0.0)
        samples = self._workers.run(
            points, Starts(bodies, memories, memory), wrong=wrong, keeps=keeps,
            durations=None if durations is None else np.ascontiguousarray(durations),
            levels=None if levels is None else np.ascontiguousarray(levels),
            chunk=CHUNK if chunk is None else chunk, deadline=deadline, on_progress=on_progress,
        )  # fmt: skip
        return self._ran(samples, before)

    def _ran(self, samples: Samples, before: Reals) -> Ran:
        found, kept, m = samples.results, samples.kept, len(samples.points)
        n = samples.final.shape[1] // 2
        last = np.zeros((m, 0))
        if len(kept):
            last = kept[np.arange(m), np.minimum(found["switches"], kept.shape[1] - 1)]

        def at(segment: int, rows: Ints) -> Places:
            there = kept[rows, segment]
            q, v, time = (self._read(name, there) for name in ("q", "v", "time"))
            return Places(q, v, time, there, np.ones(len(rows), bool))

        places = Places(
            samples.final[:, :n].copy(), samples.final[:, n:].copy(), found["time"].copy(), last,
            np.full(m, len(kept) > 0),
        )  # fmt: skip
        return Ran(
            **columns(found), residual=found["worst_residual"].copy(),
            work=self._read("drive_work", last) - before if len(kept) else np.full(m, math.nan),
            places=places, faults={}, at=at,
        )  # fmt: skip

    def proved(self, points: Reals, found: Ran, deadline: Deadline) -> Ints:
        """See `Runs.proved`."""
        over = self._workers.over

        def again(i: int) -> Run:
            given = self.parameters | dict(zip(over, points[i].tolist(), strict=True))
            alone = Simulation(
                self.scene, self.model, parameters=given, frames=3, **self._own, **self._options
            )
            run: Run = finished(alone, None, deadline)
            return run

        return proved(self.model, found.outcome, found.steps, self.budget, again, deadline)

    def begin(self, points: Reals, places: Places | None = None) -> Ran:
        """See `Runs.begin`."""
        found = self.run(points, places, np.zeros((1, 1)), keeps=True)
        return replace(found, places=found.places._replace(goes_on=np.zeros(len(points), bool)))

    def placed(self, state: State, parameters: Mapping[str, float]) -> tuple[Places, Code]:
        """See `Runs.placed`."""
        given = self.parameters | dict(parameters)
        begun = Simulation(
            self.scene, self.model, parameters=given, state=state, inputs=[], frames=3,
            duration=state.time + self._span(given), **self._options,
        )  # fmt: skip
        if begun.workspace is None or begun.reason:
            raise StateError(f"state: {begun.reason}")
        places = Places.by_hand(state.q[None].copy(), state.v[None].copy(), np.array([state.time]))
        if state.memory is not None:
            memory = begun.workspace.state.memory[None].copy()
            return places._replace(memory=memory, goes_on=np.ones(1, bool)), Code.RUNNING
        found = self.begin(np.array([[given[name] for name in self._workers.over]]), places)
        ended = Code(found.outcome[0])
        return found.places, Code.RUNNING if ended in (Code.MISSED, Code.TIMEOUT) else ended

    def taken_over(self, place: Places, _scene: Scene, levels: Reals) -> Places:
        """See `Runs.taken_over`: contacts are kept where bodies overlap, or where inputs are others than at
        the beginning; bodies that overlap by more than they may at these parameters are moved apart."""
        given = self.parameters | dict(zip(self.scene.template.inputs, levels.tolist(), strict=True))
        here = PlanarPlace(self.scene, self.parameters)
        if not here.geometry(place.q)[1][0] and given == self.parameters:
            return Places.by_hand(place.q.copy(), place.v.copy())
        memory = Memory(place.memory[0], digest(self.scene), self.model, 1.0, ())
        own = place.q[0]

        def begins(q: Reals) -> Places:
            kept = memory if q is own else None
            state = State(self.scene.template.coordinates, q, place.v[0], float(place.time[0]), kept)
            begun = self._begun(state, given)
            if isinstance(begun, str):
                raise PlaceError(begun)
            return begun

        try:
            return Nearest(self.scene, given)(own, begins)[0]
        except PlaceError:
            return Places.by_hand(place.q.copy(), place.v.copy())

    def measured(self, q: Reals, v: Reals, levels: Reals) -> Places:
        """See `Runs.measured`."""
        given = self.parameters | dict(zip(self.scene.template.inputs, levels.tolist(), strict=True))
        begun = self._begun(State(self.scene.template.coordinates, q, v), given)
        if isinstance(begun, str):
            raise PlaceError(begun)
        return begun

    def _begun(self, state: State, given: dict[str, float]) -> Places | str:
        """Where a run begins at a state with these inputs; or what is wrong with it."""
        begun = Simulation(
            self.scene, self.model, parameters=given, state=state, frames=3,
            duration=state.time + self._span(given),
        )  # fmt: skip
        if begun.workspace is None or begun.reason:
            return begun.reason
        own = begun.workspace.state.memory[None].copy()
        return Places(
            state.q[None].copy(), state.v[None].copy(), np.array([state.time]), own, np.ones(1, bool)
        )

    def _span(self, given: Mapping[str, float]) -> float:
        """How long a whole run lasts."""
        return self._whole or self.scene.bind(given).duration

    def numbers(self, places: Places) -> Reals:
        return np.asarray(self._read("values", places.memory))

    def forces(self, _points: Reals, places: Places) -> Reals:
        return np.asarray(self._read("pushes", places.memory))

    def state(self, places: Places, row: int, inputs: tuple[Segment, ...] = ()) -> State:
        q, v, time = places.q[row], places.v[row], float(places.time[row])
        memory = None
        if places.goes_on[row]:
            memory = Memory(places.memory[row], self._workers.digest, self.model, self._workers.theta, inputs)
        return State(self.scene.template.coordinates, q, v, time, memory)

    def _read(self, name: str, memories: Reals) -> Any:
        return in_memory(self._workers.workspace.state, name, memories)

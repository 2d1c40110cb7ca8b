"""Samples on threads that run compiled code: the common ground of batches and rollouts."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from queue import SimpleQueue
from typing import Any, NamedTuple

import numpy as np

from rungwise.deadline import NEVER, Deadline
from rungwise.kernel import Ints, Reals
from rungwise.models.ladder import Rung
from rungwise.scene import Scene, SceneError
from rungwise.scene.contract import AnyScene
from rungwise.scene.fields.values import shown
from rungwise.scene.template import records as rec
from rungwise.simulation.inputs import compiled
from rungwise.simulation.options import ModelError, RunOptions, count, preferences
from rungwise.simulation.planar.loop import STOPPED
from rungwise.simulation.planar.samples import (
    OPTIONS,
    RESULT,
    Place,
    Programs,
    Samples,
    run_samples,
)
from rungwise.simulation.planar.state.allocation import allocate
from rungwise.simulation.planar.state.workspace import CLOCK, Workspace, in_memory
from rungwise.simulation.reasons.reasons import JAM
from rungwise.simulation.state import Memory, digest
from rungwise.simulation.turns import LONGEST, TURN_S
from rungwise.simulation.watched.values import CONTROL
from rungwise.wording import choices, listed

CHUNK = 256
"""Runs of one compiled call: long enough that Python does not count, short enough for progress."""
MOST_THREADS = 256
"""More are not started: what runs give does not depend on it."""
BUDGET = 1_000_000
"""Greatest number of steps of one run; one that takes more has not converged."""


class Starts(NamedTuple):
    """Where runs begin, as of `Samples`: places, velocities and times, memories to go on from, and the row of
    each run among these; None where there is none."""

    bodies: Reals | None = None
    memories: Reals | None = None
    memory: Ints | None = None


class Workers:
    """Threads for runs of one scene on one rung, with segments whose conditions are `until` and that ramp
    where `ramps` says so; `budget` is the greatest number of steps of one run, and `jam` the motion in a step
    without solution, in parts of the goal's tolerance, that counts as a jam. Other `options` are fields of
    `RunOptions`. Raises SceneError, ScheduleError or ModelError for wrong input."""

    def __init__(
        self,
        scene: Scene,
        model: Rung,
        over: Sequence[str],
        parameters: Mapping[str, float] | None,
        *,
        until: Sequence[str | None] = (),
        ramps: Sequence[bool] = (),
        budget: int | None = None,
        jam: float = JAM,
        threads: int | None = None,
        **options: Any,
    ) -> None:
        self.scene, self.model, self.over = scene, model, tuple(over)
        given = RunOptions(**options)
        self.theta = given.theta
        self._preferred = preferences(scene, model, given.motion)
        template = scene.template
        self.parameters, self.digest = scene.parameters(parameters), digest(scene)
        self._columns = np.array([template.parameters.index(name) for name in self.over], np.int64)
        self._until, self._ramps = tuple(until), np.array(ramps, np.int64)
        conditions = template.conditions
        self._programs = Programs(
            numbers=template.fixed_numbers(), bounds=template.checks.bounds, buffer=template.buffer,
            parameters=np.array(list(self.parameters.values())), blank=np.zeros(1, CLOCK),
        )  # fmt: skip
        self._conditions = (conditions.code, conditions.constants, conditions.table)
        self._rung = self.model.record(self.theta)
        self._options = np.zeros(1, OPTIONS)
        for name in ("step", "duration", "span"):
            value = getattr(given, name)
            self._options[name] = math.nan if value is None else value
        self._options["tol"] = 0.0 if given.tol is None else given.tol
        self._options["longest"] = LONGEST
        self._options["jam"] = jam
        self._options["budget"] = BUDGET if budget is None else count("budget", budget, 1)
        self.threads = threads_of(threads)
        self._places: SimpleQueue[Place] = SimpleQueue()
        self._made = [self._place() for _ in range(self.threads)]
        for place in self._made:
            self._places.put(place)

    def run(
        self,
        points: Reals,
        starts: Starts | None = None,
        *,
        durations: Reals | None = None,
        levels: Reals | None = None,
        wrong: Ints | None = None,
        keeps: bool = False,
        chunk: int = CHUNK,
        deadline: Deadline = NEVER,
        on_progress: Callable[[int], None] | None = None,
    ) -> Samples:
        """Run every point (m, k), values of `over`, from the scene's start if no others are given; the other
        arrays are those of `Samples`, and no row of one that is not given. The bytes do not depend on threads
        or `chunk`. `on_progress` is called with the number of runs done, about ten times a second; what it
        raises ends the runs, also within a step, as Ctrl-C does; when the deadline has come runs that still
        go on are left RUNNING."""
        chunk = count("chunk", chunk, 1)
        m, n, segments = len(points), len(self.scene.template.coordinates), len(self._until)
        inputs, size = len(self.scene.template.inputs), self.workspace.state.memory.size
        begun = starts or Starts()
        samples = Samples(
            points=points,
            bodies=np.zeros((0, 2 * n + 1)) if begun.bodies is None else begun.bodies,
            memories=np.zeros((0, size)) if begun.memories is None else begun.memories,
            memory=np.full(m, -1) if begun.memory is None else begun.memory,
            durations=np.zeros((1, segments)) if durations is None else durations,
            levels=np.full((1, segments, inputs), math.nan) if levels is None else levels,
            wrong=np.zeros(m, np.int64) if wrong is None else wrong,
            results=np.zeros(m, RESULT),
            final=np.full((m, 2 * n), math.nan),
            kept=np.full((m if keeps else 0, max(segments, 1), size), math.nan),
        )
        samples.results["margin"] = math.nan
        signals = np.zeros(1, np.int64)
        with deadline.running(signals, *(place.workspace.scratch.halt for place in self._made)):
            self._make(samples, chunk, signals, on_progress)
        return samples

    def _make(
        self, samples: Samples, chunk: int, signals: Ints, on_progress: Callable[[int], None] | None
    ) -> None:
        """Make the runs, in chunks, until signalled."""
        m = len(samples.points)
        spans = [(at, min(at + chunk, m)) for at in range(0, m, chunk)]
        if m == 1 and on_progress is None:
            self._chunk(samples, 0, 1, signals)
            return
        try:
            with ThreadPoolExecutor(self.threads) as pool:
                waiting = {pool.submit(self._chunk, samples, *span, signals) for span in spans}
                try:
                    done = 0
                    for part in _sizes(waiting):
                        done += part
                        if on_progress is not None:
                            on_progress(done)
                except BaseException:
                    signals[STOPPED] = 1
                    self._halt(1)
                    for future in waiting:
                        future.cancel()
                    raise
        finally:
            self._halt(0)

    def _halt(self, value: int) -> None:
        """End the steps that threads take, or let them take steps again."""
        for place in self._made:
            place.workspace.scratch.halt[0] = value

    def _chunk(self, samples: Samples, first: int, last: int, signals: Ints) -> int:
        place = self._places.get()
        try:
            run_samples(
                self._programs, self._conditions, self._rung, self._options, self._columns, samples,
                first, last, signals, place,
            )  # fmt: skip
        finally:
            self._places.put(place)
        return last - first

    def goes_on(self, memory: Memory, parameters: Mapping[str, float]) -> bool:
        """Whether a run with these parameters goes on from the memory as if it had not been interrupted."""
        template, given = self.scene.template, self.parameters | dict(parameters)
        free = template.inputs if memory.inputs else ()
        kept = in_memory(self.workspace.state, "values", memory.values[None])[0]
        same = all(
            given[name] == value
            for name, value in zip(template.parameters, kept, strict=False)
            if name not in free
        )
        return bool(same and memory.model.record(memory.theta) == self._rung)

    @property
    def workspace(self) -> Workspace:
        """The workspace of a thread that rests."""
        place = self._places.get()
        self._places.put(place)
        return place.workspace

    def _place(self) -> Place:
        """Arrays of one thread."""
        template, segments = self.scene.template, len(self._until)
        buffer = template.buffer.copy()
        records = rec.views(buffer, template.counts)
        workspace = allocate(template, np.zeros(template.value_count), 3)
        workspace.state.prefer[:] = self._preferred
        inputs = compiled(
            self.scene, np.zeros(segments), np.zeros((segments, len(template.inputs))), self._ramps.copy(),
            self._until,
        )  # fmt: skip
        return Place(
            buffer=buffer, control=np.zeros(1, CONTROL), records=records, inputs=inputs, workspace=workspace
        )


def threads_of(threads: int | None) -> int:
    """How many threads: as many as there are cores if not given. Raises ModelError."""
    if threads is None:
        return os.cpu_count() or 1
    try:
        return min(count("threads", threads, 1), MOST_THREADS)
    except ModelError:
        raise ModelError(f"threads: {threads!r} must be at least 1") from None


def outside(scene: AnyScene, over: Sequence[str], points: Reals) -> Ints:
    """Whether each point (m, k) is outside the ranges of the parameters `over`."""
    found = np.zeros(len(points), bool)
    for column, name in zip(points.T, over, strict=True):
        declared = scene.file.parameters[name].range
        low, high = (-math.inf, math.inf) if declared is None else declared
        found |= ~((column >= low) & (column <= high))
    return found.astype(np.int64)


def names_of(scene: AnyScene, over: Sequence[str], field: str = "over") -> tuple[str, ...]:
    """The parameters' names, checked. Raises SceneError."""
    known = scene.file.parameters
    for place, name in enumerate(over):
        if name not in known:
            raise SceneError(f"{field}: unknown parameter {shown(name)}{choices(name, known)}")
        if name in over[:place]:
            raise SceneError(f"{field}: {name} is given twice")
    if not over:
        raise SceneError(f"{field}: needs at least one parameter; valid: {listed(known)}")
    return tuple(over)


def _sizes(waiting: set[Future[int]]) -> Iterator[int]:
    """Numbers of runs, as chunks end; 0 where none ends for a while."""
    left = set(waiting)
    while left:
        done, left = wait(left, timeout=TURN_S, return_when=FIRST_COMPLETED)
        yield sum(future.result() for future in done)

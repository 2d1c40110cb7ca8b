"""Batches: one scene on one rung at many points of its parameters, on threads that run compiled code."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from dataclasses import dataclass
from queue import SimpleQueue

import numpy as np
from numpy.typing import NDArray

from rungwise.kernel import Ints, Reals, RecordArray
from rungwise.models.ladder import Rung
from rungwise.outcome import Code
from rungwise.scene import Scene, SceneError
from rungwise.scene import records as rec
from rungwise.simulation.options import ModelError, check_options, moving_rung, preferences
from rungwise.simulation.planar.samples import OPTIONS, RESULT, STOPPED, Place, Programs, run_samples
from rungwise.simulation.planar.workspace import CLOCK, CONTROL, allocate
from rungwise.simulation.run import CLOSER, JAM, LONGEST, LOOKS

CHUNK = 256
"""Runs of one compiled call: long enough that Python does not count, short enough for progress."""
BUDGET = 1_000_000
"""Greatest number of steps of one run; one that takes more has not converged."""


@dataclass(frozen=True)
class Results:
    """Runs at points (m, k): codes of outcomes (see `rungwise.outcome.Code`), times, signed margins, counts
    of steps, worst scaled residuals (all (m,)), and coordinates and speeds at the end (m, n).

    The margin is positive where the goal was reached (by how much the run stayed clear of unsafe and doomed
    states) and otherwise negative (how near the run came to the goal): the margin is continuous where it
    passes zero, if the scene's conditions are continuous; nan where there was no run. A jam has no
    certificate here: run the point again with `simulate` for one.
    """

    outcome: Ints
    time: Reals
    margin: Reals
    steps: Ints
    worst_residual: Reals
    final: Reals
    speed: Reals


class Batch:
    """Runs of one scene on one rung, whatever the points. Raises SceneError or ModelError for wrong input.

    Args:
        scene, model: as for `Simulation`.
        over: names of the parameters that points give, in order.
        starts: names of the coordinates ("part.x3") or speeds ("speed(part.x3)") whose value at the start
            points give after the parameters, in place of the scene's.
        parameters: values of other parameters; the rest keep their defaults.
        step, tol, duration, theta, motion: as for `Simulation`; theta is 1/2 if not given (second order).
        threads: how many; as many as there are cores if not given. The results do not depend on it.
    """

    def __init__(
        self,
        scene: Scene,
        model: Rung | str,
        over: Sequence[str],
        *,
        starts: Sequence[str] = (),
        parameters: Mapping[str, float] | None = None,
        step: float | None = None,
        tol: float | None = 1e-3,
        duration: float | None = None,
        theta: float = 0.5,
        motion: Mapping[str, float] | None = None,
        threads: int | None = None,
    ) -> None:
        self.scene, self.model = scene, moving_rung(model)
        step, tol, duration, theta = check_options(step, tol, duration, theta)
        self.over = names_of(scene, over) if over or not starts else ()
        self.starts = tuple(starts)
        self._preferred = preferences(scene, self.model, motion)
        template = scene.template
        self.parameters = scene.parameters(parameters)
        columns = [template.parameters.index(name) for name in self.over]
        columns += [len(template.parameters) + start_of(scene, name) for name in self.starts]
        self._columns = np.array(columns, np.int64)
        conditions = template.conditions
        self._programs = Programs(
            numbers=template.fixed_numbers(), bounds=template.checks.bounds(), buffer=template.buffer,
            parameters=np.array(list(self.parameters.values())), blank=np.zeros(1, CLOCK),
        )  # fmt: skip
        self._timed = template.timed_numbers()
        self._conditions = (conditions.code, conditions.constants, conditions.table)
        self._rung = self.model.record(theta)
        self._options = np.zeros(1, OPTIONS)
        self._options["step"] = math.nan if step is None else step
        self._options["duration"] = math.nan if duration is None else duration
        self._options["tol"] = 0.0 if tol is None else tol
        self._options["longest"] = 1.0 / LONGEST
        self._options["jam"] = JAM * CLOSER**LOOKS
        self._options["budget"] = BUDGET
        self.threads = threads if threads is not None else os.cpu_count() or 1
        if self.threads < 1:
            raise ModelError(f"threads: {threads!r} must be at least 1")
        self._places: SimpleQueue[Place] = SimpleQueue()
        for _ in range(self.threads):
            self._places.put(self._place())

    def run(
        self, points: Reals, *, chunk: int = CHUNK, on_progress: Callable[[int], None] | None = None
    ) -> Results:
        """Run every point (m, k), values of `over` and `starts`; the bytes do not depend on threads or
        `chunk`.

        A point outside the ranges of the parameters, or one at which the scene is impossible, is `invalid`.
        `on_progress` is called with the number of runs done. Ctrl-C raises KeyboardInterrupt within one run.
        """
        points = np.ascontiguousarray(points, np.float64)
        if points.ndim != 2 or points.shape[1] != len(self._columns):
            raise ValueError(f"points: must have the shape (m, {len(self._columns)}), not {points.shape}")
        results = np.zeros(len(points), RESULT)
        n = len(self.scene.template.coordinates)
        final = np.zeros((len(points), 2 * n))
        signals = np.zeros(1, np.int64)
        spans = [slice(at, at + chunk) for at in range(0, len(points), chunk)]
        with ThreadPoolExecutor(self.threads) as pool:
            waiting = {pool.submit(self._chunk, points[s], signals, results[s], final[s]) for s in spans}
            try:
                done = 0
                for size in _sizes(waiting):
                    done += size
                    if on_progress is not None:
                        on_progress(done)
            except BaseException:
                signals[STOPPED] = 1
                for future in waiting:
                    future.cancel()
                raise
        outside = self._outside(points)
        outcome, margin = results["outcome"].copy(), results["margin"].copy()
        outcome[outside], margin[outside] = Code.INVALID, math.nan
        return Results(
            outcome=outcome, time=results["time"].copy(), margin=margin, steps=results["steps"].copy(),
            worst_residual=results["worst_residual"].copy(), final=final[:, :n].copy(),
            speed=final[:, n:].copy(),
        )  # fmt: skip

    def _chunk(self, points: Reals, signals: Ints, results: RecordArray, final: Reals) -> int:
        place = self._places.get()
        try:
            run_samples(
                self._programs, self._timed, self._conditions, self._rung, self._options, self._columns,
                points, signals, place, results, final,
            )  # fmt: skip
        finally:
            self._places.put(place)
        return len(points)

    def _outside(self, points: Reals) -> NDArray[np.bool_]:
        outside = np.zeros(len(points), bool)
        for column, name in zip(points.T, self.over, strict=False):
            declared = self.scene.file.parameters[name].range
            low, high = (-math.inf, math.inf) if declared is None else declared
            outside |= ~((column >= low) & (column <= high))
        return outside

    def _place(self) -> Place:
        """Arrays of one thread."""
        template = self.scene.template
        buffer = template.buffer.copy()
        records = rec.views(buffer, template.counts)
        values = np.zeros(template.value_count)
        workspace = allocate(records, values, len(template.parameters), 3)
        workspace.state.prefer[:] = self._preferred
        return Place(buffer=buffer, control=np.zeros(1, CONTROL), records=records, workspace=workspace)


def names_of(scene: Scene, over: Sequence[str]) -> tuple[str, ...]:
    """The parameters' names, checked. Raises SceneError."""
    known = ", ".join(scene.file.parameters) or "none"
    for place, name in enumerate(over):
        if name not in scene.file.parameters:
            raise SceneError(f"over: unknown parameter {str(name)[:60]!r}; valid: {known}")
        if name in over[:place]:
            raise SceneError(f"over: {name} is given twice")
    if not over:
        raise SceneError(f"over: needs at least one parameter; valid: {known}")
    return tuple(over)


def start_of(scene: Scene, name: str) -> int:
    """Index of a coordinate, or of its speed after all coordinates. Raises SceneError."""
    known = scene.template.coordinates
    inner = name[6:-1] if name.startswith("speed(") and name.endswith(")") else name
    if inner not in known:
        raise SceneError(
            f"state: unknown coordinate {str(name)[:60]!r}; valid: {', '.join(known)}, and speed() of them"
        )
    return known.index(inner) + (len(known) if inner != name else 0)


def _sizes(waiting: set[Future[int]]) -> Iterator[int]:
    """Numbers of runs, as chunks end."""
    left = set(waiting)
    while left:
        done, left = wait(left, timeout=0.1, return_when=FIRST_COMPLETED)
        for future in done:
            yield future.result()

"""Many runs of a scene in space at points of parameters, over processes."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from rungwise.kernel import Reals
from rungwise.models.ladder import Rung
from rungwise.outcome import Code
from rungwise.plain import cut
from rungwise.scene.space import SpaceScene
from rungwise.simulation.batch import Results
from rungwise.simulation.crew import names_of, outside, threads_of
from rungwise.simulation.options import check_options, count, moving_rung
from rungwise.simulation.spatial.crew import spread
from rungwise.simulation.spatial.run import SpaceSimulation

BUDGET = 1_000_000
"""Greatest number of steps of one run, as in the plane."""


class Job(NamedTuple):
    """What all runs of a batch share; as bytes it tells processes whether they have read it already."""

    scene: SpaceScene
    model: Rung
    over: tuple[str, ...]
    parameters: dict[str, float]
    options: dict[str, Any]
    budget: int


class Ran(NamedTuple):
    """One run: its code, time, margin, steps, worst residual, and q and v at the end."""

    outcome: int
    time: float
    margin: float
    steps: int
    residual: float
    q: Reals
    v: Reals


class SpaceBatch:
    """Runs of one scene in space on one rung, whatever the points; arguments and errors as of
    `simulation.batch.Batch`, but `threads` are processes."""

    def __init__(
        self,
        scene: SpaceScene,
        model: Rung | str,
        over: Sequence[str],
        *,
        parameters: Mapping[str, float] | None = None,
        step: float | None = None,
        tol: float | None = None,
        duration: float | None = None,
        theta: float = 1.0,
        budget: int | None = None,
        threads: int | None = None,
    ) -> None:
        self.scene, self.model, self.over = scene, moving_rung(model), names_of(scene, over)
        self.parameters, self.threads = (
            scene.parameters(parameters),
            min(threads_of(threads), os.cpu_count() or 1),
        )
        check_options(step, tol, duration, theta)
        options = {"step": step, "tol": tol, "duration": duration, "theta": theta}
        most = BUDGET if budget is None else count("budget", budget, 1)
        self._job = Job(scene, self.model, self.over, self.parameters, options, most)

    def __repr__(self) -> str:
        over = cut(", ".join(self.over), 200)
        return f"<SpaceBatch of {cut(self.scene.name)} on {cut(self.model.name)} over {over}>"

    def run(
        self, points: Reals, *, chunk: int | None = None, on_progress: Callable[[int], None] | None = None
    ) -> Results:
        """Run every point (m, k), values of `over`; see `Batch.run`."""
        points = np.ascontiguousarray(points, np.float64)
        if points.ndim != 2 or points.shape[1] != len(self.over):
            raise ValueError(f"points: must have the shape (m, {len(self.over)}), not {points.shape}")
        size = chunk or max(1, min(16, len(points) // (4 * self.threads)))
        parts = [points[at : at + size] for at in range(0, len(points), size)]
        found: list[Ran] = []
        look = None if on_progress is None else lambda: on_progress(len(found))
        for part in spread(run_points, self._job, parts, len(points), self.threads, look):
            found += part
            if on_progress is not None:
                on_progress(len(found))
        n_q, n_v = len(self.scene.template.coordinates), len(self.scene.template.velocities)
        return Results(
            outcome=np.array([each.outcome for each in found], np.int64),
            time=np.array([each.time for each in found]),
            margin=np.array([each.margin for each in found]),
            steps=np.array([each.steps for each in found], np.int64),
            worst_residual=np.array([each.residual for each in found]),
            final=np.array([each.q for each in found]).reshape(len(found), n_q),
            speed=np.array([each.v for each in found]).reshape(len(found), n_v),
        )


def run_points(job: Job, points: Reals) -> list[Ran]:
    """Runs at points (m, k)."""
    wrong = outside(job.scene, job.over, points)
    return [_ran(job, point) if not bad else _invalid(job) for point, bad in zip(points, wrong, strict=True)]


def _invalid(job: Job) -> Ran:
    template = job.scene.template
    q, v = np.full(len(template.coordinates), np.nan), np.full(len(template.velocities), np.nan)
    return Ran(int(Code.INVALID), 0.0, np.nan, 0, 0.0, q, v)


def _ran(job: Job, point: Reals) -> Ran:
    given = job.parameters | dict(zip(job.over, point.tolist(), strict=True))
    simulation = SpaceSimulation(job.scene, job.model, parameters=given, frames=3, **job.options)
    while simulation.advance():
        if simulation.steps > job.budget:
            simulation.outcome = Code.NOT_CONVERGED
    if simulation.outcome == Code.INVALID or simulation.march is None:
        return _invalid(job)
    march = simulation.march
    return Ran(
        int(simulation.outcome),
        march.time,
        simulation.margin,
        simulation.steps,
        march.residual,
        march.q,
        march.v,
    )

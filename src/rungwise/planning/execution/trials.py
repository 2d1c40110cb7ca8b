"""Executions of a plan in worlds that its task draws: as it is, with guarded moves, planned anew, or with its
policy."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np

from rungwise.cluster import Batch
from rungwise.deadline import TimeOver
from rungwise.kernel import Ints, Reals
from rungwise.models.ladder import Rung
from rungwise.outcome import Code
from rungwise.planning.execution.fed_back import FedBack
from rungwise.planning.execution.feedback import Replanner
from rungwise.planning.motion.budget import Budget, Stage
from rungwise.planning.plan import FEEDBACK, RE_PLANNING, Plan, plan_of
from rungwise.planning.task.task import DRAWS, drawn, fields_of
from rungwise.simulation.inputs import Segment
from rungwise.simulation.options import moving_rung
from rungwise.world.carriers import TaskError
from rungwise.world.rollout import rollout


class Trials:
    """Executions of a plan in one mode, on a rung, with an error `tol` allowed per step.

    A sample is a point (1 + k,): its number, then the values of what the task calls uncertain; the value of
    an input is an error that is added to it throughout."""

    def __init__(
        self, plan: Plan, model: Rung, tol: float, mode: str, seed: int, threads: int | None = None,
        time: Budget | None = None, noise: float = 0.0,
    ) -> None:  # fmt: skip
        self.plan, self.model, self.tol, self.mode, self.seed = plan, model, tol, mode, seed
        self._time, self.noise = time, noise
        self.names = list(fields_of(plan.scene).uncertain)
        self._threads = threads
        self._inputs = [name for name in plan.scene.template.inputs if name in self.names]

    @property
    def nominal(self) -> Reals:
        """Values (k,) without any error."""
        errors = dict.fromkeys(self._inputs, 0.0)
        return np.array([(self.plan.parameters | errors)[name] for name in self.names])

    def draw(self, samples: int) -> Reals:
        """Points (m, 1 + k). Raises TaskError where draws keep falling out of the ranges."""
        rng, rows = np.random.default_rng(self.seed), list[list[float]]()
        for _ in range(DRAWS * samples):
            values = drawn(self.plan.scene, "uncertain", self.plan.parameters, rng)
            if values is not None:
                rows.append([float(len(rows)), *(values[name] for name in self.names)])
                if len(rows) == samples:
                    return np.array(rows)
        raise TaskError("task.uncertain: nearly all draws lie outside the parameters' ranges")

    def world(self, point: Reals) -> tuple[dict[str, float], dict[str, float]]:
        """The parameters of a sample, and the errors of its inputs."""
        values = dict(zip(self.names, point[1:].tolist(), strict=True))
        errors = {name: values.pop(name) for name in self._inputs}
        return self.plan.parameters | values, errors

    def run(self, points: Reals, on_progress: Callable[[int], None] | None = None) -> tuple[Ints, Reals]:
        """Outcomes and margins (m,) of samples; executions that plan anew have no margin. Raises TimeOver."""
        if self.mode in (RE_PLANNING, FEEDBACK):
            return self._re_planned(points, on_progress)
        return self._as_it_is(points, on_progress)

    def executed(self, point: Reals) -> list[Segment]:
        """The schedule that is executed in a sample."""
        parameters, errors = self.world(point)
        if self.mode in (RE_PLANNING, FEEDBACK):
            return list(self._replanner.execute(parameters, errors, self.seed + int(point[0]))[1])
        levels = self._levels(point[None])[0][0]
        return [
            replace(segment, inputs=dict(zip(self.plan.scene.template.inputs, row.tolist(), strict=True)))
            for segment, row in zip(self.plan.segments, levels, strict=True)
        ]

    @cached_property
    def _replanner(self) -> Replanner | FedBack:
        assert self.plan.stage is not None
        if self.mode == FEEDBACK:
            return FedBack(self.plan, self.model, self.tol, self.noise, self._time)
        return Replanner(
            self.plan, Stage(self.model, self.plan.stage.tol), self.tol, self._threads, self._time
        )

    def _as_it_is(self, points: Reals, on_progress: Callable[[int], None] | None) -> tuple[Ints, Reals]:
        levels, durations = self._levels(points)
        parameters: dict[str, Any] = dict(self.plan.parameters)
        for k, name in enumerate(self.names):
            if name not in self._inputs:
                parameters[name] = points[:, 1 + k]
        segments = self.plan.segments
        found = rollout(
            self.plan.scene, self.model, inputs=levels, durations=durations, parameters=parameters,
            tol=self.tol, until=[segment.until for segment in segments],
            ramp=[segment.ramp for segment in segments], keep=False, threads=self._threads,
            limit=None if self._time is None else self._time.seconds, on_progress=on_progress,
        )  # fmt: skip
        if (found.outcome == Code.RUNNING).any():
            raise TimeOver("in a sample")
        return found.outcome, found.margin

    def _re_planned(self, points: Reals, on_progress: Callable[[int], None] | None) -> tuple[Ints, Reals]:
        outcomes = list[Code]()
        for point in points:
            outcomes.append(self._replanner.execute(*self.world(point), self.seed + int(point[0]))[0])
            if on_progress is not None:
                on_progress(len(outcomes))
        return np.array(outcomes, np.int64), np.full(len(points), np.nan)

    def _levels(self, points: Reals) -> tuple[Reals, Reals]:
        """Inputs (m, s, u) with their errors, within the ranges of the parameters, and durations (s,)."""
        one, durations = self.plan.levels()
        levels = np.repeat(one[None], len(points), axis=0)
        for name in self._inputs:
            k, error = self.plan.scene.template.inputs.index(name), points[:, 1 + self.names.index(name)]
            low, high = self.plan.scene.file.parameters[name].range or (-np.inf, np.inf)
            levels[..., k] = np.clip(levels[..., k] + error[:, None], low, high)
        return levels, durations


def trials_at(plan: str, request: str) -> Batch:
    """On a worker: the trials of a plan in one thread."""
    asked = json.loads(request)
    rung = moving_rung(asked["model"])
    model = rung if rung.metric else rung.with_inertia(asked["inertia"])
    return Trials(
        plan_of(plan), model, asked["tol"], asked["mode"], asked["seed"], threads=1,
        noise=asked["noise"],
    ).run  # fmt: skip

"""A plan executed with its policy in worlds with other parameters, from places measured with noise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rungwise.deadline import Deadline
from rungwise.kernel import Reals
from rungwise.models.ladder import Rung
from rungwise.outcome import Code
from rungwise.planning.execution.policy import Policy
from rungwise.planning.motion.budget import Budget
from rungwise.planning.plan import Plan
from rungwise.planning.task.task import task_of
from rungwise.simulation.inputs import Segment
from rungwise.simulation.live.observation import Observation
from rungwise.world.find import world_of
from rungwise.world.run import simulation_of
from rungwise.world.stepped import lead

FRAMES = 3
"""States of a run that are kept."""
AVERAGED = 5
"""Over how many measurements errors are averaged where there is noise."""


class FedBack:
    """Executes a plan with feedback on a rung, with an error `tol` allowed per step; noise: standard
    deviation of measured places of objects, as a length."""

    def __init__(
        self, plan: Plan, model: Rung, tol: float, noise: float = 0.0, time: Budget | None = None
    ) -> None:
        self._plan, self._model, self._tol, self._noise = plan, model, tol, noise
        self._time = Budget() if time is None else time
        self.policy = Policy(plan, average=AVERAGED if noise else 1)
        self._span = task_of(plan.scene, plan.parameters).span
        weights = world_of(plan.scene).at(plan.parameters).moved.weights
        self._spread = np.where(weights > 0.0, noise / np.where(weights > 0.0, weights, 1.0), 0.0)

    def execute(
        self, parameters: dict[str, float], errors: dict[str, float], seed: int
    ) -> tuple[Code, tuple[Segment, ...]]:
        """How it ends in the world with these parameters and errors of inputs, and what was executed. Raises
        TimeOver."""
        policy, rng = self.policy, np.random.default_rng(seed)
        policy.restart()
        simulation = simulation_of(
            self._plan.scene, self._model, parameters=parameters, tol=self._tol, inputs=[],
            duration=policy.duration, span=self._span, frames=FRAMES,
        )  # fmt: skip
        simulation.deadline = Deadline.at(self._time.end.ends)

        def control(seen: Observation) -> dict[str, float]:
            self._time.look()
            noisy: Reals = seen.q + self._spread * rng.standard_normal(len(seen.q))
            wanted = policy(replace(seen, q=noisy))
            return {name: self._bounded(name, wanted[name] + errors.get(name, 0.0)) for name in wanted}

        lead(control, 1.0 / policy.rate, policy.ramp, None, simulation)
        outcome = Code(int(simulation.outcome))
        return Code.MISSED if outcome == Code.TIMEOUT else outcome, tuple(simulation.inputs)

    def _bounded(self, name: str, value: float) -> float:
        low, high = self._plan.scene.file.parameters[name].range or (-np.inf, np.inf)
        return float(np.clip(value, low, high))

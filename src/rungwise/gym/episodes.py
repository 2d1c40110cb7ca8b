"""Episodes of m environments that advance together: starts, inputs, rewards, ends and observations."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from rungwise.gym.copies import Copies, Standing
from rungwise.gym.settings import GymError, Settings, Transition
from rungwise.gym.spaces import Observed, action_space, observed
from rungwise.gym.starts import Starts
from rungwise.kernel import Ints, Reals
from rungwise.outcome import OUTCOMES, Code
from rungwise.scene.fields.values import shown
from rungwise.simulation.any_run import AnyRun
from rungwise.simulation.inputs import Segment
from rungwise.simulation.state import State
from rungwise.wording import choices
from rungwise.world.run import simulate

RESET = ("state", "parameters")
"""Options of a reset."""


@dataclass(frozen=True)
class Begun:
    """How an episode began: the parameters of the instance and of the run, and the state given, if any."""

    instance: dict[str, float]
    parameters: dict[str, float]
    state: State | None


def copies_of(settings: Settings) -> Copies:
    """Copies of the settings' scene."""
    s = settings
    return Copies(s.scene, s.model, s.parameters, s.hold, s.horizon, s.ramp, s.steps, s.threads)


class Episodes:
    """m environments; rows of all arrays are theirs."""

    def __init__(self, settings: Settings, count: int) -> None:
        self.settings, self.count = settings, count
        self.copies = copies_of(settings)
        self.starts = Starts(settings, self.copies)
        self.observed, self.action_space = self._observed(), action_space(settings)
        self._begun: list[Begun | None] = [None] * count
        self._levels: list[list[Reals]] = [[] for _ in range(count)]
        self._places: Standing | None = None
        self._instances = np.zeros((count, len(self.starts.seen)))
        self._began, self._lack, self._margin = np.zeros(count), np.zeros(count), np.zeros(count)

    def _observed(self) -> Observed:
        return observed(self.settings, self.starts.seen, self.copies.travel(self.settings.parameters))

    # Beginning

    def begin(self, row: int, rng: np.random.Generator, options: Mapping[str, Any] | None) -> None:
        """Begin an episode: at the state or the parameters of the options, and otherwise as drawn. Raises
        GymError, TaskError, StateError and SceneError."""
        given = dict(options or {})
        for name in given:
            if name not in RESET:
                raise GymError(f"options: unknown {shown(name)}{choices(name, RESET)}")
        fixed = self._fixed(given.get("parameters"))
        state = given.get("state")
        if state is not None:
            instance = self.settings.parameters | fixed
            start = self.copies.begin_at(state, instance)
        else:
            instance, start = self.starts.draw(rng, fixed)
        parameters = dict(zip(self.settings.scene.template.parameters, start.points[0].tolist(), strict=True))
        self._check_travel(parameters)
        if self._places is None:
            self._places = start.take(np.zeros(self.count, np.int64))
        rows = np.array([row])
        self._places.put(rows, start)
        self._begun[row], self._levels[row] = Begun(instance, parameters, state), []
        self._instances[row] = self.starts.instance_of(instance)
        self._began[row] = start.time[0]
        answers = self.copies.goal(start)
        self._lack[row], self._margin[row] = answers.lack[0], answers.margin[0]

    def _fixed(self, given: object) -> dict[str, float]:
        """The parameters that a reset gives, checked. Raises GymError and SceneError."""
        if given is None:
            return {}
        if not isinstance(given, Mapping):
            raise GymError(f"options.parameters: must be a mapping of names to numbers, not {shown(given)}")
        checked = self.settings.scene.parameters(self.settings.parameters | dict(given))
        return {name: checked[name] for name in given}

    def _check_travel(self, parameters: dict[str, float]) -> None:
        """Raise GymError where a coordinate may go farther than the space of observations says."""
        travel = self.observed.travel
        if "q" not in self.settings.observe or not np.isfinite(travel).any():
            return
        low, high = self.copies.travel(parameters)
        if (low < travel[0]).any() or (high > travel[1]).any():
            raise GymError(
                "parameters: a coordinate may travel beyond the space of observations, which is made at the"
                " parameters that the environment is given"
            )

    # Advancing

    def advance(self, rows: Ints, actions: NDArray[Any]) -> Reals:
        """Hold the actions (r, u) in these environments; returns their rewards (r,)."""
        assert self._places is not None
        settings, before = self.settings, self._places.take(rows)
        levels = settings.levels(actions, self.copies.inputs(before))
        after = self.copies.advance(before, levels)
        lack_before = self._lack[rows]
        answers = self.copies.goal(after)
        self._places.put(rows, after)
        self._lack[rows], self._margin[rows] = answers.lack, answers.margin
        for row, level in zip(rows.tolist(), levels, strict=True):
            self._levels[row].append(level)
        if callable(settings.reward):
            return self._own_rewards(rows, before, lack_before)
        reached = settings.bonus * (after.outcome == Code.GOAL)
        return np.asarray(reached if settings.reward == "sparse" else lack_before - answers.lack + reached)

    def _own_rewards(self, rows: Ints, before: Standing, lack_before: Reals) -> Reals:
        assert callable(self.settings.reward)
        rewards = [
            self.settings.reward(self._transition(row, before.q[i], before.v[i], float(lack_before[i])))
            for i, row in enumerate(rows.tolist())
        ]
        return np.array(rewards, np.float64)

    def _transition(self, row: int, q: Reals, v: Reals, lack: float) -> Transition:
        """The last step of an environment, from places, velocities and the goal's lack before it."""
        after = self.places
        return Transition(
            q_before=q.copy(), v_before=v.copy(), lack_before=lack,
            q=after.q[row].copy(), v=after.v[row].copy(), lack=float(self._lack[row]),
            margin=float(self._margin[row]), inputs=self._levels[row][-1].copy(),
            parameters=dict(self.parameters(row)), time=float(after.time[row] - self._began[row]),
            outcome=OUTCOMES[Code(after.outcome[row])],
        )  # fmt: skip

    @property
    def terminated(self) -> NDArray[np.bool_]:
        """Which environments (m,) came to an end: goal, unsafe, doomed, jammed, ..."""
        return np.asarray(self.places.outcome != Code.RUNNING)

    @property
    def truncated(self) -> NDArray[np.bool_]:
        """Which environments (m,) have used up their time without coming to an end."""
        used = np.array([len(levels) >= self.settings.holds for levels in self._levels])
        return used & ~self.terminated

    @property
    def over(self) -> NDArray[np.bool_]:
        """Which episodes (m,) are over."""
        return np.asarray(self.terminated | self.truncated)

    # Reading

    @property
    def places(self) -> Standing:
        if self._places is None:
            raise gymnasium.error.ResetNeeded("call reset before anything else")
        return self._places

    def observe(self) -> NDArray[np.floating[Any]]:
        """Observations (m, o)."""
        places, copies = self.places, self.copies
        parts: dict[str, Callable[[], Reals]] = {
            "q": lambda: places.q, "v": lambda: places.v, "instance": lambda: self._instances,
            "inputs": lambda: copies.inputs(places), "forces": lambda: copies.forces(places),
            "time": lambda: (places.time - self._began)[:, None],
        }  # fmt: skip
        return self.observed.fitted(np.concatenate([parts[name]() for name in self.settings.observe], axis=1))

    def infos(self, rows: Ints) -> dict[str, NDArray[Any]]:
        """What a step or a reset tells beside the observation, an array (r, ...) for each name."""
        places = self.places
        outcomes = [OUTCOMES[Code(code)] for code in places.outcome[rows]]
        reasons = ["" if each.code == Code.RUNNING else each.meaning for each in outcomes]
        return {
            "outcome": np.array([str(each) for each in outcomes], object),
            "reason": np.array(reasons, object),
            "is_success": places.outcome[rows] == Code.GOAL,
            "margin": self._margin[rows], "lack": self._lack[rows], "time": places.time[rows],
            "inputs": self.copies.inputs(places)[rows], "worst_residual": places.residual[rows],
        }  # fmt: skip

    def info(self, row: int) -> dict[str, Any]:
        """The same for one environment, as plain values."""
        told = {name: values[0] for name, values in self.infos(np.array([row])).items()}
        return {
            name: value.item() if isinstance(value, np.generic) else value for name, value in told.items()
        }

    def parameters(self, row: int) -> dict[str, float]:
        return self._of(row).parameters

    def instance(self, row: int) -> dict[str, float]:
        return self._of(row).instance

    def state(self, row: int) -> State:
        schedule = self.schedule(row)
        return self.copies.state(self.places, row, schedule[-1] if schedule else None)

    def schedule(self, row: int) -> list[Segment]:
        """The inputs of the episode so far."""
        names, s = self.settings.scene.template.inputs, self.settings
        return [
            Segment(dict(zip(names, levels.tolist(), strict=True)), s.hold, None, s.ramp)
            for levels in self._levels[row]
        ]

    def replay(self, row: int) -> AnyRun:
        """The episode once more by `simulate`, in one run. Raises GymError before the first step."""
        begun, s, inputs = self._of(row), self.settings, self.schedule(row)
        if not inputs:
            raise GymError("replay: nothing has moved yet; call step first")
        run: AnyRun = simulate(
            s.scene, s.model, parameters=begun.parameters, state=begun.state, inputs=inputs,
            step=s.steps.step, tol=s.steps.tol, theta=s.steps.theta, span=s.horizon,
        )  # fmt: skip
        return run

    def _of(self, row: int) -> Begun:
        begun = self._begun[row]
        if begun is None:
            raise gymnasium.error.ResetNeeded("call reset before anything else")
        return begun

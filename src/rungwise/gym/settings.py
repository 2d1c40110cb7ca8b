"""Options of environments: accepted values, defaults that follow from the scene, and errors by name."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal, TypeAlias, TypedDict

import numpy as np
from numpy.typing import NDArray

from rungwise.errors import InputError
from rungwise.kernel import Reals
from rungwise.models.ladder import Rung
from rungwise.outcome import Outcome
from rungwise.planning.task.reserve import guarded_scene
from rungwise.planning.task.task import Task, task_of
from rungwise.scene.contract import AnyScene
from rungwise.scene.fields.values import finite, shown
from rungwise.scene.read import load
from rungwise.simulation.options import RunOptions, count, moving_rung
from rungwise.wording import choices, listed
from rungwise.world.find import world_of

HOLDS = 100
"""Actions of an episode, where neither `hold` nor `horizon` says otherwise."""
THERE_AND_BACK = 2.0
"""A robot that is led to an object before it pushes takes as long for its way as for the longest push."""
ACCURACY = 1e-3
"""Error allowed per step where none is given, as a part of the size of the largest object."""
TABLES = ("instances", "uncertain")
PARTS = ("q", "v", "instance", "inputs", "forces", "time")
"""What an observation may consist of (see `docs/gym.md`)."""
DTYPES = ("float32", "float64")


class GymError(InputError):
    """An environment cannot be made or stepped so; the text is one line that names the option."""


@dataclass(frozen=True)
class Transition:
    """One step of one environment, for a reward of one's own.

    q (n_q,), v (n_v,) in the order of the scene's coordinates and velocities, and the same `before`; inputs
    (u,) as applied; `lack`: by how much the goal fails, 0 where it holds, and `margin`, as of `rungwise.ask`;
    time since the start of the episode; outcome: `running` where the episode goes on.
    """

    q_before: Reals
    v_before: Reals
    lack_before: float
    q: Reals
    v: Reals
    lack: float
    margin: float
    inputs: Reals
    parameters: dict[str, float]
    time: float
    outcome: Outcome


Reward: TypeAlias = "Literal['progress', 'sparse'] | Callable[[Transition], float]"


class Options(TypedDict, total=False):
    """Options of an environment (see `SceneEnv`)."""

    parameters: Mapping[str, float] | None
    hold: float | None
    horizon: float | None
    bounds: Mapping[str, Sequence[float]] | None
    ramp: bool | None
    vary: Sequence[str]
    observe: Sequence[str]
    reward: Reward
    bonus: float
    scaled: bool
    dtype: str
    step: float | None
    tol: float | None
    theta: float
    threads: int | None


@dataclass(frozen=True)
class Settings:
    """Checked options: low, high, rate (u,) of the inputs; an episode has at most `holds` actions, each held
    for `hold` seconds. `steps`: the options of the runs: step, tol and theta."""

    scene: AnyScene
    model: Rung
    parameters: dict[str, float]
    low: Reals
    high: Reals
    rate: Reals
    hold: float
    holds: int
    ramp: bool
    vary: tuple[str, ...]
    observe: tuple[str, ...]
    reward: Reward
    bonus: float
    scaled: bool
    dtype: type[np.floating[Any]]
    steps: RunOptions
    threads: int | None

    @property
    def horizon(self) -> float:
        """Longest episode, in seconds."""
        return self.holds * self.hold

    def levels(self, actions: NDArray[Any], now: Reals) -> Reals:
        """Inputs (m, u) for actions (m, u), with bounds and rates kept, from inputs as they are now."""
        given = np.asarray(actions, np.float64)
        if self.scaled:
            given = self.low + 0.5 * (given + 1.0) * (self.high - self.low)
        most = self.rate * self.hold
        return np.ascontiguousarray(np.clip(np.clip(given, now - most, now + most), self.low, self.high))


def read_settings(
    scene: AnyScene | str | Path | Mapping[str, Any], model: Rung | str, given: Mapping[str, Any]
) -> Settings:
    """The options, checked. Raises GymError, SceneError, ModelError and TaskError."""
    for name in given:
        if name not in Options.__annotations__:
            raise GymError(f"{name}: unknown option{choices(name, Options.__annotations__)}")
    loaded, rung = guarded_scene(load(scene)), moving_rung(model)
    if loaded.file.goal is None:
        raise GymError("goal: the scene has none; an environment needs one")
    if not loaded.template.inputs:
        raise GymError("inputs: the scene has none; name the parameters that a policy changes over time")
    parameters = loaded.parameters(given.get("parameters"))
    task = None if loaded.file.task is None else task_of(loaded, parameters)
    duration, size = _extent(loaded, parameters)
    low, high, rate = _bounds(loaded, task, given.get("bounds"))
    steps = RunOptions(**{name: given[name] for name in ("step", "tol", "theta") if name in given})
    if steps.step is None and steps.tol is None:
        steps = replace(steps, tol=ACCURACY * size)
    hold, holds = _times(given, _longest(task, duration))
    ramp = given.get("ramp")
    return Settings(
        scene=loaded, model=rung, parameters=parameters, low=low, high=high, rate=rate,
        hold=hold, holds=holds, ramp=bool(np.isfinite(rate).any()) if ramp is None else _truth("ramp", ramp),
        vary=_names("vary", given.get("vary", TABLES), TABLES),
        observe=_names("observe", given.get("observe", ("q", "v", "instance")), PARTS),
        reward=_reward(given.get("reward", "progress")),
        bonus=finite("bonus", given.get("bonus", 1.0), GymError),
        scaled=_truth("scaled", given.get("scaled", True)), dtype=_dtype(given.get("dtype", "float32")),
        steps=steps, threads=given.get("threads"),
    )  # fmt: skip


def _extent(scene: AnyScene, parameters: dict[str, float]) -> tuple[float, float]:
    """The scene's duration, and how far the largest object reaches."""
    own = world_of(scene).at(parameters)
    return own.duration, own.moved.size


def _bounds(
    scene: AnyScene, task: Task | None, given: Mapping[str, Sequence[float]] | None
) -> tuple[Reals, Reals, Reals]:
    """Least and greatest inputs (u,) and their rates: as given, of the task, or the parameters' ranges."""
    names = scene.template.inputs
    ranges = [scene.file.parameters[name].range or (-math.inf, math.inf) for name in names]
    low, high = np.array(ranges).T.copy()
    rate = np.full(len(names), math.inf)
    if task is not None:
        low, high, rate = task.low.copy(), task.high.copy(), task.rate.copy()
        for carrier in task.carriers if task.by_place else ():
            columns = list(carrier.columns)
            rate[columns] = np.minimum(rate[columns], carrier.speed)
    if not isinstance(given, Mapping | None):
        raise GymError(f"bounds: must be a mapping of inputs to pairs of numbers, not {shown(given)}")
    for name, pair in (given or {}).items():
        if name not in names:
            raise GymError(f"bounds: unknown input {shown(name)}{choices(name, names)}")
        k = names.index(name)
        low[k], high[k] = _pair(f"bounds.{name}", pair, ranges[k])
    for name, least, most in zip(names, low, high, strict=True):
        if not math.isfinite(most - least):
            raise GymError(f"bounds.{name}: is required, because the input has no range")
        if not least < most:
            raise GymError(f"bounds.{name}: the least, {least:g}, is not below the greatest, {most:g}")
    return low, high, rate


def _pair(path: str, pair: object, within: tuple[float, float]) -> tuple[float, float]:
    if not isinstance(pair, Sequence | np.ndarray) or isinstance(pair, str) or len(pair) != 2:
        raise GymError(f"{path}: must be the least and the greatest value, not {shown(pair)}")
    least, most = (finite(f"{path}.{k}", value, GymError) for k, value in enumerate(pair))
    if not within[0] <= least <= most <= within[1]:
        raise GymError(f"{path}: must lie in the parameter's range, {within[0]:g} to {within[1]:g}")
    return least, most


def _longest(task: Task | None, duration: float) -> float:
    """The longest that the moves of a task may take; the scene's duration without a task."""
    if task is None:
        return duration
    longest = task.duration[1]
    if task.carriers:
        longest = THERE_AND_BACK * max(carrier.push[1] / carrier.speed for carrier in task.carriers)
    return task.moves[1] * longest


def _times(given: Mapping[str, Any], longest: float) -> tuple[float, int]:
    """Seconds for which an action is held, and how often; whole holds that last for the horizon at least."""
    horizon = _seconds("horizon", given.get("horizon"), longest)
    hold = _seconds("hold", given.get("hold"), horizon / HOLDS)
    if hold > horizon:
        raise GymError(f"hold: must be at most the horizon, {horizon:g}, not {hold:g}")
    return hold, count("horizon / hold", math.ceil(horizon / hold * (1.0 - 1e-12)), 1)


def _seconds(name: str, value: object, default: float) -> float:
    seconds = default if value is None else finite(name, value, GymError)
    if not seconds > 0.0:
        raise GymError(f"{name}: must be greater than 0, not {seconds:g}")
    return seconds


def _names(field: str, given: object, valid: tuple[str, ...]) -> tuple[str, ...]:
    if isinstance(given, str) or not isinstance(given, Sequence):
        raise GymError(f"{field}: must be a list of names, not {shown(given)}; valid: {listed(valid)}")
    for name in given:
        if name not in valid:
            raise GymError(f"{field}: unknown {shown(name)}{choices(name, valid)}")
    return tuple(name for name in valid if name in given)


def _reward(given: object) -> Reward:
    if given in ("progress", "sparse") or callable(given):
        return given
    raise GymError(f"reward: must be progress, sparse or a function of a transition, not {shown(given)}")


def _dtype(given: Any) -> type[np.floating[Any]]:
    try:
        name = np.dtype(given).name
    except TypeError:
        name = ""
    if name not in DTYPES:
        raise GymError(f"dtype: must be {' or '.join(DTYPES)}, not {shown(given)}")
    return np.float32 if name == "float32" else np.float64


def _truth(name: str, given: object) -> bool:
    if not isinstance(given, bool | np.bool_):
        raise GymError(f"{name}: must be true or false, not {shown(given)}")
    return bool(given)

"""The inputs under which models are compared: what a task leaves open, or what drives read."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from rungwise.kernel import Reals
from rungwise.planning.task.task import task_of
from rungwise.scene.contract import AnyScene
from rungwise.world.find import world_of

SPREAD = 0.5
"""Inputs are drawn within this part of their interval on either side of the scene's own value."""


@dataclass(frozen=True)
class Inputs:
    """Names (k,), least, greatest and own values (k,); `scheduled`: they are inputs of the scene,
    with `ramp` led from their own values to those given over the whole duration; otherwise parameters. They
    stay the same during a run."""

    names: tuple[str, ...]
    low: Reals
    high: Reals
    own: Reals
    scheduled: bool
    ramp: bool

    def draw(self, count: int, rng: np.random.Generator) -> Reals:
        """The scene's own inputs, and so many drawn: (1 + count, k)."""
        reach = SPREAD * (self.high - self.low)
        low, high = np.maximum(self.low, self.own - reach), np.minimum(self.high, self.own + reach)
        drawn = rng.uniform(low, high, (count if self.names else 0, len(self.names)))
        return np.concatenate([self.own[None], drawn])

    def options(self, values: Reals, times: Reals, duration: float) -> dict[str, Any]:
        """Inputs (m, k) as options of `rollout`, for segments that end at times (m, s)."""
        if not self.scheduled:
            return {"parameters": dict(zip(self.names, values.T, strict=True))}
        part = (times / duration if self.ramp else np.ones_like(times))[:, :, None]
        return {"inputs": (1.0 - part) * self.own + part * values[:, None], "ramp": self.ramp}

    def named(self, values: Reals) -> dict[str, float]:
        """Inputs (k,) by name."""
        return dict(zip(self.names, values.tolist(), strict=True))


def inputs_of(scene: AnyScene, parameters: dict[str, float]) -> Inputs:
    """What may be chosen in a scene: the inputs of its task, in the task's intervals; without a task its
    inputs, and without inputs the parameters that its drives read, from half to one and a half of their
    values."""
    if scene.file.task is not None and scene.template.inputs:
        task = task_of(scene, parameters)
        names = scene.template.inputs
        own = np.array([parameters[name] for name in names]).clip(task.low, task.high)
        return Inputs(names, task.low, task.high, own, True, task.by_place)
    chosen = scene.template.inputs or tuple(dict.fromkeys(world_of(scene).leading))
    rows = [(name, *_about(scene, name, parameters[name])) for name in chosen]
    rows = [row for row in rows if row[1] < row[2]]
    low, high = (np.array([row[k] for row in rows]).reshape(-1) for k in (1, 2))
    names = tuple(row[0] for row in rows)
    own = np.array([parameters[name] for name in names])
    scheduled = bool(names) and names == scene.template.inputs
    return Inputs(names, low, high, own, scheduled, False)


def _about(scene: AnyScene, name: str, value: float) -> tuple[float, float]:
    least, most = scene.file.parameters[name].range or (-math.inf, math.inf)
    low, high = sorted((0.5 * value, 1.5 * value))
    return max(low, least), min(high, most)

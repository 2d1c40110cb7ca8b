"""Spaces of observations and actions, finite in every component."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from gymnasium.spaces import Box
from numpy.typing import NDArray

from rungwise.gym.settings import Settings
from rungwise.kernel import Reals
from rungwise.scene.contract import AnyScene
from rungwise.scene.scene import FARTHEST


@dataclass(frozen=True)
class Observed:
    """What an observation consists of: names (o,), bounds low, high (o,), and the travel (2, n_q) of
    coordinates, infinite where there is none."""

    names: tuple[str, ...]
    low: Reals
    high: Reals
    travel: Reals
    dtype: type[np.floating[Any]]

    @property
    def space(self) -> Box:
        return Box(self.low.astype(self.dtype), self.high.astype(self.dtype), dtype=self.dtype)

    def fitted(self, values: Reals) -> NDArray[np.floating[Any]]:
        """Values (m, o) as observations: rounding may have carried a coordinate out of its travel."""
        return np.clip(values, self.low, self.high).astype(self.dtype)


def observed(settings: Settings, seen: tuple[str, ...], travel: Reals) -> Observed:
    """What observations consist of; `seen` are the parameters of the instance, travel (2, n_q) that of
    coordinates."""
    scene, template = settings.scene, settings.scene.template
    anything = (-math.inf, math.inf)
    ranges = [scene.file.parameters[name].range or anything for name in seen]
    parts: dict[str, list[tuple[str, float, float]]] = {
        "q": [(name, *pair) for name, pair in zip(template.coordinates, travel.T.tolist(), strict=True)],
        "v": [(f"speed({name})", *anything) for name in scene.template.velocities],
        "instance": [(name, *pair) for name, pair in zip(seen, ranges, strict=True)],
        "inputs": [(name, *_range(scene, name)) for name in template.inputs],
        "forces": [(f"force({a}, {b})", 0.0, math.inf) for a, b in template.contacts],
        "time": [("t", 0.0, math.inf)],
    }  # fmt: skip
    rows = [row for part in settings.observe for row in parts[part]]
    # What has no bound of its own lies where places may lie at all, as far as the type has such numbers.
    most = min(FARTHEST, float(np.finfo(settings.dtype).max))
    low, high = (np.clip([row[k] for row in rows], -most, most) for k in (1, 2))
    return Observed(tuple(row[0] for row in rows), low, high, travel, settings.dtype)


def _range(scene: AnyScene, name: str) -> tuple[float, float]:
    return scene.file.parameters[name].range or (-math.inf, math.inf)


def action_space(settings: Settings) -> Box:
    """-1 to 1 from the least to the greatest value of each input, or the values themselves."""
    low, high = settings.low, settings.high
    if settings.scaled:
        low, high = -np.ones(len(low)), np.ones(len(high))
    return Box(low.astype(settings.dtype), high.astype(settings.dtype), dtype=settings.dtype)

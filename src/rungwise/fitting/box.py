"""The box of parameters in which a fit searches, as a unit cube."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rungwise.errors import InputError
from rungwise.kernel import Ints, Reals
from rungwise.scene.fields.values import shown
from rungwise.simulation.threads import names_of
from rungwise.wording import choices

DECADES = 100.0
"""Of a positive range whose ends are so far apart the logarithm is searched: each decade counts alike."""


class Box(NamedTuple):
    """Names (k,), ends low and high (k,), and which are searched by their logarithm."""

    names: tuple[str, ...]
    low: Reals
    high: Reals
    logs: NDArray[np.bool_]

    @property
    def ends(self) -> dict[str, tuple[float, float]]:
        """The interval of each parameter."""
        pairs = zip(self.low.tolist(), self.high.tolist(), strict=True)
        return dict(zip(self.names, pairs, strict=True))

    def take(self, rows: Ints) -> Box:
        """Some of the parameters."""
        return Box(tuple(self.names[k] for k in rows), self.low[rows], self.high[rows], self.logs[rows])

    def values(self, unit: Reals) -> Reals:
        """Parameters (..., k) at places (..., k) of the cube."""
        with np.errstate(divide="ignore", invalid="ignore"):
            curved = self.low * (self.high / self.low) ** unit
        even = self.low + (self.high - self.low) * unit
        found = np.where(self.logs, curved, even)
        return np.asarray(np.clip(found, self.low, self.high))

    def unit(self, values: Reals) -> Reals:
        """Places (..., k) of the cube of parameters (..., k)."""
        with np.errstate(divide="ignore", invalid="ignore"):
            curved = np.log(values / self.low) / np.log(self.high / self.low)
        even = (values - self.low) / (self.high - self.low)
        return np.asarray(np.clip(np.where(self.logs, curved, even), 0.0, 1.0))


def box_of(
    scene: Any, over: Sequence[str], box: Mapping[str, tuple[float, float]] | None
) -> Box:  # fmt: skip
    """The box of parameters `over`: their ranges, or narrower ones that are given. Raises InputError."""
    names = names_of(scene, (over,) if isinstance(over, str) else tuple(over))
    for name in box or {}:
        if name not in names:
            raise InputError(f"box: {shown(name)} is not in `over`{choices(name, names)}")
    ends = []
    for name in names:
        low, high = scene.file.parameters[name].range or (-math.inf, math.inf)
        least, most = (box or {}).get(name, (low, high))
        if not low <= least < most <= high:
            raise InputError(f"box.{name}: must ascend within {low:g} to {high:g}, not {least:g} to {most:g}")
        if not math.isfinite(least + most):
            raise InputError(f"over: {name} has no finite range; give one, {name}=LOW:HIGH")
        ends.append((least, most))
    low_, high_ = np.array(ends, float).T
    with np.errstate(divide="ignore"):
        logs = (low_ > 0.0) & (high_ / np.maximum(low_, 1e-300) >= DECADES)
    return Box(names, low_, high_, logs)

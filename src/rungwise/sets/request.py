"""The request for a set: the box, the accuracy of runs, and the batch that answers."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from rungwise.kernel import Reals
from rungwise.models.ladder import Rung
from rungwise.scene.contract import AnyScene
from rungwise.sets.motions import Motions
from rungwise.sets.store import SetError
from rungwise.world.find import world_of

ACCURACY = 3e-3
"""Error allowed per step of a run, relative to the smallest shape of the scene. Chosen by trial."""
THETA = 1.0
"""Theta of the theta rule in runs: with 1, steps of controlled length are of second order on every rung."""
WIDE = 100.0
"""A range more than so many times the default is not searched as a whole; see `box_of`. Chosen by trial, to a
decade."""


def box_of(
    scene: AnyScene, over: Sequence[str], box: Mapping[str, tuple[float, float]] | None = None
) -> Reals:
    """Intervals (d, 2) of the parameters: as given, or their range, or, where the range is more than `WIDE`
    times the default, from 0 to twice the default within the range. Raises SetError."""
    intervals = []
    for name in over:
        declared = scene.file.parameters[name]
        low, high = declared.range if declared.range is not None else (-math.inf, math.inf)
        if box is not None and name in box:
            first, last = (float(x) for x in box[name])
            if not (math.isfinite(first) and math.isfinite(last) and low <= first < last <= high):
                raise SetError(
                    f"over: {name}={first:g}:{last:g} must be an interval within {low:g} to {high:g}"
                )
            low, high = first, last
        elif not high - low <= WIDE * abs(declared.default):
            if declared.default == 0.0:
                raise SetError(f"over: {name} needs an interval, {name}=LOW:HIGH")
            ends = sorted((0.0, 2.0 * declared.default))
            low, high = max(low, ends[0]), min(high, ends[1])
        intervals.append((low, high))
    return np.array(intervals)


def chosen(scene: AnyScene, over: Sequence[str], box: Mapping[str, tuple[float, float]]) -> dict[str, str]:
    """How `box_of` chooses the intervals that `box` leaves open, in words by name."""
    words = {}
    for name in over:
        declared = scene.file.parameters[name]
        low, high = declared.range if declared.range is not None else (-math.inf, math.inf)
        if name not in box:
            is_narrow = high - low <= WIDE * abs(declared.default)
            twice = f"up to twice its default, {declared.default:g}, for its range is wide"
            words[name] = "its range in the scene" if is_narrow else twice
    return words


def digest(scene: AnyScene) -> str:
    """Mark of all that a scene says."""
    return hashlib.sha256(scene.whole.encode()).hexdigest()[:16]


def smallest(scene: AnyScene, parameters: Mapping[str, float]) -> float:
    """Reach of the smallest shape that has a reach, at these parameters; 1 where no shape has."""
    return world_of(scene).at(parameters).smallest


def batch_of(
    scene: AnyScene,
    model: Rung,
    over: Sequence[str],
    request: Mapping[str, Any],
    threads: int | None,
) -> Motions:
    """The batch of runs that the request describes."""
    return Motions(
        scene, model, over, request["solutions"], parameters=request["parameters"], tol=request["accuracy"],
        theta=request["theta"], threads=threads,
    )  # fmt: skip

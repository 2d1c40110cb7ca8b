"""When measured bodies touch, by their places alone."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rungwise.fitting.measured.layout import Layout
from rungwise.scene.language.terms import ANGLE
from rungwise.world.find import world_of

NEAR = 5.0
"""A gap below so many deviations of a place is closed, and a body that moves less is at rest."""
CLOSED = 2e-2
"""The same as a part of the size of objects: marks and outlines are not known better."""


def within(scene: Any, layout: Layout) -> float:
    """The gap, and the way of a body, below which it touches, and rests."""
    dimensions = world_of(scene).place(None).dimensions()[0]
    places = [e for e, column in enumerate(layout.compared.plain) if dimensions[column] != ANGLE]
    sigma = float(np.max(layout.sigma[places], initial=0.0))
    return float(max(NEAR * sigma, CLOSED * world_of(scene).at().moved.size))


def touching(scene: Any, layout: Layout, given: Mapping[str, float]) -> list[NDArray[np.bool_]]:
    """For each trial, the frames (k,) at which bodies touch, or at which it is not known."""
    near, known = within(scene, layout), scene.parameters().keys()
    alike: dict[tuple[tuple[str, float], ...], list[int]] = {}
    for number, frames in enumerate(layout.trials):
        own = {name: value for name, value in frames.trial.parameters.items() if name in known}
        alike.setdefault(tuple(sorted((dict(given) | own).items())), []).append(number)
    found: list[NDArray[np.bool_]] = [np.ones(0, bool)] * len(layout.trials)
    for values, numbers in alike.items():
        place = world_of(scene).place(dict(values))
        q = np.concatenate([layout.trials[i].q for i in numbers])
        closed = ~np.isfinite(q).all(axis=1)
        gaps = place.geometry(np.ascontiguousarray(q[~closed]))[0]
        closed[~closed] = gaps.min(axis=1, initial=np.inf) <= near
        ends = np.cumsum([len(layout.trials[i].q) for i in numbers])[:-1]
        for number, part in zip(numbers, np.split(closed, ends), strict=True):
            found[number] = part
    return found


def touches(closed: Sequence[NDArray[np.bool_]]) -> float:
    """How often bodies come to touch in a trial, the median."""
    return float(np.median([int((part[1:] & ~part[:-1]).sum()) for part in closed]))

"""Ingredients of a world: what a diagnosis changes alone, and the numbers that go with it.

An ingredient is how motions are chosen, friction, restitution, the give of contacts, inertia, friction with
supports, and all other numbers. Each has an effective value: restitution, for example, is 0 where bodies have
no momentum to bounce with.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol, Self

import numpy as np
from numpy.typing import NDArray

from rungwise.kernel import Reals
from rungwise.models.ladder import Rung

if TYPE_CHECKING:
    import xarray

BALANCE, FRICTION, SUPPORT, COMPLIANCE, INERTIA, RESTITUTION, ACCURACY, OTHER = (
    "balance", "friction", "support", "compliance", "inertia", "restitution", "accuracy", "other numbers",
)  # fmt: skip
INGREDIENTS = (BALANCE, FRICTION, SUPPORT, COMPLIANCE, INERTIA, RESTITUTION, ACCURACY, OTHER)
CONDITIONS = ("goal", "unsafe", "doomed", "task")
"""Fields of a scene that do not change how bodies move."""
TOUCHES = 1e-3
"""Bodies that come nearer than this part of the size of what moves count as having met."""


class Variant(Protocol):
    """A scene at its parameters, on a rung, at an accuracy (the error allowed per step), taken apart into
    ingredients."""

    @property
    def scene(self) -> Any: ...
    @property
    def parameters(self) -> dict[str, float]: ...
    @property
    def model(self) -> Rung: ...
    @property
    def tol(self) -> float: ...

    def effective(self, ingredient: str) -> Any:
        """What the ingredient amounts to: plain values that are equal where it is the same."""

    def mixed(self, other: Self, taken: frozenset[str]) -> Self:
        """This variant, with the ingredients `taken` from the other, and without conditions."""


@dataclass(frozen=True)
class Motion:
    """Where objects were (k, n), weighted, at times (k,), and all else that was recorded then."""

    times: Reals
    places: Reals
    data: xarray.Dataset

    def at(self, times: Reals) -> Reals:
        """Places (m, n) at these times; at rest after the end."""
        columns = [np.interp(times, self.times, column) for column in self.places.T]
        return np.stack(columns, axis=1)

    def modes(self, times: Reals) -> NDArray[np.int8]:
        """Modes (m, points) of contact points in the steps that hold these times."""
        rows = np.searchsorted(self.times, times).clip(0, len(self.times) - 1)
        return np.asarray(self.data["mode"].values[rows])


@dataclass(frozen=True)
class Parting:
    """Two variants, their motions, when and at which body they part, and the size of what moves."""

    variants: tuple[Any, Any]
    motions: tuple[Motion, Motion]
    time: float
    body: str
    size: float


def of_body(parting: Parting) -> NDArray[np.bool_]:
    """Which coordinates (n,) are the body's own."""
    names = parting.variants[0].scene.template.coordinates
    return np.array([name.split(".")[0] == parting.body for name in names])


def speeds(parting: Parting) -> dict[str, Any]:
    """How fast the body is where the motions part."""
    own = of_body(parting)
    found = []
    for motion in parting.motions:
        k = int(np.searchsorted(motion.times, parting.time).clip(1, max(1, len(motion.times) - 1)))
        step = motion.times[k:][:1] - motion.times[k - 1]
        way = np.linalg.norm((motion.places[k:][:1] - motion.places[k - 1])[:, own])
        found.append(float(way / step[0]) if len(step) and step[0] > 0.0 else 0.0)
    return {"speed": found}


def accuracy(parting: Parting) -> dict[str, Any]:
    """The errors allowed per step."""
    return {"tol": [variant.tol for variant in parting.variants]}


def parameters(parting: Parting) -> dict[str, Any]:
    """Parameters that differ."""
    one, other = (variant.parameters for variant in parting.variants)
    return {name: [one[name], other[name]] for name in one if name in other and one[name] != other[name]}

"""Ingredients of a world: what a diagnosis changes alone, and the numbers that go with it.

An ingredient is how motions are chosen, friction, restitution, the give of contacts, inertia, friction with
supports, and all other numbers. Each has an effective value: restitution, for example, is 0 where bodies have
no momentum to bounce with.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Self, TypeAlias

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
ACTS = 1e-6
"""Entries of a certificate below this part of the greatest take no part in it."""


def acting(entries: Reals) -> NDArray[np.bool_]:
    """Which entries (n,) of a certificate, none of them negative, take part in it."""
    return np.asarray(entries > ACTS * entries.max(initial=0.0))


@dataclass(frozen=True)
class Variant(ABC):
    """A scene at its parameters, on a rung, at an accuracy (the error allowed per step), taken apart into
    ingredients, and put together from two."""

    scene: Any
    parameters: dict[str, float]
    model: Rung
    tol: float

    @abstractmethod
    def effective(self, ingredient: str) -> Any:
        """What the ingredient amounts to: plain values that are equal where it is the same."""

    @abstractmethod
    def resolved(self, friction: Self, support: Self, give: Self, bounce: Self) -> Any:
        """The scene without conditions, with numbers of contacts and supports from these variants."""

    def mixed(self, other: Self, taken: frozenset[str]) -> Self:
        """This variant, with the ingredients `taken` from the other, and without conditions."""
        of = {name: other if name in taken else self for name in INGREDIENTS}
        base, model, tol = of[OTHER], of[BALANCE].model, of[ACCURACY].tol
        if model.metric:
            return replace(base, scene=base.resolved(base, base, base, base), model=model, tol=tol)
        model = Rung(
            "hybrid", 3, "between two worlds", friction=of[FRICTION].model.friction,
            compliant=of[COMPLIANCE].model.compliant, inertia=of[INERTIA].model.inertia,
        )  # fmt: skip
        scene = base.resolved(of[FRICTION], of[SUPPORT], of[COMPLIANCE], of[RESTITUTION])
        return replace(base, scene=scene, model=model, tol=tol)


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


Evidence: TypeAlias = Callable[[Parting], dict[str, Any]]
"""Numbers that go with a cause."""


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


def overlaps(pairs: str) -> Evidence:
    """The deepest overlap where contacts yield, and whose; `pairs`: what motions call their contacts."""

    def overlap(parting: Parting) -> dict[str, Any]:
        yields, deepest, whose = [variant.model.compliant for variant in parting.variants], [], []
        for motion, soft in zip(parting.motions, yields, strict=True):
            gaps = np.fmin.reduce(motion.data["gap"].values, axis=0, initial=0.0)
            names = [str(name) for name in motion.data[pairs].values]
            whose.append(names[int(gaps.argmin())] if names else "")
            deepest.append(float(max(0.0, -gaps.min(initial=0.0))) if soft else 0.0)
        return {"contact": whose[int(np.argmax(deepest))], "overlap": deepest, "yields": yields}

    return overlap


def accuracy(parting: Parting) -> dict[str, Any]:
    """The errors allowed per step."""
    return {"tol": [variant.tol for variant in parting.variants]}


def parameters(parting: Parting) -> dict[str, Any]:
    """Parameters that differ."""
    one, other = (variant.parameters for variant in parting.variants)
    return {name: [one[name], other[name]] for name in one if name in other and one[name] != other[name]}


def evidence_of(
    own: Mapping[str, Evidence], parting: Parting, causes: Sequence[str]
) -> dict[str, dict[str, Any]]:
    """Numbers for each cause, plain values by name: those that a world's `own` functions give, and else what
    holds in all worlds."""
    known = {BALANCE: speeds, INERTIA: speeds, ACCURACY: accuracy, OTHER: parameters, **own}
    return {cause: known[cause](parting) for cause in causes if cause in known}

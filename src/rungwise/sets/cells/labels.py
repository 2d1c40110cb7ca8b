"""Labels of a set, and the outcomes that they stand for."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from enum import IntEnum
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from rungwise.content import ByContent
from rungwise.kernel import Ints, Reals
from rungwise.models.ladder import Rung
from rungwise.outcome import Code
from rungwise.plain import cut
from rungwise.scene.contract import AnyScene

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class Label(IntEnum):
    """Knowledge of a point. `DOOMED`: its run came to a state from which, by the scene's rule, no input
    reaches the goal. `INFEASIBLE`: its one run missed the goal, which says nothing about other inputs.

    A label is a number in arrays, and equal to its text ("feasible")."""

    FEASIBLE = 0
    INFEASIBLE = 1
    DOOMED = 2
    UNSAFE = 3
    JAMMED = 4
    INVALID = 5
    UNKNOWN = 6

    def __str__(self) -> str:
        return self.name.lower()

    def __eq__(self, other: object) -> bool:
        return str(self) == other if isinstance(other, str) else int(self) == other

    __hash__ = IntEnum.__hash__

    @classmethod
    def _missing_(cls, value: object) -> Label | None:
        return next((label for label in cls if str(label) == value), None)


LABELS = {
    Code.GOAL: Label.FEASIBLE,
    Code.MISSED: Label.INFEASIBLE,
    Code.TIMEOUT: Label.INFEASIBLE,
    Code.DOOMED: Label.DOOMED,
    Code.UNSAFE: Label.UNSAFE,
    Code.JAMMED: Label.JAMMED,
    Code.INVALID: Label.INVALID,
}
"""Label of each outcome; every other outcome leaves the point unknown."""

_TABLE = np.array([LABELS.get(code, Label.UNKNOWN) for code in sorted(Code)], np.int64)


def labels(outcomes: Ints) -> Ints:
    """Labels of outcomes' codes, of the same shape."""
    return np.asarray(_TABLE[outcomes])


@dataclass(frozen=True, eq=False)
class LabelledSet(ByContent, ABC):
    """Labels over a `box` (d, 2) of parameters or states, named by `over`, of a `scene` on a rung, `model`;
    and what can be asked of all such sets."""

    scene: AnyScene
    model: Rung
    over: tuple[str, ...]
    box: Reals

    @property
    @abstractmethod
    def unit(self) -> Reals:
        """Lengths (d,) of the set's unit along each axis."""

    @abstractmethod
    def _labels(self, places: Reals) -> Ints:
        """Labels of places (m, d) within the box, in units from its lower corner."""

    def _repr_html_(self) -> str:
        import rungwise

        found: Any = self
        return rungwise.to_html(found)

    def plot(self) -> Figure:
        """Slices over the first two parameters or states (see `rungwise.plot`)."""
        import rungwise

        found: Any = self
        return rungwise.plot(found)

    def classify(self, points: Reals) -> NDArray[np.str_]:
        """Labels (m,) of points (m, d), in the order of `over`; `unknown` outside the box.

        Raises ValueError for another shape.
        """
        return np.array([str(label) for label in Label])[self.labels(points)]

    def labels(self, points: Reals) -> Ints:
        """Labels of points as `classify`, but as values of `Label`."""
        points = np.asarray(points, np.float64)
        if points.ndim != 2 or points.shape[1] != len(self.over):
            raise ValueError(f"points: must have the shape (m, {len(self.over)}), not {points.shape}")
        inside = ((points >= self.box[:, 0]) & (points <= self.box[:, 1])).all(axis=1)
        result = np.full(len(points), int(Label.UNKNOWN))
        result[inside] = self._labels((points[inside] - self.box[:, 0]) / self.unit)
        return result


def bounds_of(found: LabelledSet) -> str:
    """The box of a set, in one short line."""
    sides = [f"{name} {low:.4g}..{high:.4g}" for name, (low, high) in zip(found.over, found.box, strict=True)]
    return cut(", ".join(sides), 200)

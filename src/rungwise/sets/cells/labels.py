"""Labels of a set, and the outcomes that they stand for."""

from __future__ import annotations

from enum import IntEnum
from typing import Protocol

import numpy as np

from rungwise.kernel import Ints, Reals
from rungwise.outcome import Code
from rungwise.plain import cut


class Boxed(Protocol):
    """What is over a box."""

    @property
    def over(self) -> tuple[str, ...]: ...

    @property
    def box(self) -> Reals: ...


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


def bounds_of(found: Boxed) -> str:
    """The box of a set, in one short line."""
    sides = [f"{name} {low:.4g}..{high:.4g}" for name, (low, high) in zip(found.over, found.box, strict=True)]
    return cut(", ".join(sides), 200)

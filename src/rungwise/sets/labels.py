"""Labels of a set, and the outcomes that they stand for."""

from __future__ import annotations

from enum import IntEnum

import numpy as np

from rungwise.kernel import Ints
from rungwise.outcome import Code


class Label(IntEnum):
    """Knowledge of a point. `DOOMED`: its run came to a state from which, by the scene's rule, no input
    reaches the goal. `INFEASIBLE`: its one run missed the goal, which says nothing about other inputs."""

    FEASIBLE = 0
    INFEASIBLE = 1
    DOOMED = 2
    UNSAFE = 3
    JAMMED = 4
    INVALID = 5
    UNKNOWN = 6

    def __str__(self) -> str:
        return self.name.lower()


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

"""Runs that are repeated at smaller errors per step, until what is asked of them is known well enough."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from rungwise.hierarchy.motions import BUDGET, Bench, Motions, apart
from rungwise.kernel import Ints, Reals
from rungwise.models.ladder import Rung

LONGER = 4.0
"""A run at a tenth of the error per step takes at most so many times as many steps; those that would exceed
the budget are not begun."""

PARTS = (1e-1, 1e-2, 1e-3, 1e-4)
"""Errors allowed per step, as parts of the accuracy asked for: the next where motions are not settled."""
ERROR = 0.01
"""Error of settled motions, as a part of the accuracy."""

Again = Callable[[Ints, float, bool], Motions]
"""Runs rows at an error per step; `halved`: with twice as many moments at which a step must end."""


class Settling:
    """Runs (m,) at the smallest error per step that was needed, or that was within the budget.

    motions; error (m,): how far the run before, at ten times the error per step and with other moments, is
    from it, infinite where there is none; tol (m,): the error per step.
    """

    def __init__(self, again: Again, count: int, levels: tuple[float, ...], budget: int) -> None:
        self._again, self._levels, self._budget = again, levels, budget
        self._level = np.zeros(count, int)
        self.motions = again(np.arange(count), levels[0], False)
        self.error = np.full(count, np.inf)
        self.tol = np.full(count, levels[0])
        self._open = self.motions.known.copy()

    def refine(self, wanted: NDArray[np.bool_]) -> bool:
        """Repeat those of the wanted runs (m,) that can be; whether there was any."""
        wanted = wanted & self._open & (self._level + 1 < len(self._levels))
        wanted &= self.motions.steps * LONGER <= self._budget
        for level in np.unique(self._level[wanted]):
            rows = np.flatnonzero(wanted & (self._level == level))
            found = self._again(rows, self._levels[level + 1], bool(level % 2 == 0))
            away = apart(found, self.motions.rows(rows))
            good = found.known
            kept = rows[good]
            for whole, part in zip(self.motions, found, strict=True):
                whole[kept] = part[good]
            self.error[kept], self.tol[kept] = away[good], self._levels[level + 1]
            self._level[rows] += 1
            self._open[rows[~good]] = False
        return bool(wanted.any())


def settle(bench: Bench, model: Rung, inputs: Reals, until: Reals, accuracy: float) -> Settling:
    """Runs (m,) of one model, whose errors are a small part of the accuracy where the budget allows it."""

    def again(rows: Ints, tol: float, halved: bool) -> Motions:
        return bench.run(model, inputs[rows], until[rows], tol, halved=halved)

    runs = Settling(again, len(inputs), tuple(accuracy * part for part in PARTS), BUDGET)
    while runs.refine(~(runs.error <= ERROR * accuracy)):
        pass
    return runs

"""The oracle of the tree: places -> parameters -> runs, by kept batches."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from rungwise.kernel import Ints, Reals
from rungwise.sets.labels import labels
from rungwise.sets.motions import Motions
from rungwise.sets.store import Log
from rungwise.sets.tree import BudgetSpent
from rungwise.simulation.batch import Results

KEPT = 4096
"""Runs of a batch that is kept whole."""


class Asker:
    """Answers in batches; `count` is the number of runs so far, `task` what they are for."""

    def __init__(
        self,
        batch: Motions,
        box: Reals,
        finest: int,
        budget: int,
        log: Log | None,
        on_progress: Callable[[str, int, int], None] | None,
    ) -> None:
        self._batch, self._log, self._budget, self._report = batch, log, budget, on_progress
        self._low, self._unit = box[:, 0], (box[:, 1] - box[:, 0]) / (1 << finest)
        self.count = 0
        self.task = ""

    def __call__(self, places: Reals) -> tuple[Ints, Reals]:
        if self.count + len(places) > self._budget:
            raise BudgetSpent
        points = self._low + places * self._unit
        outcomes, margins = np.zeros(len(points), np.int64), np.zeros(len(points))
        target = self.count + len(points)
        for at in range(0, len(points), KEPT):
            part = slice(at, at + KEPT)
            outcomes[part], margins[part] = self._ask(points[part], target)
            self.count += len(points[part])
        return labels(outcomes), margins

    def _ask(self, points: Reals, target: int) -> tuple[Ints, Reals]:
        kept = None if self._log is None else self._log.read(points)
        if kept is not None:
            return kept
        found: Results = self._batch.run(points, on_progress=lambda done: self._tell(done, target))
        if self._log is not None:
            self._log.write(points, found.outcome, found.margin)
        return found.outcome, found.margin

    def _tell(self, done: int, target: int) -> None:
        if self._report is not None:
            self._report(self.task, self.count + done, target)

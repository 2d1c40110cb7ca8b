"""The oracle of the tree: places -> parameters -> runs, by kept batches."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from typing import Protocol

import numpy as np

from rungwise.cluster import Answer
from rungwise.deadline import NEVER, Deadline
from rungwise.kernel import Ints, Reals
from rungwise.outcome import Code
from rungwise.sets.cells.labels import labels
from rungwise.sets.cells.tree import BudgetSpent
from rungwise.sets.motions import Motions
from rungwise.sets.store import Log

KEPT = 4096
"""Runs of a batch that is kept whole."""


class Runner(Protocol):
    """The interface of objects that run batches; `in_time` says whether they leave runs `running` when the
    deadline has come."""

    in_time: bool

    def answers(self, batches: Sequence[Reals], on_progress: Callable[[int], None]) -> Iterator[Answer]:
        """Run batches of points (m, d); each answer as soon as it is known, in any order.

        `on_progress` is called with the number of runs done beyond the answers given.
        """
        ...


class InProcess:
    """The threads of this process, one batch after the other; runs that the deadline ends are `running`."""

    in_time = True

    def __init__(self, batch: Motions, deadline: Deadline) -> None:
        self._batch, self._deadline = batch, deadline

    def answers(self, batches: Sequence[Reals], on_progress: Callable[[int], None]) -> Iterator[Answer]:
        for number, points in enumerate(batches):
            found = self._batch.run(points, deadline=self._deadline, on_progress=on_progress)
            yield number, found.outcome, found.margin


class Oracle:
    """Answers in batches; `count` is the number of runs so far, `task` their purpose. Raises BudgetSpent
    where that is spent, or the deadline has come; runs that are done then are kept."""

    def __init__(
        self,
        runner: Runner,
        box: Reals,
        finest: int,
        budget: int,
        log: Log | None,
        on_progress: Callable[[str, int, int], None] | None,
        deadline: Deadline = NEVER,
    ) -> None:
        self._runner, self._log, self._budget, self._report = runner, log, budget, on_progress
        self._low, self._unit = box[:, 0], (box[:, 1] - box[:, 0]) / (1 << finest)
        self._batches, self._ended, self.deadline = 0, False, deadline
        self.count = 0
        self.task = ""

    @property
    def keeps(self) -> bool:
        """Whether runs that are done are kept."""
        return self._log is not None

    def __call__(self, places: Reals) -> tuple[Ints, Reals]:
        if self._ended or self.count + len(places) > self._budget or self.deadline.is_over:
            raise BudgetSpent
        points = self._low + places * self._unit
        batches = [points[at : at + KEPT] for at in range(0, len(points), KEPT)]
        answers = self._known(batches)
        open_ = {k: np.flatnonzero(outcome == Code.RUNNING) for k, (outcome, _) in answers.items()}
        missing, target = [k for k, rows in open_.items() if len(rows)], self.count + len(points)
        self.count += len(points) - sum(len(open_[k]) for k in missing)
        for i, outcome, margin in self._runner.answers(
            [batches[k][open_[k]] for k in missing], lambda done: self._tell(done, target)
        ):
            k, rows = missing[i], open_[missing[i]]
            answers[k][0][rows], answers[k][1][rows] = outcome, margin
            done = len(rows) - int((outcome == Code.RUNNING).sum())
            if self._log is not None and done > 0:
                outcome, margin = answers[k]
                self._log.keep(self._batches + k, points=batches[k], outcome=outcome, margin=margin)
            if done < len(rows):
                self._ended = True
                raise BudgetSpent
            self.count += len(rows)
        self._batches += len(batches)
        outcomes, margins = np.zeros(len(points), np.int64), np.zeros(len(points))
        for number, (outcome, margin) in answers.items():
            part = slice(number * KEPT, (number + 1) * KEPT)
            outcomes[part], margins[part] = outcome, margin
        return labels(outcomes), margins

    def _known(self, batches: Sequence[Reals]) -> dict[int, tuple[Ints, Reals]]:
        """The kept answers to these batches; where there is none, runs are `running`."""
        answers = {}
        for k, points in enumerate(batches):
            kept = None if self._log is None else self._log.read(self._batches + k, points)
            none = np.full(len(points), int(Code.RUNNING)), np.full(len(points), math.nan)
            answers[k] = none if kept is None else kept
        return answers

    def _tell(self, done: int, target: int) -> None:
        if self.deadline.is_over and not self._runner.in_time:
            raise BudgetSpent
        if self._report is not None:
            self._report(self.task, self.count + done, target)

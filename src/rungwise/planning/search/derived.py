"""Models of moves from one derivative, that of a step as long as a move, beside those fitted to moves nearby.

The step is one of the quasistatic-compliant rung, whatever rung moves are run on: it tells which way objects
go, and runs tell how far. It takes a small part of the time of the moves that a fit needs, and none was run
before (Pang, Suh, Yang and Tedrake, 2023, arXiv 2206.10787).
"""

from __future__ import annotations

from collections import Counter
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from rungwise.kernel import Reals
from rungwise.planning.motion.moves import lasting
from rungwise.planning.task.task import Task
from rungwise.simulation.options import ModelError
from rungwise.world.find import world_of

if TYPE_CHECKING:
    from rungwise.simulation.derivatives.slopes import Slopes

NEAR = 0.05
"""Length over the objects' size within which contacts count as closed in the derivative."""
HELD = 0.5
"""The number of a move for its duration, where its inputs are steered."""


class Derived:
    """Linear models of a task's moves. made: how many; refused: why others have none, counted."""

    def __init__(self, task: Task) -> None:
        self._task = task
        self.made, self.refused = 0, Counter[str]()

    @cached_property
    def _slopes(self) -> Slopes | str:
        """The derivatives of the task's steps, or why there are none."""
        task = self._task
        h = float(lasting(task, np.array([HELD]))[0])
        try:
            return world_of(task.scene).slopes(task.parameters, h, NEAR * task.size)
        except ModelError as error:
            return str(error)

    def model(self, q: Reals, time: float, levels: Reals) -> Reals | None:
        """By how much objects come off (f, n), as `Task.off` counts it, as each free input goes over its
        range, from a place q (n,) with inputs `levels` (u,); None where there is no derivative."""
        task = self._task
        if isinstance(self._slopes, str):
            self.refused[self._slopes] += 1
            return None
        try:
            changes = self._slopes(q, time, levels, task.free, (task.high - task.low)[task.free])
        except ModelError as error:
            self.refused[str(error)] += 1
            return None
        self.made += 1
        return np.asarray(changes.T * task.weights)

"""What a search may spend: simulated steps, counted by stage.

Its parts are parts of these steps, so that a search does the same on any machine; time only ends it.
"""

from __future__ import annotations

import time as clock
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np

from rungwise.deadline import Deadline, TimeOver, seconds
from rungwise.kernel import Ints
from rungwise.models.ladder import Rung
from rungwise.outcome import Code
from rungwise.simulation.turns import TURN_S

SLOW = "too many steps"
"""What is said of moves that take more steps than a search waits for."""
UNBOUNDED = 1_250_000
"""Steps of which stages take their parts where a search has no bound."""
TOLD, OPEN = 6, 0.6
"""Moves after which a stage may be given up, and the part of them that then ends without a verdict."""
WITHOUT_VERDICT = (Code.UNSUPPORTED, Code.MODEL_INVALID, Code.INVALID, Code.NOT_CONVERGED)
"""Outcomes that leave open where a move leads."""


@dataclass(frozen=True)
class Stage:
    """A rung, `model`, and an accuracy: `tol` is the error allowed per step, as a part of the scene's
    size."""

    model: Rung
    tol: float

    def __str__(self) -> str:
        return f"{self.model.name} @ {self.tol:g}"


class Budget:
    """Simulated steps by stage, refused ones included, and outcomes of moves; `left`: whether there are
    more, and time is left of `limit` seconds. `tell` is called about ten times a second while runs go on."""

    def __init__(self, steps: int | None = None, limit: float | None = None) -> None:
        self.most, self.spent, self.outcomes = steps, Counter[str](), Counter[str]()
        self.end = Deadline(seconds(limit))
        self._moves, self._open = Counter[str](), Counter[str]()
        self._given_up = ""
        self.tell: Callable[[], None] = _nothing
        self._told = clock.monotonic()

    def look(self, _done: object = None) -> None:
        """Called again and again while runs go on. Raises TimeOver."""
        if not self.is_in_time():
            raise TimeOver("in a search")
        self.announce()

    def announce(self, _done: object = None) -> None:
        """Tell how far it is, about ten times a second."""
        if clock.monotonic() - self._told >= TURN_S:
            self.tell()
            self._told = clock.monotonic()

    def take(self, stage: Stage, steps: int, outcomes: Ints, slow: int = 0) -> None:
        """Count steps, and moves by their outcomes; so many more were `slow`, ended by a bound of steps."""
        self.spent[str(stage)] += steps
        if slow:
            self.outcomes[SLOW] += slow
        self._moves[str(stage)] += len(outcomes)
        for code, count in enumerate(np.bincount(outcomes)):
            if count:
                self.outcomes[Code(code).name.lower()] += int(count)
                self._open[str(stage)] += int(count) * (code in WITHOUT_VERDICT)

    @contextmanager
    def part(self, share: float, giving_up: Stage | None = None) -> Iterator[None]:
        """Allow only this part of the steps that are left, until the end of the context, of `UNBOUNDED` ones
        where they have no bound, so that all stages have their turns; and no more where most moves on a stage
        that may be given up end without a verdict."""
        most, spent, given_up = self.most, self.spent.total(), self._given_up
        self._given_up = given_up if giving_up is None else str(giving_up)
        self.most = spent + int(share * (UNBOUNDED if most is None else most - spent))
        try:
            yield
        finally:
            self.most, self._given_up = most, given_up

    @property
    def deadline(self) -> Deadline:
        """When the time is over, with a halt of its own."""
        return Deadline.at(self.end.ends)

    def within(self, steps: int | None) -> Budget:
        """Another budget, of so many steps, that ends when this one does."""
        other = Budget(steps)
        other.end = self.end
        return other

    @property
    def seconds(self) -> float | None:
        """The time that is left; None without a limit."""
        return self.end.seconds

    def extend(self, steps: int) -> None:
        """Allow so many steps from now on."""
        self.most = self.spent.total() + steps

    @property
    def ended(self) -> str:
        """Why nothing more may be tried, in words; empty if more may."""
        if self.most is not None and self.spent.total() >= self.most:
            return "the budget is spent"
        moves, without = self._moves[self._given_up], self._open[self._given_up]
        if self._given_up and moves >= TOLD and without > OPEN * moves:
            return "most moves end without a verdict"
        return "" if self.is_in_time() else "the time is over"

    def is_in_time(self) -> bool:
        """Whether time is left, whatever the steps."""
        return not self.end.is_over

    @property
    def left(self) -> bool:
        return not self.ended


def _nothing() -> None:
    """Tell nobody."""

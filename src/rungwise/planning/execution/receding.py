"""What of a plan is left while a policy follows it, and how its next part, one leg by contact modes or one
move, is proposed anew from where the world is measured to be."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Protocol

import numpy as np

from rungwise.deadline import TimeOver
from rungwise.kernel import Reals
from rungwise.planning.execution.feedback import Moves
from rungwise.planning.execution.remaining_legs import PIECE, Legs, in_pieces, legs_of
from rungwise.planning.execution.timed import Timed, timed
from rungwise.planning.modes.legs import is_placed
from rungwise.planning.modes.planner import ModePlanner
from rungwise.planning.motion.propagate import Predictor
from rungwise.planning.plan import Plan
from rungwise.planning.search.layout import counts_of, is_by_modes
from rungwise.planning.search.problem import Found, Work
from rungwise.simulation.inputs import Segment

PARTS = 20
"""Into how many pieces a segment of a plan without legs is cut, over which its bodies are expected."""


class Rest(Protocol):
    """The part of a plan that is left. midway: whether a part that runs may be proposed anew."""

    midway: bool

    def away(self, leg: int, here: Reals, expected: Reals, /) -> float:
        """How far objects are from a place (n,) where they are expected, in a leg of those that are left."""

    def leave(self, leg: int, labels: Sequence[str], /) -> int:
        """Drop the legs before this one, and return how many; where none is left, the last one stays.
        labels: of the segments that were made of the first that stays."""

    def anew(self, work: Work, levels: Reals) -> Timed | None:
        """The next part from where the work starts, after inputs (u,); None where nothing leads on. Raises
        TimeOver."""


class RecedingLegs(Legs):
    """Legs of a plan by contact modes, proposed anew one by one; the rest, or a new plan, where one fails."""

    midway = True

    def __init__(self, plan: Plan, nominal: Predictor, work: Work) -> None:
        super().__init__(plan, nominal, work.start)
        self._planner = ModePlanner(work)
        self._rest = self._left[:0]

    def away(self, leg: int, here: Reals, expected: Reals) -> float:
        assert self._planner is not None
        return self._planner.scene.ground(self._left[min(leg, len(self._left) - 1)]).away(here, expected)

    def leave(self, leg: int, labels: Sequence[str]) -> int:
        assert self._planner is not None
        first = min(leg, len(self._left) - 1)
        self._failed = 0 if 0 < leg == first else self._failed + 1
        self._left = self._left[first:].copy()
        if is_placed(labels):
            self._left[0] = self._planner.scene.going_on(self._left[0])
        return first

    def anew(self, work: Work, levels: Reals) -> Timed | None:
        planner = self._planner = ModePlanner(work, levels)
        planner.predictor = self._nominal
        found = self._led(planner, work)
        if found is None:
            return None
        self._left = np.concatenate([found.vectors, self._rest])
        course = found.course
        return self._timed(self._nominal, work, levels, course.segments, course.labels, course.counts)

    def _led(self, planner: ModePlanner, work: Work) -> Found | None:
        self._rest = self._left[:0]
        try:
            led = planner.next_leg(self._left, max(self._failed, 0))
        except TimeOver:
            return None
        if led is not None:
            node, self._rest = led
            return node.found
        return super()._led(planner, work)

    def _timed(
        self, predictor: Predictor, work: Work, levels: Reals, segments: Sequence[Segment],
        labels: Sequence[str], counts: Sequence[int],
    ) -> Timed:  # fmt: skip
        longest = PIECE * work.task.size / work.task.fastest
        names = work.task.scene.template.inputs
        pieces = in_pieces(names, levels, segments, labels, legs_of(counts), longest)
        return timed(predictor, work.task, work.start, levels, *pieces)


class RecedingMoves(Moves):
    """Moves of a plan: the rest is repaired at the end of each, or found anew."""

    midway = False

    def __init__(self, plan: Plan, nominal: Predictor, work: Work) -> None:
        super().__init__(plan, nominal, work)
        self._task = work.task

    def away(self, _leg: int, here: Reals, expected: Reals) -> float:
        return float(self._task.away(here[None], expected)[0])

    def leave(self, leg: int, _labels: Sequence[str]) -> int:
        self._left = self._left[leg:]
        return leg

    def anew(self, work: Work, levels: Reals) -> Timed | None:
        course = self.next(work, levels)
        if course is None:
            return None
        return self._timed(self._nominal, work, levels, course.segments, course.labels, course.counts)

    def _timed(
        self, predictor: Predictor, work: Work, levels: Reals, segments: Sequence[Segment],
        labels: Sequence[str], counts: Sequence[int],
    ) -> Timed:  # fmt: skip
        longest = max(each.duration for each in segments) / PARTS
        names = work.task.scene.template.inputs
        pieces = in_pieces(names, levels, segments, labels, legs_of(counts), longest)
        return timed(predictor, work.task, work.start, levels, *pieces)


def rest_of(plan: Plan, nominal: Predictor, work: Work) -> RecedingLegs | RecedingMoves:
    """All of a plan."""
    return (
        RecedingLegs(plan, nominal, work) if is_by_modes(plan.labels) else RecedingMoves(plan, nominal, work)
    )


def whole(plan: Plan, work: Work) -> Timed:
    """The plan as it is, with bodies where its run expects them."""
    assert plan.stage is not None
    names, (rows, _) = plan.scene.template.inputs, plan.levels()
    segments = [
        replace(segment, inputs=dict(zip(names, row.tolist(), strict=True)))
        for segment, row in zip(plan.segments, rows, strict=True)
    ]
    before = np.array([plan.parameters[name] for name in names])
    found = timed(
        work.predictor(plan.stage), work.task, work.start, before, segments, plan.labels,
        legs_of(counts_of(plan.labels)),
    )  # fmt: skip
    states = plan.replay().states
    return found._replace(
        path=np.array([state.q for state in states]), times=np.array([state.time for state in states])
    )

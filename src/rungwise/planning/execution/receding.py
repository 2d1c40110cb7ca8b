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
from rungwise.planning.modes.hands.beside import beside
from rungwise.planning.modes.hands.gaits import hand_in
from rungwise.planning.modes.hands.hand import Hand
from rungwise.planning.modes.legs import is_placed
from rungwise.planning.modes.planner import ModePlanner
from rungwise.planning.motion.propagate import Predictor
from rungwise.planning.plan import Plan
from rungwise.planning.search.layout import counts_of, is_by_modes
from rungwise.planning.search.problem import Found, Work
from rungwise.simulation.inputs import Segment

PARTS = 20
"""Into how many pieces a segment of a plan without legs is cut, over which its bodies are expected."""
AFRESH, ASTRAY_BY_HAND = 0.02, 0.25
"""How far from where it is expected, in parts of the size, an object may be as a leg begins, or what is left
is proposed anew; the same of one that a hand leads, whose fingers keep to it."""
RESTS = 0.02
"""How far an object is to go in a move of a hand, in parts of the size, while it counts as resting."""


class Rest(Protocol):
    """The part of a plan that is left. before: inputs (u,) at its beginning; midway: whether a part that
    runs may be proposed anew; closes: whether contacts that are expected are closed where it is; astray: how
    far objects may be from where they are expected as a leg begins, in parts of the size."""

    before: Reals
    midway: bool
    closes: bool
    astray: float

    def away(self, leg: int, here: Reals, expected: Reals, /) -> float:
        """How far objects are from a place (n,) where they are expected, in a leg of those that are left."""

    def leave(self, leg: int, labels: Sequence[str], /) -> int:
        """Drop the legs before this one, and return how many; where none is left, the last one stays.
        labels: of the segments that were made of the first that stays."""

    def fitted(self, part: Timed, leg: int, here: Reals, expected: Reals, /) -> Timed:
        """A part with inputs of the leg that begins which suit a place (n,) that differs from the expected
        one."""

    def anew(self, work: Work, levels: Reals) -> Timed | None:
        """The next part from where the work starts, after inputs (u,); None where nothing leads on. Raises
        TimeOver."""


class RecedingLegs(Legs):
    """Legs of a plan by contact modes, proposed anew one by one; the rest, or a new plan, where one fails."""

    midway, closes, astray = True, True, AFRESH

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

    def fitted(self, part: Timed, _leg: int, _here: Reals, _expected: Reals) -> Timed:
        return part

    def anew(self, work: Work, levels: Reals) -> Timed | None:
        planner = self._planner = ModePlanner(work, levels)
        planner.predictor = self._nominal
        found = self._led(planner, work) or self._let_go(planner)
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

    def _let_go(self, planner: ModePlanner) -> Found | None:
        """Where nothing leads on from where fingers touch an object, they leave it, and what is left follows
        from where it rests: it may lean on them, and they may be where no leg begins."""
        node, self._rest = planner.let_go(), self._left
        return None if node is None else node.found

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

    midway, closes, astray = False, True, AFRESH

    def __init__(self, plan: Plan, nominal: Predictor, work: Work) -> None:
        super().__init__(plan, nominal, work)
        self._task = work.task

    def away(self, _leg: int, here: Reals, expected: Reals) -> float:
        return float(self._task.away(here[None], expected)[0])

    def leave(self, leg: int, _labels: Sequence[str]) -> int:
        self._left = self._left[leg:]
        return leg

    def fitted(self, part: Timed, _leg: int, _here: Reals, _expected: Reals) -> Timed:
        return part

    def anew(self, work: Work, levels: Reals) -> Timed | None:
        course = self.next(work, levels)
        if course is None:
            return None
        self._left = np.concatenate([self.made, self._left])
        return self._timed(self._nominal, work, levels, course.segments, course.labels, course.counts)

    def _timed(
        self, predictor: Predictor, work: Work, levels: Reals, segments: Sequence[Segment],
        labels: Sequence[str], counts: Sequence[int],
    ) -> Timed:  # fmt: skip
        longest = max(each.duration for each in segments) / PARTS
        names = work.task.scene.template.inputs
        pieces = in_pieces(names, levels, segments, labels, legs_of(counts), longest)
        return timed(predictor, work.task, work.start, levels, *pieces)


class RecedingCycles(RecedingMoves):
    """Moves of a hand: fingers keep to the object where it is not quite where it is expected; what is left is
    found anew where it went far from there, and where the goal is missed. Fingers on opposite sides of an
    object cannot all be closed by moving it."""

    closes, astray = False, ASTRAY_BY_HAND

    def __init__(self, plan: Plan, nominal: Predictor, work: Work, hand: Hand) -> None:
        super().__init__(plan, nominal, work)
        self._keeping, self._seen = hand, (work.start.q[0], work.start.q[0])

    def fitted(self, part: Timed, leg: int, here: Reals, expected: Reals) -> Timed:
        """Fingers go to where they are to touch the object as it is, and lead it from there as planned: while
        it is led, they do not follow it where it stays behind."""
        own = np.flatnonzero(part.legs == leg)
        planned = part.expected(float(part.ends[own[-1] + 1]))
        if self.away(leg, planned, part.expected(float(part.ends[own[0]]))) < RESTS * self._task.size:
            self._seen = expected, here
        rows = part.rows.copy()
        rows[own + 1] = beside(self._keeping, rows[own + 1], planned, *self._seen)
        rows[own + 1] = np.clip(rows[own + 1], self._task.low, self._task.high)
        return part._replace(rows=rows)

    def anew(self, work: Work, levels: Reals) -> Timed | None:
        self._seen = work.start.q[0], work.start.q[0]
        return super().anew(work, levels)


def rest_of(plan: Plan, nominal: Predictor, work: Work) -> Rest:
    """All of a plan."""
    if is_by_modes(plan.labels):
        return RecedingLegs(plan, nominal, work)
    hand = hand_in(work)
    if hand is None:
        return RecedingMoves(plan, nominal, work)
    return RecedingCycles(plan, nominal, work, hand)


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

"""What is left of a plan by contact modes while it is executed: its legs, proposed anew from where the object
really is.

The plan is run as it is, piece by piece, as long as the object keeps to the way on which the planner expects
it. Where it leaves that way, or misses the goal in the end, the running leg and those after it are proposed
anew from there; a new search follows only where they do not lead to the goal.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from rungwise.deadline import TimeOver
from rungwise.kernel import Ints, Reals
from rungwise.outcome import Code
from rungwise.planning.modes.legs import is_placed
from rungwise.planning.modes.planner import AGAIN, ATTEMPTS, ModePlanner
from rungwise.planning.motion.propagate import GOES_ON, Places, Predictor
from rungwise.planning.plan import Plan
from rungwise.planning.search.layout import FOLLOW, TOUCH, Course, counts_of
from rungwise.planning.search.problem import Found, Work
from rungwise.simulation.inputs import Segment

ASTRAY = 0.05
"""How far from where it is expected, in parts of the size, an object may be, and no farther."""
LED = (TOUCH, FOLLOW)
"""Labels of segments in which fingers lead the object, which are followed piece by piece."""
PIECE = 0.1
"""How long a piece of a leg takes at most, in parts of the time in which the fastest finger goes the size."""


class Schedule(NamedTuple):
    """Segments that are left, in pieces, with their labels, to which of the legs that are left each belongs
    (s,), and where the planner expects bodies (n,) at the ends of those that it knows to end."""

    segments: tuple[Segment, ...]
    labels: tuple[str, ...]
    legs: Ints
    path: list[Reals]


class Legs:
    """The legs of a plan that are left in one execution; before: inputs (u,) at its beginning."""

    def __init__(self, plan: Plan, nominal: Predictor, start: Places) -> None:
        """Begin with the plan as it is, which the planner expects to begin at this place."""
        self.before = np.array([plan.parameters[name] for name in plan.scene.template.inputs])
        self._nominal, self._left = nominal, plan.moves
        self._planner: ModePlanner | None = None
        self._plan: tuple[Plan, Places] | None = (plan, start)
        self._now: Schedule | None = None
        self._failed = -1

    def next(self, work: Work, levels: Reals) -> Course | None:
        """What is left from where the world is, after inputs `levels` (u,), in pieces; None where nothing is
        known that leads on."""
        self._planner = ModePlanner(work, levels)
        self._planner.predictor = self._nominal
        if self._plan is not None:
            (plan, start), self._plan = self._plan, None
            own = plan.segments, plan.labels, counts_of(plan.labels)
        else:
            start, found = work.start, self._led(self._planner, work)
            if found is None:
                return None
            self._left = found.vectors
            own = found.course.segments, found.course.labels, found.course.counts
        now = self._now = self._in_pieces(work, start, levels, *own)
        return Course(
            now.segments, now.labels, (len(now.segments),), (start,), inputs_of(now.segments)[-1], 0.0,
            Code.MISSED,
        )  # fmt: skip

    def went(self, places: Sequence[Reals]) -> int:
        """After how many segments the object, which was at these places (n,) at their ends, left the way that
        was expected; all where it did not. What is left is proposed anew from there."""
        now, planner = self._now, self._planner
        assert now is not None and planner is not None
        size, scene, count = planner.work.task.size, planner.scene, len(places)
        for k, (here, expected) in enumerate(zip(places, now.path, strict=False)):
            if scene.ground(self._left[now.legs[k]]).away(here, expected) > ASTRAY * size:
                count = k + 1
                break
        running = int(now.legs[count - 1]) if count else 0
        self._failed = 0 if running else self._failed + 1
        of_leg = [label for label, leg in zip(now.labels[:count], now.legs, strict=False) if leg == running]
        self._left = self._left[running:].copy()
        if is_placed(of_leg):
            self._left[0] = scene.going_on(self._left[0])
        return count

    def _led(self, planner: ModePlanner, work: Work) -> Found | None:
        """The legs that are left, without the first ones where they do not come to the goal, or new ones,
        at once where the same leg failed in all manners; else those that come nearest to it."""
        try:
            for first in range(len(self._left) if self._failed < len(AGAIN) else 0):
                found = planner.led_again(self._left[first:], self._failed)
                if found is not None:
                    return found
            while work.budget.left:
                found = planner.search(ATTEMPTS)
                if found is not None:
                    return found
        except TimeOver:
            pass  # the nearest that was found is made
        node = min(planner.nodes, key=lambda each: each.lack)
        return node.found if node.counts and node.outcome in GOES_ON else None

    def _in_pieces(
        self, work: Work, start: Places, levels: Reals, segments: Sequence[Segment], labels: Sequence[str],
        counts: Sequence[int],
    ) -> Schedule:  # fmt: skip
        """The same inputs over time, after inputs `levels` (u,), where fingers lead the object in pieces."""
        assert self._planner is not None
        longest = PIECE * work.task.size / max(f.carrier.speed for f in self._planner.scene.fingers)
        found, named, legs = in_pieces(
            work.task.scene.template.inputs, levels, segments, labels, legs_of(counts), longest, LED
        )
        path = [place.q[0] for place in run_pieces(self._nominal, start, found)[1]]
        return Schedule(tuple(found), tuple(named), legs, path)


def in_pieces(
    names: Sequence[str], levels: Reals, segments: Sequence[Segment], labels: Sequence[str],
    of_legs: Ints, longest: float, cut: Sequence[str] | None = None,
) -> tuple[list[Segment], list[str], Ints]:  # fmt: skip
    """The same inputs over time, after inputs `levels` (u,), where segments with the labels to `cut`, or all,
    take no longer than `longest`; their labels, and to which of the legs (s,) they belong."""
    rows = [levels, *inputs_of(segments)]
    found, named, legs = list[Segment](), list[str](), list[int]()
    for segment, label, leg, (a, b) in zip(segments, labels, of_legs, pairwise(rows), strict=True):
        is_cut = cut is None or label in cut
        count = max(1, math.ceil(segment.duration / longest)) if is_cut else 1
        for k in range(count):
            own = b - (count - k - 1) / count * (b - a) if segment.ramp else b
            inputs = dict(zip(names, own.tolist(), strict=True))
            found.append(replace(segment, inputs=inputs, duration=segment.duration / count))
        named += [label] * count
        legs += [int(leg)] * count
    return found, named, np.array(legs, np.int64)


def legs_of(counts: Sequence[int]) -> Ints:
    """To which leg each segment (s,) belongs, where legs have so many."""
    return np.repeat(np.arange(len(counts)), counts)


def run_pieces(
    world: Predictor, now: Places, segments: Sequence[Segment]
) -> tuple[Code, list[Places], Places]:
    """How segments end, the places at the ends of those that ended, and where the run ends."""
    durations = np.array([[segment.duration for segment in segments]])
    ends = world.run(
        now,
        inputs_of(segments)[None],
        durations,
        ramps=tuple(segment.ramp for segment in segments),
        patient=True,
    )
    one: Ints = np.zeros(1, np.int64)
    return (
        Code(int(ends.outcome[0])), [ends.at(k, one) for k in range(int(ends.switches[0]))], ends.places,
    )  # fmt: skip


def inputs_of(segments: Sequence[Segment]) -> Reals:
    """Inputs (s, u) of segments that name all of them."""
    return np.array([list(segment.inputs.values()) for segment in segments])

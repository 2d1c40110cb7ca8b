"""Plans for goals that ask where a robot's own body is: through free space to where it leaves the goal
straight, and from there into it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from rungwise.kernel import Reals
from rungwise.outcome import Code
from rungwise.planning.modes.reach.arm import Arm, arm_of, turn_between
from rungwise.planning.modes.reach.moves import (
    ENTER,
    ENTERS,
    FREE,
    PACE,
    Ramp,
    beyond,
    hold,
    ramps,
    shifted,
)
from rungwise.planning.modes.reach.places import Entry, Room
from rungwise.planning.motion.propagate import GOES_ON, Places, Predictor
from rungwise.planning.search.layout import Course
from rungwise.planning.search.problem import Found, Work
from rungwise.simulation.inputs import Segment

BEYOND = 0.5
"""How far targets go on beyond the goal, in parts of the size: servos yield, and
the goal may be farther than it is believed to be."""
SLOWER = (1.0, 3.0)
"""How many times as slowly bodies enter the goal, in turn."""
RINGS, AROUND = (0.02, 0.05, 0.1), 6
"""Distances, in parts of the size, and directions of shifts with which the goal is entered where it cannot
be entered straight."""
TILTS = (0.03, 0.08)
"""Turns, in radians, in the same manner."""
WAITS = 3
"""Waits after an entry, in which the goal may come to hold."""
REACH, ENTRIES, TRIED = "arm", "ways into the goal", "ways into the goal that were tried"
"""By which the arm, and the ways into the goal, are kept for all stages, and how many of these a stage
tried."""
DRAWN, GOALS = "draws of places at the goal", "places of the arm at the goal"
"""By which their number, and those that no way was sought to yet, are kept."""
ROOMS = 2
"""Draws of places at the goal after which it counts as one that nothing can reach without overlap."""
NO_PLACE = "no place at the goal was found at which the arm overlaps nothing"
NO_WAY_OUT = "no straight way out of the goal"
NO_PATH = "no path for the arm to the goal"


class Approach(NamedTuple):
    """A way of the arm: through free space (k, n_q), and on into the goal."""

    way: Reals
    entry: Entry


class Node(NamedTuple):
    """Where a plan has come to: places, inputs (u,), and the segments that led there, with the work of
    drives."""

    places: Places
    levels: Reals
    segments: tuple[Ramp, ...]
    work: float
    outcome: Code


def reach_in(work: Work) -> Arm | None:
    """The arm of a task whose goal asks where a robot's own body is, sought once; None where it does not."""
    if REACH not in work.kept:
        work.kept[REACH] = arm_of(work.task, work.start.q[0])
    found: Arm | None = work.kept[REACH]
    return found


def by_reach(work: Work, predictor: Predictor, arm: Arm) -> Found | None:
    """A plan that leads the arm into the goal. Raises TimeOver."""
    tried = f"{TRIED} {predictor.stage}"
    for approach in _approaches(work, arm, work.kept.get(tried, 0)):
        work.kept[tried] = work.kept.get(tried, 0) + 1
        found = Reaching(work, predictor, arm, approach).found()
        if found is not None:
            return found
        if not work.budget.left:
            break
    return None


def _approaches(work: Work, arm: Arm, tried: int) -> Iterator[Approach]:
    """Ways into the goal, kept for all stages: known ones that were not yet tried on a stage, and new ones
    once none is left."""
    known: list[Approach] = work.kept.setdefault(ENTRIES, [])
    if tried < len(known):
        yield from known[tried:]
        return
    in_time, start = work.budget.is_in_time, work.start.q[0]
    room, goals = Room(arm, start), work.kept.pop(GOALS, [])
    goals = goals or _goals(work, room)
    if not goals:
        work.failures[NO_PLACE] += 1
    for k, goal in enumerate(goals):
        entries = room.entries(goal)
        if not entries:
            work.failures[NO_WAY_OUT] += 1
        for entry in entries:
            way = room.way(start, entry.places[0], work.seed + k, in_time)
            if way is None:
                work.failures[NO_PATH] += 1
                continue
            known.append(Approach(way, entry))
            yield known[-1]


def has_room(work: Work, arm: Arm) -> bool:
    """Whether a place at the goal was found at which nothing overlaps; the search begins with it."""
    room = Room(arm, work.start.q[0])
    for _ in range(ROOMS):
        work.kept[GOALS] = _goals(work, room)
        if work.kept[GOALS] or not work.budget.is_in_time():
            return True
    return False


def _goals(work: Work, room: Room) -> list[Reals]:
    """Places (n_q,) at the goal, others each time."""
    number = work.kept[DRAWN] = work.kept.get(DRAWN, -1) + 1
    return room.goals(np.random.default_rng([work.seed, number]), work.budget.is_in_time)


class Reaching:
    """One way into the goal, run on a stage."""

    def __init__(self, work: Work, predictor: Predictor, arm: Arm, approach: Approach) -> None:
        self._work, self._predictor, self._arm, self._approach = work, predictor, arm, approach
        self._last = approach.entry.places[1:]
        if len(self._last):
            length = BEYOND * work.task.size
            count = max(1, round(length / _step(arm, approach.entry)))
            on = beyond(arm, approach.entry.places, approach.entry.direction, length, count)
            self._last = np.vstack([self._last, on])

    def found(self) -> Found | None:
        """The plan, by the first of the ways to enter that comes to the goal. Raises TimeOver."""
        before = self._approached()
        if before is None or before.outcome == Code.GOAL:
            return None if before is None else self._plan(before)
        if not len(self._last):
            self._work.failures["at the goal's place, but other terms of the goal fail"] += 1
            return None
        for segments in self._entered(before, self._lag(before)):
            if not self._work.budget.left:
                return None
            after = self._run(before, segments)
            if after is not None and after.outcome == Code.GOAL:
                return self._plan(after)
        return None

    def _approached(self) -> Node | None:
        """Where the arm is before it enters the goal."""
        work, arm = self._work, self._arm
        begun = Node(work.start, work.task.before, (), 0.0, Code.MISSED)
        way = ramps(arm, self._approach.way[1:], begun.levels, FREE, PACE)
        last = way[-1].levels if way else begun.levels
        return self._run(begun, [*way, hold(arm, last)])

    def _lag(self, node: Node) -> Reals:
        """By how much the joints' targets (k,) are to differ so that bodies come to where they are to be."""
        arm, wanted = self._arm, self._approach.entry.places[0]
        aims, now = arm.poses(wanted), arm.poses(node.places.q[0])
        off = (aims[:, :3] - now[:, :3]).mean(axis=0)
        turns = [turn_between(a, b) for a, b in zip(now[:, 3:], aims[:, 3:], strict=True)]
        return shifted(arm, wanted, off, np.mean(turns, axis=0))

    def _entered(self, before: Node, lag: Reals) -> Iterator[list[Ramp]]:
        """Ways to enter the goal: straight, more slowly, shifted, and tilted."""
        for slower in SLOWER:
            yield from self._line(before, lag, slower)
        for by, turn in self._shifts():
            own = shifted(self._arm, self._approach.entry.places[0], by, turn)
            yield from self._line(before, lag + own, 1.0)

    def _line(self, before: Node, shift: Reals, slower: float) -> Iterator[list[Ramp]]:
        """The straight way into the goal with shifted targets (k,)."""
        arm, pace = self._arm, ENTERS / slower
        first = ramps(arm, self._approach.entry.places[:1], before.levels, ENTER, pace, shift)
        begun = first[-1].levels if first else before.levels
        line = ramps(arm, self._last, begun, ENTER, pace, shift)
        if line:
            still = [hold(arm, line[-1].levels)] * WAITS
            yield [*first, *([hold(arm, begun)] if first else []), *line, *still]

    def _shifts(self) -> Iterator[tuple[Reals, Reals]]:
        """Shifts (3,) across the way, and turns (3,), from small ones to great ones."""
        across = np.linalg.svd(self._approach.entry.direction[None])[2][1:]
        ring = [np.array([np.cos(a), np.sin(a)]) @ across for a in np.arange(AROUND) * 2.0 * np.pi / AROUND]
        for k in range(max(len(RINGS), len(TILTS))):
            for way in ring:
                if k < len(RINGS):
                    yield RINGS[k] * self._work.task.size * way, np.zeros(3)
                if k < len(TILTS):
                    yield np.zeros(3), TILTS[k] * way

    def _run(self, node: Node, segments: Sequence[Ramp]) -> Node | None:
        """Where segments lead from a node; None where nothing may follow. Raises TimeOver."""
        work = self._work
        run = self._predictor.run(
            node.places, np.array([[each.levels for each in segments]]),
            np.array([[each.duration for each in segments]]), ramps=(True,) * len(segments), patient=True,
        )  # fmt: skip
        outcome, places = Code(int(run.outcome[0])), run.places
        lack = 0.0 if outcome == Code.GOAL else float(work.lack(places)[0])
        work.came_near(lack, places.q[0])
        if outcome != Code.GOAL and outcome not in GOES_ON:
            work.failures[f"{outcome.name.lower()} on {self._predictor.stage.model.name}"] += 1
            return None
        return Node(
            places, segments[-1].levels, (*node.segments, *segments), node.work + float(run.work[0]), outcome
        )

    def _plan(self, node: Node) -> Found:
        """The plan that led to a node; it goes on after the goal holds, for it may hold later elsewhere."""
        work, names = self._work, self._work.task.scene.template.inputs
        segments = tuple(
            Segment(dict(zip(names, each.levels.tolist(), strict=True)), each.duration, None, True)
            for each in node.segments
        )
        course = Course(
            segments, tuple(each.label for each in node.segments), (len(segments),), (node.places,),
            node.levels, node.work, node.outcome,
        )  # fmt: skip
        return Found(course, np.zeros((0, work.moves.size)))


def _step(arm: Arm, entry: Entry) -> float:
    """How far bodies go from one place of an entry to the next."""
    ends = arm.poses(entry.places[0])[:, :3], arm.poses(entry.places[-1])[:, :3]
    return float(np.linalg.norm(ends[1] - ends[0], axis=1).max()) / (len(entry.places) - 1)

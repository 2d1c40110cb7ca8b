"""Robots on their way through free space, between pushes: the geometric rung, by OMPL.

Straight ways that are free are taken as they are; others are grown by OMPL and pulled tight (`free_paths`).
All other bodies hold still.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping

import numpy as np
from numpy.typing import NDArray

from rungwise.kernel import Reals
from rungwise.planning.motion.free_paths import CHECKS, always, grown, is_clear, shortened
from rungwise.planning.task.task import Task
from rungwise.world.carriers import Carrier, Surroundings
from rungwise.world.contract import OBJECT
from rungwise.world.find import world_of
from rungwise.world.margins import Question

NEAR = 0.25
"""Part of the clearance that robots keep on their way."""
DIRECTIONS = 32
"""Directions tried away from what a robot touches."""


def over_objects(task: Task, raised: Collection[str]) -> set[int]:
    """The contacts of the scene that robots do not make while they are raised."""
    roles = world_of(task.scene).roles(task.parameters)
    return {
        k for k, pair in enumerate(task.scene.template.contacts)
        if any(robot in raised and roles[other] == OBJECT for robot, other in (pair, pair[::-1]))
    }  # fmt: skip


class Transit:
    """Ways of a task's carriers between places, with all else where it is; within the least and greatest
    places (2, 2) of some of their bodies. Those that are raised pass over objects. `around`, if it is known,
    answers for whole ways."""

    def __init__(
        self, task: Task, question: Question, within: Mapping[str, Reals], raised: Collection[str] = (),
        around: Surroundings | None = None,
    ) -> None:  # fmt: skip
        self._task, self._question, self._within, self._around = task, question, within, around
        self._columns = [place for carrier in task.carriers for place in carrier.places]
        contacts, names = task.scene.template.contacts, {carrier.body for carrier in task.carriers}
        over = over_objects(task, raised)
        self._own = [k for k, pair in enumerate(contacts) if names & set(pair) and k not in over]
        self._clearance = min((carrier.clearance for carrier in task.carriers), default=0.0)

    def way(self, q: Reals, goal: Reals, seed: int, in_time: Callable[[], bool] = always) -> Reals | None:
        """Places (k, n) from q (n,) to the goal (n,), both included, sought while there is time; None where
        no way was found."""
        begun = self.away(q)
        if begun is not q:
            rest = self.way(begun, goal, seed, in_time)
            return None if rest is None else np.vstack([q, rest])
        ends = np.stack([q, goal])
        least = min(NEAR * self._clearance, 0.5 * float(self._gaps(ends).min(initial=math.inf)))
        if least <= 0.0:
            return None
        if self._is_free(q, goal, least):
            return ends
        low, high = self._room(q, goal)
        found = grown(
            q, goal[None], self._columns, low, high,
            lambda a, b: self._is_free(a, b, least), seed, lambda asked: asked <= CHECKS and in_time(),
        )  # fmt: skip
        return None if found is None else shortened(found, lambda a, b: self._is_free(a, b, least))

    def goes_straight(self, q: Reals, goal: Reals) -> bool:
        """Whether the straight way from q (n,) to the goal (n,) is free."""
        ends = np.stack([q, goal])
        least = min(NEAR * self._clearance, 0.5 * float(self._gaps(ends).min(initial=math.inf)))
        return least > 0.0 and self._is_free(q, goal, least)

    def touches(self, rows: Reals) -> NDArray[np.bool_]:
        """Whether something is as near to a carrier at places (m, n) as carriers do not come on their way."""
        return np.asarray(self._gaps(rows).min(axis=1, initial=math.inf) < NEAR * self._clearance)

    def away(self, q: Reals) -> Reals:
        """The place q (n,); where something touches a carrier there, one at a distance straight away."""
        if not self.touches(q[None])[0]:
            return q
        place, contacts = q.copy(), self._task.scene.template.contacts
        turns = np.linspace(0.0, 2.0 * math.pi, DIRECTIONS, endpoint=False)
        steps = self._clearance * np.stack([np.cos(turns), np.sin(turns)], axis=-1)
        for carrier in self._task.carriers:
            columns = list(carrier.places)
            own = [k for k, contact in enumerate(self._own) if carrier.body in contacts[contact]]
            trials = np.repeat(place[None], len(steps), axis=0)
            trials[:, columns] = np.clip(trials[:, columns] + steps, *self.bounds(carrier))
            place = trials[self._gaps(trials)[:, own].min(axis=1, initial=math.inf).argmax()]
        apart = float(self._gaps(place[None]).min()) > max(0.0, float(self._gaps(q[None]).min()))
        return place if apart else q

    def time(self, a: Reals, b: Reals) -> float:
        """How long the straight way takes."""
        ways = [math.hypot(*(b - a)[list(carrier.places)]) / carrier.speed for carrier in self._task.carriers]
        return max(ways, default=0.0)

    def _gaps(self, q: Reals) -> Reals:
        """Gaps (m, c) of the carriers at places (m, n)."""
        return self._question.geometry(np.ascontiguousarray(q)).gaps[:, self._own]

    def _moved(self, a: Reals, b: Reals) -> float:
        """By how much a gap may shrink at most on the straight way."""
        return sum(math.hypot(*(b - a)[list(carrier.places)]) for carrier in self._task.carriers)

    def _is_free(self, a: Reals, b: Reals, least: float) -> bool:
        """Whether the straight way keeps this gap; none shrinks by more than what the robots move."""

        def gaps(places: Reals) -> Reals:
            return np.asarray(self._gaps(places).min(axis=1, initial=math.inf))

        if self._around is not None:
            return self._around.is_clear(a, b, self._moved(a, b), least, np.array(self._own, np.int64))
        return is_clear(gaps, a, b, self._moved(a, b), least)

    def _room(self, q: Reals, goal: Reals) -> tuple[Reals, Reals]:
        """Least and greatest numbers (c,) of where robots may go: about all bodies, with room to pass."""
        poses = self._question.geometry(np.stack([q, goal])).poses[..., :2].reshape(-1, 2)
        low, high = poses.min(axis=0), poses.max(axis=0)
        room = 0.5 * float(np.linalg.norm(high - low)) + 10.0 * self._clearance
        bounds = np.array([self.bounds(carrier) for carrier in self._task.carriers])
        ends = np.stack([q, goal])[:, self._columns]
        least = np.maximum(low - room, bounds[:, 0]).ravel()
        most = np.minimum(high + room, bounds[:, 1]).ravel()
        return np.minimum(least, ends.min(axis=0)), np.maximum(most, ends.max(axis=0))

    def bounds(self, carrier: Carrier) -> tuple[Reals, Reals]:
        """Least and greatest places (2,) at which a carrier may be, and to which inputs within their bounds
        lead it."""
        if carrier.body in self._within:
            low, high = self._within[carrier.body]
            return low, high
        if not carrier.by_place:
            return np.full(2, -math.inf), np.full(2, math.inf)
        columns = list(carrier.columns)
        ends = np.stack([self._task.low[columns], self._task.high[columns]])
        middle, half = carrier.led.at(ends.mean(axis=0)), np.ptp(ends, axis=0) / 2.0
        reach = np.abs(carrier.led.matrix) @ half
        return middle - reach, middle + reach

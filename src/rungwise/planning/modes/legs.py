"""A leg as inputs over time: fingers leave, go to their places, touch, lead the object, and hold it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from rungwise.kernel import Ints, Reals
from rungwise.planning.modes.arm_paths import arms_way
from rungwise.planning.modes.balance import rests
from rungwise.planning.modes.fingers import contacts_of
from rungwise.planning.modes.ground import DEPENDENT, Ground, Seen
from rungwise.planning.modes.tree import Leg
from rungwise.planning.motion.budget import Budget
from rungwise.planning.motion.transit import Transit
from rungwise.planning.search.layout import FOLLOW, TOUCH
from rungwise.world.margins import Question

LEAVE, TRANSIT, HOLD, LIFT, LOWER = "leave", "transit", "hold", "lift", "lower"
"""Labels of segments, beside those in `search.layout`."""
STRAIGHT = 1e-3
"""How far, in parts of the size, aims between two rows may be off the straight line between these."""
HELD, LAGS = 0.1, 3.0
"""How long objects are held at the end of a leg at least: in parts of the time that a finger takes for their
size, and in times by which its servos lag behind their targets."""
BACK = (1.0, 0.5)
"""Parts of their clearance by which fingers draw back, the first that fits."""


class Row(NamedTuple):
    """Aims (n,) of the fingers' coordinates at the end of a segment, how long it takes, its label, and the
    fingers that are raised in it."""

    aims: Reals
    duration: float
    label: str
    raised: frozenset[int] = frozenset()


class Layout(NamedTuple):
    """Inputs (s, u), durations (s,), ramps (s,) and labels of a leg; aims (n,) at its end."""

    levels: Reals
    durations: Reals
    ramps: tuple[bool, ...]
    labels: tuple[str, ...]
    aims: Reals


class Writer:
    """Lays out legs on one object."""

    def __init__(self, ground: Ground, question: Question, pace: float) -> None:
        self.ground, self._question, self._pace = ground, question, pace
        self._rows: list[Row] = []
        self._aims, self._raised = np.zeros(0), frozenset[int]()

    def leg(
        self, seen: Seen, aims: Reals, levels: Reals, leg: Leg, seed: int, budget: Budget
    ) -> Layout | str:
        """The leg from what touches now, after these aims (n,) and inputs (u,); or why it cannot be laid
        out."""
        ground = self.ground
        self._rows, self._aims, self._raised = [], aims, frozenset()
        held = (seen.held >= 0).astype(np.int64)
        if leg.changes.any() and not self._relocated(seen, leg, held, seed, budget):
            return "no way"
        self._follow(leg)
        last = self._rows[-1].aims if self._rows else self._aims
        speed = max(finger.carrier.speed for finger in ground.fingers)
        lag = max(finger.carrier.servos.lag for finger in ground.fingers)
        self._rows.append(Row(last, max(HELD * ground.task.size / speed, LAGS * lag), HOLD))
        return self._written(aims, levels)

    def aimed(self, q: Reals, pushes: Reals) -> Reals:
        """The place (n,) to which servos aim to press so at a place, and to carry their own weight: where
        fingers would be if nothing held them."""
        ground = self.ground
        stiffness, found = ground.around.stiffness, q.copy()
        wanted = pushes - ground.around.loads(q)
        for finger in ground.fingers:
            if finger.arm is None:
                own = stiffness[finger.columns]
                found[finger.columns] += np.where(
                    own > 0.0, wanted[finger.columns] / np.where(own > 0.0, own, 1.0), 0.0
                )
            elif finger.carrier.by_place:
                torques = wanted[finger.moved] @ finger.rates(q)
                found = finger.put(found, finger.drives(q) + torques / finger.carrier.servos.stiffness)
        return found

    def drawn_back(self, seen: Seen, leaving: Ints) -> Reals | None:
        """The place (n,) with fingers (f,) drawn back from where they touch; None where they do not fit."""
        q = seen.q.copy()
        for f in np.flatnonzero(leaving):
            found = self._beside(q, int(f), seen)
            if found is None:
                return None
            q = found
        return q

    def _relocated(self, seen: Seen, leg: Leg, held: Ints, seed: int, budget: Budget) -> bool:
        """Lead fingers that change places there, straight in the plane, over objects where they may, or
        around them; False where there is no way."""
        self._keep(seen, held * (1 - leg.changes))
        now = self._left(seen, leg.changes * held)
        goal = None if now is None else self._before_touch(leg, now)
        if now is None or goal is None:
            return False
        moving = np.flatnonzero(leg.changes)
        raised = frozenset(f for f in moving.tolist() if self.ground.fingers[f].lift is not None)
        straight = not raised or self._goes_straight(now, goal, moving)
        for lifted in (frozenset[int](), raised) if straight else (raised, frozenset[int]()):
            way = self._way(now, goal, moving, seed, budget, lifted)
            if way is not None:
                self._lift(lifted, LIFT)
                for place in way[1:]:
                    self._to(place, moving, TRANSIT)
                self._lift(frozenset(), LOWER)
                return True
        return False

    def _lift(self, raised: frozenset[int], label: str) -> None:
        """Raise these fingers, and lower all others, where they are."""
        moved = raised ^ self._raised
        if not moved:
            return
        fingers = [self.ground.fingers[f] for f in moved]
        took = max(each.lift[1] / each.carrier.speed for each in fingers if each.lift is not None)
        self._raised = raised
        self._rows.append(Row(self._aims, self._pace * took, label, raised))

    def _put(self, aims: Reals, label: str, pace: float = 1.0) -> None:
        took = 0.0
        for finger in self.ground.fingers:
            way = finger.way(self.ground.around, self._aims, aims, self.ground.task.size)
            took = max(took, pace * self._pace * way / finger.carrier.speed)
        if took > 0.0:
            self._rows.append(Row(aims, took, label, self._raised))
            self._aims = aims

    def _keep(self, seen: Seen, staying: Ints) -> None:
        """The fingers that stay press so that the object rests when the others leave."""
        pushes = rests(self.ground, seen, staying)
        by_place = self.ground.fingers[0].carrier.by_place
        if pushes is None or not staying.any() or not by_place:
            return
        aims, own = self._aims.copy(), self.aimed(seen.q, pushes)
        for f in np.flatnonzero(staying):
            columns = self.ground.fingers[f].places
            aims[columns] = own[columns]
        self._put(aims, LEAVE)

    def _left(self, seen: Seen, leaving: Ints) -> Reals | None:
        """See `drawn_back`: fingers go there."""
        q = self.drawn_back(seen, leaving)
        if q is not None:
            self._to(q, np.flatnonzero(leaving), LEAVE)
        return q

    def _beside(self, q: Reals, f: int, seen: Seen) -> Reals | None:
        """The place (n,) with a finger away from where it touches, along the normal: with the least change of
        its drives, else straight."""
        finger, ground = self.ground.fingers[f], self.ground
        rows = seen.touches.rows[seen.held[f], : ground.around.dimension][:, finger.moved] @ finger.rates(q)
        for kept in (rows[:1], rows) if finger.arm is not None else (rows[:1],):
            away = np.linalg.pinv(kept, rcond=DEPENDENT)[:, 0]
            for part in BACK:
                found = finger.put(q, finger.drives(q) + part * finger.carrier.clearance * away)
                least = ground.around.least(found, contacts_of(finger, ground.task, ground.around))
                if least.min(initial=np.inf) > 0.0 and finger.reaches(found, ground.around):
                    return found
        return None

    def _before_touch(self, leg: Leg, now: Reals) -> Reals | None:
        """The place (n,) from which the fingers that change touch the object."""
        first = self.ground.look(leg.way.places[0])
        q = now.copy()
        for f in np.flatnonzero(leg.changes):
            columns = self.ground.fingers[f].places
            q[columns] = first.q[columns]
        for f in np.flatnonzero(leg.changes * leg.way.used):
            if first.held[f] < 0:
                return None
            found = self._beside(q, int(f), first)
            if found is None:
                return None
            q = found
        return q

    def _way(
        self, a: Reals, b: Reals, moving: Ints, seed: int, budget: Budget, raised: frozenset[int]
    ) -> Reals | None:  # fmt: skip
        if any(self.ground.fingers[f].arm is not None for f in moving):
            return arms_way(self.ground, a, b, moving, seed, budget.is_in_time, self._names(raised))
        return self._transit(moving, raised).way(a, b, seed, budget.is_in_time)

    def _goes_straight(self, a: Reals, b: Reals, moving: Ints) -> bool:
        """Whether fingers go straight in the plane; of arms that is not asked."""
        arms = any(self.ground.fingers[f].arm is not None for f in moving)
        return not arms and self._transit(moving, frozenset()).goes_straight(a, b)

    def _transit(self, moving: Ints, raised: frozenset[int]) -> Transit:
        carriers = tuple(self.ground.fingers[f].carrier for f in moving)
        within = {finger.carrier.body: finger.bounds for finger in self.ground.fingers}
        task = replace(self.ground.task, carriers=carriers)
        return Transit(task, self._question, within, self._names(raised), self.ground.around)

    def _names(self, fingers: frozenset[int]) -> list[str]:
        return [self.ground.fingers[f].carrier.body for f in sorted(fingers)]

    def _to(self, place: Reals, moving: Ints, label: str) -> None:
        """Lead fingers through free space to a place (n,)."""
        aims = self._aims.copy()
        free = self.aimed(place, np.zeros(len(self.ground.around.owners)))
        for f in moving:
            columns = self.ground.fingers[f].places
            aims[columns] = free[columns]
        self._put(aims, label)

    def _follow(self, leg: Leg) -> None:
        """Touch and lead the object along the way."""
        way = leg.way
        rows = np.array([self.aimed(q, push) for q, push in zip(way.places, way.pushes, strict=True)])
        free = np.ones(len(self._aims), bool)
        for f in np.flatnonzero(way.used):
            free[self.ground.fingers[f].places] = False
        rows[:, free] = self._aims[free]
        self._put(rows[0], TOUCH)
        for k in _turns(rows, STRAIGHT * self.ground.task.size):
            self._put(rows[k], FOLLOW)

    def _written(self, aims: Reals, levels: Reals) -> Layout | str:
        """The rows as inputs, after aims (n,) and inputs (u,)."""
        found, now, before = list[Reals](), levels.copy(), aims
        by_place = self.ground.fingers[0].carrier.by_place
        for row in self._rows:
            now = now.copy()
            for finger in self.ground.fingers:
                own = finger.drives(row.aims)
                speeds = (own - finger.drives(before)) / row.duration
                now[list(finger.carrier.columns)] = finger.carrier.levels(speeds[None], own[None])[0]
            for f, finger in enumerate(self.ground.fingers):
                if finger.lift is not None:
                    now[finger.lift[0]] = finger.lift[1] if f in row.raised else 0.0
            found.append(now)
            before = row.aims
        every = np.array(found)
        if not self.ground.task.allows(every).all():
            return "out of the bounds of inputs"
        return Layout(
            every, np.array([row.duration for row in self._rows]),
            tuple(by_place and row.label not in (LIFT, LOWER) for row in self._rows),
            tuple(row.label for row in self._rows), before,
        )  # fmt: skip


def _turns(rows: Reals, off: float) -> list[int]:
    """Rows after the first at which straight lines from one to the next keep within `off` of all rows (k, n)
    between."""
    kept, at = list[int](), 0
    while at < len(rows) - 1:
        to = at + 1
        while to + 1 < len(rows) and _is_straight(rows[at : to + 2], off):
            to += 1
        kept.append(to)
        at = to
    return kept


def _is_straight(rows: Reals, off: float) -> bool:
    parts = np.linspace(0.0, 1.0, len(rows))[:, None]
    return bool(np.abs(rows - (rows[0] + parts * (rows[-1] - rows[0]))).max() <= off)


def is_placed(labels: Sequence[str]) -> bool:
    """Whether fingers that change their places have come to them, after segments with these labels."""
    return not {TOUCH, FOLLOW, HOLD}.isdisjoint(labels)

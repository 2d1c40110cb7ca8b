"""A third system: two discs that do not turn, one in a field that pulls it back, one led, and a wall.

q = v' = (puck.x, puck.y, finger.x, finger.y). The puck feels the field -k q and a drag; the finger goes at
prescribed speeds; the wall is the half-plane x >= `wall`.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from rungwise.system.moving import Moment, Size, fall_freely
from rungwise.system.terms import Terms

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
PUCK, FINGER, WALL = range(3)
PAIRS = ((FINGER, PUCK), (PUCK, WALL), (FINGER, WALL))
"""Pairs of bodies, by the slots of their contacts; nothing free takes part in the last."""


@dataclass
class Discs:
    place: Array
    motion: Array
    columns: tuple[int, int]
    radius: float
    mass: float
    pull: float
    drag: float
    wall: float
    friction: float
    restitution: float
    stiffness: float = 1e5
    kept: tuple[()] = ()
    led: Array = field(default_factory=lambda: np.zeros(2))

    def __post_init__(self) -> None:
        self.size = Size(4, 4, 2, 2, 0, self.radius, self.radius)
        self._none = np.zeros(0, np.int64)

    def forget(self) -> None:
        """Nothing is known of contacts beside what the core keeps by slot."""

    def follow(self, middle: Array, _end: Array) -> None:
        self.led = middle[list(self.columns)]

    @property
    def driving(self) -> Array:
        return np.zeros(4)

    def start(self) -> tuple[Array, Array]:
        return self.place.copy(), self.motion.copy()

    def speeds(self, _time: float) -> Array:
        return np.array([np.nan, np.nan, *self.led])

    def normal(self, q: Array, a: int, b: int) -> tuple[float, Array]:
        """The gap of two bodies, and the unit vector from the second to the first."""
        if b == WALL:
            return self.wall - self.radius - q[2 * a], np.array([-1.0, 0.0])
        way = q[2 * a : 2 * a + 2] - q[2 * b : 2 * b + 2]
        far = float(np.linalg.norm(way))
        return far - 2.0 * self.radius, way / far if far > 0.0 else np.array([1.0, 0.0])

    def gap(self, q: Array, a: int, b: int) -> float:
        return self.normal(q, min(a, b), max(a, b))[0]

    def pushes(self, force: Array) -> list[tuple[int, int, float]]:
        return [(*PAIRS[s], float(push)) for s, push in enumerate(force[:, 0]) if push > 0.0]

    def fill(self, moment: Moment, terms: Terms, reach: float) -> tuple[Ints, Ints]:
        terms.inertia[:] = self.mass * np.eye(4)
        terms.metric[:] = np.eye(4)
        terms.damping[:] = terms.stiffness[:] = 0.0
        for i in (0, 1):
            terms.damping[i, i], terms.stiffness[i, i] = self.drag, self.pull
        terms.load[:] = 0.0
        terms.load[:2] = -self.pull * moment.q[:2]
        fall_freely(terms, self.speeds(moment.time))
        slots = []
        for slot, (a, b) in enumerate(PAIRS[:2]):
            gap, normal = self.normal(moment.q, a, b)
            if gap > reach:
                continue
            k = len(slots)
            terms.gap[k] = gap
            terms.rows[2 * k : 2 * k + 2] = 0.0
            for row, way in ((2 * k, normal), (2 * k + 1, np.array([-normal[1], normal[0]]))):
                terms.rows[row, 2 * a : 2 * a + 2] = way
                if b != WALL:
                    terms.rows[row, 2 * b : 2 * b + 2] = -way
            terms.friction[k], terms.restitution[k] = self.friction, self.restitution
            terms.contact_stiffness[k] = self.stiffness * np.eye(2)
            terms.contact_damping[k] = 1e-2 * self.stiffness * np.eye(2)
            slots.append(slot)
        return np.array(slots, np.int64), np.zeros(len(slots), np.int64)

    def accept(self) -> None:
        """Slots belong to pairs: nothing is to be kept."""

    def integrate(self, q: Array, v: Array, h: float) -> Array:
        return q + h * v

    def least_gap(self, q: Array) -> float:
        return min(self.normal(q, a, b)[0] for a, b in PAIRS[:2])

    def passes(self, _q: Array, _v: Array, _h: float) -> bool:
        return True  # asked where discs move by more than a radius: the step is halved

    def fastest(self, _q: Array, v: Array) -> float:
        return float(np.hypot(v[0], v[1]) + np.hypot(v[2], v[3]))

    def energy(self, q: Array, v: Array) -> float:
        return float(0.5 * self.mass * v @ v + 0.5 * self.pull * q[:2] @ q[:2])

"""A third system: an arm of two rods in the plane, whose inertia M(q) is full, and whose tip meets a wall.

q = v' = (angle of the first rod, angle of the second relative to it). The wall is the line x = `wall`; rods
are uniform.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rungwise.system.moving import Moment, Size, fall_freely
from rungwise.system.terms import Terms

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


class AtMostOneContact:
    """What systems of two coordinates with one surface have in common."""

    friction: float
    restitution: float

    def touch(self, terms: Terms, gap: float, rows: Array, stiffness: float, damping: float) -> Ints:
        """Fill in the contact, with its rows (2, 2), and return its slot; (1,)."""
        terms.gap[0], terms.rows[0], terms.rows[1] = gap, rows[0], rows[1]
        terms.friction[0], terms.restitution[0] = self.friction, self.restitution
        terms.contact_stiffness[0], terms.contact_damping[0] = stiffness * np.eye(2), damping * np.eye(2)
        return np.zeros(1, np.int64)

    def accept(self) -> None:
        """There is only one contact: nothing is to be kept."""

    def integrate(self, q: Array, v: Array, h: float) -> Array:
        return q + h * v

    def passes(self, _q: Array, _v: Array, _h: float) -> bool:
        return False


@dataclass
class TwoLinkArm(AtMostOneContact):
    q: tuple[float, float]
    v: tuple[float, float] = (0.0, 0.0)
    lengths: tuple[float, float] = (1.0, 0.8)
    masses: tuple[float, float] = (2.0, 1.5)
    gravity: float = 0.0
    torques: tuple[float, float] = (0.0, 0.0)
    damping: float = 0.0
    wall: float = np.inf
    friction: float = 0.0
    restitution: float = 0.0
    stiffness: float = 1e6
    contact_damping: float = 1e3
    driven: Callable[[float], Sequence[float]] = lambda _: (np.nan, np.nan)

    size = Size(2, 2, 1, 2, 0, 0.1)

    @property
    def driving(self) -> Array:
        return np.array(self.torques)

    def start(self) -> tuple[Array, Array]:
        return np.array(self.q), np.array(self.v)

    def speeds(self, time: float) -> Array:
        return np.array(self.driven(time), float)

    def fill(self, moment: Moment, terms: Terms, reach: float) -> tuple[Ints, Ints]:
        (_, b), (da, db) = moment.q, moment.v
        (l1, l2), (_, m2) = self.lengths, self.masses
        h = 0.5 * m2 * l1 * l2 * np.sin(b)
        terms.inertia[:] = self.inertia(moment.q)
        terms.metric[:] = terms.inertia / sum(self.masses)
        terms.damping[:] = self.damping * np.eye(2)
        coriolis = np.array([h * (2.0 * da * db + db * db), -h * da * da])
        terms.load[:] = self.torques + self.weight(moment.q) + moment.inertia * coriolis
        fall_freely(terms, self.speeds(moment.time))
        gap = self.least_gap(moment.q)
        if gap > reach:
            return np.zeros(0, np.int64), np.zeros(0, np.int64)
        rows = [[-1.0], [1.0]] * self.jacobian(moment.q)
        return self.touch(terms, gap, rows, self.stiffness, self.contact_damping), np.zeros(1, np.int64)

    def least_gap(self, q: Array) -> float:
        return self.wall - self.tip(q)[0]

    def fastest(self, _q: Array, v: Array) -> float:
        l1, l2 = self.lengths
        return float(l1 * abs(v[0]) + l2 * abs(v[0] + v[1]))

    def energy(self, q: Array, v: Array) -> float:
        (l1, l2), (m1, m2) = self.lengths, self.masses
        height = 0.5 * m1 * l1 * np.sin(q[0]) + m2 * (l1 * np.sin(q[0]) + 0.5 * l2 * np.sin(q[0] + q[1]))
        return float(0.5 * v @ self.inertia(q) @ v + self.gravity * height)

    def inertia(self, q: Array) -> Array:
        (l1, l2), (m1, m2) = self.lengths, self.masses
        across = 0.5 * m2 * l1 * l2 * np.cos(q[1])
        second = m2 * l2**2 / 3.0
        first = m1 * l1**2 / 3.0 + m2 * l1**2 + second + 2.0 * across
        return np.array([[first, second + across], [second + across, second]])

    def weight(self, q: Array) -> Array:
        (l1, l2), (m1, m2) = self.lengths, self.masses
        outer = 0.5 * m2 * l2 * np.cos(q[0] + q[1])
        return -self.gravity * np.array([(0.5 * m1 + m2) * l1 * np.cos(q[0]) + outer, outer])

    def tip(self, q: Array) -> Array:
        l1, l2 = self.lengths
        return np.array([l1 * np.cos(q[0]) + l2 * np.cos(q.sum()), l1 * np.sin(q[0]) + l2 * np.sin(q.sum())])

    def jacobian(self, q: Array) -> Array:
        l1, l2 = self.lengths
        outer = l2 * np.array([-np.sin(q.sum()), np.cos(q.sum())])
        inner = l1 * np.array([-np.sin(q[0]), np.cos(q[0])])
        return np.column_stack([inner + outer, outer])

"""A second system: spheres and boxes in space above the plane z = 0, with unit quaternions.

q = (x, y, z, w, i, j, k) per body, v = (velocity of the centre, angular velocity), both in the world's frame,
so that M(q) is full, and k = -omega x (I omega). Contacts: a sphere or a corner of a box with the plane, and
two spheres; three directions each.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import combinations, product

import numpy as np
from numpy.typing import NDArray

from rungwise.system.moving import Moment, Size, fall_freely
from rungwise.system.terms import Terms

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
CORNERS = 8


@dataclass
class Body:
    """A sphere of radius `half` or a box of half edges `half`; `inertia` (3,) about its own axes."""

    mass: float
    half: float | tuple[float, float, float]
    q: tuple[float, ...]
    v: tuple[float, ...] = (0.0,) * 6
    driven: Callable[[float], Sequence[float]] | None = None
    turned: tuple[float, float, float] | None = None

    @property
    def is_sphere(self) -> bool:
        return isinstance(self.half, float)

    @property
    def inertia(self) -> Array:
        if self.turned is not None:
            return np.array(self.turned)
        if isinstance(self.half, float):
            return np.full(3, 0.4 * self.mass * self.half**2)
        a, b, c = np.array(self.half) ** 2
        return self.mass / 3.0 * np.array([b + c, a + c, a + b])

    @property
    def reach(self) -> float:
        return float(np.linalg.norm(self.half)) if not self.is_sphere else float(self.half)  # type: ignore[arg-type]


@dataclass
class BodiesInSpace:
    bodies: list[Body]
    gravity: Array = field(default_factory=lambda: np.array([0.0, 0.0, -9.81]))
    friction: float = 0.0
    restitution: float = 0.0
    stiffness: float = 1e5
    damping: float = 1e3
    drag: float = 0.0
    plane: bool = True

    def __post_init__(self) -> None:
        n = len(self.bodies)
        self.pairs = list(combinations(range(n), 2))
        slots = CORNERS * n + len(self.pairs)
        self.driving = np.zeros(6 * n)
        self.size = Size(7 * n, 6 * n, slots, 3, 0, min(body.reach for body in self.bodies))

    def start(self) -> tuple[Array, Array]:
        q = np.concatenate([body.q for body in self.bodies])
        return q, np.concatenate([body.v for body in self.bodies])

    def speeds(self, time: float) -> Array:
        free = np.full(6, np.nan)
        return np.concatenate(
            [free if body.driven is None else body.driven(time) for body in self.bodies]
        ).astype(float)

    def fill(self, moment: Moment, terms: Terms, reach: float) -> tuple[Ints, Ints]:
        terms.inertia[:], terms.metric[:], terms.damping[:] = 0.0, 0.0, 0.0
        for b, body in enumerate(self.bodies):
            at = slice(6 * b, 6 * b + 3)
            turn = slice(6 * b + 3, 6 * b + 6)
            R, omega = rotation(moment.q[7 * b + 3 : 7 * b + 7]), moment.v[turn]
            spin = R @ np.diag(body.inertia) @ R.T
            terms.inertia[at, at], terms.inertia[turn, turn] = body.mass * np.eye(3), spin
            terms.metric[at, at], terms.metric[turn, turn] = np.eye(3), spin / body.mass
            terms.load[at] = body.mass * self.gravity
            terms.load[turn] = -moment.inertia * np.cross(omega, spin @ omega)
            terms.damping[at, at] = self.drag * np.eye(3)
            terms.damping[turn, turn] = self.drag * np.eye(3)
        fall_freely(terms, self.speeds(moment.time))
        slots = []
        for slot, gap, normal, arms in self._contacts(moment.q):
            if gap > reach:
                continue
            k = len(slots)
            terms.gap[k] = gap
            frame = np.vstack([normal, *tangents(normal)])
            terms.rows[3 * k : 3 * k + 3] = 0.0
            for b, sign, arm in arms:
                terms.rows[3 * k : 3 * k + 3, 6 * b : 6 * b + 3] = sign * frame
                terms.rows[3 * k : 3 * k + 3, 6 * b + 3 : 6 * b + 6] = sign * np.cross(arm, frame)
            terms.friction[k], terms.restitution[k] = self.friction, self.restitution
            terms.contact_stiffness[k] = self.stiffness * np.eye(3)
            terms.contact_damping[k] = self.damping * np.eye(3)
            slots.append(slot)
        return np.array(slots, np.int64), np.zeros(len(slots), np.int64)

    def accept(self) -> None:
        """Corners and pairs are the same throughout: nothing is to be kept."""

    def integrate(self, q: Array, v: Array, h: float) -> Array:
        after = q.copy()
        for b in range(len(self.bodies)):
            after[7 * b : 7 * b + 3] += h * v[6 * b : 6 * b + 3]
            turned = multiply(turn_by(h * v[6 * b + 3 : 6 * b + 6]), q[7 * b + 3 : 7 * b + 7])
            after[7 * b + 3 : 7 * b + 7] = turned / np.linalg.norm(turned)
        return after

    def least_gap(self, q: Array) -> float:
        return min((gap for _, gap, _, _ in self._contacts(q)), default=np.inf)

    def passes(self, _q: Array, _v: Array, _h: float) -> bool:
        return False

    def fastest(self, _q: Array, v: Array) -> float:
        return 2.0 * max(
            float(np.linalg.norm(own[:3])) + body.reach * float(np.linalg.norm(own[3:]))
            for body, own in zip(self.bodies, v.reshape(-1, 6), strict=True)
        )

    def energy(self, q: Array, v: Array) -> float:
        total = 0.0
        for b, body in enumerate(self.bodies):
            R, omega = rotation(q[7 * b + 3 : 7 * b + 7]), v[6 * b + 3 : 6 * b + 6]
            total += 0.5 * body.mass * v[6 * b : 6 * b + 3] @ v[6 * b : 6 * b + 3]
            total += 0.5 * omega @ (R @ np.diag(body.inertia) @ R.T) @ omega
            total -= body.mass * self.gravity @ q[7 * b : 7 * b + 3]
        return float(total)

    def _contacts(self, q: Array) -> list[tuple[int, float, Array, list[tuple[int, float, Array]]]]:
        """Slot, gap, normal, and the bodies with their sign and the arm from the centre to the contact, of
        what is free to move."""
        up, found = np.array([0.0, 0.0, 1.0]), []
        for b, body in enumerate(self.bodies if self.plane else []):
            centre, R = q[7 * b : 7 * b + 3], rotation(q[7 * b + 3 : 7 * b + 7])
            if body.is_sphere:
                found.append((CORNERS * b, centre[2] - body.reach, up, [(b, 1.0, -body.reach * up)]))
                continue
            for corner, signs in enumerate(product((-1.0, 1.0), repeat=3)):
                arm = R @ (np.array(signs) * body.half)
                found.append((CORNERS * b + corner, centre[2] + arm[2], up, [(b, 1.0, arm)]))
        for number, (a, b) in enumerate(self.pairs):
            between = q[7 * b : 7 * b + 3] - q[7 * a : 7 * a + 3]
            distance = float(np.linalg.norm(between))
            normal, first, second = between / distance, self.bodies[a].reach, self.bodies[b].reach
            arms = [(a, -1.0, first * normal), (b, 1.0, -second * normal)]
            found.append((CORNERS * len(self.bodies) + number, distance - first - second, normal, arms))
        return [one for one in found if any(self.bodies[b].driven is None for b, _, _ in one[3])]


def rotation(p: Array) -> Array:
    w, x, y, z = p
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def turn_by(angle: Array) -> Array:
    size = float(np.linalg.norm(angle))
    return np.concatenate([[np.cos(size / 2)], 0.5 * np.sinc(size / (2 * np.pi)) * angle])


def multiply(p: Array, q: Array) -> Array:
    a, u, b, w = p[0], p[1:], q[0], q[1:]
    return np.concatenate([[a * b - u @ w], a * w + b * u + np.cross(u, w)])


def tangents(normal: Array) -> tuple[Array, Array]:
    least = np.eye(3)[int(np.argmin(np.abs(normal)))]
    first = np.cross(normal, least)
    first /= np.linalg.norm(first)
    return first, np.cross(normal, first)

"""Bodies that joints lead to places beside objects (see `world.contract.Tool`).

A body is brought beside an object by damped least squares on its joints (Nakamura and Hanafusa 1986), as near
as the joints allow.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Protocol

import numpy as np

from rungwise.kernel import Reals
from rungwise.scene.space.laws import touching
from rungwise.system.spatial.patch.geoms import Geoms
from rungwise.system.spatial.patch.shapes import shapes
from rungwise.system.spatial.reach import reaches
from rungwise.world.carriers import Carrier, TaskError
from rungwise.world.contract import OBJECT
from rungwise.world.spatial.instance import reaches_of

if TYPE_CHECKING:
    import mujoco

ITERATIONS, LONGEST, DAMPING = 40, 0.3, 1e-3
"""Steps of least squares, how far a joint goes in one, and their damping, over the size squared."""
OFF = 0.25
"""Part of the clearance by which a body may miss its distance from an object."""


class Solids(Protocol):
    """What tools read of places of solids: the model, names and roles of its bodies, the geoms of each pair
    of bodies that may touch, up to where gaps are known, and the size of the largest object."""

    model: mujoco.MjModel
    names: tuple[str, ...]
    roles: dict[str, str]
    geoms: dict[tuple[int, int], list[tuple[int, int]]]
    far: float
    size: float


class JointTool:
    """See `Tool`."""

    def __init__(self, room: Solids, carrier: Carrier) -> None:
        import mujoco

        self._mujoco, self._room, self.carrier = mujoco, room, carrier
        m = self._model = room.model
        self._data, names, self._solids = mujoco.MjData(m), list(room.names), Geoms(m, shapes(m))
        self._body, self._columns = names.index(carrier.body), list(carrier.places)
        self.changes = np.array(carrier.rates, np.int64)
        self._low, self._high = carrier.travel
        self._pairs = [
            (a + b - self._body, pairs)
            for (a, b), pairs in room.geoms.items()
            if self._body in (a, b) and room.roles[names[a + b - self._body]] == OBJECT
        ]
        self.targets = tuple(target for target, _ in self._pairs)
        if not self.targets:
            raise TaskError(f"task.transit.{carrier.body}: touches no object; see the geoms of both")
        self._geoms = np.flatnonzero((m.geom_bodyid == self._body) & touching(m))
        self._reach = reaches_of(m)
        self.moves = (reaches(m)[:, self.changes] > 0.0).any(axis=1)

    def _place(self, q: Reals) -> None:
        """Put the model at q (n_q,)."""
        self._data.qpos[:] = q
        self._mujoco.mj_kinematics(self._model, self._data)
        self._mujoco.mj_comPos(self._model, self._data)

    def middle(self, q: Reals) -> Reals:
        self._place(q)
        return self._middle()

    def centre(self, q: Reals, target: int) -> Reals:
        self._place(q)
        return np.asarray(self._data.xipos[self.targets[target]])

    def reach(self, target: int) -> float:
        return float(self._reach[self.targets[target]])

    def _middle(self) -> Reals:
        """The middle (3,) of the geoms that touch."""
        return np.asarray(self._data.geom_xpos[self._geoms].mean(axis=0))

    def _slope(self, point: Reals) -> Reals:
        """How joints move a point of the body (3, k)."""
        found = np.zeros((3, self._model.nv))
        self._mujoco.mj_jac(self._model, self._data, found, None, point, self._body)
        return found[:, self.changes]

    def _nearest(self, target: int) -> tuple[float, Reals, Reals]:
        """The gap to an object, the direction (3,) away from it, and the point (3,) of the body there."""
        least, ends = math.inf, np.zeros(6)
        self._solids.place(self._data)
        for a, b in self._pairs[target][1]:
            gap, own = self._solids.distance(a, b, self._room.far)
            if gap < least:
                least = gap
                ends = (own if self._model.geom_bodyid[b] == self._body else own[::-1]).ravel()
        away = (ends[3:] - ends[:3]) * (1.0 if least >= 0.0 else -1.0)
        length = float(np.linalg.norm(away))
        return least, away / length if length > 0.0 else away, ends[3:]

    def led(self, q: Reals, aim: Reals) -> Reals:
        found = q.copy()
        for _ in range(ITERATIONS):
            self._place(found)
            middle = self._middle()
            if not self._step(found, self._slope(middle), aim - middle):
                break
        return found

    def beside(self, q: Reals, target: int, point: Reals, away: Reals) -> Reals | None:
        across = np.eye(3) - np.outer(away, away)
        found = self.led(q, point + away * self._far(target))
        for _ in range(ITERATIONS):
            self._place(found)
            gap, normal, tip = self._nearest(target)
            middle = self._middle()
            slopes = np.vstack([across @ self._slope(middle), normal @ self._slope(tip)])
            lacks = np.append(across @ (point - middle), self.carrier.clearance - gap)
            if not self._step(found, slopes, lacks):
                break
        self._place(found)
        gap, normal, _ = self._nearest(target)
        leans = math.acos(float(np.clip(normal @ away, -1.0, 1.0)))
        fits = abs(gap - self.carrier.clearance) <= OFF * self.carrier.clearance
        return found if fits and leans <= self.carrier.lean else None

    def _far(self, target: int) -> float:
        """How far from the point of a line the middle of the body is beyond the object."""
        ball = float(self.reach(target) + self._model.geom_rbound[self._geoms].max())
        return ball + self.carrier.clearance

    def _step(self, q: Reals, slopes: Reals, lacks: Reals) -> bool:
        """Take a step of the joints in q; False where it is none."""
        damped = slopes @ slopes.T + DAMPING * self._room.size**2 * np.eye(len(lacks))
        step = np.clip(slopes.T @ np.linalg.solve(damped, lacks), -LONGEST, LONGEST)
        before = q[self._columns]
        q[self._columns] = np.clip(before + step, self._low, self._high)
        return bool(np.abs(q[self._columns] - before).max() > 1e-9)

    def drawn(self, q: Reals, number: int) -> Reals:
        if number == 0:
            return q
        found, rng = q.copy(), np.random.default_rng(number)
        low, high = np.maximum(self._low, -math.pi), np.minimum(self._high, math.pi)
        found[self._columns] = rng.uniform(low, high)
        return found

"""Where bodies may be placed in space: free bodies anywhere, joints within their ranges.

Gaps are of all pairs of geoms that may touch. Places hold quaternions; a straight way turns them
along the shortest arc (Shoemake, Animating rotation with quaternion curves, 1985), and a change of one is a
turn about the body's own axes, as velocities are.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from rungwise.kernel import Reals
from rungwise.scene.space import SpaceScene
from rungwise.scene.space.laws import touching, touching_pairs
from rungwise.simulation.core.tolerances import OVERLAP
from rungwise.system.spatial.drives import BALL, FREE, SLIDE
from rungwise.system.spatial.reach import reaches
from rungwise.world.carriers import Carrier
from rungwise.world.contract import OBJECT
from rungwise.world.spatial.around.distances import Distances
from rungwise.world.spatial.instance import roles_in_space
from rungwise.world.spatial.tool import JointTool

if TYPE_CHECKING:
    import mujoco

FAR = 10.0
"""Gaps are no longer than this many times the model's extent."""


class SpatialConfigurations:
    """See `Configurations`."""

    def __init__(
        self, scene: SpaceScene, parameters: Mapping[str, float], size: float, without: str = ""
    ) -> None:
        import mujoco

        bound = scene.bind(parameters)
        self._mujoco, self.model = mujoco, bound.model
        m, self._data = bound.model, mujoco.MjData(bound.model)
        self.names, self.size = scene.template.bodies, size
        touches, halves = touching(m) & (m.geom_rbound > 0.0), m.geom_aabb[:, 3:]
        self.thin = float(2.0 * halves[touches].min(initial=0.5 * size))
        moving = touches & (m.body_weldid[m.geom_bodyid] != 0)
        self.rounding = OVERLAP * float(m.geom_rbound[moving].min(initial=size))
        self.roles = dict(zip(self.names, roles_in_space(bound), strict=True))
        self._describe()
        self.far = FAR * float(m.stat.extent)
        self.geoms: dict[tuple[int, int], list[tuple[int, int]]] = {}
        for a, b in touching_pairs(m).tolist():
            first, second = sorted((int(m.geom_bodyid[a]), int(m.geom_bodyid[b])))
            if without not in (self.names[first], self.names[second]):
                self.geoms.setdefault((first, second), []).append((a, b))
        self.pairs = np.array(list(self.geoms), np.int64).reshape(-1, 2)
        self._distances = Distances(m, list(self.geoms.values()), self.far)
        self.bound = _bound(m)

    def _describe(self) -> None:
        """Set what depends on joints alone."""
        m, far = self.model, np.inf
        turning, low, high = list[bool](), list[float](), list[float]()
        numbers, of_numbers = list[int](), list[int]()
        groups, turns, bodies = list[list[int]](), list[list[int]](), dict[int, list[int]]()
        self.unit = np.ones(m.nv)
        for j in range(m.njnt):
            kind, q, v = int(m.jnt_type[j]), int(m.jnt_qposadr[j]), int(m.jnt_dofadr[j])
            plain = {FREE: 3, BALL: 0}.get(kind, 1)
            travel = m.jnt_range[j].tolist() if m.jnt_limited[j] and kind not in (FREE, BALL) else [-far, far]
            is_length = kind in (FREE, SLIDE)
            numbers += range(q, q + plain)
            of_numbers += range(v, v + plain)
            turning += [not is_length] * plain
            low += [travel[0]] * plain
            high += [travel[1]] * plain
            groups += [list(range(v, v + plain))] if plain else []
            if is_length:
                self.unit[v : v + plain] = self.size
            if kind in (FREE, BALL):
                turns.append(list(range(q + plain, q + plain + 4)))
                groups.append(list(range(v + plain, v + plain + 3)))
            width = plain + 4 * (kind in (FREE, BALL))
            bodies.setdefault(int(m.jnt_bodyid[j]), []).extend(range(q, q + width))
        self.numbers, self.turns = np.array(numbers, np.int64), np.array(turns, np.int64).reshape(-1, 4)
        self.of_numbers = np.array(of_numbers, np.int64)
        self.turning, self.low, self.high = np.array(turning, bool), np.array(low), np.array(high)
        self.units, self.bodies, self._groups = self.unit[self.of_numbers], list(bodies.values()), groups
        self.objects = np.array([self.roles[self.names[b]] == OBJECT for b in m.dof_bodyid.tolist()], bool)
        self._reach = reaches(m)[:, [group[0] for group in groups]]

    def tool(self, carrier: Carrier) -> JointTool:
        return JointTool(self, carrier)

    def look(self, rows: Reals) -> tuple[Reals, Reals]:
        m, d, pairs = self.model, self._data, np.arange(len(self.geoms))
        gaps = np.empty((len(rows), len(self.geoms)))
        for row, found in zip(rows, gaps, strict=True):
            d.qpos[:] = row
            self._mujoco.mj_kinematics(m, d)
            found[:] = self._distances.least(d, pairs)
        return gaps, rows

    def moved(self, marks: Reals) -> Reals:
        change = self._changes(marks)
        along = [np.linalg.norm(change[:, group], axis=1) for group in self._groups]
        return np.asarray(np.stack(along, axis=1) @ self._reach.T)

    def changed(self, rows: Reals, change: Reals) -> Reals:
        shape = np.broadcast_shapes(rows.shape[:-1], change.shape[:-1])
        found = np.broadcast_to(rows, (*shape, rows.shape[-1])).reshape(-1, rows.shape[-1]).copy()
        changes = np.broadcast_to(change, (*shape, change.shape[-1])).reshape(-1, change.shape[-1])
        for place, step in zip(found, np.ascontiguousarray(changes), strict=True):
            self._mujoco.mj_integratePos(self.model, place, step, 1.0)
        return found.reshape(*shape, rows.shape[-1])

    def between(self, a: Reals, b: Reals, at: Reals) -> Reals:
        return self.changed(a, at[:, None] * self._changes(np.stack([a, b])))

    def lengths(self, way: Reals) -> Reals:
        return np.asarray(np.linalg.norm(self._changes(way) / self.unit, axis=1))

    def _changes(self, way: Reals) -> Reals:
        """What leads from each place of a way (k, n_q) to the next, the short way round (k - 1, n_v)."""
        found = np.zeros((len(way) - 1, self.model.nv))
        for (a, b), change in zip(pairwise(way), found, strict=True):
            self._mujoco.mj_differentiatePos(self.model, change, 1.0, a, b)
        return found


def _bound(model: mujoco.MjModel) -> str:
    """What bounds places beside gaps and ranges of single joints, in words; empty where nothing does."""
    if model.neq and model.eq_active0.any():
        return "bodies are joined"
    if model.tendon_limited.any():
        return "tendons bound places"
    return "a ball joint has a range" if model.jnt_limited[model.jnt_type == BALL].any() else ""

"""Distances of pairs of bodies, of which balls about their geoms tell that most need not be measured."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from rungwise.kernel import Ints, Reals
from rungwise.system.spatial.patch.geoms import Geoms
from rungwise.system.spatial.patch.shapes import shapes

if TYPE_CHECKING:
    import mujoco

SLACK = 1e-6
"""Part of the size of a model by which distances may be below those of the balls, by rounding."""


class Distances:
    """Distances of pairs of bodies (p,), each by its pairs of geoms. They are measured up to `far`."""

    def __init__(self, model: mujoco.MjModel, geoms: Sequence[Sequence[tuple[int, int]]], far: float) -> None:
        import mujoco

        self._solids, self._far = Geoms(model, shapes(model)), far
        every = [(g, h, k) for k, own in enumerate(geoms) for g, h in own]
        a, b, self._of = np.array(every, np.int64).reshape(-1, 3).T
        flat = model.geom_type == mujoco.mjtGeom.mjGEOM_PLANE
        self._a, self._b = np.where(flat[b], b, a), np.where(flat[b], a, b)
        self._planes = flat[self._a]
        self._reach = model.geom_rbound[self._a] + model.geom_rbound[self._b]
        self._rows = [np.flatnonzero(self._of == k) for k in range(len(geoms))]
        self._geoms, self._count = geoms, len(geoms)
        self._slack, self._asked = SLACK * far, dict[bytes, Ints]()

    def nearest(self, data: mujoco.MjData, pair: int) -> tuple[float, Reals, tuple[int, int]]:
        """The gap of a pair at the data's places, its nearest points (6,), and the geoms, the first of those
        that are equally near."""
        rows = self._rows[pair]
        least, own = self._least(data, rows), self._geoms[pair]
        gap, ends, geoms = math.inf, np.zeros(6), (0, 0)
        if len(rows):
            gap, _ = self._solids.distance(*own[int(least.argmin())], self._far)
            gap = max(gap, float(least.min()))  # of pairs farther than is measured one is kept
        gap, most = math.inf, gap + self._slack
        for k in np.flatnonzero(least <= most).tolist():
            apart, found = self._solids.distance(*own[k], self._far)
            if apart < gap:
                gap, ends, geoms = apart, found.ravel(), own[k]
        return gap, ends, geoms

    def least(self, data: mujoco.MjData, pairs: Ints, within: float = math.inf) -> Reals:
        """The gaps (k,) of pairs (k,) at the data's places; of those that are farther, at least `within`."""
        key = pairs.tobytes()
        if key not in self._asked:
            some = [self._rows[pair] for pair in pairs.tolist()]
            self._asked[key] = np.concatenate([np.zeros(0, np.int64), *some])
        rows = self._asked[key]
        least = self._least(data, rows)
        found = np.full(self._count, self._far)
        order = np.argsort(least, kind="stable")
        order = order[: int(np.searchsorted(least[order], min(within, self._far)))]
        for row, bound in zip(rows[order].tolist(), least[order].tolist(), strict=True):
            pair = int(self._of[row])
            if bound < found[pair]:
                a, b = int(self._a[row]), int(self._b[row])
                own, _ = self._solids.distance(a, b, float(found[pair]))
                found[pair] = min(found[pair], own)
        return np.asarray(found[pairs])

    def _least(self, data: mujoco.MjData, rows: Ints) -> Reals:
        """Gaps (r,) below which pairs of geoms (r,) are not, by balls about them; places the geoms."""
        self._solids.place(data)
        a, planes = self._a[rows], self._planes[rows]
        off = data.geom_xpos[self._b[rows]] - data.geom_xpos[a]
        away = np.sqrt((off * off).sum(axis=1))
        if planes.any():
            up = data.geom_xmat[a[planes]].reshape(-1, 9)[:, 2::3]
            away[planes] = (off[planes] * up).sum(axis=1)
        return np.asarray(away - self._reach[rows] - self._slack)

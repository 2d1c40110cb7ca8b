"""The nearest points of convex geoms, where MuJoCo's contacts of their faces miss them.

MuJoCo finds the nearest points of two convex geoms (GJK and EPA), then puts contacts of the faces beside them
in their place ("multiccd"), as many as bodies that lie on each other need. The faces of curved geoms are not
those of a polyhedron, and a corner against the side of a cylinder or of a rough mesh may then be deeper than
all contacts say, along a normal of another direction. Where contacts miss them, the nearest points, found
once more without those of faces, are a contact as well; they are the only one where it has another normal.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from rungwise.kernel import Ints, Reals, kernel, steady
from rungwise.scene.space.laws import touching
from rungwise.system.spatial.passing import CAPSULE, CYLINDER, MESH, Frames, Shapes, separation

if TYPE_CHECKING:
    import mujoco

MISSED = 1e-5
"""Contacts miss the nearest points that are nearer by this part of the size of the smaller geom, a tenth of
the overlap that a rigid step may have."""
ALIKE = 0.9
"""Cosine of the angle between two normals from which on contacts of faces stay beside the nearest points.
Chosen by trial, to a factor of two of the angle."""


class Nearest:
    """Collision of a model, with the nearest points of geoms whose contacts miss them."""

    def __init__(self, model: mujoco.MjModel, shapes: Shapes, sizes: Reals) -> None:
        import mujoco

        self._mujoco, self.model, self.shapes, self.sizes = mujoco, model, shapes, sizes
        kinds = shapes.kind[touching(model)]
        faced, convex = np.isin(kinds, (CYLINDER, MESH)), (kinds >= CAPSULE) & (kinds <= MESH)
        self.may_meet = bool(faced.any() and convex.sum() > 1)
        self._doubted = steady(doubted)
        self._doubts, self._first = False, np.zeros(1, np.int64)

    def collide(self, data: mujoco.MjData) -> None:
        """Find the contacts of all geoms where they are."""
        alone = self._alone(data) if self._doubts else None
        self._mujoco.mj_collision(self.model, data)
        count = self._doubts_in(data)
        self._doubts = count > 0
        if count == 0:
            return
        if alone is None:
            alone = self._alone(data)
            self._mujoco.mj_collision(self.model, data)
        for first in self._first[:count].tolist():
            self._mend(first, alone, data)

    def _doubts_in(self, data: mujoco.MjData) -> int:
        c = data.contact
        if data.ncon < 2:  # numpy's arrays of one are contiguous, another type
            return 0
        if len(self._first) < data.ncon:
            self._first = np.zeros(2 * data.ncon, np.int64)
        where = Frames(data.geom_xpos, data.geom_xmat)
        return int(self._doubted(c.geom, c.dist, c.frame, self.shapes, where, self.sizes, self._first))

    def _alone(self, data: mujoco.MjData) -> dict[tuple[int, int], tuple[float, Reals, Reals]]:
        """Gap, place and frame of the nearest points of geoms, without contacts of their faces."""
        flags, option = self.model.opt.disableflags, self.model.opt
        option.disableflags = flags | self._mujoco.mjtDisableBit.mjDSBL_MULTICCD
        self._mujoco.mj_collision(self.model, data)
        option.disableflags = flags
        c = data.contact
        pairs, gaps, places, frames = c.geom.tolist(), c.dist.tolist(), c.pos.copy(), c.frame.copy()
        return {(a, b): (gaps[k], places[k], frames[k]) for k, (a, b) in enumerate(pairs)}

    def _mend(
        self, first: int, alone: dict[tuple[int, int], tuple[float, Reals, Reals]], data: mujoco.MjData
    ) -> None:
        """Add the nearest points to the contacts of two geoms that begin at `first`, or leave them alone."""
        contact = data.contact[first]
        a, b = contact.geom.tolist()
        group = data.contact.geom[first:] == (a, b)
        count = int(np.argmin(np.append(group.all(1), False)))
        gap, place, frame = alone.get((a, b), (math.inf, contact.pos, contact.frame))
        if not gap < data.contact.dist[first : first + count].min() - MISSED * min(self.sizes[[a, b]]):
            return
        if frame[:3] @ contact.frame[:3] > ALIKE:
            self._mujoco.mj_addContact(self.model, data, contact)
            contact = data.contact[data.ncon - 1]
        else:
            data.contact.exclude[first + 1 : first + count] = 1
        contact.dist, contact.pos, contact.frame = gap, place, frame


@kernel
def doubted(
    geom: Ints, dist: Reals, frame: Reals, shapes: Shapes, where: Frames, sizes: Reals, found: Ints
) -> int:
    """Fill in the first of the contacts (c,) of each two geoms that may be nearer than all of them say, for
    how far they are apart along their normal; returns how many there are."""
    count, c = 0, 0
    while c < geom.shape[0]:
        first, a, b, least, apart = c, geom[c, 0], geom[c, 1], math.inf, math.inf
        while c < geom.shape[0] and geom[c, 0] == a and geom[c, 1] == b:
            least = min(least, dist[c])
            c += 1
        if c > first + 1 and a >= 0 and b >= 0 and _have_faces(shapes.kind[a], shapes.kind[b]):
            x, y, z = frame[first, 0], frame[first, 1], frame[first, 2]
            apart = separation(a, b, x, y, z, shapes, where)
            if least > apart + MISSED * min(sizes[a], sizes[b]):
                found[count] = first
                count += 1
    return count


@kernel
def _have_faces(one: int, other: int) -> bool:
    """Whether MuJoCo makes contacts of faces for two geoms by its search for the nearest points."""
    faced = one in (CYLINDER, MESH) or other in (CYLINDER, MESH)
    return faced and CAPSULE <= one <= MESH and CAPSULE <= other <= MESH

"""Distances of the geoms of a model."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from rungwise.kernel import Reals, steady
from rungwise.system.spatial.patch.fields import fields, meet_field
from rungwise.system.spatial.patch.pairs import FULL, allocate_found, allocate_scratch, distance
from rungwise.system.spatial.patch.shapes import FIELD, Frames, Shapes

if TYPE_CHECKING:
    import mujoco

ROOM = 64
"""Contacts of a height field that there is room for at first; it is doubled as often as need be."""
FARTHEST = 10.0
"""How far distances from height fields are known, over the longest side of these."""


class Geoms:
    """The geoms of a model as shapes, where they were placed last."""

    def __init__(self, model: mujoco.MjModel, shapes: Shapes) -> None:
        self.shapes, self.fields, self._count = shapes, fields(model), model.ngeom
        self.frames = Frames(place=np.zeros((model.ngeom + 1, 3)), axes=np.zeros((model.ngeom + 1, 9)))
        self._scratch, self._near, self._distance = (
            allocate_scratch(shapes),
            allocate_found(ROOM),
            steady(distance),
        )

    def place(self, data: mujoco.MjData) -> None:
        """Take over where the geoms are."""
        self.frames.place[: self._count] = data.geom_xpos
        self.frames.axes[: self._count] = data.geom_xmat

    def distance(self, a: int, b: int, within: float = math.inf) -> tuple[float, Reals]:
        """The distance of two geoms, negative where they overlap, and their nearest points (2, 3); of geoms
        that are farther than `within` a bound above it."""
        kinds = self.shapes.kind
        if FIELD in (kinds[a], kinds[b]):
            return self._from_field(a, b, within) if kinds[a] == FIELD else self._from_field(b, a, within)
        s = self._distance(a, b, within, self.shapes, self.frames, self._scratch)
        return s, self._scratch.room.ends.copy()

    def _from_field(self, g: int, h: int, within: float) -> tuple[float, Reals]:
        """The same of a height field and another geom."""
        most, size = min(within, FARTHEST * float(self.shapes.size[g].max())), self.shapes.size[h]
        near, ends = float(size[size > 0.0].min()), np.zeros((2, 3))
        while True:
            near = min(near, most)
            count = meet_field(
                g, h, near, self.shapes, self.fields, self.frames, self._scratch, self._near, 0
            )
            if count == FULL:
                self._near = allocate_found(2 * len(self._near.gap))
            elif count:
                c = int(self._near.gap[:count].argmin())
                gap, way = float(self._near.gap[c]), self._near.normal[c]
                ends[:] = self._near.place[c] - 0.5 * gap * way, self._near.place[c] + 0.5 * gap * way
                return gap, ends
            elif near == most:
                return math.inf, ends
            else:
                near *= 2.0

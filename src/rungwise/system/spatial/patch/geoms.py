"""Distances of the geoms of a model."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from rungwise.kernel import Reals, kernel, steady
from rungwise.system.spatial.patch.fields import Fields, fields, meet_field
from rungwise.system.spatial.patch.pairs import (
    FULL,
    Found,
    Scratch,
    allocate_found,
    allocate_scratch,
    distance,
)
from rungwise.system.spatial.patch.shapes import FIELD, Frames, Shapes

if TYPE_CHECKING:
    import mujoco

ROOM = 64
"""Contacts of a height field that there is room for: where more are found, fewer are nearer."""
EVEN = 1e-9
"""Part of a distance within which as many contacts as there is room for are as near as any."""
FARTHEST = 10.0
"""How far distances from height fields are known, over the longest side of these."""


class Geoms:
    """The geoms of a model as shapes, where they were placed last."""

    def __init__(self, model: mujoco.MjModel, shapes: Shapes) -> None:
        self.shapes, self.fields, self._count = shapes, fields(model), model.ngeom
        self.frames = Frames(place=np.zeros((model.ngeom + 1, 3)), axes=np.zeros((model.ngeom + 1, 9)))
        self._scratch, self._near = allocate_scratch(shapes), allocate_found(ROOM)
        self._nearest = steady(nearest)

    def place(self, data: mujoco.MjData) -> None:
        """Take over where the geoms are."""
        self.frames.place[: self._count] = data.geom_xpos
        self.frames.axes[: self._count] = data.geom_xmat

    def distance(self, a: int, b: int, within: float = math.inf) -> tuple[float, Reals]:
        """The distance of two geoms, negative where they overlap, and their nearest points (2, 3); of geoms
        that are farther than `within` a bound above it."""
        s = self._nearest(a, b, within, self.shapes, self.fields, self.frames, self._scratch, self._near)
        return float(s), self._scratch.room.ends.copy()


@kernel
def nearest(
    a: int, b: int, within: float, shapes: Shapes, fields: Fields, frames: Frames, scratch: Scratch,
    found: Found,
) -> float:  # fmt: skip
    """The distance of two geoms, negative where they overlap; of those that are farther, a bound above
    `within`. The nearest points are put into room.ends."""
    if shapes.kind[a] != FIELD and shapes.kind[b] != FIELD:
        return float(distance(a, b, within, shapes, frames, scratch))
    g, h = (a, b) if shapes.kind[a] == FIELD else (b, a)
    longest, near = 0.0, math.inf
    for k in range(3):
        longest = max(longest, shapes.size[g, k])
        if shapes.size[h, k] > 0.0:
            near = min(near, shapes.size[h, k])
    most, none, full = min(within, FARTHEST * longest), 0.0, math.inf
    while True:
        near = min(near, most)
        count = meet_field(g, h, near, shapes, fields, frames, scratch, found, 0)
        if count == FULL:
            full, count = near, len(found.gap) if near - none <= EVEN * near else 0
        elif count == 0 and near == most:
            return math.inf
        elif count == 0:
            none = near
        if count > 0:
            break
        near = 2.0 * near if math.isinf(full) else 0.5 * (none + full)
    c = 0
    for k in range(1, count):
        c = k if found.gap[k] < found.gap[c] else c
    for k in range(3):
        way = 0.5 * found.gap[c] * found.normal[c, k]
        scratch.room.ends[0, k] = found.place[c, k] - way
        scratch.room.ends[1, k] = found.place[c, k] + way
    return float(found.gap[c])

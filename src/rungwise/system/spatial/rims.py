"""Cylinders that stand on planes: where MuJoCo's contacts of their rims are lost in rounding.

MuJoCo looks for the lowest point of a rim along the part of the plane's normal that lies across the axis.
Where a cylinder stands upright but for 1e-12 rad or so, that part is rounding: made a unit vector, it leads
out of the end face, and contacts are deep below the plane, or so far above it that there are none. Such
cylinders are made upright before MuJoCo looks for contacts, and their contacts are put where their rims are.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from rungwise.kernel import Ints, Reals, kernel
from rungwise.scene.space.laws import touching

if TYPE_CHECKING:
    import mujoco

UPRIGHT = 1e-3
"""Tilt, in rad, up to which contacts are found anew; of a greater one MuJoCo keeps all but three digits."""
LEVEL = 1e-8
"""Tilt, in rad, that no gap tells from none: contacts then stay where they are on the rim."""
RIM, BOTH = 3, 4
"""Contacts of a cylinder that stands: three of its lower rim; one of the upper rim, after the first."""


class Rims:
    """What mends contacts of planes and cylinders in the data of a model."""

    def __init__(self, model: mujoco.MjModel) -> None:
        import mujoco

        kinds = mujoco.mjtGeom
        self.size = model.geom_size
        self.is_plane = (model.geom_type == kinds.mjGEOM_PLANE).astype(np.int64)
        self.stands = (model.geom_type == kinds.mjGEOM_CYLINDER).astype(np.int64)
        touches = touching(model)
        self.may_meet = bool((self.is_plane[touches]).any() and self.stands[touches].any())

    def straighten(self, data: mujoco.MjData) -> None:
        """Make cylinders upright that no gap to a plane tells from upright ones."""
        straighten(self.is_plane, self.stands, data.geom_xmat)

    def mend(self, data: mujoco.MjData) -> None:
        """Put the contacts of cylinders that stand where their rims are."""
        c = data.contact
        mend_rims(
            c.geom,
            c.frame,
            c.pos,
            c.dist,
            self.is_plane,
            self.stands,
            self.size,
            data.geom_xpos,
            data.geom_xmat,
        )


@kernel
def straighten(is_plane: Ints, stands: Ints, turn: Reals) -> None:
    """Put the axes in turn (g, 9) of cylinders that stand on planes, but for a tilt below `LEVEL`, along the
    normals of these, made unit vectors to the last digit: MuJoCo takes what they lack for a tilt."""
    for a in range(len(is_plane)):
        for b in range(len(stands)):
            if is_plane[a] and stands[b]:
                along, off = 0.0, 0.0
                for i in (2, 5, 8):
                    along += turn[a, i] * turn[b, i]
                side = 1.0 if along > 0.0 else -1.0
                for i in (2, 5, 8):
                    off = max(off, abs(turn[b, i] - side * turn[a, i]))
                if off < LEVEL:
                    length = math.sqrt(turn[a, 2] ** 2 + turn[a, 5] ** 2 + turn[a, 8] ** 2)
                    for i in (2, 5, 8):
                        turn[a, i] /= length
                        turn[b, i] = side * turn[a, i]


@kernel
def mend_rims(
    geom: Ints,
    frame: Reals,
    pos: Reals,
    dist: Reals,
    is_plane: Ints,
    stands: Ints,
    size: Reals,
    centre: Reals,
    turn: Reals,
) -> None:
    """Find the contacts of each standing cylinder with a plane anew, in pos (c, 3) and dist (c,)."""
    c = 0
    while c < geom.shape[0]:
        first, a, b = c, geom[c, 0], geom[c, 1]
        while c < geom.shape[0] and geom[c, 0] == a and geom[c, 1] == b:
            c += 1
        if a >= 0 and b >= 0 and is_plane[a] and stands[b] and RIM <= c - first <= BOTH:
            _mend(first, c, frame[first], pos, dist, size[b], centre[a], centre[b], turn[b])


@kernel
def _mend(
    first: int,
    end: int,
    normal: Reals,
    pos: Reals,
    dist: Reals,
    size: Reals,
    plane: Reals,
    centre: Reals,
    turn: Reals,
) -> None:
    down = 0.0
    for i in range(3):
        down -= turn[3 * i + 2] * normal[i]
    side = 1.0 if down > 0.0 else -1.0
    x, y, z = side * turn[2], side * turn[5], side * turn[8]
    u, v, w = -normal[0] - abs(down) * x, -normal[1] - abs(down) * y, -normal[2] - abs(down) * z
    tilt = math.sqrt(u * u + v * v + w * w)
    if tilt > UPRIGHT:
        return
    if tilt < LEVEL:
        u, v, w = turn[0], turn[3], turn[6]
    along = u * x + v * y + w * z
    u, v, w = u - along * x, v - along * y, w - along * z
    length = math.sqrt(u * u + v * v + w * w)
    u, v, w = u / length, v / length, w / length
    for c in range(first, end):
        upper = end - first == BOTH and c == first + 1
        turned = 0.0 if c == first or upper else (1.0 if c == end - 1 else -1.0)
        ahead, across = 1.0 if turned == 0.0 else -0.5, turned * math.sqrt(0.75)
        p = size[0] * (ahead * u + across * (y * w - z * v)) + (-size[1] if upper else size[1]) * x
        q = size[0] * (ahead * v + across * (z * u - x * w)) + (-size[1] if upper else size[1]) * y
        r = size[0] * (ahead * w + across * (x * v - y * u)) + (-size[1] if upper else size[1]) * z
        p, q, r = p + centre[0], q + centre[1], r + centre[2]
        gap = normal[0] * (p - plane[0]) + normal[1] * (q - plane[1]) + normal[2] * (r - plane[2])
        dist[c] = gap
        pos[c, 0], pos[c, 1] = p - 0.5 * gap * normal[0], q - 0.5 * gap * normal[1]
        pos[c, 2] = r - 0.5 * gap * normal[2]

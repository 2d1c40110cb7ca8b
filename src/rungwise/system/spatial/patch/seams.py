"""Boxes of one piece that touch each other, as the boards of a floor: no contact with a covered face.

Geoms meet alone. Where a corner has only just passed the seam of two boxes that are flush, the shortest way
out of the second is back through the face between them; where an edge is about to pass that of another box,
the nearest points of both may be joined by any normal between those of its faces.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rungwise.block import Block
from rungwise.kernel import Ints, Reals, kernel
from rungwise.system.spatial.patch.pairs import Found
from rungwise.system.spatial.patch.shapes import BOX, CYLINDER, Frames, Shapes

if TYPE_CHECKING:
    import mujoco

FLUSH = 1e-5
"""Part of the smaller box by which boxes that are flush may be apart, a tenth of the overlap that a rigid
step may have."""
BEYOND = 2.0
"""How far beyond a face is looked whether another box covers it, in the distance that counts as flush."""
FACE = 1.0 - 1e-9
"""Cosine of the angle from which on a normal is that of a face: 5e-5 rad."""


class Box(NamedTuple):
    """A box in the world: centre (3,), axes as columns of turn (9,), and half of its edges (3,)."""

    centre: Reals
    turn: Reals
    half: Reals


class Seams(Block):
    """The boxes of the same piece that each geom touches: where they begin (g + 1,), and their numbers."""

    first: Ints
    others: Ints


def seams(model: mujoco.MjModel) -> Seams:
    import mujoco

    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    boxes = np.flatnonzero(model.geom_type == BOX).tolist()
    shapes = {g: Box(data.geom_xpos[g], data.geom_xmat[g], model.geom_size[g]) for g in boxes}
    piece, first, others = model.body_weldid[model.geom_bodyid], [0], list[int]()
    for g in range(model.ngeom):
        beside = [h for h in boxes if g in shapes and h != g and piece[h] == piece[g]]
        others += [
            h for h in beside if far_apart(shapes[g], shapes[h]) <= FLUSH * model.geom_size[[g, h]].min()
        ]
        first.append(len(others))
    return Seams(first=np.array(first), others=np.array(others, np.int64))


@kernel
def far_apart(one: Box, other: Box) -> float:
    """How far two boxes are apart at least, on the normals of their faces."""
    far = -math.inf
    for k in range(6):
        far = max(far, _apart(k % 3, (other if k >= 3 else one).turn, one, other))
    return far


@kernel
def is_behind(c: int, seams: Seams, shapes: Shapes, frames: Frames, found: Found) -> bool:
    """Whether a contact is with a face of a box that another box of its piece covers, and beyond which the
    first does not reach there."""
    n, place, gap = found.normal[c], found.place[c], found.gap[c]
    for side in range(2):
        g, away = found.geoms[c, side], 1.0 - 2.0 * side
        for at in range(seams.first[g], seams.first[g + 1]):
            h = seams.others[at]
            own = Box(frames.place[g], frames.axes[g], shapes.size[g])
            cover = Box(frames.place[h], frames.axes[h], shapes.size[h])
            if is_covered(own, cover, n, away, place, gap):
                return True
            if is_hidden(own, cover, n, away, place, gap) and not (
                _is_of_face(found.geoms[c, 0], n, shapes, frames)
                or _is_of_face(found.geoms[c, 1], n, shapes, frames)
            ):
                return True
    return False


@kernel
def is_covered(own: Box, cover: Box, normal: Reals, away: float, pos: Reals, dist: float) -> bool:
    """Whether the place of a contact on a box is covered by another one, beyond whose nearest face next to it
    the first does not reach; `away` times the normal leads out of the first box."""
    smaller = math.inf
    for i in range(3):
        smaller = min(smaller, own.half[i], cover.half[i])
    flush = FLUSH * smaller
    nearest, beside, sign = math.inf, -1, 1.0
    for i in range(3):
        place, out = 0.0, 0.0
        for k in range(3):
            surface = pos[k] + away * normal[k] * (BEYOND * flush - 0.5 * dist)
            place += cover.turn[3 * k + i] * (surface - cover.centre[k])
            out += cover.turn[3 * k + i] * away * normal[k]
        left = cover.half[i] - abs(place)
        if left < -flush:
            return False
        if left < nearest and abs(out) < 0.5:
            nearest, beside, sign = left, i, math.copysign(1.0, place)
    if beside < 0:
        return False
    reach = 0.0
    for k in range(3):
        reach += sign * cover.turn[3 * k + beside] * (own.centre[k] - cover.centre[k])
    for j in range(3):
        along = 0.0
        for k in range(3):
            along += cover.turn[3 * k + beside] * own.turn[3 * k + j]
        reach += abs(along) * own.half[j]
    return bool(reach <= cover.half[beside] + flush)


@kernel
def is_hidden(own: Box, cover: Box, normal: Reals, away: float, pos: Reals, dist: float) -> bool:
    """Whether the place of a contact on a box is on another one, too, which reaches beyond a plane across the
    normal: of edges and corners, that one is the nearer of both."""
    smaller, height = math.inf, 0.0
    for i in range(3):
        smaller = min(smaller, own.half[i], cover.half[i])
    for i in range(3):
        place, along = 0.0, 0.0
        for k in range(3):
            surface = pos[k] - 0.5 * away * normal[k] * dist
            place += cover.turn[3 * k + i] * (surface - cover.centre[k])
            along += cover.turn[3 * k + i] * away * normal[k]
        if abs(place) > cover.half[i] + FLUSH * smaller:
            return False
        height += abs(along) * cover.half[i] - along * place
    return bool(height > BEYOND * FLUSH * smaller)


@kernel
def _is_of_face(g: int, n: Reals, shapes: Shapes, frames: Frames) -> bool:
    """Whether a direction is across a face of a geom, or an end of a cylinder."""
    u = frames.axes[g]
    p = u[0] * n[0] + u[3] * n[1] + u[6] * n[2]
    q = u[1] * n[0] + u[4] * n[1] + u[7] * n[2]
    r = u[2] * n[0] + u[5] * n[1] + u[8] * n[2]
    most = abs(r) if shapes.kind[g] == CYLINDER else 0.0
    for f in range(shapes.face_first[g], shapes.face_end[g]):
        along = shapes.normals[f, 0] * p + shapes.normals[f, 1] * q + shapes.normals[f, 2] * r
        most = max(most, abs(along))
    return most > FACE


@kernel
def _apart(i: int, axes: Reals, one: Box, other: Box) -> float:
    """How far the boxes are apart along axis i of these, which are those of one box."""
    along, radius = 0.0, 0.0
    for k in range(3):
        along += axes[3 * k + i] * (other.centre[k] - one.centre[k])
    for j in range(3):
        mine, theirs = 0.0, 0.0
        for k in range(3):
            mine += axes[3 * k + i] * one.turn[3 * k + j]
            theirs += axes[3 * k + i] * other.turn[3 * k + j]
        radius += abs(mine) * one.half[j] + abs(theirs) * other.half[j]
    return abs(along) - radius

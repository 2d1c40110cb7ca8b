"""Boxes face to face: their contacts in place of the one that MuJoCo finds where edges seem farther apart,
and none with a face that another box of the same piece covers.

MuJoCo takes the axis of 15 on which two boxes are farthest apart (Gottschalk and others 1996, OBBTree). Where
faces are flush but for 1e-12 rad or so, the cross product of two edges is the normal of the faces up to
rounding, wins every tenth time, and leaves one contact of two edges where there are four of faces. So it does
where soft faces press on each other at a small angle and one hangs over an edge of the other: on the normal
of a face, boxes then seem to overlap by more than they do where they touch.

It takes each geom alone. Where a corner has only just passed the seam of two boxes that are flush, as the
boards of a floor, the shortest way out of the second is back through the face between them.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rungwise.kernel import Ints, Reals, kernel, steady

if TYPE_CHECKING:
    import mujoco

FLUSH = 1e-5
"""An axis of two edges counts where boxes are farther apart on it than on any normal of a face, by this part
of the smaller box, a tenth of the overlap that a rigid step may have."""
BEYOND = 2.0
"""How far beyond a face is looked whether another box covers it, in the distance that counts as flush."""
CORNERS = 16
"""Room for the corners of a face that another has cut: eight at most, and one more for each of four cuts."""


class Box(NamedTuple):
    """A box in the world: centre (3,), axes as columns of turn (9,), and half of its edges (3,)."""

    centre: Reals
    turn: Reals
    half: Reals


class Room(NamedTuple):
    """What is found: point and gap (c, 4) of contacts, and their normal (3,); scratch: cut, spare (c, 3)."""

    found: Reals
    normal: Reals
    cut: Reals
    spare: Reals


class Boxes:
    """What mends contacts of boxes in the data of a model."""

    def __init__(self, model: mujoco.MjModel) -> None:
        import mujoco

        self.model = model
        self.is_box = (model.geom_type == mujoco.mjtGeom.mjGEOM_BOX).astype(np.int64)
        self.may_meet = bool(self.is_box.sum() > 1)
        # By whether there are several contacts, whose array is another type then.
        self._single_contacts = steady(single_contacts), steady(single_contacts)
        self._face_contacts, self._fill_tangents = steady(face_contacts), steady(fill_tangents)
        self._alone = np.zeros(1, np.int64)
        self._frame = np.zeros(9)
        self._seams = seams(model) if self.may_meet else None
        self._room = Room(
            np.zeros((CORNERS, 4)), self._frame[:3], np.zeros((CORNERS, 3)), np.zeros((CORNERS, 3))
        )

    def mend(self, data: mujoco.MjData) -> None:
        """Put contacts of faces in place of single ones of edges, and leave out those with covered faces."""
        contact = data.contact
        if len(self._alone) < data.ncon:
            self._alone = np.zeros(2 * data.ncon, np.int64)
        count = self._single_contacts[data.ncon > 1](contact.geom, self.is_box, self._alone)
        for c in self._alone[:count].tolist():
            self._replace(c, data)
        if self._seams is not None and data.ncon:
            contact = data.contact
            leave_out(
                contact.geom, contact.frame, contact.pos, contact.dist, contact.exclude, *self._seams,
                data.geom_xpos, data.geom_xmat, self.model.geom_size,
            )  # fmt: skip

    def _replace(self, c: int, data: mujoco.MjData) -> None:
        import mujoco

        contact, sizes = data.contact[c], self.model.geom_size
        one, other = (Box(data.geom_xpos[g], data.geom_xmat[g], sizes[g]) for g in contact.geom)
        count = self._face_contacts(one, other, float(contact.dist), self._room)
        near = [row for row in self._room.found[:count].tolist() if row[3] <= contact.includemargin]
        if not near:
            return
        self._fill_tangents(self._frame)
        contact.frame = self._frame
        for k, (*place, gap) in enumerate(near):
            contact.pos, contact.dist = place, gap
            if k + 1 < len(near):
                mujoco.mj_addContact(self.model, data, contact)


def seams(model: mujoco.MjModel) -> tuple[Ints, Ints] | None:
    """The boxes of the same piece that each geom touches: where they begin (g + 1,), and their numbers; None
    if there are none."""
    import mujoco

    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    boxes = np.flatnonzero(model.geom_type == mujoco.mjtGeom.mjGEOM_BOX).tolist()
    shapes = {g: Box(data.geom_xpos[g], data.geom_xmat[g], model.geom_size[g]) for g in boxes}
    piece, first, others = model.body_weldid[model.geom_bodyid], [0], list[int]()
    for g in range(model.ngeom):
        beside = [h for h in boxes if g in shapes and h != g and piece[h] == piece[g]]
        others += [
            h for h in beside if far_apart(shapes[g], shapes[h]) <= FLUSH * model.geom_size[[g, h]].min()
        ]
        first.append(len(others))
    return (np.array(first), np.array(others)) if others else None


@kernel
def far_apart(one: Box, other: Box) -> float:
    """How far two boxes are apart at least, on the normals of their faces."""
    far = -math.inf
    for k in range(6):
        far = max(far, _apart(k % 3, (other if k >= 3 else one).turn, one, other))
    return far


@kernel
def leave_out(
    geom: Ints, frame: Reals, pos: Reals, dist: Reals, exclude: Ints, first: Ints, others: Ints,
    centre: Reals, turn: Reals, size: Reals,
) -> None:  # fmt: skip
    """Exclude contacts with a face of a box that another box of its piece covers, and beyond which the first
    does not reach there."""
    for c in range(geom.shape[0]):
        for side in range(2):
            g, away = geom[c, side], 1.0 - 2.0 * side
            if g < 0:
                continue
            for at in range(first[g], first[g + 1]):
                h = others[at]
                own, cover = Box(centre[g], turn[g], size[g]), Box(centre[h], turn[h], size[h])
                if is_covered(own, cover, frame[c, :3], away, pos[c], dist[c]):
                    exclude[c] = 1


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
def fill_tangents(frame: Reals) -> None:
    """Two tangents, right-handed, after the normal at the beginning of a frame (9,), as MuJoCo has them:
    friction may differ along them. The first is next to the axis y, or to z where the normal is near y."""
    x, y, z = frame[0], frame[1], frame[2]
    if -0.5 < y < 0.5:
        frame[3], frame[4], frame[5] = -y * x, 1.0 - y * y, -y * z
    else:
        frame[3], frame[4], frame[5] = -z * x, -z * y, 1.0 - z * z
    length = math.sqrt(frame[3] * frame[3] + frame[4] * frame[4] + frame[5] * frame[5])
    for i in range(3, 6):
        frame[i] /= length
    frame[6] = y * frame[5] - z * frame[4]
    frame[7] = z * frame[3] - x * frame[5]
    frame[8] = x * frame[4] - y * frame[3]


@kernel
def single_contacts(geom: Ints, is_box: Ints, alone: Ints) -> int:
    """Fill in the numbers of contacts that are the only one of two boxes; returns how many there are."""
    count, n = 0, geom.shape[0]
    for c in range(n):
        a, b = geom[c, 0], geom[c, 1]
        if a < 0 or b < 0 or not (is_box[a] and is_box[b]):
            continue
        before = c > 0 and geom[c - 1, 0] == a and geom[c - 1, 1] == b
        after = c + 1 < n and geom[c + 1, 0] == a and geom[c + 1, 1] == b
        if not before and not after:
            alone[count] = c
            count += 1
    return count


@kernel
def face_contacts(one: Box, other: Box, apart: float, room: Room) -> int:
    """Contacts of two boxes face to face; `apart`: how far they are by two edges. The normal is from the
    first box to the other. Returns how many contacts there are, 0 where faces do not lie over each other, or
    edges are farther apart than the faces are, both on their normals and where they press on each other.
    """
    far, axis, swap = -math.inf, 0, False
    for k in range(6):
        of_other = k >= 3
        reach = _apart(k % 3, (other if of_other else one).turn, one, other)
        if reach > far:
            far, axis, swap = reach, k % 3, of_other
    smaller = math.inf
    for i in range(3):
        smaller = min(smaller, one.half[i], other.half[i])
    flush = FLUSH * smaller
    count = _lying_on(axis, other, one, room) if swap else _lying_on(axis, one, other, room)
    if swap:
        for i in range(3):
            room.normal[i] = -room.normal[i]
    return count if apart <= far + flush or _press(count, apart - flush, flush, room.found) else 0


@kernel
def _press(count: int, least: float, flush: float, found: Reals) -> bool:
    """Whether faces press on each other at several points, nowhere deeper than so."""
    pressed = 0
    for c in range(count):
        if found[c, 3] < least:
            return False
        pressed += found[c, 3] <= flush
    return pressed > 1


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


@kernel
def _lying_on(i: int, one: Box, above: Box, room: Room) -> int:
    """Points where the nearest face of the box above lies over face i of the first, and their gaps."""
    (centre, turn, size), (other, other_turn, other_size) = one, above
    found, normal, cut, spare = room
    along = 0.0
    for k in range(3):
        along += turn[3 * k + i] * (other[k] - centre[k])
    side = 1.0 if along > 0.0 else -1.0
    facing, most, sign = 0, -1.0, 1.0
    for j in range(3):
        dot = 0.0
        for k in range(3):
            dot += side * turn[3 * k + i] * other_turn[3 * k + j]
        if abs(dot) > most:
            facing, most, sign = j, abs(dot), (-1.0 if dot > 0.0 else 1.0)
    a, b = (facing + 1) % 3, (facing + 2) % 3
    u, w = (i + 1) % 3, (i + 2) % 3
    for corner in range(4):
        x = other_size[a] * (1.0 if corner in (0, 3) else -1.0)
        y = other_size[b] * (1.0 if corner < 2 else -1.0)
        for axis in range(3):
            local = 0.0
            for k in range(3):
                place = other[k] - centre[k] + sign * other_size[facing] * other_turn[3 * k + facing]
                place += x * other_turn[3 * k + a] + y * other_turn[3 * k + b]
                local += turn[3 * k + (i, u, w)[axis]] * place
            cut[corner, axis] = side * local - size[i] if axis == 0 else local
    count = 4
    for axis, half in ((1, size[u]), (2, size[w])):
        for end in (1.0, -1.0):
            count = _clip(axis, end, half, count, cut, spare)
    for c in range(count):
        found[c, 3] = cut[c, 0]
        for k in range(3):
            found[c, k] = centre[k] + side * (size[i] + 0.5 * cut[c, 0]) * turn[3 * k + i]
            found[c, k] += cut[c, 1] * turn[3 * k + u] + cut[c, 2] * turn[3 * k + w]
    for k in range(3):
        normal[k] = side * turn[3 * k + i]
    return count


@kernel
def _clip(axis: int, end: float, half: float, count: int, cut: Reals, spare: Reals) -> int:
    """Cut a polygon of height and place (count, 3) where its place along an axis passes `half`."""
    kept = 0
    for c in range(count):
        after = (c + 1) % count
        here, there = half - end * cut[c, axis], half - end * cut[after, axis]
        if here >= 0.0:
            for k in range(3):
                spare[kept, k] = cut[c, k]
            kept += 1
        if (here >= 0.0) != (there >= 0.0):
            part = here / (here - there)
            for k in range(3):
                spare[kept, k] = cut[c, k] + part * (cut[after, k] - cut[c, k])
            kept += 1
    for c in range(kept):
        for k in range(3):
            cut[c, k] = spare[c, k]
    return kept

"""Boxes face to face: their contacts in place of the one that MuJoCo finds where edges seem farther apart.

MuJoCo takes the axis of 15 on which two boxes are farthest apart (Gottschalk and others 1996, OBBTree). Where
faces are flush but for 1e-12 rad or so, the cross product of two edges is the normal of the faces up to
rounding, wins every tenth time, and leaves one contact of two edges where there are four of faces.
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
        self._room = Room(
            np.zeros((CORNERS, 4)), self._frame[:3], np.zeros((CORNERS, 3)), np.zeros((CORNERS, 3))
        )

    def mend(self, data: mujoco.MjData) -> None:
        """Put contacts of faces in place of single ones of edges."""
        contact = data.contact
        if len(self._alone) < data.ncon:
            self._alone = np.zeros(2 * data.ncon, np.int64)
        count = self._single_contacts[data.ncon > 1](contact.geom, self.is_box, self._alone)
        for c in self._alone[:count].tolist():
            self._replace(c, data)

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


@kernel
def fill_tangents(frame: Reals) -> None:
    """Two tangents, right-handed, after the normal at the beginning of a frame (9,)."""
    least, x, y, z = 0, frame[0], frame[1], frame[2]
    for i in range(1, 3):
        if abs(frame[i]) < abs(frame[least]):
            least = i
    frame[3], frame[4], frame[5] = 0.0, z, -y
    if least == 1:
        frame[3], frame[4], frame[5] = -z, 0.0, x
    elif least == 2:
        frame[3], frame[4], frame[5] = y, -x, 0.0
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
    """Contacts of two boxes face to face, if they are no farther apart than on the normal of a face; `apart`:
    how far they are by two edges. The normal is from the first box to the other. Returns how many contacts
    there are, 0 where faces do not lie over each other or edges are farther apart.
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
    if apart > far + FLUSH * smaller:
        return 0
    if not swap:
        return _lying_on(axis, one, other, room)
    count = _lying_on(axis, other, one, room)
    for i in range(3):
        room.normal[i] = -room.normal[i]
    return count


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

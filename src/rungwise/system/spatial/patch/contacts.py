"""All contacts of the geoms of a model: which may touch, where they do, and the rows of what moves them."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from rungwise.block import Block
from rungwise.kernel import Ints, Reals, copy, kernel
from rungwise.scene.space.laws import LEAST, touching_pairs
from rungwise.system.spatial.features import ContactSet, Seen, seen_in
from rungwise.system.spatial.native import Ints32
from rungwise.system.spatial.patch.fields import Fields, meet_field
from rungwise.system.spatial.patch.geoms import Geoms
from rungwise.system.spatial.patch.pairs import (
    FULL,
    Found,
    Scratch,
    allocate_found,
    copy_contact,
    meet,
)
from rungwise.system.spatial.patch.seams import Seams, is_behind, seams
from rungwise.system.spatial.patch.shapes import FIELD, PLANE, Frames, Shapes

if TYPE_CHECKING:
    import mujoco

ROOM = 64
"""Contacts that there is room for at first; it is doubled as often as need be."""
WIDE = 6
"""Rows of a contact at most: three of motions, three of turns."""


class Pairs(Block):
    """Geoms (p, 2) that may touch, in the order of their types, and the kind (p,) of their contacts, in short
    integers, for they are many; radii (g,) of balls about geoms, 0 of a plane; of each kind the directions in
    which contacts resist (k,), and friction (k, 5): sliding, two directions, torsional, rolling, two
    directions."""

    geoms: Ints32
    kind: Ints32
    radius: Reals
    dim: Ints
    friction: Reals


class Tree(Block):
    """Which velocities move a body: the last (b,) of its own or of the bodies that carry it, -1 if none; the
    one before each (n,); and the body (b,) about whose centre of mass MuJoCo tells motions."""

    last: Ints
    before: Ints
    root: Ints


class Motions(Block):
    """Turn and speed (n, 6) by each velocity about the centres of mass (b, 3), in MuJoCo's memory."""

    each: Reals
    centre: Reals


def pairs(model: mujoco.MjModel) -> Pairs:
    """The geoms that may touch and of which something moves one, with friction as MuJoCo combines it."""
    m, kind = model, model.geom_type.astype(np.int64)
    geoms = touching_pairs(m)
    fixed = tree(m).last[m.geom_bodyid] < 0
    geoms = geoms[~fixed[geoms].all(axis=1) & ~np.isin(kind[geoms], range(PLANE, 8), invert=True).any(axis=1)]
    swap = kind[geoms[:, 0]] > kind[geoms[:, 1]]
    geoms[swap] = geoms[swap][:, ::-1]
    count, own, kinds = _kinds(m)
    a, b = np.divmod(np.arange(count * count), count)
    a, b = kinds[a], kinds[b]
    first, second = m.geom_priority[a], m.geom_priority[b]
    dims = np.maximum(m.geom_condim[a], m.geom_condim[b])
    dims = np.where(first > second, m.geom_condim[a], np.where(first < second, m.geom_condim[b], dims))
    slide = np.maximum(m.geom_friction[a], m.geom_friction[b])
    slide = np.where((first > second)[:, None], m.geom_friction[a], slide)
    slide = np.where((first < second)[:, None], m.geom_friction[b], slide)
    of_pair = own[geoms[:, 0]] * count + own[geoms[:, 1]]
    for k, named in enumerate(np.stack([m.pair_geom1, m.pair_geom2], axis=1)):
        of_pair[(np.sort(geoms) == np.sort(named)).all(axis=1)] = count * count + k
    friction = np.concatenate([slide[:, [0, 0, 1, 2, 2]], m.pair_friction])
    return Pairs(
        geoms=geoms.astype(np.int32), kind=of_pair.astype(np.int32),
        radius=np.where(kind == PLANE, 0.0, m.geom_rbound),
        dim=np.concatenate([dims, m.pair_dim]).astype(np.int64),
        friction=np.ascontiguousarray(np.maximum(friction, LEAST)),
    )  # fmt: skip


def _kinds(model: mujoco.MjModel) -> tuple[int, Ints, Ints]:
    """How many geoms there are that contacts resist otherwise; which of these each geom is like (g,), and one
    geom of each (k,)."""
    m = model
    numbers = np.column_stack([m.geom_condim, m.geom_priority, m.geom_friction])
    rows, geoms, own = np.unique(numbers, axis=0, return_index=True, return_inverse=True)
    return len(rows), own.ravel().astype(np.int64), geoms.astype(np.int64)


def tree(model: mujoco.MjModel) -> Tree:
    m, last = model, np.full(model.nbody, -1)
    for b in range(1, m.nbody):
        own = int(m.body_dofadr[b] + m.body_dofnum[b] - 1)
        last[b] = own if m.body_dofnum[b] else last[m.body_parentid[b]]
    return Tree(
        last=last.astype(np.int64),
        before=m.dof_parentid.astype(np.int64),
        root=m.body_rootid.astype(np.int64),
    )


class Finder(Block):
    """What finds contacts: the pairs and their geoms, which MuJoCo places at geom_place (g, 3) and geom_axes
    (g, 9); the pair (c,) of each contact that was found, and all that is said of these; `near` is scratch for
    distances."""

    pairs: Pairs
    shapes: Shapes
    fields: Fields
    seams: Seams
    tree: Tree
    motions: Motions
    geom_place: Reals
    geom_axes: Reals
    frames: Frames
    scratch: Scratch
    near: Found
    found: Found
    of: Ints
    contacts: ContactSet


class Contacts(Geoms):
    """Finds the contacts of the geoms of a model where its data has them."""

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, shapes: Shapes) -> None:
        super().__init__(model, shapes)
        self.pairs, self._tree, self._seams, self._data = pairs(model), tree(model), seams(model), data
        self._wide = 1 + max((len(_chain(self._tree, b)) for b in range(model.nbody)), default=0)
        self.finder = self._with_room(ROOM)

    def _with_room(self, most: int) -> Finder:
        rows, found, data = WIDE * most, allocate_found(most), self._data
        contacts = ContactSet(
            count=np.zeros(1, np.int64), dist=found.gap, pos=found.place, frame=np.zeros((most, 9)),
            friction=np.zeros((most, 5)), dim=np.zeros(most, np.int64), geom=found.geoms,
            address=np.zeros(most, np.int64), first=np.zeros(rows, np.int64),
            entries=np.zeros(rows, np.int64), column=np.zeros(2 * self._wide * rows, np.int64),
            J=np.zeros(2 * self._wide * rows),
        )  # fmt: skip
        return Finder(
            pairs=self.pairs, shapes=self.shapes, fields=self.fields, seams=self._seams, tree=self._tree,
            motions=Motions(each=data.cdof, centre=data.subtree_com), geom_place=data.geom_xpos,
            geom_axes=data.geom_xmat, frames=self.frames, scratch=self._scratch, near=self._near, found=found,
            of=np.zeros(most, np.int64), contacts=contacts,
        )  # fmt: skip

    def give_room(self) -> None:
        """Make room for twice as many contacts, in another finder."""
        self.finder = self._with_room(2 * len(self.finder.of))

    def within(self, margin: float) -> Seen:
        """The contacts that are nearer than `margin`."""
        while not look(margin, self.finder):
            self.give_room()
        return seen_in(self.finder.contacts)


@kernel
def look(within: float, f: Finder) -> bool:
    """Fill in the contacts that are nearer than `within`, where the geoms are now; False where there is no
    room for all."""
    copy(f.geom_place, f.frames.place[: len(f.geom_place)])
    copy(f.geom_axes, f.frames.axes[: len(f.geom_axes)])
    count = find(within, f.pairs, f.shapes, f.fields, f.seams, f.frames, f.scratch, f.found, f.of)
    if count == FULL:
        return False
    f.contacts.count[0] = count
    put_rows(count, f.of, f.found, f.pairs, f.shapes, f.tree, f.motions, f.contacts)
    return True


def _chain(made: Tree, body: int) -> list[int]:
    """The velocities that move a body."""
    found, at = list[int](), int(made.last[body])
    while at >= 0:
        found.append(at)
        at = int(made.before[at])
    return found


@kernel
def find(
    within: float, pairs: Pairs, shapes: Shapes, fields: Fields, seams: Seams, frames: Frames,
    scratch: Scratch, found: Found, of: Ints,
) -> int:  # fmt: skip
    """Fill in the contacts that are nearer than `within`, and the pair (c,) of each; returns how many, or
    `FULL`."""
    count, place = 0, frames.place
    for p in range(pairs.kind.shape[0]):
        a, b = int(pairs.geoms[p, 0]), int(pairs.geoms[p, 1])
        x, y, z = place[b, 0] - place[a, 0], place[b, 1] - place[a, 1], place[b, 2] - place[a, 2]
        most, before = pairs.radius[a] + pairs.radius[b] + within, count
        if shapes.kind[a] == PLANE:
            u = frames.axes[a]
            if shapes.kind[b] == PLANE or shapes.kind[b] == FIELD or x * u[2] + y * u[5] + z * u[8] > most:
                continue
        elif x * x + y * y + z * z > most * most:
            continue
        if shapes.kind[a] == FIELD:
            if shapes.kind[b] != FIELD:
                count = meet_field(a, b, within, shapes, fields, frames, scratch, found, count)
        else:
            count = meet(a, b, within, shapes, frames, scratch, found, count)
        if count == FULL:
            return FULL
        last, count = count, before
        for c in range(before, last):
            if not is_behind(c, seams, shapes, frames, found):
                copy_contact(c, count, found)
                of[count] = p
                count += 1
    return count


@kernel
def put_rows(
    count: int,
    of: Ints,
    found: Found,
    pairs: Pairs,
    shapes: Shapes,
    tree: Tree,
    motions: Motions,
    seen: ContactSet,
) -> None:
    """Fill in frames, friction, and the rows of contacts: of the second body's motion less the first one's,
    in the frame of the contact."""
    rows, entries = 0, 0
    for c in range(count):
        p, frame = of[c], seen.frame[c]
        for k in range(3):
            frame[k] = found.normal[c, k]
        fill_tangents(frame)
        for k in range(5):
            seen.friction[c, k] = pairs.friction[pairs.kind[p], k]
        dim = seen.dim[c] = pairs.dim[pairs.kind[p]]
        one, other = shapes.body[found.geoms[c, 0]], shapes.body[found.geoms[c, 1]]
        width = _columns(one, other, entries, tree, seen)
        seen.address[c] = rows if width else -1
        for i in range(dim if width else 0):
            seen.first[rows + i], seen.entries[rows + i] = entries + i * width, width
        for e in range(width):
            _put_column(c, entries, e, width, dim, one, other, found, tree, motions, seen)
        if width:
            rows, entries = rows + dim, entries + dim * width


@kernel
def _columns(one: int, other: int, begin: int, tree: Tree, seen: ContactSet) -> int:
    """Fill in the velocities that move two bodies against each other, those of the second as they are and
    those of the first as -1 - j; returns how many."""
    i, j, count = tree.last[one], tree.last[other], 0
    while i != j:
        if i > j:
            seen.column[begin + count], i = -1 - i, tree.before[i]
        else:
            seen.column[begin + count], j = j, tree.before[j]
        count += 1
    return count


@kernel
def _put_column(
    c: int, begin: int, e: int, width: int, dim: int, one: int, other: int, found: Found, tree: Tree,
    motions: Motions, seen: ContactSet,
) -> None:  # fmt: skip
    """Fill in what one velocity does to the rows of a contact."""
    j = seen.column[begin + e]
    body, sign = (other, 1.0) if j >= 0 else (one, -1.0)
    if j < 0:
        j = -1 - j
        seen.column[begin + e] = j
    centre, own, place, frame = (
        motions.centre[tree.root[body]],
        motions.each[j],
        found.place[c],
        seen.frame[c],
    )
    x, y, z = place[0] - centre[0], place[1] - centre[1], place[2] - centre[2]
    u = sign * (own[3] + own[1] * z - own[2] * y)
    v = sign * (own[4] + own[2] * x - own[0] * z)
    w = sign * (own[5] + own[0] * y - own[1] * x)
    for i in range(dim):
        if i == 3:
            u, v, w = sign * own[0], sign * own[1], sign * own[2]
        k = 3 * (i % 3)
        seen.column[begin + i * width + e] = j
        seen.J[begin + i * width + e] = frame[k] * u + frame[k + 1] * v + frame[k + 2] * w


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

"""Contacts of two geoms: at most four places, with their gaps and the normal that they share."""

from __future__ import annotations

import math

import numpy as np

from rungwise.block import Block
from rungwise.kernel import Ints, Reals, kernel
from rungwise.system.spatial.patch.clip import EVEN, Patch, allocate_patch, clip, keep
from rungwise.system.spatial.patch.normal import DEEP, GAIN, Room, allocate_room, guess, search
from rungwise.system.spatial.patch.shapes import PLANE, Frames, Shapes, extent, separation

FULL = -1
"""In place of a number of contacts: there is no room for them."""


class Scratch(Block):
    """What the routine works in."""

    room: Room
    patch: Patch


class Found(Block):
    """Contacts: place (c, 3), gap (c,), normal (c, 3) from the first to the second of two geoms (c, 2)."""

    place: Reals
    gap: Reals
    normal: Reals
    geoms: Ints


def allocate_scratch(shapes: Shapes) -> Scratch:
    return Scratch(room=allocate_room(), patch=allocate_patch(shapes))


def allocate_found(most: int) -> Found:
    return Found(
        place=np.zeros((most, 3)), gap=np.zeros(most), normal=np.zeros((most, 3)),
        geoms=np.zeros((most, 2), np.int64),
    )  # fmt: skip


@kernel
def distance(a: int, b: int, within: float, shapes: Shapes, frames: Frames, scratch: Scratch) -> float:
    """The distance of two geoms, negative where they overlap; of those that are farther, a bound above
    `within`. The normal is put into room.n, and the nearest points into room.ends: where sides lie along each
    other the first contact that is nearly as near as any, so that they do not leap."""
    room, patch, size = scratch.room, scratch.patch, min(shapes.inner[a], shapes.inner[b])
    if shapes.kind[a] == PLANE or shapes.kind[b] == PLANE:
        s = _over(a, b, shapes, frames, room)
    else:
        s = guess(a, b, within, shapes, frames, room)
        if s > within:
            return s
        s = search(a, b, s, shapes, frames, room)
    shared = clip(a, b, room.n, shapes, frames, patch)
    for i in range(shared):
        x, y, low, high = patch.places[i, 0], patch.places[i, 1], patch.places[i, 2], patch.places[i, 3]
        if high - low <= s + EVEN * size:
            for k in range(3):
                place = x * patch.axes[0, k] + y * patch.axes[1, k] + 0.5 * (low + high) * room.n[k]
                room.ends[0, k] = patch.origin[k] + place - 0.5 * s * room.n[k]
                room.ends[1, k] = patch.origin[k] + place + 0.5 * s * room.n[k]
            break
    return s


@kernel
def _over(a: int, b: int, shapes: Shapes, frames: Frames, room: Room) -> float:
    """The distance of a plane and another geom."""
    plane, g, sign = (a, b, 1.0) if shapes.kind[a] == PLANE else (b, a, -1.0)
    u, along, n = frames.axes[plane], 0.0, room.n
    for k in range(3):
        n[k] = sign * u[3 * k + 2]
        along += u[3 * k + 2] * (frames.place[g, k] - frames.place[plane, k])
    return along - extent(g, -u[2], -u[5], -u[8], shapes, frames)


@kernel
def meet(
    a: int, b: int, within: float, shapes: Shapes, frames: Frames, scratch: Scratch, found: Found, count: int
) -> int:
    """Add the contacts of two geoms that are nearer than `within` to `count` others; returns how many there
    are then, or `FULL`."""
    room, patch, size = scratch.room, scratch.patch, min(shapes.inner[a], shapes.inner[b])
    has_plane = shapes.kind[a] == PLANE or shapes.kind[b] == PLANE
    s = _over(a, b, shapes, frames, room) if has_plane else guess(a, b, within, shapes, frames, room)
    if s > within:
        return count
    shared = clip(a, b, room.n, shapes, frames, patch)
    if not has_plane and not (_least(shared, patch) <= s + GAIN * size and s > -DEEP * size):
        s = search(a, b, s, shapes, frames, room)
        if s > within:
            return count
        shared = clip(a, b, room.n, shapes, frames, patch)
        if _least(shared, patch) > s + GAIN * size:
            shared = _put_nearest(shared, s, room, patch)
    return _add(a, b, shared, within, size, scratch, found, count)


@kernel
def meet_along(
    a: int, b: int, within: float, shapes: Shapes, frames: Frames, scratch: Scratch, found: Found, count: int
) -> int:
    """The same of contacts along the given normal room.n, whether that is the shortest way or not."""
    n, size = scratch.room.n, min(shapes.inner[a], shapes.inner[b])
    s = separation(a, b, n[0], n[1], n[2], shapes, frames)
    if s > within:
        return count
    shared = clip(a, b, n, shapes, frames, scratch.patch)
    return _add(a, b, shared, within, size, scratch, found, count)


@kernel
def _add(
    a: int, b: int, shared: int, within: float, size: float, scratch: Scratch, found: Found, count: int
) -> int:
    """Add those of so many places that are kept and are nearer than `within`."""
    patch = scratch.patch
    kept = keep(shared, size, patch)
    for i in range(kept):
        own = patch.places[patch.keep[i]]
        gap = own[3] - own[2]
        if gap > within:
            continue
        if count == found.gap.shape[0]:
            return FULL
        height, upright = 0.5 * (own[2] + own[3]), math.sqrt(1.0 - own[5] * own[5] - own[6] * own[6])
        for k in range(3):
            x, y, z = patch.axes[0, k], patch.axes[1, k], patch.axes[2, k]
            found.place[count, k] = patch.origin[k] + own[0] * x + own[1] * y + height * z
            found.normal[count, k] = own[5] * x + own[6] * y + upright * z
        found.gap[count] = gap
        found.geoms[count, 0], found.geoms[count, 1] = a, b
        count += 1
    return count


@kernel
def _least(count: int, patch: Patch) -> float:
    """The least gap of so many places. If it is the distance along the normal, no other normal has a greater
    one: the nearest points are there."""
    least = math.inf
    for i in range(count):
        least = min(least, patch.places[i, 3] - patch.places[i, 2])
    return least


@kernel
def _put_nearest(count: int, s: float, room: Room, patch: Patch) -> int:
    """Add the middle of the nearest points."""
    count = min(count, patch.places.shape[0] - 1)
    own, ends = patch.places[count], room.ends
    own[5], own[6] = 0.0, 0.0
    for i in range(3):
        own[i] = 0.0
        for k in range(3):
            own[i] += patch.axes[i, k] * (0.5 * (ends[0, k] + ends[1, k]) - patch.origin[k])
    own[2], own[3], own[4] = own[2] - 0.5 * s, own[2] + 0.5 * s, -1.0
    return count + 1


@kernel
def copy_contact(one: int, to: int, found: Found) -> None:
    """Put a contact in the place of another one."""
    for k in range(3):
        found.place[to, k], found.normal[to, k] = found.place[one, k], found.normal[one, k]
    found.gap[to] = found.gap[one]
    found.geoms[to, 0], found.geoms[to, 1] = found.geoms[one, 0], found.geoms[one, 1]

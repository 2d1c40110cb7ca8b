"""The way of an object among its surroundings as if no finger had to lead it: the geometric rung, by OMPL."""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import pairwise

import numpy as np

from rungwise.kernel import Ints, Reals
from rungwise.planning.modes.ground import DEPENDENT, Ground, Seen
from rungwise.planning.motion.free_paths import CHECKS, grown, shortened

CLEAR = 0.02
"""Gap, in parts of the size, that an object keeps on its way."""
APART = 0.5
"""How far places on the way are from each other at most, in parts of the size."""
ROOM, TURNS = 3.0, 0.5
"""Room about start and goal for the way, in parts of the size, and for turns, in parts of the way of points
that are so far from the centre."""
OFF = 0.05
"""How far an object that keeps contacts is raised off these, in parts of the size, to tell what else is in
its way."""
RAISED, LOOKS = 0.1, 24
"""How far, in parts of the size, an object is lifted off what it touches before it goes through the air; and
places on the straight way at which it may not overlap anything."""


def guide(ground: Ground, q: Reals, goal: Reals, seed: int, in_time: Callable[[], bool]) -> Reals | None:
    """Places (k, n) of the object on its way from q (n,) to the goal (n,); none where the straight way is
    free, or where it touches something at an end; None where no way was found."""
    if len(ground.turns):
        along = _along_contacts(ground, q, goal, seed, in_time)
        return along if along is not None else _lifted(ground, q, goal, seed, in_time)
    none = np.zeros((0, len(q)))

    ends = np.stack([q, goal])
    apart = [ground.around.touches(end, 0.0).least[ground.pairs].min(initial=math.inf) for end in ends]
    least = min(CLEAR * ground.task.size, 0.5 * float(min(apart)))
    if least <= 0.0:
        return none

    def is_free(a: Reals, b: Reals) -> bool:
        """No gap shrinks by more than what the object's points move."""
        change = (b - a)[ground.columns]
        turning = ground.units != 1.0
        length = float(np.linalg.norm(change[~turning])) + ground.task.size * float(
            np.abs(change[turning]).sum()
        )
        return ground.around.is_clear(a, b, length, least, ground.pairs)

    if is_free(q, goal):
        return none
    own = ends[:, ground.columns]
    room = ROOM * ground.task.size / ground.units
    way = grown(
        q, goal[None], ground.columns.tolist(), own.min(axis=0) - room, own.max(axis=0) + room, is_free,
        seed, lambda asked: asked <= CHECKS and in_time(), 1.0 / ground.units,
    )  # fmt: skip
    return None if way is None else _dense(ground, shortened(way, is_free))


def _along_contacts(
    ground: Ground, q: Reals, goal: Reals, seed: int, in_time: Callable[[], bool]
) -> Reals | None:  # fmt: skip
    """See `guide`, in space: the object keeps the contacts that are closed at its start, as one that lies on
    a floor, among all else; None where it does not keep them at the goal, or no way was found."""
    none, size = np.zeros((0, len(q))), ground.task.size
    seen = ground.look(q)
    normals = seen.touches.rows[seen.closed, 0][:, ground.columns] / ground.units
    _, sizes, axes = np.linalg.svd(normals, full_matrices=True)
    basis = axes[int((sizes > DEPENDENT * sizes.max(initial=0.0)).sum()) :]
    change = ground.off(q, goal)
    if np.linalg.norm(change - change @ basis.T @ basis) > CLEAR * size or not len(basis):
        return None
    others, up = _beside(ground, seen, normals)

    def place(steps: Reals, off: Reals = up) -> Reals:
        whole = np.zeros(len(ground.around.owners))
        whole[ground.columns] = (steps @ basis + off) / ground.units
        return ground.around.changed(q, whole)

    ends = np.stack([np.zeros(len(basis)), basis @ change])
    apart = [ground.around.least(place(end), others).min(initial=math.inf) for end in ends]
    least = min(CLEAR * size, 0.5 * float(min(apart)))
    if least <= 0.0:
        return none

    def is_free(a: Reals, b: Reals) -> bool:
        length = math.sqrt(2.0) * float(np.linalg.norm(b - a))
        return ground.around.is_clear(place(a), place(b), length, least, others)

    if is_free(*ends):
        return none
    room = ROOM * size
    way = grown(
        ends[0], ends[1][None], list(range(len(basis))), ends.min(axis=0) - room, ends.max(axis=0) + room,
        is_free, seed, lambda asked: asked <= CHECKS and in_time(),
    )  # fmt: skip
    if way is None:
        return None
    return _dense(ground, np.array([place(steps, 0.0 * up) for steps in shortened(way, is_free)]))


def _beside(ground: Ground, seen: Seen, normals: Reals) -> tuple[Ints, Reals]:
    """The scene's contacts (p,) that an object which keeps its closed ones, with these normals (r, k), is to
    keep clear of, and how far it is raised off the closed ones (k,), over units, to tell: their bodies may be
    in the way elsewhere, as a post that stands on the floor. Those from which it cannot be raised are left
    out."""
    up = np.linalg.lstsq(normals, np.full(len(normals), OFF * ground.task.size), rcond=DEPENDENT)[0]
    opens = normals @ up > CLEAR * ground.task.size
    held = seen.touches.pairs[seen.closed[~opens]]
    return np.setdiff1d(ground.pairs, held), up if opens.any() else 0.0 * up


def _lifted(
    ground: Ground, q: Reals, goal: Reals, seed: int, in_time: Callable[[], bool]
) -> Reals | None:  # fmt: skip
    """See `guide`, in space: the object leaves what it touches at its start, along the normals, and comes to
    what it touches at the goal so; none where the straight way overlaps nothing."""
    size = ground.task.size

    def place(steps: Reals) -> Reals:
        whole = np.zeros(len(ground.around.owners))
        whole[ground.columns] = steps / ground.units
        return ground.around.changed(q, whole)

    straight = [place(part * ground.off(q, goal)) for part in np.linspace(0.0, 1.0, LOOKS)]
    if min(float(_least(ground, each)) for each in straight) > -ground.closed:
        return np.zeros((0, len(q)))
    ends = np.stack([ground.off(q, _raised(ground, end)) for end in (q, goal)])
    least = min(CLEAR * size, 0.5 * min(_least(ground, place(end)) for end in ends))
    if least <= 0.0:
        return None

    def is_free(a: Reals, b: Reals) -> bool:
        length = math.sqrt(2.0) * float(np.linalg.norm(b - a))
        return ground.around.is_clear(place(a), place(b), length, least, ground.pairs)

    room = np.where(ground.units == 1.0, ROOM, TURNS) * size
    way = ends
    if not is_free(*ends):
        found = grown(
            ends[0], ends[1][None], list(range(len(ground.columns))), ends.min(axis=0) - room,
            ends.max(axis=0) + room, is_free, seed, lambda asked: asked <= CHECKS and in_time(),
        )  # fmt: skip
        if found is None:
            return None
        way = shortened(found, is_free)
    return _dense(ground, np.array([q, *(place(steps) for steps in way), goal]))


def _raised(ground: Ground, q: Reals) -> Reals:
    """The place (n,) with the object away from all that it touches at q (n,)."""
    seen = ground.look(q)
    normals = seen.touches.rows[seen.closed, 0][:, ground.columns] / ground.units
    up = np.linalg.lstsq(normals, np.full(len(normals), RAISED * ground.task.size), rcond=DEPENDENT)[0]
    whole = np.zeros(len(ground.around.owners))
    whole[ground.columns] = up / ground.units
    return ground.around.changed(q, whole)


def _least(ground: Ground, q: Reals) -> float:
    return float(ground.around.least(q, ground.pairs).min(initial=math.inf))


def _dense(ground: Ground, way: Reals) -> Reals:
    """The way (k, n) with more places on its legs."""
    found = [way[:1]]
    for a, b in pairwise(way):
        count = max(1, math.ceil(ground.away(a, b) / (APART * ground.task.size)))
        change = ground.around.change(a, b)
        parts = np.linspace(0.0, 1.0, count + 1)[1:]
        found.append(np.array([ground.around.changed(a, part * change) for part in parts]))
    return np.concatenate(found)

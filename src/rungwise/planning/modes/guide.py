"""The way of an object among its surroundings as if no finger had to lead it: the geometric rung, by OMPL."""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import pairwise

import numpy as np

from rungwise.kernel import Reals
from rungwise.planning.modes.ground import Ground
from rungwise.planning.motion.free_paths import CHECKS, grown, shortened

CLEAR = 0.02
"""Gap, in parts of the size, that an object keeps on its way."""
APART = 0.5
"""How far places on the way are from each other at most, in parts of the size."""
ROOM = 3.0
"""Room about start and goal for the way, in parts of the size."""


def guide(ground: Ground, q: Reals, goal: Reals, seed: int, in_time: Callable[[], bool]) -> Reals | None:
    """Places (k, n) of the object on its way from q (n,) to the goal (n,); none where the straight way is
    free, or where it touches something at an end; None where no way was found."""
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


def _dense(ground: Ground, way: Reals) -> Reals:
    """The way (k, n) with more places on its legs."""
    found = [way[:1]]
    for a, b in pairwise(way):
        count = max(1, math.ceil(ground.away(a, b) / (APART * ground.task.size)))
        found.append(a + np.linspace(0.0, 1.0, count + 1)[1:, None] * (b - a))
    return np.concatenate(found)

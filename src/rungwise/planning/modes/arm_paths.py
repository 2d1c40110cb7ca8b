"""Ways of arms through free space, over their joints, by OMPL."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection

import numpy as np

from rungwise.kernel import Ints, Reals
from rungwise.planning.modes.fingers import contacts_of
from rungwise.planning.modes.ground import Ground
from rungwise.planning.motion.free_paths import CHECKS, grown, shortened
from rungwise.planning.motion.transit import NEAR, over_objects

TURN = 0.02
"""Greatest change of hinges, in radians, and of slides, in sizes, between places of a way that are looked
at."""


def arms_way(
    ground: Ground, a: Reals, b: Reals, moving: Ints, seed: int, in_time: Callable[[], bool],
    raised: Collection[str] = (),
) -> Reals | None:  # fmt: skip
    """Places (k, n) on the way of fingers (f,), some of them arms, from a (n,) to b (n,), both included; None
    where no way was found. All else holds still; those that are raised pass over objects."""
    fingers = [ground.fingers[f] for f in moving]
    over = over_objects(ground.task, raised)
    contacts = [contacts_of(finger, ground.task, ground.around) for finger in fingers]
    own = np.setdiff1d(np.concatenate(contacts), list(over))
    units = np.concatenate([finger.units for finger in fingers])
    low = np.concatenate([_range(ground, int(f))[0] for f in moving])
    high = np.concatenate([_range(ground, int(f))[1] for f in moving])

    def place(values: Reals) -> Reals:
        q, at = a, 0
        for finger in fingers:
            size = len(finger.carrier.columns)
            q, at = finger.put(q, values[at : at + size]), at + size
        return q

    clear = NEAR * min(finger.carrier.clearance for finger in fingers)

    def gaps(values: Reals) -> Reals:
        return ground.around.least(place(values), own, 2.0 * clear)

    ends = [np.concatenate([finger.drives(q) for finger in fingers]) for q in (a, b)]
    least = np.minimum(clear, 0.5 * np.min([gaps(end) for end in ends], axis=0))
    if (least <= 0.0).any():
        return None

    def is_free(one: Reals, other: Reals) -> bool:
        count = max(1, math.ceil(float(np.abs((other - one) / units).max(initial=0.0)) / TURN))
        return all(
            bool((gaps(one + part * (other - one)) >= least).all())
            for part in np.linspace(0.0, 1.0, count + 1)
        )

    way: Reals | None = np.array(ends)
    if not is_free(*ends):
        way = grown(
            ends[0], ends[1][None], list(range(len(low))), np.minimum(low, np.minimum(*ends)),
            np.maximum(high, np.maximum(*ends)), is_free, seed,
            lambda asked: asked <= CHECKS and in_time(),
        )  # fmt: skip
        way = None if way is None else shortened(way, is_free)
    return None if way is None else np.array([place(values) for values in way])


def _range(ground: Ground, f: int) -> tuple[Reals, Reals]:
    """Least and greatest values (k,) of what drives a finger."""
    finger = ground.fingers[f]
    low, high = finger.bounds if finger.arm is None else finger.arm.bounds
    return np.maximum(low, -10.0 * ground.task.size if finger.arm is None else -math.pi), np.minimum(
        high, 10.0 * ground.task.size if finger.arm is None else math.pi
    )

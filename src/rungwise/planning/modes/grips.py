"""How fingers hold an object where they touch it: at one place each, or at several, so that it does not turn.

A finger of x and y does not turn. An object that sticks to it at several places goes with it as it is; where
it is to turn, it does so about one of these, and leaves the others (pushes along an edge: Lynch and Mason,
Stable pushing, 1996). In space joints may turn a finger: an object that sticks to it goes where these lead
all contacts together.
"""

from __future__ import annotations

from itertools import product
from typing import NamedTuple

import numpy as np

from rungwise.kernel import Ints, Reals
from rungwise.planning.modes.forces.cones import Memory
from rungwise.planning.modes.ground import Ground, Seen

SAME = 1e-2
"""Distance of two contacts of a finger, in parts of the object's size, up to which they are one."""
MOST = 8
"""Most ways to hold an object that are tried, of fingers that touch it at several places."""
FREE = 1e-3
"""Motion of the contacts of a finger, over the greatest that its joints make, that counts as none."""


class Grip(NamedTuple):
    """The contacts (g,) at which fingers `of` (g,) press, the one by which each finger is led (f,), -1 for
    none, and whether some finger touches at several, so that in the plane the object cannot turn."""

    contacts: Ints
    of: Ints
    led: Ints
    flat: bool


def grips(ground: Ground, seen: Seen, used: Ints) -> list[Grip]:
    """The ways in which fingers (f,) may hold the object: at all their contacts, then, of each finger that
    has several, at one of them."""
    if not ground.is_wide:
        led = np.where(used > 0, seen.held, -1)
        of = np.flatnonzero(led >= 0)
        return [Grip(led[of], of, led, False)]
    every = [touching(ground, seen, f) if used[f] else [] for f in range(len(used))]
    found = [_grip(every)]
    if found[0].flat and ground.around.dimension == 2:
        found += [_grip([[each] for each in picked]) for picked in product(*(own or [-1] for own in every))]
    return found[:MOST]


def bind(ground: Ground, seen: Seen, held: Grip, memory: Memory) -> None:
    """Write the directions in which fingers that hold the object so do not let it go: its turn, in the plane
    where one holds it at several contacts; in space what no joints of a finger make all its contacts do."""
    rows = np.zeros((0, len(ground.columns)))
    if ground.around.dimension == 2:
        rows = np.eye(len(ground.columns))[[ground.turning] if held.flat else []]
    elif held.flat or seen.touches.rows.shape[1] > 3:
        rows = _not_followed(ground, seen, held)
    memory.bounds[0] = len(rows)
    memory.bound[: len(rows)] = rows


def _not_followed(ground: Ground, seen: Seen, held: Grip) -> Reals:
    """Orthonormal directions (r, k) of the object's change, over units, along which contacts of a finger
    would have to move as its joints do not."""
    every = list[Reals]()
    for f in np.unique(held.of):
        finger, rows = ground.fingers[f], seen.touches.rows[held.contacts[held.of == f]]
        rows = rows.reshape(-1, rows.shape[2])
        ways, sizes, _ = np.linalg.svd(rows[:, finger.moved] @ finger.rates(seen.q))
        left = ways[:, int((sizes > FREE * sizes[0]).sum()) :]
        every.append(left.T @ rows[:, ground.columns] / ground.units)
    rows = np.concatenate(every)
    _, sizes, axes = np.linalg.svd(rows)
    return np.asarray(axes[: int((sizes > FREE).sum())])


def touching(ground: Ground, seen: Seen, f: int) -> list[int]:
    """The contacts of a finger with the object, the nearest first, then those that are farthest from all of
    these, as many as it may have."""
    most, nearest = ground.fingers[f].contacts, int(seen.held[f])
    if nearest < 0 or most == 1:
        return [nearest][: int(nearest >= 0)]
    touches, found = seen.touches, [nearest]
    own = np.flatnonzero((touches.pairs == ground.own[f]) & (touches.gaps < ground.closed))
    while len(found) < most:
        away = np.linalg.norm(touches.points[own][:, None] - touches.points[found], axis=2).min(axis=1)
        if away.max() <= SAME * ground.task.size:
            break
        found.append(int(own[away.argmax()]))
    return found


def _grip(every: list[list[int]]) -> Grip:
    """Fingers that press at these contacts of each, -1 for none."""
    own = [[k for k in each if k >= 0] for each in every]
    contacts = [k for each in own for k in each]
    of = [f for f, each in enumerate(own) for _ in each]
    led = [each[0] if each else -1 for each in own]
    return Grip(
        np.array(contacts, np.int64), np.array(of, np.int64), np.array(led, np.int64),
        any(len(each) > 1 for each in own),
    )  # fmt: skip

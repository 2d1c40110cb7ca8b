"""Following a contact mode towards a place of the object, in small steps, while forces balance."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from rungwise.kernel import Ints, Reals
from rungwise.planning.modes.balance import motion
from rungwise.planning.modes.forces.cones import PART, STICK
from rungwise.planning.modes.frames import weights_of
from rungwise.planning.modes.ground import Ground, Seen

STEP, LONGEST = 0.04, 400
"""Length of a step, in parts of the object's size, and most steps."""
SHORTER = tuple(0.5**k for k in range(7))
"""Parts of a step that are tried, one after the other, where objects that push others would overlap them."""
ARRIVED = 1e-3
"""Distance from the target, in parts of the size, at which it counts as reached."""
NEIGHBOUR = 0.1
"""How far, in parts of the size, a contact may be from where it was to count as the same."""
TARGET, STALLED, BALANCE, FINGER, OVERLAP, CONTACT, LENGTH = (
    "target", "stalled", "no balance", "a finger in the way", "overlap", "contact", "length",
)  # fmt: skip
"""Why a mode was followed no further."""


class Way(NamedTuple):
    """Places (k, n_q) of the object and its fingers, and what these press with there (k, n_v); the fingers
    that touch (f,); and why it ends."""

    places: Reals
    pushes: Reals
    used: Ints
    why: str


class _Roles(NamedTuple):
    """What each contact that was closed when a mode began does, by its feature, its pair and its point."""

    features: list[int]
    pairs: list[int]
    points: Reals
    kinds: list[int]

    def of(self, seen: Seen, near: float) -> list[int | None]:
        """What the closed contacts do; None for new ones."""
        found = list[int | None]()
        for k in seen.closed:
            feature, pair = int(seen.touches.features[k]), int(seen.touches.pairs[k])
            if feature in self.features:
                found.append(self.kinds[self.features.index(feature)])
                continue
            away = np.linalg.norm(self.points - seen.touches.points[k], axis=1)
            away[np.array(self.pairs, int) != pair] = np.inf
            same = int(away.argmin()) if len(away) else -1
            found.append(self.kinds[same] if same >= 0 and away[same] < near else None)
        return found

    def then(self, seen: Seen, kinds: list[int]) -> _Roles:
        """The same after a step: contacts that opened are forgotten."""
        t, rows = seen.touches, seen.closed
        return _Roles(t.features[rows].tolist(), t.pairs[rows].tolist(), t.points[rows], kinds)


def follow(
    ground: Ground, begun: Seen, used: Ints, mode: tuple[int, ...], target: Reals, press: float,
    look: Callable[[int], None],
) -> Way:  # fmt: skip
    """The way of the object in a mode of its closed contacts, towards where it is at `target` (n,). `look` is
    called with the steps that are made, and may raise."""
    size, seen = ground.task.size, begun
    roles = _Roles([], [], np.zeros((0, ground.around.dimension)), []).then(seen, list(mode))
    places, pushes, why = [seen.q], list[Reals](), LENGTH
    weights = weights_of(ground.task, ground.columns)
    for _ in range(LONGEST):
        look(1)
        want = ground.off(seen.q, target)
        if np.linalg.norm(want) < ARRIVED * size:
            why = TARGET
            break
        found = motion(ground, seen, used, tuple(roles.kinds), want, press)
        if found is None:
            why = BALANCE
            break
        length = float(np.linalg.norm(found.change * weights))
        if length < 0.02 * float(np.linalg.norm(want)) or length < 0.1 * ARRIVED * size:
            why = STALLED
            break
        kept = {f for f, kind in zip(roles.features, roles.kinds, strict=True) if kind != PART}
        for part in SHORTER if ground.pushes else SHORTER[:1]:
            change = found.change * part * min(1.0, STEP * size / length)
            after = ground.corrected(ground.moved(seen, change, used, found.led), kept, used)
            own = roles.of(after, NEIGHBOUR * size)
            why = _stopped(ground, after, used) or _runs_into(ground, after, own)
            if why != OVERLAP:
                break
        if why:
            break
        seen, why = after, LENGTH
        places.append(seen.q)
        pushes.append(found.pushes)
        if any(kind is None for kind in own):
            why = CONTACT
            break
        roles = roles.then(seen, [STICK if kind is None else kind for kind in own])
    if pushes:
        pushes.append(pushes[-1])
    return Way(np.array(places), np.array(pushes).reshape(-1, len(ground.around.owners)), used, why)


def _stopped(ground: Ground, seen: Seen, used: Ints) -> str:
    """Why a step cannot be made; empty where it can."""
    if not ground.is_held(seen, used):
        return FINGER
    if seen.touches.least[ground.pairs].min(initial=np.inf) < -ground.closed:
        return OVERLAP
    return "" if ground.is_free(seen, used) else FINGER


def _runs_into(ground: Ground, seen: Seen, roles: list[int | None]) -> str:
    """Why a step cannot be made at which another object is touched that was not; empty where none is."""
    new = [k for k, role in zip(seen.closed, roles, strict=True) if role is None]
    return OVERLAP if ground.beside[seen.touches.pairs[new]].any() else ""

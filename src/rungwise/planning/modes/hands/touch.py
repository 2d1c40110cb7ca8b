"""Postures in which a finger touches an object, and those that it takes while the object moves."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rungwise.kernel import Reals
from rungwise.planning.modes.hands.hand import Finger, Hand
from rungwise.planning.modes.joints.inverse_kinematics import damped, no_leap
from rungwise.world.carriers import Near

CLOSES = 12
"""Steps in which a finger closes on an object."""
CLOSED = 1e-3
"""Gap, in parts of the size, of what touches."""
SLIPS = 0.25
"""Part of the way of an object's point by which a finger may fall behind it."""
HOME = 0.1
"""Part of the way to their posture at the start that joints go in each step where nothing else moves them."""


class Touch(NamedTuple):
    """A finger that touches the object: the contact, and joints (s + 1, k) as the object goes on its way in
    steps, as far as the finger follows."""

    pair: int
    joints: Reals

    @property
    def steps(self) -> int:
        """How many steps it follows."""
        return len(self.joints) - 1


def closed(hand: Hand, finger: Finger, q: Reals, pair: int, gap: float = 0.0) -> Reals | None:
    """The place (n_q,) with a finger led along the normal until its gap is this; None where it cannot be."""
    for _ in range(CLOSES):
        near = hand.around.near(q, pair)
        off = np.array([gap - near.gap])
        if abs(off[0]) < CLOSED * hand.size:
            return q
        q = stepped(hand, finger, q, _own(finger, near, q)[:1], off)
    return None


def opened(hand: Hand, finger: Finger, q: Reals, gap: float) -> Reals:
    """The place (n_q,) with all that a finger's last bodies touch at least nearly so far from the object."""
    for _ in range(CLOSES):
        nearest = min((hand.around.near(q, pair) for pair in finger.touching), key=lambda near: near.gap)
        if nearest.gap > 0.9 * gap:
            break
        q = stepped(hand, finger, q, _own(finger, nearest, q)[:1], np.array([gap - nearest.gap]))
    return q


def is_clear(hand: Hand, finger: Finger, q: Reals, but: int = -1) -> bool:
    """Whether a finger overlaps nothing but other fingers; at the contact `but` it may touch."""
    pairs = finger.around[finger.around != but]
    gaps = hand.around.least(q, pairs)
    return bool((gaps > -CLOSED * hand.size).all())


def followed(
    hand: Hand, finger: Finger, q: Reals, pair: int, change: Reals, steps: int, home: Reals
) -> Touch:
    """A finger that touches the object at a place (n_q,), as the object is changed by (n_v,) in steps: it
    rolls on the object, with joints near `home` (k,), until it cannot follow."""
    part, found = change / steps, [finger.chain.joints(q)]
    for _ in range(steps):
        near = hand.around.near(q, pair)
        own, way = _own(finger, near, q), near.rows @ part
        wanted = -way
        wanted[0] -= near.gap
        step = damped(own, wanted, hand.size)
        back = HOME * (home - found[-1])
        step = step + back - damped(own, own @ back, hand.size)
        before = found[-1]
        q = finger.posed(hand.around.changed(q, part), before + step)
        now = hand.around.near(q, pair)
        q = stepped(hand, finger, q, _own(finger, now, q)[:1], np.array([-now.gap]))
        joints = finger.chain.joints(q)
        slip = np.linalg.norm(own[1:] @ (joints - before) + way[1:])
        gap = abs(hand.around.near(q, pair).gap)
        allowed = SLIPS * max(float(np.linalg.norm(way)), 1e-9)
        if slip > allowed or gap > 2.0 * CLOSED * hand.size or not is_clear(hand, finger, q, pair):
            break
        found.append(joints)
    return Touch(pair, np.array(found))


def stepped(hand: Hand, finger: Finger, q: Reals, slope: Reals, wanted: Reals) -> Reals:
    """The place (n_q,) after a damped step of the joints, of which none goes far."""
    step = no_leap(finger.chain, damped(slope, wanted, hand.size))
    return finger.posed(q, finger.chain.joints(q) + step)


def _own(finger: Finger, near: Near, q: Reals) -> Reals:
    """Rates (d, k) of a contact per joint of a finger."""
    return np.asarray(near.rows[:, finger.chain.columns] @ finger.rates(q))

"""Inputs of a hand whose fingers keep to the object where it is not quite where it was expected."""

from __future__ import annotations

import numpy as np

from rungwise.kernel import Reals
from rungwise.planning.modes.hands.cycles import inputs
from rungwise.planning.modes.hands.hand import Finger, Hand
from rungwise.planning.modes.hands.touch import stepped
from rungwise.world.carriers import frame_of

REACHES = 10
"""Steps in which a fingertip is led to its place beside the object, at most."""
EXACT = 1e-3
"""How near it comes there, in parts of the size."""


def beside(hand: Hand, levels: Reals, planned: Reals, expected: Reals, here: Reals) -> Reals:
    """Inputs (r, u) that lead fingertips to where they are at a planned place (n_q,), to which the inputs
    `levels` (r, u) lead them, but in the frame of the object, which is as at `here` (n_q,) and not as at
    `expected` (n_q,)."""
    changes = [_change(hand, finger, planned, expected, here) for finger in hand.fingers]
    found = list[Reals]()
    for row in levels:
        now = [finger.driven.led.at(row[list(finger.driven.columns)]) for finger in hand.fingers]
        found.append(inputs(hand, row, np.concatenate(now) + np.concatenate(changes)))
    return np.array(found)


def _change(hand: Hand, finger: Finger, planned: Reals, expected: Reals, here: Reals) -> Reals:
    """The change of a finger's joints (k,) that keeps its tip to the object, by damped least squares."""
    poses = hand.around.poses
    body, tip = _tip(hand, finger, planned)
    (a, turned), (b, turn) = (frame_of(poses(q)[hand.body]) for q in (expected, here))
    centre, own = frame_of(poses(planned)[body])
    goal = b + turn @ turned.T @ (centre + own @ tip - a)
    q, basis = planned, np.eye(len(tip))
    for _ in range(REACHES):
        centre, own = frame_of(poses(q)[body])
        off = goal - centre - own @ tip
        if np.linalg.norm(off) < EXACT * hand.size:
            break
        slope = hand.around.rows(q, body, np.repeat(tip[None], len(tip), axis=0), basis)[:, 0]
        q = stepped(hand, finger, q, slope[:, finger.chain.columns] @ finger.rates(q), off)
    return np.asarray(finger.chain.joints(q) - finger.chain.joints(planned))


def _tip(hand: Hand, finger: Finger, q: Reals) -> tuple[int, Reals]:
    """The body of a finger that is next to the object at a place (n_q,), and its point (d,) that is, in the
    frame of its pose."""
    nears = [hand.around.near(q, pair) for pair in finger.touching]
    next_to = int(np.argmin([near.gap for near in nears]))
    body = finger.tips[next_to]
    centre, turn = frame_of(hand.around.poses(q)[body])
    return body, np.asarray(turn.T @ (nears[next_to].point - centre))

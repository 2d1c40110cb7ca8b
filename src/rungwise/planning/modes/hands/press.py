"""Forces with which fingers hold an object, and the joints' targets that make servos press so."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.optimize import nnls

from rungwise.kernel import Reals
from rungwise.planning.modes.forces.cones import ring_of
from rungwise.planning.modes.hands.hand import Finger, Hand

KEPT = 0.8
"""The part of friction that is counted on."""
FIRMLY = 0.5
"""How much it counts that a finger presses as hard as it is to, beside what is out of balance."""
STRONGEST = 0.6
"""Part of its greatest force with which a servo presses at most."""
SUPPORTS = 0.02
"""Gap, in parts of the size, within which something supports the object."""
SLIDES = 0.05
"""Part of the object's motion from which on it slides over what supports it, or leaves it."""
LEAST_LED = 0.03
"""Least over greatest rate of contacts, over all motions of an object, from which on they leave it none."""
CARRIED, LIGHT = 0.3, 1e-6
"""What may be out of balance of a load that is carried, in parts of it; and loads that count as none, over
the force of fingers."""


class Hold(NamedTuple):
    """Fingers that hold an object: forces (f, d) of their contacts, and what is out of balance, in parts of
    how hard they press."""

    forces: Reals
    off: float


def held(hand: Hand, q: Reals, pairs: list[int], press: float, change: Reals | None = None) -> Hold:
    """Forces of contacts of fingers at a place (n_q,) that, with what supports the object, balance its load
    best while each presses (non-negative least squares); while the object changes so (n_v,), where that is
    given."""
    around, units = hand.around, _units(hand)
    columns, owners = list[Reals](), list[int]()
    ways = list[Reals]()
    nears = [around.near(q, pair) for pair in pairs]
    for k, near in enumerate(nears):
        for edge in _edges(len(near.rows), near.friction):
            columns.append(edge @ near.rows[:, hand.columns] / units)
            owners.append(k)
            ways.append(edge)
    supports = _supports(hand, q, change)
    columns += list(supports)
    owners += [-1] * len(supports)
    ways += [np.zeros(around.dimension)] * len(supports)
    wrenches, belongs = np.array(columns).T, np.array(owners)
    firm = np.array([belongs == k for k in range(len(pairs))]) * FIRMLY
    load = around.loads(q)[hand.columns] / units
    right = np.concatenate([-load, np.full(len(pairs), FIRMLY * press)])
    found, _ = nnls(np.vstack([wrenches, firm]), right)
    forces = np.array([found[belongs == k] @ np.array(ways)[belongs == k] for k in range(len(pairs))])
    return Hold(forces, float(np.linalg.norm(wrenches @ found + load)) / press)


def rests(hand: Hand, q: Reals, pairs: list[int], press: float) -> bool:
    """Whether the object stays at a place (n_q,) with no other fingers than these contacts: nothing loads it,
    or its load is balanced."""
    load = loaded(hand, q)
    if load < LIGHT * press:
        return True
    return held(hand, q, pairs, load).off < CARRIED if pairs else _lies(hand, q, load)


def loaded(hand: Hand, q: Reals) -> float:
    """The load of the object at a place (n_q,), as a force at its size."""
    return float(np.linalg.norm(hand.around.loads(q)[hand.columns] / _units(hand)))


def is_led(hand: Hand, q: Reals, pairs: list[int], change: Reals) -> bool:
    """Whether contacts of fingers that stick, and supports, leave the object no other motion at a place
    (n_q,) as it changes (n_v,)."""
    rows = [hand.around.near(q, pair).rows[:, hand.columns] for pair in pairs]
    for support in _carrying(hand, q, change):
        rows.append(support.rows[: None if support.slides is None else 1, hand.columns])
    singular = np.linalg.svd(np.vstack(rows) / _units(hand), compute_uv=False)
    return len(singular) == len(hand.columns) and bool(singular[-1] > LEAST_LED * singular[0])


def _lies(hand: Hand, q: Reals, load: float) -> bool:
    """Whether what supports the object carries it alone."""
    rows = _supports(hand, q, None)
    if not len(rows):
        return False
    _, off = nnls(rows.T, -hand.around.loads(q)[hand.columns] / _units(hand))
    return bool(off < CARRIED * load)


class Support(NamedTuple):
    """A contact of the object with what no finger moves: rows (d, n_v), friction, and the direction (d - 1,)
    in which the object slides there; None where it sticks."""

    rows: Reals
    friction: float
    slides: Reals | None


def _carrying(hand: Hand, q: Reals, change: Reals | None) -> list[Support]:
    """What supports an object at a place (n_q,), and goes on to as it changes (n_v,)."""
    around, found = hand.around, list[Support]()
    touches = around.touches(q, SUPPORTS * hand.size)
    for k in np.flatnonzero(np.isin(touches.pairs, list(hand.fixed))).tolist():
        rows, friction = touches.rows[k][: around.dimension], float(touches.friction[k])
        if change is None:
            found.append(Support(rows, friction, None))
            continue
        way = rows @ change
        least, speed = SLIDES * np.linalg.norm(_units(hand) * change[hand.columns]), np.linalg.norm(way[1:])
        if way[0] <= least:
            found.append(Support(rows, friction, way[1:] / speed if speed > least else None))
    return found


def _supports(hand: Hand, q: Reals, change: Reals | None) -> Reals:
    """Wrenches (e, n_o) on the object along the edges of the cones of what supports it; where it slides over
    that as it changes (n_v,), friction is against it."""
    found = [np.zeros((0, len(hand.columns)))]
    for rows, friction, slides in _carrying(hand, q, change):
        edges = _edges(len(rows), friction)
        if slides is not None:
            edges = np.array([[1.0, *(-friction * slides)]])
        found.append(edges @ rows[:, hand.columns] / _units(hand))
    return np.vstack(found)


def targets(hand: Hand, finger: Finger, q: Reals, pair: int, force: Reals) -> Reals:
    """Targets (k,) of a finger's servos at a place (n_q,) with which it presses by a force (d,) at a contact
    and carries its own weight."""
    rates, columns = finger.rates(q), finger.chain.columns
    loads = rates.T @ hand.around.loads(q)[columns]
    if pair >= 0:
        loads = loads + rates.T @ (hand.around.near(q, pair).rows[:, columns].T @ force)
    driven = finger.driven
    most = STRONGEST * driven.servos.limit
    return np.asarray(finger.chain.joints(q) - np.clip(loads, -most, most) / driven.servos.stiffness)


def pressing(hand: Hand, finger: Finger, q: Reals, pair: int, deflection: float) -> float:
    """The force with which a finger presses at a place (n_q,) where its servos yield by so many radians, or
    parts of the size, as far as they are strong."""
    normal = hand.around.near(q, pair).rows[0, finger.chain.columns] @ finger.rates(q)
    driven = finger.driven
    size = np.where(finger.chain.hinges, 1.0, hand.size)
    yields = np.abs(normal) / (driven.servos.stiffness * size)
    strength = np.abs(normal) / (STRONGEST * driven.servos.limit)
    return float(1.0 / max(float(yields.max()) / deflection, float(strength.max()), 1e-12))


def _edges(dimension: int, friction: float) -> Reals:
    """Forces (e, d) along the edges of a cone: along the normal, and across it."""
    ring = ring_of(dimension - 1)
    return np.column_stack([np.ones(len(ring)), KEPT * friction * ring])


def _units(hand: Hand) -> Reals:
    """The size where an object turns, 1 where it moves (n_o,)."""
    count = len(hand.columns)
    moves = min(hand.around.dimension, count) if count in (3, 6) else count
    return np.where(np.arange(count) < moves, 1.0, hand.size)

"""Joints with which an arm touches an object at a point, by damped least squares."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq

from rungwise.kernel import Reals
from rungwise.planning.modes.joints.chains import Chain
from rungwise.world.carriers import Surroundings, frame_of

BEGUN = 12
"""Places in the ranges of joints from which places of arms are sought."""
ROLLS = (0.0, 0.5 * math.pi, -0.5 * math.pi)
"""Turns of an arm's last hinge, from its home, from which places in space are sought as well."""
REACHES, LEAP, DAMPED = 30, 0.3, 0.02
"""Steps of damped least squares; the greatest change of a hinge in one, in radians; damping, in parts
of the size."""
POSTURE, RANK = 0.2, 1e-6
"""Part of the way to their posture that joints go in a step; and part of the greatest squares of rates that
is added to all of them, so that dependent ones count."""
STALLS, HARDLY = 4, 0.9
"""Steps in which the gap and the distance from the line must shrink to this part, or no more follow."""
NEAR = 0.1
"""How far from the point, in parts of the size, a touch in the plane may be to count as there."""
BESIDE = 0.5
"""How far beside the point, in parts of the size, an arm of few joints may touch."""
STILL = 1e-7
"""Change of joints in a step below which they go no farther."""
EXACT = 1e-3
"""Gap, in parts of those that count as closed, that is left where an arm touches, and after correction."""
AHEAD, MIDDLE, OUTER = 0.2, 60, 0.8
"""How far before a point, in parts of the size, an arm in space is led at first; places on its last body
whose mean is its middle; and distance from the body's origin, over the greatest, from which on they are its
outer end."""

BEFORE, FLAT = 0.05, 1e-4
"""How far before a point, in parts of the size, a flat side is led at first, and how near it comes there."""
OF_SIDES, ALIKE, NEARLY = 960, 0.999, 0.7
"""Places on a body among which its flat sides are sought; cosine of the angle up to which places lie on one
side; and how large, over the largest, others are that objects are held with."""


class Reach(NamedTuple):
    """What an arm is to touch: the scene's contact, 1 where the arm is its first body, else -1; the arm's
    body; the point (d,) of the object and the outward normal (d,) there; the object's size, and a gap that
    is none."""

    pair: int
    sign: float
    body: int
    point: Reals
    normal: Reals
    size: float
    exact: float


def reached(
    around: Surroundings, arm: Chain, q: Reals, wanted: Reach, first: Sequence[Reals] = ()
) -> Iterator[Reals]:
    """Places (n,) with an arm that touches an object at a point, or elsewhere on the line along the normal,
    which come last: damped least squares on its joints (Nakamura and Hanafusa 1986), from where they are and
    from others, of which some (k,) come first; in the plane also from before the point."""
    begun, in_space, elsewhere = [*first, *_begins(arm, q)], len(wanted.point) == 3, list[Reals]()
    for k, joints in enumerate(begun if in_space else [*begun[:1], *begun]):
        found, posture = arm.posed(q, joints), joints if in_space else arm.posture
        if in_space or k == 1:
            found = _led(around, arm, found, wanted, posture)
        found, off = _touching(around, arm, found, wanted, posture)
        if np.abs(off).max() < wanted.exact:
            if in_space or _is_at(around, found, wanted):
                yield found
            else:
                elsewhere.append(found)
        elif in_space and not _spares(arm) and np.linalg.norm(off[1:]) < BESIDE * wanted.size:
            yield _closed(around, arm, found, wanted)
    yield from elsewhere


def _begins(arm: Chain, q: Reals) -> list[Reals]:
    """Joints (k,) from which places of an arm are sought: those at q (n,); then in space, where an arm has
    more than touching takes, those of its home, its last hinge turned besides; and others in their ranges."""
    low, high = (np.clip(bound, -np.pi, np.pi) for bound in arm.bounds)
    found = [arm.joints(q)]
    if _spares(arm):
        for roll in ROLLS:
            joints = arm.home.copy()
            joints[-1] += roll
            if low[-1] <= joints[-1] <= high[-1]:
                found.append(joints)
    return [*found, *_spread(low, high)] if arm.hinges.any() else found


def _spread(low: Reals, high: Reals) -> Reals:
    """Joints (m, k) between these bounds, far from each other: an additive recurrence, whose ratio is the
    golden section's in more dimensions."""
    k = np.arange(1, len(low) + 1)
    ratio = brentq(lambda x: x ** (len(low) + 1) - x - 1.0, 1.0, 2.0)
    parts = (0.5 + np.arange(BEGUN)[:, None] * ratio**-k) % 1.0
    return np.asarray(low + parts * (high - low))


def _spares(arm: Chain) -> bool:
    """Whether an arm in space has more joints than touching takes, of which the last turns its hand."""
    return bool(arm.posture is None and len(arm.hinges) > 3 and arm.hinges[-1])


def _touching(
    around: Surroundings, arm: Chain, q: Reals, wanted: Reach, posture: Reals | None
) -> tuple[Reals, Reals]:
    """The place (n,) with an arm that is led until it touches on the line along the normal, and what is left:
    the gap, and the distance from that line."""
    off, left = np.full(1, np.inf), list[float]()
    for _ in range(REACHES):
        near = around.near(q, wanted.pair)
        off = np.array([near.gap, *near.across @ (near.point - wanted.point)])
        left.append(float(np.abs(off).max()))
        stalls = len(left) > STALLS and left[-1] > HARDLY * left[-1 - STALLS]
        if left[-1] < EXACT * wanted.exact or stalls:
            break
        own = near.rows[:, arm.columns] @ arm.rates(q)
        own[1:] *= wanted.sign
        before, q = q, stepped(arm, q, own, -off, wanted.size, posture if left[-1] > wanted.exact else None)
        if np.abs(q - before).max() < STILL:
            break
    return q, off


def _is_at(around: Surroundings, q: Reals, wanted: Reach) -> bool:
    """Whether the touch is at the point, not on the far side of the object."""
    away = around.near(q, wanted.pair).point - wanted.point
    return bool(np.linalg.norm(away) < NEAR * wanted.size)


def _closed(around: Surroundings, arm: Chain, q: Reals, wanted: Reach) -> Reals:
    """The place (n,) with an arm led along the normal until it touches, as one of few joints that does not
    come to the point itself."""
    for _ in range(REACHES):
        near = around.near(q, wanted.pair)
        if abs(near.gap) < EXACT * wanted.exact:
            break
        own = near.rows[:1, arm.columns] @ arm.rates(q)
        q = stepped(arm, q, own, np.array([-near.gap]), wanted.size, arm.posture)
    return q


def _led(around: Surroundings, arm: Chain, q: Reals, wanted: Reach, posture: Reals | None) -> Reals:
    """The place (n,) with the outer end of an arm's last body before the point that it is to touch, as near
    as its joints bring it."""
    surface, _ = around.outline(wanted.body)(np.arange(0.5, MIDDLE) / MIDDLE)
    away = np.linalg.norm(surface, axis=1)
    end = surface[away >= OUTER * away.max()]
    tip = end.mean(axis=0)
    far = float(np.linalg.norm(end - tip, axis=1).max()) + AHEAD * wanted.size
    goal, basis = wanted.point + far * wanted.normal, np.eye(len(tip))
    for _ in range(REACHES):
        centre, turn = frame_of(around.poses(q)[wanted.body])
        off = goal - centre - turn @ tip
        if np.linalg.norm(off) < AHEAD * wanted.size:
            break
        slope = around.rows(q, wanted.body, np.repeat(tip[None], len(tip), axis=0), basis)[:, 0]
        before, q = q, stepped(arm, q, slope[:, arm.columns] @ arm.rates(q), off, wanted.size, posture)
        if np.abs(q - before).max() < STILL:
            break
    return q


def stepped(
    arm: Chain, q: Reals, slope: Reals, wanted: Reals, size: float, posture: Reals | None
) -> Reals:  # fmt: skip
    """The place (n,) after a damped step of the joints, of which none goes far, and which leads them to a
    posture (k,), if there is one."""
    low, high = (np.clip(bound, -np.pi, np.pi) for bound in arm.bounds)
    step = damped(slope, wanted, size)
    step += to_posture(arm, q, slope, posture)
    return arm.posed(q, np.clip(arm.joints(q) + no_leap(arm, step), low, high))


def damped(slope: Reals, wanted: Reals, size: float) -> Reals:
    """The damped step (k,) of joints that changes what has this slope (m, k) as wanted (m,), beside an object
    of this size."""
    damping = (DAMPED * size) ** 2 * np.eye(len(wanted))
    return np.asarray(slope.T @ np.linalg.solve(slope @ slope.T + damping, wanted))


def no_leap(arm: Chain, step: Reals) -> Reals:
    """A step (k,) of joints, or the part of it in which no hinge goes too far."""
    largest = float(np.abs(step[arm.hinges]).max(initial=0.0))
    return step * min(1.0, LEAP / max(largest, 1e-12))


def laid(around: Surroundings, arm: Chain, q: Reals, wanted: Reach) -> Iterator[Reals]:
    """Places (n,) with a flat side of an arm's last body on an object, its middle at a point, in space:
    damped least squares on the joints, from where they are and from others, until that side faces the object
    there; then along the normal until it touches."""
    low, high = (np.clip(bound, -np.pi, np.pi) for bound in arm.bounds)
    begun = [arm.joints(q), *(_spread(low, high) if arm.hinges.any() else ())]
    _, turn = frame_of(around.poses(q)[wanted.body])
    sides = sorted(sides_of(around, wanted.body), key=lambda side: float(turn @ side[1] @ wanted.normal))
    for side in sides:
        for joints in begun:
            found = _faced(around, arm, arm.posed(q, joints), wanted, *side)
            if found is not None:
                yield _closed(around, arm, found, wanted)


def _faced(
    around: Surroundings, arm: Chain, q: Reals, wanted: Reach, middle: Reals, normal: Reals
) -> Reals | None:
    """The place (n,) with the side of an arm that has this middle (3,) and outward normal (3,) at a point,
    and facing it; None where its joints do not bring it there."""
    points = np.array([middle, middle + wanted.size * normal])
    goal = wanted.point + BEFORE * wanted.size * wanted.normal
    goals = np.array([goal, goal - wanted.size * wanted.normal])
    basis, every = np.tile(np.eye(3), (2, 1)), np.repeat(points, 3, axis=0)
    for _ in range(REACHES):
        at, turn = frame_of(around.poses(q)[wanted.body])
        off = (goals - at - points @ turn.T).ravel()
        if np.abs(off).max() < FLAT * wanted.size:
            return q
        slope = around.rows(q, wanted.body, every, basis)[:, 0]
        own = slope[:, arm.columns] @ arm.rates(q)
        before, q = q, stepped(arm, q, own, off, wanted.size, arm.posture)
        if np.abs(q - before).max() < STILL:
            break
    return None


def middle_of(around: Surroundings, body: int) -> Reals:
    """The middle (3,) of a body's surface, in its frame."""
    points, _ = around.outline(body)(np.arange(0.5, MIDDLE) / MIDDLE)
    return np.asarray(points.mean(axis=0))


def sides_of(around: Surroundings, body: int) -> list[tuple[Reals, Reals]]:
    """The largest flat side of a body, and those that are nearly as large: the middle (3,) of each, and its
    outward normal (3,), in the body's frame."""
    points, normals = around.outline(body)(np.arange(0.5, OF_SIDES) / OF_SIDES)
    left, found = np.arange(len(points)), list[tuple[int, Reals, Reals]]()
    while len(left):
        alike = left[normals[left] @ normals[left[0]] > ALIKE]
        own = points[alike]
        found.append((len(alike), (own.max(axis=0) + own.min(axis=0)) / 2.0, normals[left[0]]))
        left = np.setdiff1d(left, alike)
    largest = max(count for count, _, _ in found)
    return [(middle, normal) for count, middle, normal in found if count >= NEARLY * largest]


def to_posture(arm: Chain, q: Reals, slope: Reals, posture: Reals | None) -> Reals:
    """The change (k,) of the joints towards a posture (k,), if there is one, that leaves alone
    what moves by `slope` (r, k) per
    joint (Liegeois 1977); none where there are no more joints than that takes."""
    if posture is None or len(slope) >= slope.shape[1]:
        return np.zeros(slope.shape[1])
    wanted = POSTURE * (posture - arm.joints(q))
    square = slope @ slope.T
    square += RANK * float(np.trace(square)) * np.eye(len(slope))
    return np.asarray(wanted - slope.T @ np.linalg.solve(square, slope @ wanted))

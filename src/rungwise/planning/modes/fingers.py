"""Fingers: robots that a planner may place on objects, what is known of their drives, how they are led."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from rungwise.kernel import Ints, Reals, kernel
from rungwise.planning.modes.joints.chains import Chain, chain_of
from rungwise.planning.task.fingers import Finger as Stated
from rungwise.planning.task.fingers import fingers_of as stated
from rungwise.planning.task.task import Task
from rungwise.world.carriers import Carrier, Surroundings, frame_of

Flags: TypeAlias = NDArray[np.bool_]

STRONGEST = 0.9
"""Part of the greatest force of a finger with which it presses at most."""


@dataclass(frozen=True)
class Finger:
    """A robot that touches objects: its carrier; its body's number; the columns (k,) of its coordinates;
    numbers of the objects that it may touch, and at how many places at most; forces with which it presses at
    each, at least and at most, of which the least is 0 where it is chosen for the object; the part of its
    friction that it keeps; the least and the greatest places (2, k) to which its inputs lead it; its arm, if
    joints lead it; the column of the input that raises it off the plane, and how high, if it may pass over
    objects."""

    carrier: Carrier
    body: int
    columns: Ints
    objects: frozenset[int]
    contacts: int
    press: tuple[float, float]
    reserve: float
    bounds: Reals
    arm: Chain | None = None
    lift: tuple[int, float] | None = None

    @property
    def is_redundant(self) -> bool:
        """Whether it is an arm in space with more joints than touching a point takes."""
        return self.arm is not None and self.bounds.shape[1] == 3 and len(self.arm.units) > 3

    @property
    def moved(self) -> Ints:
        """The columns (m,) of velocities that its drives move."""
        return self.columns if self.arm is None else self.arm.columns

    @property
    def places(self) -> Ints:
        """The columns (p,) of coordinates that its drives move."""
        return self.columns if self.arm is None else self.arm.places

    @property
    def units(self) -> Reals:
        """What its drives (k,) go in a step, over one another."""
        return np.ones(len(self.columns)) if self.arm is None else self.arm.units

    def drives(self, q: Reals) -> Reals:
        """What its inputs drive (k,) at a place (n,): x and y, or joints."""
        return q[self.columns] if self.arm is None else self.arm.joints(q)

    def put(self, q: Reals, drives: Reals) -> Reals:
        """The place (n,) with these (k,)."""
        if self.arm is not None:
            return self.arm.posed(q, drives)
        found = q.copy()
        found[self.columns] = drives
        return found

    def rates(self, q: Reals) -> Reals:
        """Changes (m, k) of its velocities per unit of what is driven."""
        return np.eye(len(self.columns)) if self.arm is None else self.arm.rates(q)

    def reaches(self, q: Reals, around: Surroundings) -> bool:
        """Whether its inputs lead it to a place (n,)."""
        if self.arm is not None:
            joints, (low, high) = self.arm.joints(q), self.arm.bounds
            if (joints < low).any() or (joints > high).any():
                return False
        size = self.bounds.shape[1]
        own = q[self.columns] if size == 2 else around.poses(q)[self.body, :size]
        return bool((own >= self.bounds[0]).all() and (own <= self.bounds[1]).all())

    def way(self, around: Surroundings, a: Reals, b: Reals, size: float) -> float:
        """How far it goes from one place (n,) to another, and turns, as if it reached so far (`size`)."""
        if self.bounds.shape[1] == 2:
            return float(np.linalg.norm((b - a)[self.columns]))
        (start, turn), (end, turned) = (frame_of(around.poses(q)[self.body]) for q in (a, b))
        gone, leaned = np.linalg.norm(end - start), np.linalg.norm(turned - turn)
        return float(gone + 0.5**0.5 * size * leaned)


def fingers_of(task: Task) -> tuple[Finger, ...]:
    """The fingers of a task: those that are led by their x and y, in the order of its carriers, and arms."""
    names, said = list(task.scene.template.bodies), {each.name: each for each in stated(task)}
    found, arms = [], {each.name: chain_of(task, each.driven) for each in said.values() if each.is_arm}
    carried = {carrier.body for carrier in task.carriers}
    led = [_arms_carrier(said[name]) for name, arm in arms.items() if arm is not None and name not in carried]
    for carrier in (*task.carriers, *led):
        own = said.get(carrier.body)
        if own is None:
            continue
        press = (0.0, math.inf) if own.press is None else (own.press[0], STRONGEST * own.press[1])
        found.append(
            Finger(
                carrier=carrier, body=names.index(carrier.body),
                columns=np.array(carrier.places, np.int64),
                objects=frozenset(names.index(name) for name in own.objects),
                contacts=own.contacts, press=press, reserve=own.reserve, bounds=own.within,
                arm=arms.get(own.name),
                lift=own.lift,
            )
        )  # fmt: skip
    return tuple(found)


def _arms_carrier(finger: Stated) -> Carrier:
    """An arm as what is led; it is not led to push."""
    return Carrier(
        **vars(finger.driven), speed=finger.speed, clearance=finger.clearance, push=(0.0, 0.0), lean=0.0
    )


@kernel
def carry(
    rows: Reals, held: Ints, used: Ints, placing: Ints, columns: Ints, change: Reals, q: Reals
) -> None:  # fmt: skip
    """Lead fingers that are used (f,), of x and y at places (f, 2) of q (n,), so that where they touch, at
    contacts (f,), neither opens nor slips while the object changes by (k,)."""
    for f in range(len(held)):
        i, j = placing[f, 0], placing[f, 1]
        if held[f] < 0 or used[f] == 0 or i < 0:
            continue
        normal, tangent = rows[held[f], 0], rows[held[f], 1]
        opens, slips = 0.0, 0.0
        for c in range(len(columns)):
            opens -= normal[columns[c]] * change[c]
            slips -= tangent[columns[c]] * change[c]
        area = normal[i] * tangent[j] - normal[j] * tangent[i]
        q[i] += (opens * tangent[j] - slips * normal[j]) / area
        q[j] += (slips * normal[i] - opens * tangent[i]) / area


@kernel
def touch(rows: Reals, gaps: Reals, held: Ints, used: Ints, placing: Ints, q: Reals) -> None:
    """Lead fingers that are used (f,), of x and y at places (f, 2) of q (n,), along the normals of their
    contacts (f,) until these close."""
    for f in range(len(held)):
        i, j = placing[f, 0], placing[f, 1]
        if held[f] < 0 or used[f] == 0 or i < 0:
            continue
        x, y = rows[held[f], 0, i], rows[held[f], 0, j]
        q[i] -= x * gaps[held[f]] / (x * x + y * y)
        q[j] -= y * gaps[held[f]] / (x * x + y * y)


@kernel
def sort_touches(
    gaps: Reals, pairs: Ints, near: float, surrounds: Flags, own: Ints, closed: Ints, held: Ints
) -> int:  # fmt: skip
    """Of contacts (c,), write the closed ones with the surroundings, and the nearest closed one of each
    finger (f,), -1 where there is none; returns how many the first are."""
    count = 0
    for f in range(len(own)):
        held[f] = -1
    for k in range(len(gaps)):
        if not gaps[k] < near:
            continue
        if surrounds[pairs[k]]:
            closed[count] = k
            count += 1
        for f in range(len(own)):
            if own[f] == pairs[k] and (held[f] < 0 or gaps[k] < gaps[held[f]]):
                held[f] = k
    return count


@kernel
def are_apart(
    least: Reals, pairs: Ints, avoided: Ints, kept: Reals, own: Ints, used: Ints, closed: float, apart: float,
    q: Reals, placing: Ints, reach: Reals,
) -> bool:  # fmt: skip
    """See `Ground.is_free`, but for arms."""
    for k in range(len(avoided)):
        if not least[avoided[k]] >= kept[k]:
            return False
    for k in range(len(pairs)):
        if not least[pairs[k]] >= -closed:
            return False
    for f in range(len(own)):
        if own[f] >= 0 and used[f] == 0 and not least[own[f]] >= apart:
            return False
        for axis in range(2):
            if placing[f, axis] >= 0:
                place = q[placing[f, axis]]
                if not (reach[f, 0, axis] <= place and place <= reach[f, 1, axis]):
                    return False
    return True


def sort_contacts(
    task: Task, around: Surroundings, fingers: Sequence[Finger], both: Sequence[int], aside: Collection[int]
) -> tuple[Ints, Ints, Ints, Ints]:
    """The scene's contacts of an object (the first of `both`; the last is the one that it is to push) by who
    touches: with each finger (f,), -1 where there is none; of both with what is no finger; of fingers, and of
    links of their arms, with all else; and of these with objects that are pushed aside."""
    names, body = list(task.scene.template.bodies), both[0]
    touching = {finger.body: k for k, finger in enumerate(fingers) if body in finger.objects}
    own, pairs, avoided, beyond = [-1] * len(fingers), list[int](), list[int](), list[int]()
    links = {k for f in fingers if f.arm is not None for k in around.moved_by(f.arm.columns).tolist()}
    for k, pair in enumerate(task.scene.template.contacts):
        a, b = (names.index(name) for name in pair)
        of_finger = [finger.body for finger in fingers if finger.body in (a, b)]
        if body in (a, b) and len(of_finger) == 1 and of_finger[0] in touching:
            own[touching[of_finger[0]]] = k
        elif {a, b} & set(aside):
            beyond += [k] * bool(of_finger or links & {a, b})
        elif of_finger or links & {a, b}:
            avoided.append(k)
        elif {a, b} & set(both):
            pairs.append(k)
    own_, pairs_, avoided_, beyond_ = (np.array(each, np.int64) for each in (own, pairs, avoided, beyond))
    return own_, pairs_, avoided_, beyond_


def contacts_of(finger: Finger, task: Task, around: Surroundings) -> Ints:
    """The scene's contacts of a finger and of all that its joints move."""
    names = task.scene.template.bodies
    moved = [] if finger.arm is None else around.moved_by(finger.arm.columns).tolist()
    bodies = {finger.carrier.body, *(names[body] for body in moved)}
    pairs = task.scene.template.contacts
    return np.array([k for k, pair in enumerate(pairs) if bodies & set(pair)], np.int64)

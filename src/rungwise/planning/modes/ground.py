"""One object among its surroundings and fingers: what touches it at a place, and places next to it."""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from rungwise.kernel import Ints, Reals
from rungwise.planning.modes.fingers import (
    Finger,
    Flags,
    are_apart,
    carry,
    sort_contacts,
    sort_touches,
    touch,
)
from rungwise.planning.modes.forces.cones import Memory, memory_for, see
from rungwise.planning.modes.forces.mode_motions import turn
from rungwise.planning.modes.frames import (
    TURNS,
    asks_turn,
    is_round,
    weights_of,
)
from rungwise.planning.modes.joints.clearing import Earlier, cleared, touching
from rungwise.planning.modes.joints.inverse_kinematics import (
    EXACT,
    Reach,
    middle_of,
    to_posture,
)
from rungwise.planning.task.task import Task
from rungwise.world.carriers import Near, Surroundings, Touches, frame_of
from rungwise.world.contract import OBJECT
from rungwise.world.find import world_of

CLOSED = 2e-3
"""Gap, in parts of the object's size, below which a contact counts as closed."""
APART, BEGUN = 0.1, 0.5
"""Part of their clearance that fingers keep from what they do not touch, and of the gap at the start, where
that is less."""
CORRECTIONS = 3
"""Steps of Newton's method with which contacts that are kept are closed again."""
EDGE = 0.08
"""How near to a corner of the outline a finger may be, in parts of half the edge."""
DEPENDENT = 1e-6
"""Motion of contacts, over the greatest that drives make, below which drives count as dependent."""
MORE = 8
"""Contacts and edges for which more memory is taken than is asked for."""
SPINS = 0.1
"""Weight of a round object's angle where the goal does not ask for it, over its usual one: it may roll."""


class Seen(NamedTuple):
    """What touches at a place q (n,): the contacts of the object with its surroundings, rows of `touches`
    (e,), and with each finger, -1 where it does not touch (f,)."""

    q: Reals
    touches: Touches
    closed: Ints
    held: Ints


@dataclass(frozen=True)
class Ground:
    """An object, by its number and its columns (k,) of velocities with their units (k,) as lengths, and
    (p,) of coordinates, `places`; its fingers and its surroundings. Where it is to push another one, `last`
    is that one, else the same; the columns of both follow each other, and `aims` (k,) are those of the last.
    pairs: the scene's contacts of the object with what is no finger, and surrounds (c,), which these are;
    beside (c,): those of them with other objects; own (f,): with each finger; avoided (a,): of fingers with
    all else; beyond (b,): of fingers with objects that are pushed aside, which the other lists leave out."""

    task: Task
    around: Surroundings
    fingers: tuple[Finger, ...]
    body: int
    last: int
    columns: Ints
    places: Ints
    aims: Flags
    units: Reals
    pairs: Ints
    surrounds: Flags
    beside: Flags
    own: Ints
    avoided: Ints
    beyond: Ints
    closed: float
    apart: float
    _memories: list[Memory] = field(default_factory=list)
    _earlier: dict[int, Earlier] = field(default_factory=dict)

    @classmethod
    def of(
        cls, task: Task, around: Surroundings, fingers: tuple[Finger, ...], body: int,
        last: int | None = None, aside: Collection[int] = (),
    ) -> Ground:  # fmt: skip
        """The object with this number, which is to push the last one, if any, and others aside."""
        names, contacts = list(task.scene.template.bodies), task.scene.template.contacts
        both = (body,) if last is None else (body, last)
        columns = np.concatenate([np.flatnonzero(around.owners == each) for each in both])
        last = body if last is None else last
        own, pairs, avoided, beyond = sort_contacts(task, around, fingers, both, aside)
        surrounds, beside = np.zeros((2, len(contacts)), bool)
        surrounds[pairs] = True
        roles = world_of(task.scene).roles(task.parameters)
        within = {names[each] for each in both}
        beside[pairs] = [
            all(roles[name] == OBJECT for name in contacts[k]) and set(contacts[k]) != within for k in pairs
        ]
        least = min(finger.carrier.clearance for finger in fingers)
        places = np.concatenate([np.flatnonzero(around.placed == each) for each in both])
        units = weights_of(task, columns)
        for each in both:
            turns = [f"{names[each]}.{turn}" for turn in TURNS]
            if not asks_turn(task, names[each]) and is_round(around, each):
                units[[world_of(task.scene).velocities[k] in turns for k in columns]] *= SPINS
        return cls(
            task, around, fingers, body, last, columns, places, around.owners[columns] == last, units, pairs,
            surrounds, beside, own, avoided, beyond, CLOSED * task.size, APART * least,
        )  # fmt: skip

    def look(self, q: Reals) -> Seen:
        """What touches at a place (n,)."""
        touches = self.around.touches(q, max(4.0 * self.closed, self.apart))
        closed, held = np.empty(len(touches.gaps), np.int64), np.empty(len(self.fingers), np.int64)
        count = sort_touches(touches.gaps, touches.pairs, self.closed, self.surrounds, self.own, closed, held)
        return Seen(q, touches, closed[:count], held)

    @cached_property
    def kept_apart(self) -> Reals:
        """The gaps (a,) that fingers keep from what they avoid: less where they begin nearer, as links of an
        arm may be to each other."""
        start = world_of(self.task.scene).at(self.task.parameters).q
        return np.minimum(self.apart, BEGUN * self.around.least(start, self.avoided))

    @property
    def is_free_body(self) -> bool:
        """Whether it is one body that nothing holds."""
        return len(self.columns) == (3 if self.around.dimension == 2 else 6)

    @property
    def pushes(self) -> bool:
        """Whether it is to push another object."""
        return self.last != self.body

    @cached_property
    def between(self) -> tuple[int, float]:
        """The scene's contact of the two objects, and the sign with which its normal goes into the last."""
        names = self.task.scene.template.bodies
        pair = (names[self.last], names[self.body])
        for k, own in enumerate(self.task.scene.template.contacts):
            if set(own) == set(pair):
                return k, 1.0 if own == pair else -1.0
        return -1, 1.0

    def away(self, a: Reals, b: Reals) -> float:
        """How far the object is from one place (n,) to another."""
        return float(np.linalg.norm(self.off(b, a)))

    def off(self, q: Reals, to: Reals) -> Reals:
        """The change (k,), over units, that leads the object from a place (n,) to another."""
        return np.asarray(self.around.change(q, to)[self.columns] * self.units)

    @property
    def aimed(self) -> Ints:
        """Columns (p,) of the coordinates of what is to come to the goal."""
        return np.asarray(self.places[self.around.placed[self.places] == self.last])

    @cached_property
    def turns(self) -> Ints:
        """The columns (r, 4) of its quaternions."""
        return np.array([row for row in self.task.turns if row[0] in self.places], np.int64).reshape(-1, 4)

    def is_free(self, seen: Seen, used: Ints) -> bool:
        """Whether fingers that are not used (f,) are apart from the object, and all from everything else."""
        free = are_apart(
            seen.touches.least, self.pairs, self.avoided, self.kept_apart, self.own, used, self.closed,
            self.apart, seen.q, self.placing, self.reach,
        )  # fmt: skip
        return bool(free) and all(
            finger.reaches(seen.q, self.around) for finger in self.fingers if finger.arm is not None
        )

    def begins_free(self, seen: Seen, used: Ints) -> bool:
        """See `is_free`, of fingers that objects which are pushed aside may not overlap, either."""
        least = seen.touches.least[self.beyond].min(initial=math.inf)
        return bool(least > -self.closed) and self.is_free(seen, used)

    def is_held(self, seen: Seen, used: Ints) -> bool:
        """Whether the fingers in use (f,) touch the object, away from its corners if at one place."""
        held, wide = seen.held.tolist(), [finger.contacts > 1 for finger in self.fingers]
        return all(
            held[f] >= 0 and (wide[f] or self.part(seen, f)[1] >= EDGE)
            for f, own in enumerate(used.tolist()) if own
        )  # fmt: skip

    def part(self, seen: Seen, f: int) -> tuple[float, float]:
        """Where on the outline a finger touches (or is, if at several), and how far from corners: 0..1."""
        point, pose = seen.touches.points[seen.held[f]], seen.touches.poses[self.body]
        if self.fingers[f].contacts > 1:
            normal, middle = seen.touches.normals[seen.held[f]], self._middle(seen, f)
            point = middle + normal * ((point - middle) @ normal)
        at, turned = frame_of(pose)
        return self.around.outline(self.body).part_of((point - at) @ turned)

    def _middle(self, seen: Seen, f: int) -> Reals:
        """The middle (d,) of a finger: its centre of mass in the plane, of its surface in space."""
        body = self.fingers[f].body
        at, turned = frame_of(seen.touches.poses[body])
        if self.around.dimension == 2:
            return at
        return np.asarray(at + turned @ middle_of(self.around, body))

    def memory(self, contacts: int, edges: int = 0) -> Memory:
        """Memory of kernels for so many contacts with surroundings, and edges of forces."""
        for memory in self._memories:
            if len(memory.friction) >= contacts and len(memory.edges) > edges:
                return memory
        size = (len(self.columns), len(self.around.owners), self.around.tangents)
        held = sum(finger.contacts for finger in self.fingers)
        self._memories[:] = [memory_for(contacts + MORE, held, edges + MORE, *size)]
        return self._memories[0]

    @cached_property
    def kept(self) -> Reals:
        """Part of the friction of each finger that its forces may use (f,)."""
        return np.array([1.0 - finger.reserve for finger in self.fingers])

    @cached_property
    def strongest(self) -> Reals:
        """The force with which each finger presses at most (f,)."""
        return np.array([finger.press[1] for finger in self.fingers])

    @cached_property
    def stronger(self) -> Ground:
        """The same with fingers of any strength."""
        return replace(self, fingers=tuple(replace(each, press=(0.0, math.inf)) for each in self.fingers))

    @cached_property
    def is_wide(self) -> bool:
        """Whether some finger may touch it at several places."""
        return any(finger.contacts > 1 for finger in self.fingers)

    @cached_property
    def turning(self) -> int:
        """The number of the object's coordinate that turns it, -1 where none does."""
        names = world_of(self.task.scene).velocities
        turns = [k for k, column in enumerate(self.columns) if names[column].endswith(".angle")]
        return turns[0] if turns else -1

    @cached_property
    def supporting(self) -> Ints:
        """The rows of supports that carry the object (r,); none where it may fall, or turn about a point."""
        start = world_of(self.task.scene).at(self.task.parameters).q
        rows = self.around.touches(start, 0.0).supports.rows[:, self.columns]
        on = np.flatnonzero(np.abs(rows).max(axis=1, initial=0.0) > 0.0)
        return on if len(on) > 1 else on[:0]

    @cached_property
    def reach(self) -> Reals:
        """Least and greatest x and y of each finger that these place (f, 2, 2)."""
        return np.array([f.bounds if f.arm is None else np.zeros((2, 2)) for f in self.fingers])

    @cached_property
    def frictions(self) -> Reals:
        """Friction of each finger on the object (f,)."""
        return np.array([0.0 if each is None else each.friction for each in self._first])

    @cached_property
    def twists(self) -> Reals:
        """Torsional over sliding friction of each finger on the object (f,), as lengths."""
        return np.array([0.0 if each is None else each.twist for each in self._first])

    @cached_property
    def _first(self) -> list[Near | None]:
        """Nearest points of each finger and the object, at the start."""
        start = world_of(self.task.scene).at(self.task.parameters).q
        return [self.around.near(start, int(pair)) if pair >= 0 else None for pair in self.own]

    def placed(self, q: Reals, f: int, part: float) -> Reals | None:
        """The place (n,) with a finger at this part of the outline; None where it does not come there."""
        finger, found = self.fingers[f], q.copy()
        at, turned = frame_of(self.around.poses(q)[self.body])
        point, normal = (rows[0] for rows in self.around.outline(self.body)(np.array([part])))
        point, normal, pair = at + turned @ point, turned @ normal, int(self.own[f])
        if finger.arm is not None:
            wanted = self._reach(f, point, normal)
            earlier = self._earlier.setdefault(f, Earlier(self.task.size)) if finger.is_redundant else None
            return touching(
                self.around,
                finger.arm,
                q,
                wanted,
                self.avoided,
                self.kept_apart,
                earlier,
                finger.contacts > 1,
            )
        found[finger.columns] = point + 2.0 * self.task.size * normal
        for _ in range(CORRECTIONS if finger.contacts == 1 else MORE):
            gap = self.around.touches(found, 0.0).least[pair]
            found[finger.columns] -= gap * normal
        return found if self.look(found).held[f] >= 0 else None

    def moved(self, seen: Seen, change: Reals, used: Ints, led: Ints | None = None) -> Reals:
        """The place (n,) after a change (k,) of the object, with which the fingers that are used (f,) go,
        each led by its nearest contact, or by another (f,)."""
        whole = np.zeros(len(self.around.owners))
        whole[self.columns] = change
        q = self.around.changed(seen.q, whole)
        led = seen.held if led is None else led
        carry(seen.touches.rows, led, used, self.placing, self.columns, change, q)
        for f in self.arms:
            if not used[f]:
                continue
            rows, finger = seen.touches.rows[self.touched(seen, f)], self.fingers[f]
            rows = rows.reshape(-1, rows.shape[2])
            own = rows[:, finger.moved] @ finger.rates(q)
            along = np.linalg.lstsq(own, -rows[:, self.columns] @ change, rcond=DEPENDENT)[0]
            if finger.arm is not None:
                along += to_posture(finger.arm, q, own, finger.arm.posture)
            q = finger.put(q, finger.drives(q) + along)
        return q

    def corrected(self, q: Reals, kept: set[int], used: Ints) -> Seen:
        """What touches where the kept contacts, by their features, and those of the fingers are closed."""
        for _ in range(CORRECTIONS):
            seen = self.look(q)
            touches, held = seen.touches, used * (seen.held >= 0)
            rows = [k for k in seen.closed.tolist() if int(touches.features[k]) in kept]
            gaps = touches.gaps[[*rows, *seen.held[held > 0].tolist()]]
            if np.abs(gaps).max(initial=0.0) < EXACT * self.closed:
                return seen
            if rows:
                q = self.moved(seen, self._closing(touches, np.array(rows)), held)
                seen = self.look(q)
            q = q.copy()
            touch(seen.touches.rows, seen.touches.gaps, seen.held, held, self.placing, q)
            for f in self.arms:
                if held[f] and seen.held[f] >= 0:
                    finger, own = self.fingers[f], self.touched(seen, f)
                    normals = seen.touches.rows[own, 0][:, finger.moved] @ finger.rates(q)
                    closing = np.linalg.lstsq(normals, -seen.touches.gaps[own], rcond=DEPENDENT)[0]
                    q = finger.put(q, finger.drives(q) + closing)
        return self._cleared(self.look(q), used)

    def _cleared(self, seen: Seen, used: Ints) -> Seen:
        """What touches where arms that have joints to spare keep away from what they avoid."""
        q = seen.q
        for f, finger in enumerate(self.fingers):
            near = seen.touches.least[self.avoided] < self.kept_apart
            if not used[f] or seen.held[f] < 0 or not finger.is_redundant or not near.any():
                continue
            assert finger.arm is not None
            point, normal = seen.touches.points[seen.held[f]], seen.touches.normals[seen.held[f]]
            wanted = self._reach(f, point, normal)
            q = cleared(self.around, finger.arm, q, wanted, self.avoided, self.kept_apart)
            seen = self.look(q)
        return seen

    def _reach(self, f: int, point: Reals, normal: Reals) -> Reach:
        """What a finger is to touch at a point (d,) with this outward normal (d,)."""
        finger, pair = self.fingers[f], int(self.own[f])
        first = self.task.scene.template.contacts[pair][0] == finger.carrier.body
        return Reach(pair, 1.0 if first else -1.0, finger.body, point, normal, self.task.size, self.closed)

    def touched(self, seen: Seen, f: int) -> list[int]:
        """The contacts at which a finger touches the object: the nearest one, or all closed ones of a finger
        that may touch at several."""
        nearest = int(seen.held[f])
        if self.fingers[f].contacts == 1:
            return [nearest]
        closed = (seen.touches.pairs == self.own[f]) & (seen.touches.gaps < self.closed)
        return [nearest, *(k for k in np.flatnonzero(closed).tolist() if k != nearest)]

    def _closing(self, touches: Touches, rows: Ints) -> Reals:
        """The least change (k,) of the object that closes some contacts (r,)."""
        memory = self.memory(len(rows))
        see(touches.rows, touches.friction, rows, self.columns, self.units, memory)
        normals = memory.normals[: len(rows)]
        turn(normals, memory)
        return -memory.turned @ (normals.T @ touches.gaps[rows]) / self.units

    @cached_property
    def arms(self) -> list[int]:
        """The fingers that joints lead."""
        return [f for f, finger in enumerate(self.fingers) if finger.arm is not None]

    @cached_property
    def placing(self) -> Ints:
        """The columns of x and y of each finger that these place (f, 2), -1 for others."""
        return np.array([f.columns if f.arm is None else (-1, -1) for f in self.fingers], np.int64)

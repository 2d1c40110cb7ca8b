"""Legs on a stage: proposed again from where the object really is, laid out, run; the end is a node."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from rungwise.kernel import Reals
from rungwise.outcome import Code
from rungwise.planning.modes.balance import modes
from rungwise.planning.modes.fingers import Finger, fingers_of
from rungwise.planning.modes.follow import TARGET, Way, follow
from rungwise.planning.modes.ground import Ground, Seen
from rungwise.planning.modes.legs import HOLD, Layout, Writer
from rungwise.planning.modes.pushed import loose
from rungwise.planning.modes.tree import Leg
from rungwise.planning.motion.placements import placed_part
from rungwise.planning.motion.propagate import GOES_ON, Ends, Places, Predictor
from rungwise.planning.motion.settle import HELD
from rungwise.planning.search.layout import FOLLOW, LATER, WAIT, Course
from rungwise.planning.search.problem import Found, Work
from rungwise.scene.language.lasting import names_in
from rungwise.simulation.inputs import Segment
from rungwise.world.carriers import Surroundings
from rungwise.world.contract import OBJECT
from rungwise.world.find import world_of
from rungwise.world.margins import Question

AGAIN = 8
"""Modes that are tried to make a leg again from another place."""
NEARER = 0.5
"""Part of the way of a leg that is left at most when it is made again."""


@dataclass(frozen=True)
class Node:
    """Where legs have led on a stage: one place, inputs (u,) and aims (n,) of the fingers there; what was
    laid out and run; what is lacking of the goal; how often it was gone on from; and how often fingers
    changed their places."""

    places: Places
    levels: Reals
    aims: Reals
    lack: float
    segments: tuple[Segment, ...] = ()
    labels: tuple[str, ...] = ()
    counts: tuple[int, ...] = ()
    waypoints: tuple[Places, ...] = ()
    vectors: tuple[Reals, ...] = ()
    work: float = 0.0
    outcome: Code = Code.MISSED
    tries: list[int] = field(default_factory=lambda: [0])
    grasps: int = 0

    @property
    def found(self) -> Found:
        """The plan that ends here."""
        course = Course(
            self.segments, self.labels, self.counts, self.waypoints, self.levels, self.work, self.outcome
        )
        return Found(course, np.array(self.vectors))


class Manner(NamedTuple):
    """How legs are made: with which part of the load fingers press at least, and how many times slower than
    their speed they go."""

    press: float
    pace: float


class Begun(NamedTuple):
    """A leg that begins where its object really is: whose it is, and what is seen there."""

    ground: Ground
    seen: Seen
    leg: Leg


class Scene:
    """Objects and fingers of a task, as modes see them."""

    def __init__(self, work: Work) -> None:
        self.work, task = work, work.task
        around = world_of(task.scene).surroundings(task.parameters)
        assert around is not None
        self.fingers: tuple[Finger, ...] = fingers_of(task)
        names, roles = list(task.scene.template.bodies), world_of(task.scene).roles(task.parameters)
        self.grounds = {
            name: Ground.of(task, around, self.fingers, names.index(name))
            for name, role in roles.items()
            if role == OBJECT and any(names.index(name) in finger.objects for finger in self.fingers)
        }
        placed = placed_part(task.search.file.goal or "")
        assert placed is not None
        self.placed = Question(task.search, placed, task.parameters)
        self._add_pushed(around)
        self.aside = self._pushing_aside(around)
        self._all = [*self.grounds.values(), *self.aside.values()]
        self._wide = max(len(ground.places) for ground in self._all)

    def _add_pushed(self, around: Surroundings) -> None:
        """Objects of which the goal speaks, as pushed by others that fingers may touch."""
        task, names = self.work.task, list(self.work.task.scene.template.bodies)
        roles, contacts = world_of(task.scene).roles(task.parameters), task.scene.template.contacts
        asked = self._asked()
        free = {name for name in names if (around.owners == names.index(name)).sum() == 3}
        for first in list(self.grounds):
            for last, role in roles.items():
                touches = (first, last) in contacts or (last, first) in contacts
                if role == OBJECT and touches and last in asked and {first, last} <= free:
                    own = Ground.of(task, around, self.fingers, names.index(first), names.index(last))
                    self.grounds[f"{first} pushes {last}"] = own

    def _asked(self) -> set[str]:
        """Names in the goal."""
        return {name for texts in self.placed.parts for text in texts for name in names_in(text)}

    def _pushing_aside(self, around: Surroundings) -> dict[int, Ground]:
        """By their numbers, objects of which the goal speaks, as pushing others aside that lie loose."""
        task, asked = self.work.task, self._asked()
        aside = loose(task, around, asked)
        wanted = [own.body for name, own in self.grounds.items() if name in asked] if aside else []
        return {body: Ground.of(task, around, self.fingers, body, aside=aside) for body in wanted}

    def name(self, ground: Ground) -> str:
        """The name of the object that is to come to the goal."""
        return str(self.work.task.scene.template.bodies[ground.last])

    def root(self, levels: Reals | None = None) -> Node:
        """Where planning starts, after inputs (u,), those of the instance if none are given."""
        work = self.work
        q = work.start.q[0]
        aims = q.copy() if levels is None else self._aims(q, levels)
        before = work.task.before if levels is None else levels
        return Node(work.start, before, aims, float(work.lack(work.start)[0]))

    def ground(self, vector: Reals) -> Ground:
        """The object of the leg of these numbers (d,)."""
        return self._all[int(vector[0])]

    def end(self, q: Reals, vector: Reals) -> Reals:
        """The place (n,) where the leg of these numbers (d,) leads its object; all else is as at q (n,)."""
        places, found = self.ground(vector).places, q.copy()
        found[places] = vector[2 : 2 + len(places)]
        return found

    def going_on(self, vector: Reals) -> Reals:
        """The leg of these numbers (d,) after fingers have changed their places."""
        found, width, k = vector.copy(), 0, 2 + self._wide
        for finger in self.fingers:
            found[k + width] = 0.0
            width += 3 + len(finger.carrier.columns)
        return found

    def vector(self, ground: Ground, leg: Leg, manner: Manner) -> Reals:
        """A leg as numbers (d,): the object, by its number among those that are led, and where it is led,
        how, and where the fingers are."""
        first, last = ground.look(leg.way.places[0]), leg.way.places[-1]
        number = next(k for k, own in enumerate(self._all) if own is ground)
        found = [float(number), manner.press, *last[ground.places]]
        found += [0.0] * (self._wide - len(ground.places))
        for f, finger in enumerate(self.fingers):
            used = bool(leg.way.used[f])
            part = ground.part(first, f)[0] if used and first.held[f] >= 0 else 0.0
            found += [float(leg.changes[f]), float(used), part, *finger.drives(first.q)]
        return np.array(found)

    def leg(
        self, q: Reals, vector: Reals, manner: Manner, look: Callable[[int], None]
    ) -> Begun | None:  # fmt: skip
        """The leg of these numbers (d,), made again from a place (n,); None where that cannot be. `look` is
        called with the steps that it takes, and may raise."""
        ground = self.ground(vector)
        seen, k = ground.look(q), 2 + self._wide
        target, begun = self.end(q, vector), q.copy()
        changes, used = (np.zeros(len(self.fingers), np.int64) for _ in range(2))
        for f, finger in enumerate(self.fingers):
            width = 3 + len(finger.carrier.columns)
            own = vector[k + width * f : k + width * (f + 1)]
            changes[f], used[f] = int(own[0]), int(own[1])
            if used[f] and not changes[f] and seen.held[f] < 0:
                changes[f] = 1
            if not changes[f]:
                continue
            begun = finger.put(begun, own[3:])
            if used[f]:
                place = ground.placed(begun, f, float(own[2]))
                if place is None:
                    return None
                begun = place
        start = ground.look(begun)
        if not ground.is_held(start, used) or not ground.begins_free(start, used):
            return None
        want = ground.off(begun, target)
        best, left = None, NEARER * float(np.linalg.norm(want))
        for mode, _ in modes(ground, start, want)[:AGAIN]:
            way = follow(ground, start, used, mode, target, manner.press, look)
            away = ground.away(way.places[-1], target)
            if len(way.places) > 1 and away < left:
                best, left = way, away
        return None if best is None else Begun(ground, seen, Leg(changes, best))

    def letting_go(self, q: Reals) -> Begun | None:
        """The leg in which all fingers that touch an object at a place (n,) draw back from it; of the first
        object of which they can, None where there is none."""
        for ground in self.grounds.values():
            seen = ground.look(q)
            held = (seen.held >= 0).astype(np.int64)
            back = Writer(ground, self.work.moves.question, 1.0).drawn_back(seen, held)
            if held.any() and back is not None:
                still = np.zeros((1, len(ground.around.owners)))
                return Begun(ground, seen, Leg(held, Way(back[None], still, np.zeros_like(held), TARGET)))
        return None

    def run(self, predictor: Predictor, node: Node, begun: Begun, manner: Manner) -> Node | None:
        """The node at the end of a leg; None where it cannot be laid out, or ends so that nothing follows."""
        work, (ground, seen, leg) = self.work, begun
        writer = Writer(ground, work.moves.question, manner.pace)
        seed = work.seed + len(node.counts)
        laid = writer.leg(seen, aims_at(self, node), node.levels, leg, seed, work.budget)
        if isinstance(laid, str):
            work.failures[laid] += 1
            return None
        ends = predictor.run(
            node.places,
            laid.levels[None],
            laid.durations[None],
            ramps=laid.ramps,
            patient=predictor.stage.model.inertia > 0.0 or ground.around.dimension > 2,
        )
        outcome, count = Code(int(ends.outcome[0])), len(laid.durations)
        places = ends.places
        if outcome not in (Code.GOAL, *GOES_ON):
            work.failures[f"lost on {predictor.stage.model.name}: {outcome.name.lower()}"] += 1
            count = int(ends.switches[0])
            if count <= laid.labels.index(FOLLOW if FOLLOW in laid.labels else HOLD):
                return None
            places, outcome = ends.at(count - 1, np.zeros(1, np.int64)), Code.MISSED
        own = _segments(self.work, laid, count)
        labels = (*laid.labels[: count - 1], HOLD)
        levels = laid.levels[count - 1]
        aims = self._aims(laid.aims, levels)
        if outcome != Code.GOAL and work.task.moving(places.v)[0]:
            waited = self._waited(predictor, places, levels)
            if waited is not None:
                own = (*own, Segment(own[-1].inputs, (1.0 + LATER) * waited[1], None, False))
                labels, places = (*labels, WAIT), waited[0].places
                outcome = Code(int(waited[0].outcome[0]))
        if outcome != Code.GOAL and self.is_there(places.q[0]):
            rested = self._held(predictor, places, levels, work.task.patience)
            if rested is not None:
                own = (*own, Segment(own[-1].inputs, (1.0 + LATER) * rested[1], None, False))
                labels, places, outcome = (*labels, WAIT), rested[0].places, Code.GOAL
        if outcome != Code.GOAL and work.moves.hopes(places.q, places.v)[0]:
            lasted = self._held(predictor, places, levels, (1.0 + HELD) * work.task.lasting)
            if lasted is not None:
                own = (*own, Segment(own[-1].inputs, (1.0 + LATER) * lasted[1], None, False))
                labels, places, outcome = (*labels, WAIT), lasted[0].places, Code.GOAL
        lack = 0.0 if outcome == Code.GOAL else max(float(work.lack(places)[0]), 1e-12)
        return Node(
            places=places, levels=levels, aims=aims, lack=lack, segments=node.segments + own,
            labels=node.labels + labels, counts=(*node.counts, len(own)),
            waypoints=(*node.waypoints, places), work=node.work + float(ends.work[0]), outcome=outcome,
            vectors=(*node.vectors, self.vector(ground, leg, manner)),
            grasps=node.grasps + int(leg.changes.any()),
        )  # fmt: skip

    def _waited(self, predictor: Predictor, places: Places, levels: Reals) -> tuple[Ends, float] | None:
        """What comes of waiting until objects rest, and for how long; None where they do not."""
        task = self.work.task
        held = task.held(levels[None])
        ends = predictor.run(places, held[:, None], np.full((1, 1), task.patience), until=(task.at_rest,))
        outcome = Code(int(ends.outcome[0]))
        if outcome not in (Code.GOAL, *GOES_ON):
            return None
        return ends, float(ends.places.time[0] - places.time[0])

    def is_there(self, q: Reals) -> bool:
        """Whether all holds at a place (n,) that the goal says of places."""
        return bool((self.placed.ask(self.work.task.resting(q)).lacks[0] == 0.0).all())

    def _held(
        self, predictor: Predictor, places: Places, levels: Reals, duration: float
    ) -> tuple[Ends, float] | None:
        """What comes of standing still so long, and for how long; None where the goal is not reached so."""
        held = self.work.task.held(levels[None])
        ends = predictor.run(places, held[:, None], np.full((1, 1), duration))
        if ends.outcome[0] != Code.GOAL:
            return None
        return ends, float(ends.places.time[0] - places.time[0])

    def _aims(self, aims: Reals, levels: Reals) -> Reals:
        """Aims (n,) after inputs (u,): those of servos, else these."""
        found = aims.copy()
        for finger in self.fingers:
            carrier = finger.carrier
            if carrier.by_place:
                found = finger.put(found, carrier.led.at(levels[list(carrier.columns)]))
        return found


def aims_at(scene: Scene, node: Node) -> Reals:
    """Aims (n,) of the fingers at a node: where speeds drive them, where they are."""
    aims = node.aims.copy()
    for finger in scene.fingers:
        if not finger.carrier.by_place:
            aims[finger.places] = node.places.q[0, finger.places]
    return aims


def _segments(work: Work, laid: Layout, count: int) -> tuple[Segment, ...]:
    names = work.task.scene.template.inputs
    return tuple(
        Segment(dict(zip(names, row.tolist(), strict=True)), float(took), None, ramp)
        for row, took, ramp in zip(
            laid.levels[:count], laid.durations[:count], laid.ramps[:count], strict=True
        )
    )

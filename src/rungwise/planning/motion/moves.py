"""Moves: what a plan is made of, as vectors that searches vary.

A move leads its carriers each to a place at the boundary of an object, pushes from there along a straight
way, and draws back; inputs that no carrier uses take a value. Without carriers a move is a segment of inputs.
Each number of a vector lies in 0..1; that of a place on a boundary is periodic.
"""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rungwise.kernel import Reals
from rungwise.planning.motion.propagate import Places
from rungwise.planning.motion.transit import Transit
from rungwise.planning.task.fingers import Finger, stated_of
from rungwise.planning.task.task import Task
from rungwise.scene.language.lasting import names_in
from rungwise.scene.template.records import Records
from rungwise.world.carriers import Carrier, TaskError
from rungwise.world.find import world_of
from rungwise.world.margins import Question
from rungwise.world.planar.boundary import Boundary, boundary


class Segments(NamedTuple):
    """Inputs (m, s, u) and durations (m, s) of one move of m plans; ramps (s,)."""

    levels: Reals
    durations: Reals
    ramps: tuple[bool, ...]

    def take(self, rows: NDArray[np.bool_]) -> Segments:
        return Segments(self.levels[rows], self.durations[rows], self.ramps)


@dataclass(frozen=True)
class _Target:
    """An object to push at: its number among the bodies, and its boundary."""

    body: int
    boundary: Boundary


class Stroke(NamedTuple):
    """Ways of one carrier (m, k), in its coordinates, of a push and back from there, and how long the push is
    (m,)."""

    there: Reals
    back: Reals
    length: Reals


class Moves:
    """The moves of a task: from vectors (m, d) to places of robots and segments of inputs. `per`: numbers of
    a vector for each carrier, of which the first is periodic; `forgets`: whether carriers that are placed
    beside objects make runs forget their contacts."""

    per = 3
    forgets = True

    def __init__(self, task: Task) -> None:
        self.task = task
        self.question = Question(task.scene, None, task.parameters)
        self._goal = Question(task.search, "goal", task.parameters, now=True) if task.lasting else None
        self._free = task.free
        self.size = self.per * len(task.carriers) + len(self._free) + (0 if task.carriers else 1)
        self.periodic = np.zeros(self.size, bool)
        self.periodic[: self.per * len(task.carriers) : self.per] = True
        self._ramped = bool(np.isfinite(task.rate[self._free]).any())

    def hopes(self, q: Reals, v: Reals) -> NDArray[np.bool_]:
        """Whether the goal holds at q (m, n_q), v (m, n_v), as far as these say, and must go on to hold for a
        time."""
        if self._goal is None or not len(q):
            return np.zeros(len(q), bool)
        if {"force", "impulse"} & names_in(self.task.search.file.goal):
            return np.ones(len(q), bool)
        return self._goal.ask(np.hstack([q, v])).holds

    @cached_property
    def transit(self) -> Transit:
        """Ways of the robots between moves."""
        within = {name: finger.within for name, finger in self._said.items()}
        around = world_of(self.task.scene).surroundings(self.task.parameters)
        return Transit(self.task, self.question, within, around=around)

    @cached_property
    def _said(self) -> dict[str, Finger]:
        """What the task says of robots as fingers."""
        return stated_of(self.task)

    @cached_property
    def _targets(self) -> list[list[_Target]]:
        return [self._pushed(carrier) for carrier in self.task.carriers]

    @cached_property
    def _records(self) -> Records:
        return self.task.planar.bind(self.task.parameters).records

    def aimed(self, vectors: Reals, bodies: Collection[str]) -> Reals:
        """The vectors (..., d) with pushes turned to these bodies, by every robot that may push at one."""
        found = vectors.copy()
        for k, names in enumerate(self.pushable):
            chosen = np.flatnonzero([name in bodies for name in names])
            if len(chosen):
                scaled = np.mod(found[..., self.per * k], 1.0) * len(names)
                whole = np.minimum(scaled.astype(np.int64), len(names) - 1)
                other = chosen[whole % len(chosen)]
                target = np.where(np.isin(whole, chosen), whole, other)
                found[..., self.per * k] = np.minimum(
                    target + scaled - whole, np.nextafter(target + 1, 0.0)
                ) / len(names)
        return found

    @property
    def pushable(self) -> list[list[str]]:
        """The names of the objects that each robot may push at, in the order of its targets."""
        names = self.task.scene.template.bodies
        return [[names[target.body] for target in targets] for targets in self._targets]

    @property
    def segments(self) -> int:
        """Segments of a move: a push and the way back, or what holds the inputs; before them the change of
        inputs, if that takes time, with carriers at rest."""
        if not self.task.carriers:
            return 2 if self._ramped else 1
        return 2 + (self._ramped or self.task.by_place) + self._ramped

    def begin(self, vectors: Reals, places: Places) -> tuple[Places, NDArray[np.bool_]]:
        """The places with the carriers led to where their moves begin, and whether they fit there (m,)."""
        if not self.task.carriers:
            return places, np.ones(len(vectors), bool)
        q, v = places.q.copy(), places.v.copy()
        poses = self.question.geometry(np.ascontiguousarray(q)).poses
        for k, carrier in enumerate(self.task.carriers):
            points, normals = self._contact(k, vectors[:, 3 * k], poses)
            q[:, list(carrier.places)] = points + self._beside(carrier, normals, poses)
            v[:, list(carrier.places)] = 0.0
        begun = Places(q, v, places.time, places.memory[:0])
        return begun, ~self.question.geometry(q).collides & self._keeps_within(vectors, begun)

    def _keeps_within(self, vectors: Reals, begun: Places) -> NDArray[np.bool_]:
        """Whether all pushes from these places keep to where the task lets its fingers be (m,)."""
        fits = np.ones(len(vectors), bool)
        if not self._said:
            return fits
        for carrier, stroke in zip(self.task.carriers, self._strokes(vectors, begun), strict=True):
            if carrier.body in self._said:
                low, high = self._said[carrier.body].within
                at = begun.q[:, list(carrier.places)]
                for place in (at, at + stroke.there):
                    fits &= ((place >= low) & (place <= high)).all(axis=1)
        return fits

    def segments_of(self, vectors: Reals, places: Places, before: Reals, cuts: int = 1) -> Segments:
        """Inputs and durations, of moves that begin at these places after inputs `before` (m, u); pushes at
        given speeds are cut into so many segments."""
        m, task = len(vectors), self.task
        held = before.copy()
        held[:, self._free] = self._inputs(vectors)
        rest = before.copy()
        for carrier in task.carriers:
            at = places.q[:, list(carrier.places)]
            rest[:, list(carrier.columns)] = carrier.levels(np.zeros_like(at), at)
            held[:, list(carrier.columns)] = rest[:, list(carrier.columns)]
        parts = []
        if task.carriers and (self._ramped or task.by_place):
            parts.append((rest, np.zeros(m), False))
        if self._ramped:
            rate = task.rate[self._free]
            change = np.abs(held[:, self._free] - before[:, self._free])
            parts.append((held, np.max(change / rate, axis=1, initial=0.0), True))
        if not task.carriers:
            parts.append((held, lasting(task, vectors[:, -1]), False))
            return _segments(parts)
        push, back = self._pushes(held, self._strokes(vectors, places), places)
        cut = (push[0], push[1] / cuts, push[2])
        return _segments([*parts, *([cut] * cuts), back])

    def held_for(self, levels: Reals, durations: Reals) -> Reals:
        """The moves (m, d) of a task without carriers that come nearest to holding inputs (m, u) for
        durations (m,)."""
        least, most = _durations(self.task)
        span = self.task.high - self.task.low
        inputs = (levels - self.task.low) / np.where(span > 0.0, span, 1.0)
        part = np.log(np.maximum(durations, least) / least) / (math.log(most / least) or 1.0)
        return np.clip(np.column_stack([inputs, part]), 0.0, 1.0)

    def cut(self, vectors: Reals, part: float) -> tuple[Reals, NDArray[np.bool_]]:
        """The vectors (m, d) of moves whose pushes end after a part of their way, and whether pushes may be
        so short (m,)."""
        found, fits = vectors.copy(), np.ones(len(vectors), bool)
        for k, carrier in enumerate(self.task.carriers):
            column, (low, high) = self.per * (k + 1) - 1, carrier.push
            length = part * pushed_length(carrier, vectors[:, column]) - carrier.clearance
            fits &= length >= low
            if high > low:
                found[:, column] = np.log(np.maximum(length, low) / low) / math.log(high / low)
        return found, fits

    def _pushes(self, held: Reals, strokes: list[Stroke], places: Places) -> list[tuple[Reals, Reals, bool]]:
        """The push, all carriers in the same time, and the way back."""
        task, there, back = self.task, held.copy(), held.copy()
        took, returns = np.zeros(len(held)), 0.0
        for carrier, stroke in zip(task.carriers, strokes, strict=True):
            took = np.maximum(took, stroke.length / carrier.speed)
            returns = max(returns, carrier.clearance / carrier.speed)
        for carrier, stroke in zip(task.carriers, strokes, strict=True):
            columns, end = list(carrier.columns), places.q[:, list(carrier.places)] + stroke.there
            there[:, columns] = carrier.levels(stroke.there / took[:, None], end)
            back[:, columns] = carrier.levels(stroke.back / returns, end + stroke.back)
        return [(there, took, task.by_place), (back, np.full(len(held), returns), task.by_place)]

    def _strokes(self, vectors: Reals, places: Places) -> list[Stroke]:
        """Where each carrier goes from the place where it begins, and back."""
        poses = self.question.geometry(np.ascontiguousarray(places.q)).poses
        strokes = []
        for k, carrier in enumerate(self.task.carriers):
            _, normals = self._contact(k, vectors[:, 3 * k], poses)
            lean = carrier.lean * (2.0 * vectors[:, 3 * k + 1] - 1.0)
            way = -_turned(normals, lean) * pushed_length(carrier, vectors[:, 3 * k + 2])[:, None]
            length = np.linalg.norm(way, axis=1)
            strokes.append(Stroke(way, -carrier.clearance * way / length[:, None], length))
        return strokes

    def _inputs(self, vectors: Reals) -> Reals:
        """Values (m, f) of the inputs that no carrier uses."""
        first = self.per * len(self.task.carriers)
        low, high = self.task.low[self._free], self.task.high[self._free]
        return np.asarray(low + (high - low) * vectors[:, first : first + len(self._free)])

    def _contact(self, k: int, part: Reals, poses: Reals) -> tuple[Reals, Reals]:
        """Points and outward normals (m, 2) in the world on the objects that carrier k pushes at."""
        targets = self._targets[k]
        scaled = np.mod(part, 1.0) * len(targets)
        chosen = np.minimum(scaled.astype(np.int64), len(targets) - 1)
        points, normals = np.zeros((len(part), 2)), np.zeros((len(part), 2))
        for number, target in enumerate(targets):
            rows = np.flatnonzero(chosen == number)
            if len(rows):
                point, normal = target.boundary(scaled[rows] - number)
                pose = poses[rows, target.body]
                points[rows] = pose[:, :2] + _turned(point, pose[:, 2])
                normals[rows] = _turned(normal, pose[:, 2])
        return points, normals

    def _beside(self, carrier: Carrier, normals: Reals, poses: Reals) -> Reals:
        """From a point of an object to the centre of the robot that is `clearance` away from it."""
        records, index = self._records, self.task.scene.template.bodies.index(carrier.body)
        body = records.bodies[index]
        angle = poses[:, index, 2]
        towards = _turned(-normals, -angle)
        support, farthest = np.zeros_like(normals), np.full(len(normals), -math.inf)
        for s in range(int(body["first_shape"]), int(body["end_shape"])):
            shape = records.shapes[s]
            own = records.vertices[int(shape["first"]) : int(shape["end"])]
            places = np.stack([own["x"], own["y"]], axis=-1)
            out = towards @ places.T + float(shape["radius"])
            best = out.argmax(axis=1)
            point = places[best] + float(shape["radius"]) * towards
            better = out[np.arange(len(out)), best] > farthest
            support[better], farthest[better] = point[better], out.max(axis=1)[better]
        return carrier.clearance * normals - _turned(support, angle)

    def _pushed(self, carrier: Carrier) -> list[_Target]:
        """The objects that a carrier may push at."""
        scene, template = self.task.planar, self.task.scene.template
        targets = []
        said = self._said.get(carrier.body)
        for index, name in enumerate(template.bodies):
            pair = {name, carrier.body}
            if said is not None and name not in said.objects:
                continue
            if scene.file.bodies[name].role == "object" and any(set(c) == pair for c in template.contacts):
                try:
                    targets.append(_Target(index, boundary(self._records, index)))
                except ValueError:
                    continue
        if not targets:
            raise TaskError(f"task.transit.{carrier.body}: touches no object; see contacts")
        return targets


def lasting(task: Task, part: Reals) -> Reals:
    """Durations (m,) of moves without carriers, at parts 0..1 of their range."""
    least, most = _durations(task)
    return np.asarray(least * (most / least) ** part)


def _durations(task: Task) -> tuple[float, float]:
    """The least and the greatest duration of moves without carriers."""
    low, high = task.duration
    return max(low, 1e-3 * high), high


def pushed_length(carrier: Carrier, part: Reals) -> Reals:
    """Lengths (m,) of pushes at parts 0..1 of their range, with the way to the object."""
    low, high = carrier.push
    return np.asarray(low * (high / low) ** part + carrier.clearance)


def _segments(parts: list[tuple[Reals, Reals, bool]]) -> Segments:
    levels, durations, ramps = zip(*parts, strict=True)
    return Segments(np.stack(levels, axis=1), np.stack(durations, axis=1), tuple(ramps))


def _turned(vectors: Reals, angle: Reals) -> Reals:
    """Vectors (m, 2), turned by angles (m,)."""
    c, s = np.cos(angle), np.sin(angle)
    x, y = vectors[:, 0], vectors[:, 1]
    return np.stack([c * x - s * y, s * x + c * y], axis=-1)

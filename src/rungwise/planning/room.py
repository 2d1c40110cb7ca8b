"""Where bodies may be placed: their coordinates, how these change, and what is between the bodies there.

The geometric rung asks nothing else of a scene. Here for scenes in the plane; `space_room` is the same for
scenes in space, where places hold quaternions and changes of them are turns.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from rungwise.kernel import Ints, Reals
from rungwise.planning.task import Task
from rungwise.scene import Scene
from rungwise.scene.space import SpaceScene
from rungwise.system.planar.place import turns
from rungwise.world.contract import OBJECT
from rungwise.world.find import world_of
from rungwise.world.questions import Question

ROUNDING = 1e-9
"""Overlap that counts as rounding, in parts of the size of what is moved."""


class Room(Protocol):
    """Places (n_q,) of all bodies, and changes (n_v,) of them.

    names: of bodies; size: how far the largest object reaches; thin: width of the thinnest shape; rounding:
    overlap that counts as none; unit (n_v,): changes as long as the size, or of one radian; objects (n_v,):
    which changes move objects; bodies: columns of places of each body; pairs (c, 2): bodies that may touch;
    numbers (p,): columns of places that are plain numbers; of these turning (p,): which are angles, low, high
    (p,): their travel, units (p,), of_numbers (p,): their changes; turns (r, 4): columns of quaternions;
    bound: what else bounds places, in words, empty where nothing does.
    """

    names: tuple[str, ...]
    size: float
    thin: float
    rounding: float
    unit: Reals
    objects: NDArray[np.bool_]
    bodies: list[list[int]]
    pairs: Ints
    numbers: Ints
    turning: NDArray[np.bool_]
    low: Reals
    high: Reals
    units: Reals
    of_numbers: Ints
    turns: Ints
    bound: str

    def look(self, rows: Reals) -> tuple[Reals, Reals]:
        """Gaps (m, c) at places (m, n_q), and what `moved` needs of these (m, ...)."""

    def moved(self, marks: Reals) -> Reals:
        """How far each body moves at most from each place to the next (m - 1, b)."""

    def changed(self, rows: Reals, change: Reals) -> Reals:
        """Places (..., n_q) after changes (..., n_v)."""

    def between(self, a: Reals, b: Reals, at: Reals) -> Reals:
        """Places (m, n_q) at parts `at` (m,) of the straight way from a to b (n_q,)."""

    def lengths(self, way: Reals) -> Reals:
        """How long each leg (k - 1,) of a way (k, n_q) is, in units."""


def room_of(task: Task, scene: Scene | SpaceScene, without: str = "") -> Room:
    """Where the bodies of a scene may be placed at a task's parameters, as if the body `without` were not
    there."""
    if isinstance(scene, SpaceScene):
        from rungwise.planning.space_room import SpaceRoom

        return SpaceRoom(task, scene, without)
    return PlanarRoom(task, scene, without)


class PlanarRoom:
    """The same of a planar scene: changes are differences of places."""

    def __init__(self, task: Task, scene: Scene, without: str) -> None:
        records = scene.bind(task.parameters).records
        self._question = Question(scene, None, task.parameters)
        coordinates, reach = records.coordinates, records.shapes["reach"]
        self.names, self.size, self.rounding = scene.template.bodies, task.size, ROUNDING * task.size
        self.bound = "bodies are joined" if scene.template.joints else ""
        self.turning = np.array(
            [turns(records.bodies[c["body"]], i) for i, c in enumerate(coordinates)], bool
        )
        self.unit = self.units = np.where(self.turning, 1.0, task.size)
        self.low, self.high = coordinates["lower"].copy(), coordinates["upper"].copy()
        self.numbers = self.of_numbers = np.arange(len(coordinates), dtype=np.int64)
        self.turns = np.zeros((0, 4), np.int64)
        widths = records.shapes["width"]
        self.thin = float(widths[np.isfinite(widths) & (widths > 0.0)].min(initial=task.size))
        self._reach = np.zeros(len(records.bodies))
        for shape, far in zip(records.shapes, np.where(np.isfinite(reach), reach, 0.0), strict=True):
            self._reach[shape["body"]] = max(self._reach[shape["body"]], far)
        contacts = scene.template.contacts
        self._kept = [k for k, pair in enumerate(contacts) if without not in pair]
        pairs = [[self.names.index(name) for name in contacts[k]] for k in self._kept]
        self.pairs = np.array(pairs, np.int64).reshape(-1, 2)
        owners, roles = coordinates["body"].tolist(), world_of(scene).roles()
        self.objects = np.array([roles[self.names[body]] == OBJECT for body in owners], bool)
        self.bodies = [[i for i, owner in enumerate(owners) if owner == body] for body in set(owners)]

    def look(self, rows: Reals) -> tuple[Reals, Reals]:
        found = self._question.geometry(rows)
        return found.gaps[:, self._kept], found.poses

    def moved(self, marks: Reals) -> Reals:
        moved = np.linalg.norm(np.diff(marks[..., :2], axis=0), axis=-1)
        return np.asarray(moved + self._reach * np.abs(_wrapped(np.diff(marks[..., 2], axis=0))))

    def changed(self, rows: Reals, change: Reals) -> Reals:
        return np.asarray(rows + change)

    def between(self, a: Reals, b: Reals, at: Reals) -> Reals:
        return np.asarray(a + at[:, None] * (b - a))

    def lengths(self, way: Reals) -> Reals:
        return np.asarray(np.linalg.norm(np.diff(way / self.unit, axis=0), axis=1))


def _wrapped(angles: Reals) -> Reals:
    return (angles + np.pi) % (2.0 * np.pi) - np.pi

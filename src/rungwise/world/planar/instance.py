"""A planar scene at one set of parameters (see `world.contract.Instance`)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from rungwise.kernel import Reals
from rungwise.scene import Bound, Scene
from rungwise.scene.template.records import Records
from rungwise.system.planar.place import start
from rungwise.world.carriers import Driven
from rungwise.world.contract import OBJECT, OBSTACLE, Load, Moved
from rungwise.world.parts import SceneInstance
from rungwise.world.planar.carriers import driven


@dataclass(frozen=True)
class PlanarInstance(SceneInstance[Bound]):
    """See `Instance`."""

    scene: Scene

    @cached_property
    def _start(self) -> tuple[Reals, Reals]:
        n = len(self.scene.template.coordinates)
        q, v = np.zeros(n), np.zeros(n)
        start(self.bound.records, q, v)
        return q, v

    @property
    def travel(self) -> Reals:
        own = self.bound.records.coordinates
        return np.array([own["lower"], own["upper"]])

    @property
    def smallest(self) -> float:
        reach = self.bound.records.shapes["reach"]
        known = reach[np.isfinite(reach) & (reach > 0.0)]
        return float(known.min()) if len(known) else 1.0

    @cached_property
    def moved(self) -> Moved:
        return moved_in_plane(self.scene, self.bound.records)

    @property
    def stops(self) -> Reals | None:
        records, roles = self.bound.records, roles_in_plane(self.scene)
        objects = {k for k, name in enumerate(self.scene.template.bodies) if roles[name] == OBJECT}
        if not objects <= set(records.supports["body"].tolist()):
            return None
        return np.asarray(records.supports["force"] / records.bodies["mass"][records.supports["body"]])

    def driven(self, name: str, path: str) -> Driven:
        return driven(self.scene, name, self.bound, path)

    @property
    def loads(self) -> Mapping[str, Load]:
        records, names, roles = self.bound.records, self.scene.template.bodies, roles_in_plane(self.scene)
        gravity = np.array([records.world["gravity_x"][0], records.world["gravity_y"][0]])
        found = {}
        for name, body in zip(names, records.bodies, strict=True):
            if roles[name] != OBJECT:
                continue
            force = body["mass"] * gravity + [body["force_x"], body["force_y"]]
            pairs = [pair for pair in self.scene.template.contacts if name in pair]
            on = tuple(other for pair in pairs for other in pair if roles[other] == OBSTACLE)
            own = records.supports["force"][records.supports["body"] == names.index(name)]
            found[name] = Load(math.hypot(*force), on, float(own.sum()))
        return found


def roles_in_plane(scene: Scene, _parameters: Mapping[str, float] | None = None) -> dict[str, str]:
    """The role of each body, as it is written."""
    return {name: body.role for name, body in scene.file.bodies.items()}


def moved_in_plane(scene: Scene, records: Records) -> Moved:
    """Weights and size of what is moved; angles count by the radius of gyration, and without a finite object
    the size is 1."""
    roles, names = roles_in_plane(scene), scene.template.coordinates
    of_object = [roles[name.split(".")[0]] == OBJECT for name in names]
    reaches = [
        float(s["reach"]) for s in records.shapes if roles[scene.template.bodies[int(s["body"])]] == OBJECT
    ]
    size = max((reach for reach in reaches if math.isfinite(reach)), default=1.0)
    levers = np.where(of_object, records.coordinates["lever"], 0.0)
    return Moved(levers, size, np.zeros((0, 4), np.int64), levers)

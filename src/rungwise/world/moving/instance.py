"""A scene of whatever moves at one set of parameters (see `world.contract.Instance`)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from rungwise.kernel import Reals
from rungwise.scene.stated import StatedScene
from rungwise.simulation.moving.prepared import Numbers, Prepared
from rungwise.world.carriers import Driven, TaskError
from rungwise.world.contract import OBJECT, Load, Moved
from rungwise.world.parts import BoundInstance


@dataclass(frozen=True)
class MovingInstance(BoundInstance):
    """See `Instance`: coordinates are lengths of the bodies by whose names they begin, nothing bounds them,
    and nothing lies on supports."""

    scene: StatedScene
    made: Prepared
    roles: Mapping[str, str]

    @property
    def bound(self) -> Numbers:
        return self.made.bound

    @cached_property
    def _start(self) -> tuple[Reals, Reals]:
        q, v = self.made.system.start()
        return np.array(q, float), np.array(v, float)

    @property
    def travel(self) -> Reals:
        return np.repeat([[-math.inf], [math.inf]], len(self.q), axis=1)

    @property
    def smallest(self) -> float:
        return float(self.made.system.size.length)

    @property
    def moved(self) -> Moved:
        template = self.scene.template
        weights, rates = (
            np.array([float(self.roles[body_of(name)] == OBJECT) for name in names])
            for names in (template.coordinates, template.velocities)
        )
        turns = np.array([range(first, first + 4) for first in template.turns], np.int64).reshape(-1, 4)
        return Moved(weights, self.smallest, turns, rates)

    def driven(self, _name: str, path: str) -> Driven:
        raise TaskError(f"{path}: no body of {self.scene.name} is led through free space")

    @property
    def loads(self) -> Mapping[str, Load]:
        return {}


def body_of(name: str) -> str:
    """The body of a coordinate or a velocity."""
    return name.partition(".")[0]

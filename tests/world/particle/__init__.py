"""A third world: a puck in a field, a finger, and a wall. Fields, names, and what the package asks."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from rungwise.scene.fields.stated import Stated
from rungwise.scene.fields.values import Number, Pair
from rungwise.scene.stated import NameTemplate, StatedScene, read_fields
from rungwise.simulation.moving.prepared import Bound, Prepared
from rungwise.world.moving.world import MovingWorld

from .system import Discs

BODIES = ("puck", "finger", "wall")
CONTACTS = (("finger", "puck"), ("puck", "wall"), ("finger", "wall"))
COORDINATES = ("puck.x", "puck.y", "finger.x", "finger.y")


class ParticleFile(Stated):
    puck: Pair = (0.0, 0.0)
    finger: Pair
    speed: tuple[str, str]
    radius: Number = 0.1
    mass: Number = 1.0
    pull: Number = 1.0
    drag: Number = 1.0
    wall: Number = 2.0
    friction: Number = 0.0
    restitution: Number = 0.0


@dataclass(frozen=True, repr=False)
class ParticleScene(StatedScene):
    world: ClassVar[str] = __name__

    def start(self, parameters: Mapping[str, float] | None = None) -> tuple[Any, Any]:
        return world(self).prepare(self.parameters(parameters)).system.start()


@dataclass(frozen=True)
class world(MovingWorld):
    robots: ClassVar[tuple[str, ...]] = ("finger",)

    def prepare(self, parameters: dict[str, float]) -> Prepared:
        number, file = self.scene.numbers(parameters), self.scene.file
        bound, names = Bound.of(self.scene, parameters), tuple(parameters)
        place = [
            number.one(x, f"{name}.{k}") for name in BODIES[:2] for k, x in enumerate(getattr(file, name))
        ]
        columns = names.index(file.speed[0]), names.index(file.speed[1])
        sizes = {name: number.positive(getattr(file, name), name) for name in ("radius", "mass", "wall")}
        others = ("pull", "drag", "friction", "restitution")
        rest = {name: number.one(getattr(file, name), name) for name in others}
        system = Discs(np.array(place), np.zeros(4), columns, **sizes, **rest)
        system.follow(bound.values, bound.values)
        return Prepared(bound, system)

    @property
    def prescribed(self) -> tuple[str, ...]:
        return COORDINATES[2:]


def load(data: Mapping[str, Any]) -> ParticleScene:
    file = read_fields(ParticleFile, data)
    names = NameTemplate(tuple(file.parameters), file.inputs, BODIES, COORDINATES, COORDINATES, CONTACTS)
    return ParticleScene(file, names).checked()

"""Where bodies may be placed whose coordinates are lengths along fixed axes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from rungwise.errors import InputError
from rungwise.kernel import Ints, Reals
from rungwise.simulation.core.tolerances import OVERLAP
from rungwise.world.carriers import Carrier, TaskError
from rungwise.world.contract import OBJECT, Tool
from rungwise.world.moving.instance import MovingInstance, body_of

if TYPE_CHECKING:
    from rungwise.world.moving.place import MovingPlace


class StraightWays:
    """The part of `Configurations` that holds where changes are differences of places."""

    unit: Reals

    def tool(self, carrier: Carrier) -> Tool:
        """None is known here. Raises TaskError."""
        raise TaskError(f"task.transit.{carrier.body}: is led by no joints")

    def changed(self, rows: Reals, change: Reals) -> Reals:
        return np.asarray(rows + change)

    def between(self, a: Reals, b: Reals, at: Reals) -> Reals:
        return np.asarray(a + at[:, None] * (b - a))

    def lengths(self, way: Reals) -> Reals:
        return np.asarray(np.linalg.norm(np.diff(way / self.unit, axis=0), axis=1))


class MovingConfigurations(StraightWays):
    """See `Configurations`: changes are differences of places, and a body moves as far as its coordinates do.
    Raises InputError for scenes in which velocities are no rates of places."""

    def __init__(self, place: MovingPlace, here: MovingInstance, size: float, without: str) -> None:
        template = here.scene.template
        names = template.coordinates
        if names != template.velocities:
            raise InputError(f"scene: where bodies of {here.scene.name} may be placed is not known")
        self._place, self.names, self.size, self.bound = place, template.bodies, size, ""
        self.thin = min(size, place.system.size.thin)
        self.rounding = OVERLAP * place.system.size.length
        self.unit = self.units = np.full(len(names), size)
        self.numbers = self.of_numbers = np.arange(len(names), dtype=np.int64)
        self.turning, self.turns = np.zeros(len(names), bool), np.zeros((0, 4), np.int64)
        self.low, self.high = here.travel
        owners = [self.names.index(body_of(name)) for name in names]
        self.objects = np.array([here.roles[self.names[body]] == OBJECT for body in owners], bool)
        self.bodies = [
            [k for k, owner in enumerate(owners) if owner == body] for body in dict.fromkeys(owners)
        ]
        self._owners = np.eye(len(self.names), dtype=bool)[owners]
        self._kept, self.pairs = pairs_without(template, without)

    def look(self, rows: Reals) -> tuple[Reals, Reals]:
        return self._place.geometry(rows)[0][:, self._kept], rows

    def moved(self, marks: Reals) -> Reals:
        return np.asarray(np.sqrt(np.diff(marks, axis=0) ** 2 @ self._owners))


def pairs_without(template: Any, without: str) -> tuple[list[int], Ints]:
    """Numbers of the pairs that may touch, but for those of the body `without`, and their bodies (c, 2)."""
    kept = [k for k, pair in enumerate(template.contacts) if without not in pair]
    pairs = [[template.bodies.index(name) for name in template.contacts[k]] for k in kept]
    return kept, np.array(pairs, np.int64).reshape(-1, 2)

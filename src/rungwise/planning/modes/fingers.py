"""Fingers: robots that a planner may place on objects, with what is known of their drives."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from rungwise.kernel import Ints, Reals
from rungwise.planning.motion.transit import Transit
from rungwise.planning.task.task import Task
from rungwise.world.carriers import Carrier, Surroundings

RESERVE = 0.1
"""Part of its friction that a finger keeps in hand."""
STRONGEST = 0.9
"""Part of the limit of its drives with which a finger presses at most."""


@dataclass(frozen=True)
class Finger:
    """A robot that touches objects: its carrier; its body's number; the columns (k,) of its coordinates;
    numbers of the objects that it may touch; forces with which it presses, at least and at most, of which the
    least is 0 where it is chosen for the object; the part of its friction that it keeps; and the least and
    the greatest places (2, k) to which its inputs lead it."""

    carrier: Carrier
    body: int
    columns: Ints
    objects: frozenset[int]
    press: tuple[float, float]
    reserve: float
    bounds: Reals

    def reaches(self, q: Reals) -> bool:
        """Whether its inputs lead it to a place (n,)."""
        own = q[self.columns]
        return bool((own >= self.bounds[0]).all() and (own <= self.bounds[1]).all())


def fingers_of(task: Task, transit: Transit, around: Surroundings) -> tuple[Finger, ...]:
    """The fingers of a task: the robots that it leads through free space."""
    names, contacts = list(task.scene.template.bodies), task.scene.template.contacts
    found = []
    for carrier in task.carriers:
        columns = np.array(carrier.places, np.int64)
        others = {name for pair in contacts if carrier.body in pair for name in pair} - {carrier.body}
        strongest = float(around.limit[columns].min()) if carrier.by_place else math.inf
        found.append(
            Finger(
                carrier=carrier, body=names.index(carrier.body), columns=columns,
                objects=frozenset(names.index(name) for name in others),
                press=(0.0, STRONGEST * strongest), reserve=RESERVE,
                bounds=np.array(transit.bounds(carrier)),
            )
        )  # fmt: skip
    return tuple(found)

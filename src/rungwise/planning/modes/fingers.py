"""Fingers: robots that a planner may place on objects, with what is known of their drives."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from rungwise.kernel import Ints, Reals
from rungwise.planning.task.fingers import fingers_of as stated
from rungwise.planning.task.task import Task
from rungwise.world.carriers import Carrier

STRONGEST = 0.9
"""Part of the greatest force of a finger with which it presses at most."""


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


def fingers_of(task: Task) -> tuple[Finger, ...]:
    """The fingers of a task that are led by their x and y, in the order of its carriers."""
    names, said = list(task.scene.template.bodies), {each.name: each for each in stated(task)}
    found = []
    for carrier in task.carriers:
        own = said.get(carrier.body)
        if own is None:
            continue
        press = (0.0, math.inf) if own.press is None else (own.press[0], STRONGEST * own.press[1])
        found.append(
            Finger(
                carrier=carrier, body=names.index(carrier.body),
                columns=np.array(carrier.places, np.int64),
                objects=frozenset(names.index(name) for name in own.objects),
                press=press, reserve=own.reserve, bounds=own.within,
            )
        )  # fmt: skip
    return tuple(found)

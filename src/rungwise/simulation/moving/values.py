"""What conditions and schedules of a scene read at its states, and where they find it."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from rungwise.kernel import Ints, Reals
from rungwise.scene.language.expression import LOAD, SLOTS
from rungwise.scene.language.names import OF_CONTACTS
from rungwise.scene.language.poses import NUMBERS
from rungwise.scene.stated import NameTemplate
from rungwise.simulation.moving.prepared import Numbers
from rungwise.simulation.watched.values import Slots
from rungwise.system.contract import hear, tell_values
from rungwise.system.moving import Asked


def slots_of(template: NameTemplate) -> Slots:
    """Where among a scene's values what lies."""
    time = len(template.parameters)
    speeds = time + 1 + len(template.coordinates)
    poses = speeds + len(template.velocities)
    forces = poses + NUMBERS * len(template.posed) + len(template.contacts)
    return Slots(time, speeds, poses, forces, forces + (len(OF_CONTACTS) - 1) * len(template.contacts))


def blank_values(template: NameTemplate, bound: Numbers) -> Reals:
    """Values (w,) of a scene at its parameters before any state is seen: no part of a condition has held."""
    slots, values = slots_of(template), np.zeros(template.value_count)
    values[: len(template.parameters)] = bound.values[:-1]
    values[slots.dates : slots.dates + SLOTS] = np.inf
    values[-1] = bound.tolerance
    return values


def asked_of(template: NameTemplate, codes: Iterable[Ints], step: float) -> Asked:
    """What programs with these codes (k, 2) read of a scene's states."""
    slots, bodies, count = slots_of(template), template.bodies, len(template.contacts)
    gaps, ways = slots.forces - count, template.value_count - 1 - len(bodies)
    code = np.concatenate(list(codes))
    read = np.unique(code[code[:, 0] == LOAD, 1])
    of_pairs = read[(read >= gaps) & (read < slots.dates)]
    place = np.unique((of_pairs - gaps) % max(count, 1))
    pairs = np.array([sorted(map(bodies.index, template.contacts[k])) for k in place]).reshape(-1, 2)
    owners = [
        bodies.index(name.split(".")[0]) if name.split(".")[0] in bodies else -1
        for name in template.velocities
    ]
    return Asked(
        pairs=pairs.astype(np.int64), place=place.astype(np.int64),
        reads=np.array(
            [len(code) > 0, ((read >= slots.poses) & (read < gaps)).any(), (read >= ways).any()], np.int64
        ),
        firsts=np.array([slots.poses, gaps, ways]), contacts=np.array([count]),
        owner=np.array(owners, np.int64), step=np.array([step]),
    )  # fmt: skip


def place_values(
    system: Any, asked: Asked, slots: Slots, time: float, q: Reals, v: Reals, values: Reals
) -> None:
    """Fill in what is read of a state without forces. `system`: as steps see it."""
    values[slots.time], values[slots.time + 1 : slots.speeds] = time, q
    values[slots.speeds : slots.speeds + len(v)] = v
    values[slots.forces + asked.place] = 0.0
    tell_values(system, asked, q, v, values)


def push_values(system: Any, asked: Asked, force: Reals, values: Reals) -> None:
    """Add the forces by slot (s, d) of a step, without their impulses."""
    hear(system, asked, force, 0.0, values)

"""Frames of a run in space: states, and the contacts in them."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from rungwise.contact.step import span
from rungwise.kernel import Ints, Reals, copy, kernel
from rungwise.scene.space import SpaceScene
from rungwise.scene.space.labels import Labels
from rungwise.simulation.core.state import Scratch, State
from rungwise.simulation.live.observation import Contacts
from rungwise.simulation.moving.frames import Row
from rungwise.simulation.moving.memory import memory_parts
from rungwise.simulation.moving.values import slots_of
from rungwise.simulation.spatial.memory import Kept, contacts_in
from rungwise.simulation.stepping.stepper import Stepper
from rungwise.system import contract
from rungwise.system.spatial.mechanism import Mechanism, energy_of, put_at
from rungwise.system.spatial.space import Space
from rungwise.system.terms import DRIVE, JOINT, Terms


class Touch(NamedTuple):
    """Contacts of a frame: point (c, 3), normal (c, 3), force (c, 3) on the second body in the world,
    friction (c,), mode (c,), geoms (c, 2), gap (c,)."""

    point: Reals
    normal: Reals
    force: Reals
    friction: Reals
    mode: Ints
    geoms: Ints
    gap: Reals


class Frame(NamedTuple):
    """A state of the run: time, q, v, memory, contacts, residual, energy, the work of all steps, and
    reactions (4, n_v) of the last step (see `REACTIONS`)."""

    time: float
    q: Reals
    v: Reals
    memory: Reals
    touch: Touch
    residual: float
    energy: float
    work: Reals
    reactions: Reals


REACTIONS = ("drive_force", "limit_force", "joint_force", "dry_friction")
"""What acts on each velocity beside contacts and loads: drives, travel limits, equalities, dry friction in
joints."""


@contract.tell_frame.given_by(Mechanism)
@kernel
def tell_frame(m: Mechanism, s: Any, out: Reals, at: int) -> int:
    """The energy, and reactions (see `REACTIONS`)."""
    n, rows = s.state.v.shape[0], 4
    if at + 1 + rows * n > out.shape[0]:
        return -1
    put_at(m, s.attempt.q)
    out[at] = energy_of(m, s.state.v)
    found = out[at + 1 : at + 1 + rows * n].reshape((rows, n))
    found[:, :] = 0.0
    if s.rung[0].loads:
        put_reactions(s.terms, s.state, s.scratch, s.attempt.note[0].contacts, m.known.shape[0], found)
    return int(at + 1 + rows * n)


def frame_of(row: Row, scene: SpaceScene, space: Space) -> Frame:
    """A frame of how it was recorded."""
    parts, slots, n = memory_parts(scene, row.memory), slots_of(scene.template), space.model.nv
    values = row.memory[parts.values]
    places, speeds = values[slots.time + 1 : slots.speeds], values[slots.speeds :][:n]
    touch = touch_of(contacts_in(row.memory[parts.core], space))
    return Frame(
        float(values[slots.time]), places, speeds, row.memory, touch, row.residual, float(row.rest[0]),
        row.work, row.rest[1:].reshape(len(REACTIONS), n),
    )  # fmt: skip


@kernel
def put_reactions(
    terms: Terms, state: State, scratch: Scratch, contacts: int, first: int, found: Reals
) -> None:
    """Fill found (4, n) with what acts on each velocity; slots of travel limits begin at `first`."""
    d, n = state.force.shape[1], found.shape[1]
    copy(state.reaction, found[0])
    for k in range(contacts):
        force = scratch.contact_force[k * d]
        for side in range(2 if scratch.slots[k] >= first and force != 0.0 else 0):
            low, high, shift = span(terms.entries.rows, k, side, n)
            for i in range(low, high):
                found[1, i] += force * terms.rows[k * d, i - shift]
    for r in range(terms.account.shape[0]):
        row = 2 if terms.account[r] == JOINT else 3
        force = scratch.limited_force[r] if terms.account[r] != DRIVE else 0.0
        if force != 0.0:
            for i in range(n):
                found[row, i] += force * terms.limited[r, i]


def touching(stepper: Stepper, space: Space) -> Touch:
    """Contacts of the last step, where they were at its start."""
    kept, state = space.kept, stepper.state
    slots = np.flatnonzero(kept.geoms[: int(kept.used[0]), 0] >= 0)
    return touch_of(Kept(kept.geoms[slots], kept.world[slots], state.force[slots], state.modes[slots]))


def touch_of(kept: Kept) -> Touch:
    """Contacts in the world."""
    world, force = kept.world, kept.force
    normal, along = world[:, 3:6], world[:, 6:9]
    pushed = force[:, :1] * normal + force[:, 1:2] * along + force[:, 2:3] * np.cross(normal, along)
    return Touch(world[:, :3], normal, pushed, world[:, 10], kept.mode, kept.geoms, world[:, 9])


MODES = ("open", "stick", "slip")


def contacts_of(
    stepper: Stepper, space: Space, labels: Labels, tolerance: float, knows_forces: bool
) -> Contacts:
    """Contacts of the last step that were closed, within the scene's tolerance, or pushed."""
    touch, body = touching(stepper, space), space.solids.body
    pushes = np.einsum("kd,kd->k", touch.force, touch.normal)
    kept = np.flatnonzero((touch.gap <= tolerance) | (pushes > 0.0))
    unknown = 0.0 if knows_forces else np.nan
    bodies = [(labels.bodies[int(body[a])], labels.bodies[int(body[b])]) for a, b in touch.geoms[kept]]
    return Contacts(
        tuple(bodies), touch.point[kept], touch.normal[kept], touch.force[kept] + unknown,
        pushes[kept] + unknown, touch.gap[kept], tuple(MODES[int(mode)] for mode in touch.mode[kept]),
    )  # fmt: skip

"""Frames of a run in space: states, and the contacts in them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rungwise.contact.step import span
from rungwise.kernel import Ints, Reals, copy, kernel
from rungwise.scene.space.labels import Labels
from rungwise.simulation.core.state import Scratch, State
from rungwise.simulation.core.stepper import Stepper
from rungwise.simulation.live.observation import Contacts
from rungwise.simulation.moving.frames import worked
from rungwise.system.spatial.features import Features
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


def frame(stepper: Stepper, space: Space, memory: Reals) -> Frame:
    """The state of a run now."""
    clock = stepper.state.clock[0]
    return Frame(
        stepper.time, stepper.q.copy(), stepper.v.copy(), memory, touching(stepper, space),
        float(clock["residual"]), space.energy(stepper.q, stepper.v),
        worked(clock), reactions(stepper, space),
    )  # fmt: skip


def reactions(stepper: Stepper, space: Space) -> Reals:
    """What acted on each velocity in the last step, as of `REACTIONS`."""
    found = np.zeros((len(REACTIONS), len(stepper.state.v)))
    if stepper.rung.loads:
        put_reactions(stepper.terms, stepper.state, stepper.scratch, stepper.contacts, space.most, found)
    return found


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
    slots = np.empty(int(kept.used[0]), np.int64)
    count = used_features(kept, slots)
    point, normal, pushed = np.empty((3, count, 3))
    friction, gap = np.empty((2, count))
    mode, geoms = np.empty(count, np.int64), np.empty((count, 2), np.int64)
    put_touch(kept, state.force, state.modes, slots, point, normal, pushed, friction, mode, geoms, gap)
    return Touch(point, normal, pushed, friction, mode, geoms, gap)


@kernel
def used_features(kept: Features, slots: Ints) -> int:
    """Fill in which slots have a feature; returns how many."""
    count = 0
    for s in range(kept.used[0]):
        if kept.geoms[s, 0] >= 0:
            slots[count] = s
            count += 1
    return count


@kernel
def put_touch(
    kept: Features, force: Reals, modes: Ints, slots: Ints, point: Reals, normal: Reals, pushed: Reals,
    friction: Reals, mode: Ints, geoms: Ints, gap: Reals,
) -> None:  # fmt: skip
    """Fill in the fields of `Touch` of the features in these slots."""
    for c in range(len(gap)):
        slot = slots[c]
        world, along = kept.world[slot], kept.world[slot, 6:9]
        mode[c], gap[c], friction[c] = modes[slot], world[9], world[10]
        geoms[c, 0], geoms[c, 1] = kept.geoms[slot, 0], kept.geoms[slot, 1]
        for i in range(3):
            point[c, i], normal[c, i] = world[i], world[3 + i]
            j, k = (i + 1) % 3, (i + 2) % 3
            across = world[3 + j] * along[k] - world[3 + k] * along[j]
            pushed[c, i] = force[slot, 0] * world[3 + i] + force[slot, 1] * along[i] + force[slot, 2] * across


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

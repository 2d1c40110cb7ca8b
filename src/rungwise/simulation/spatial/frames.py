"""Frames of a run in space: states, and the contacts in them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rungwise.kernel import Ints, Reals, kernel
from rungwise.scene.space.labels import Labels
from rungwise.simulation.core.stepper import Stepper
from rungwise.simulation.live.observation import Contacts
from rungwise.simulation.moving.frames import worked
from rungwise.system.spatial.space import Space
from rungwise.system.terms import JOINT, SUPPORT


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
    terms, scratch, state = stepper.terms, stepper.scratch, stepper.state
    found = np.zeros((len(REACTIONS), len(state.v)))
    if not stepper.rung.loads:
        return found
    found[0] = state.reaction
    d = space.size.directions
    for k in np.flatnonzero(scratch.slots[: stepper.contacts] >= space.most):
        found[1] += scratch.contact_force[k * d] * terms.rows[k * d]
    for row, account in ((2, JOINT), (3, SUPPORT)):
        own = terms.account == account
        found[row] = scratch.limited_force[own] @ terms.limited[own]
    return found


def touching(stepper: Stepper, space: Space) -> Touch:
    """Contacts of the last step, where they were at its start."""
    kept, state = space.kept, stepper.state
    slots = np.flatnonzero(kept.geoms[:, 0] >= 0)
    world, pushed = kept.world[slots], np.empty((len(slots), 3))
    put_forces(world, state.force, slots, pushed)
    return Touch(
        world[:, :3], world[:, 3:6], pushed, world[:, 10], state.modes[slots], kept.geoms[slots], world[:, 9]
    )


@kernel
def put_forces(world: Reals, force: Reals, slots: Ints, pushed: Reals) -> None:
    """Fill pushed (c, 3): forces in the world of contacts (c, 11), from those along their directions, by
    slot."""
    for c, slot in enumerate(slots):
        normal, along = world[c, 3:6], world[c, 6:9]
        for i in range(3):
            j, k = (i + 1) % 3, (i + 2) % 3
            across = normal[j] * along[k] - normal[k] * along[j]
            pushed[c, i] = force[slot, 0] * normal[i] + force[slot, 1] * along[i] + force[slot, 2] * across


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

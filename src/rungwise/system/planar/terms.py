"""Terms of a planar scene: constants once per run, loads and contacts at each state."""

from __future__ import annotations

import math

from rungwise.kernel import kernel
from rungwise.scene.records import FORCE, FREE, HINGE, SERVO, SLIDE, SPEED
from rungwise.system.planar.jacobian import contact_rows
from rungwise.system.planar.manifold import ABSENT, GAP
from rungwise.system.planar.place import X, Y


@kernel
def constants(coordinates, potentials, factors, terms):  # type: ignore[no-untyped-def]
    """Inertia, metric, stiffness, damping and force-limited rows; returns how many such rows there are."""
    n, count = coordinates.shape[0], 0
    for i in range(n):
        c = coordinates[i]
        terms.inertia[i, i] = c.mass
        terms.metric[i, i] = c.metric
        terms.damping[i, i] = c.damping
        if c.drive == SERVO and c.limited == 0:
            terms.stiffness[i, i] += c.stiffness
            terms.damping[i, i] += c.drive_damping
        elif c.drive == SERVO:
            terms.limited[count, i] = 1.0
            terms.limit[count] = c.limit
            terms.gains[count, 0], terms.gains[count, 1] = c.stiffness, c.drive_damping
            count += 1
        if c.dry_friction > 0.0 and c.drive != SPEED:
            terms.limited[count, i] = 1.0
            terms.limit[count] = c.dry_friction
            count += 1
    for p in range(potentials.shape[0]):
        for i in range(n):
            for j in range(n):
                a, b = factors[p * n + i], factors[p * n + j]
                if a.acts and b.acts:
                    terms.stiffness[i, j] += potentials[p].stiffness * a.factor * b.factor
    return count


@kernel
def target(coordinate, start, time):  # type: ignore[no-untyped-def]
    """Position that a servo wants at `time`."""
    if coordinate.has_target:
        return coordinate.target
    return start + coordinate.target_speed * time


@kernel
def loads(  # type: ignore[no-untyped-def]
    world, bodies, coordinates, potentials, factors, pose, q, start, time, passive, terms
):
    """Load and servo errors at q for a step that ends at `time`; `passive` gets gravity and given body forces."""
    n = q.shape[0]
    for b in range(bodies.shape[0]):
        _weight(world, bodies[b], pose[b], passive)
    count = 0
    for i in range(n):
        c = coordinates[i]
        terms.load[i] = passive[i]
        if c.drive == FORCE:
            terms.load[i] += c.force
        elif c.drive == SERVO and c.limited == 0:
            error = target(c, start[i], time) - q[i]
            terms.load[i] += c.stiffness * error + c.drive_damping * c.target_speed
        elif c.drive == SERVO:
            terms.error[count, 0] = target(c, start[i], time) - q[i]
            terms.error[count, 1] = c.target_speed
            count += 1
        if c.dry_friction > 0.0 and c.drive != SPEED:
            terms.error[count, 0] = terms.error[count, 1] = 0.0
            count += 1
    for p in range(potentials.shape[0]):
        pull = potentials[p].target
        for i in range(n):
            pull -= factors[p * n + i].factor * q[i]
        for i in range(n):
            if factors[p * n + i].acts:
                terms.load[i] += potentials[p].stiffness * pull * factors[p * n + i].factor


@kernel
def _weight(world, body, pose, passive):  # type: ignore[no-untyped-def]
    fx = body.mass * world[0].gravity_x + body.force_x
    fy = body.mass * world[0].gravity_y + body.force_y
    i = body.coordinate
    if body.motion == SLIDE:
        passive[i] = body.axis_x * fx + body.axis_y * fy
    elif body.motion == HINGE:
        passive[i] = (pose[X] - body.pivot_x) * fy - (pose[Y] - body.pivot_y) * fx + body.torque
    elif body.motion == FREE:
        passive[i], passive[i + 1], passive[i + 2] = fx, fy, body.torque


@kernel
def potential_energy(world, bodies, pose):  # type: ignore[no-untyped-def]
    """Energy of the bodies' weight."""
    energy = 0.0
    for b in range(bodies.shape[0]):
        x, y = pose[b, X], pose[b, Y]
        energy -= bodies[b].mass * (world[0].gravity_x * x + world[0].gravity_y * y)
    return energy


@kernel
def gather(  # type: ignore[no-untyped-def]
    bodies,
    coordinates,
    contacts,
    pairs,
    pose,
    points,
    features,
    deformation,
    q,
    prescribed,
    margin,
    terms,
    slots,
):
    """Terms of the contacts nearer than `margin` or still deformed, then of travel limits; returns how many, with
    their `slots`."""
    count = 0
    for p in range(pairs.shape[0]):
        for slot in range(2 * p, 2 * p + 2):
            strained = deformation[slot, 0] != 0.0 or deformation[slot, 1] != 0.0
            if features[slot] != ABSENT and (points[slot, GAP] <= margin or strained):
                contact = contacts[pairs[p].contact]
                a, b = contact.body_a, contact.body_b
                contact_rows(bodies[a], bodies[b], a, b, pose, points[slot], terms.rows, 2 * count)
                terms.gap[count] = points[slot, GAP]
                terms.friction[count] = contact.friction
                terms.restitution[count] = contact.restitution
                terms.contact_stiffness[count, 0, 0] = contact.stiffness
                terms.contact_stiffness[count, 1, 1] = contact.tangential_stiffness
                terms.contact_damping[count, 0, 0] = contact.damping
                terms.contact_damping[count, 1, 1] = contact.tangential_damping
                terms.deformation[2 * count] = deformation[slot, 0]
                terms.deformation[2 * count + 1] = deformation[slot, 1]
                slots[count] = slot
                count += 1
    for i in range(coordinates.shape[0]):
        if not prescribed[i]:
            slot = 2 * pairs.shape[0] + 2 * i
            if math.isfinite(coordinates[i].lower):
                _stop(q[i] - coordinates[i].lower, i, 1.0, count, terms)
                slots[count] = slot
                count += 1
            if math.isfinite(coordinates[i].upper):
                _stop(coordinates[i].upper - q[i], i, -1.0, count, terms)
                slots[count] = slot + 1
                count += 1
    return count


@kernel
def _stop(gap, i, sign, count, terms):  # type: ignore[no-untyped-def]
    """A travel limit: a rigid frictionless contact on one coordinate (infinite stiffness stands for rigid)."""
    terms.rows[2 * count, :] = 0.0
    terms.rows[2 * count + 1, :] = 0.0
    terms.rows[2 * count, i] = sign
    terms.gap[count] = gap
    terms.friction[count] = terms.restitution[count] = 0.0
    for d in range(2):
        terms.contact_stiffness[count, d, d] = math.inf
        terms.contact_damping[count, d, d] = 0.0
        terms.deformation[2 * count + d] = 0.0

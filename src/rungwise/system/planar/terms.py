"""Terms of a planar scene: constants once per run, loads and contacts at each state."""

from __future__ import annotations

import math

from rungwise.contact.step import place_in, stretch
from rungwise.kernel import Ints, Reals, Record, RecordArray, inner_kernel, kernel, rare_kernel
from rungwise.scene.template.records import FORCE, FREE, HINGE, SERVO, SLIDE, SPEED, Records
from rungwise.system.entries import clear_rows, is_crowded, set_spans
from rungwise.system.planar.contact_manifold import ABSENT, GAP, Manifolds
from rungwise.system.planar.jacobian import enter_rows
from rungwise.system.planar.near import near_pairs, pair_at
from rungwise.system.planar.place import X, Y
from rungwise.system.planar.supports import enter_supports, slides_any_way
from rungwise.system.terms import APART, DRIVE, INERTIA, METRIC, SUPPORT, Terms

FULL = -1
"""More contacts than there is room for."""


@kernel
def constants(records: Records, terms: Terms) -> int:
    """Inertia, metric, stiffness, damping and force-limited rows, where matrices have their stretches;
    returns how many such rows there are."""
    coordinates, potentials, factors = records.coordinates, records.potentials, records.terms
    n, count = coordinates.shape[0], 0
    for i in range(n):
        c, own = coordinates[i], i - stretch(terms.entries.matrices, i, n)[0]
        terms.inertia[i, own] = c.mass
        terms.metric[i, own] = c.metric
        terms.heft[i, INERTIA], terms.heft[i, METRIC] = c.mass, c.metric
        terms.damping[i, own] = c.damping
        if c.drive == SERVO and c.limited == 0:
            terms.stiffness[i, own] += c.stiffness
            terms.damping[i, own] += c.drive_damping
        elif c.drive == SERVO:
            terms.limited[count, i] = c.lever
            terms.limit[count] = c.limit / c.lever
            terms.gains[count, 0] = c.stiffness / (c.lever * c.lever)
            terms.gains[count, 1] = c.drive_damping / (c.lever * c.lever)
            terms.account[count], terms.surface[count] = DRIVE, APART
            count += 1
        if c.dry_friction > 0.0 and c.drive != SPEED:
            terms.limited[count, i] = c.lever
            terms.limit[count] = c.dry_friction / c.lever
            terms.account[count] = SUPPORT
            terms.surface[count] = c.body if slides_any_way(records.bodies[c.body], coordinates) else APART
            count += 1
    count = enter_supports(records, count, terms)
    for p in range(potentials.shape[0]):
        for i in range(n):
            low, _ = stretch(terms.entries.matrices, i, n)
            for j in range(n):
                a, b = factors[p * n + i], factors[p * n + j]
                if a.acts and b.acts:
                    terms.stiffness[i, j - low] += potentials[p].stiffness * a.factor * b.factor
    return count


@rare_kernel
def couple(records: Records, stretches: Ints) -> None:
    """Tell where the matrices have entries, unless they are dense: on the diagonal, and where potentials join
    coordinates."""
    n, factors = records.coordinates.shape[0], records.terms
    for i in range(stretches.shape[0]):
        stretches[i, 0], stretches[i, 1] = i, i + 1
    for p in range(records.potentials.shape[0] if stretches.shape[0] > 0 else 0):
        first, end = n, 0
        for i in range(n):
            if factors[p * n + i].acts:
                first, end = min(first, i), i + 1
        for i in range(first, end):
            if factors[p * n + i].acts:
                stretches[i, 0], stretches[i, 1] = min(stretches[i, 0], first), max(stretches[i, 1], end)


@kernel
def target(coordinate: Record, start: float, time: float) -> float:
    """Position that a servo wants at `time`."""
    if coordinate.has_target:
        return coordinate.target
    return start + coordinate.target_speed * time


@kernel
def loads(
    records: Records,
    pose: Reals,
    q: Reals,
    v: Reals,
    start: Reals,
    time: float,
    h: float,
    theta: float,
    passive: Reals,
    terms: Terms,
) -> None:
    """Fill in load and servo errors at q for a step of length h; `passive` gets gravity and given forces.

    Targets are taken at theta of the step. Loads that do not depend linearly on place are explicit, at q + (1
    - theta) h v: the step is symplectic, of first order with theta = 1 and of second with 1/2.
    """
    bodies, coordinates = records.bodies, records.coordinates
    potentials, factors = records.potentials, records.terms
    ahead = (1.0 - theta) * h
    time += theta * h
    n = q.shape[0]
    for b in range(bodies.shape[0]):
        i = bodies[b].coordinate
        turn = ahead * v[i] if bodies[b].motion == HINGE else 0.0
        _weight(records.world, bodies[b], pose[b], turn, passive)
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
            terms.error[count, 0] = c.lever * (target(c, start[i], time) - q[i])
            terms.error[count, 1] = c.lever * c.target_speed
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
    for i in range(n):
        if coordinates[i].mass > 0.0:
            terms.fall[i] = terms.load[i] / coordinates[i].mass


@kernel
def _weight(world: RecordArray, body: Record, pose: Reals, turn: float, passive: Reals) -> None:
    """Add gravity and given forces on the body, which is turned by `turn` about its hinge."""
    fx = body.mass * world[0].gravity_x + body.force_x
    fy = body.mass * world[0].gravity_y + body.force_y
    i = body.coordinate
    if body.motion == SLIDE:
        passive[i] = body.axis_x * fx + body.axis_y * fy
    elif body.motion == HINGE:
        x, y = pose[X] - body.pivot_x, pose[Y] - body.pivot_y
        c, s = math.cos(turn), math.sin(turn)
        passive[i] = (c * x - s * y) * fy - (s * x + c * y) * fx + body.torque
    elif body.motion == FREE:
        passive[i], passive[i + 1], passive[i + 2] = fx, fy, body.torque


@kernel
def potential_energy(records: Records, pose: Reals) -> float:
    """Energy of the bodies' weight."""
    world, bodies, energy = records.world, records.bodies, 0.0
    for b in range(bodies.shape[0]):
        x, y = pose[b, X], pose[b, Y]
        energy -= bodies[b].mass * (world[0].gravity_x * x + world[0].gravity_y * y)
    return energy


@kernel
def gather(
    records: Records,
    pose: Reals,
    manifolds: Manifolds,
    q: Reals,
    prescribed: Ints,
    margin: float,
    terms: Terms,
    slots: Ints,
) -> int:
    """Terms of the contacts nearer than `margin` or still deformed, then of travel limits; returns how many,
    with their `slots`, or FULL where there is no room for so many."""
    pairs, coordinates = records.pairs, records.coordinates
    most = slots.shape[0] - 2 * coordinates.shape[0] - 2 * records.measures.shape[0]
    points, deformation = manifolds.points, manifolds.deformation
    count = 0
    for i in range(near_pairs(manifolds, pairs.shape[0])):
        p = pair_at(manifolds, i)
        for slot in range(2 * p, 2 * p + 2):
            strained = deformation[slot, 0] != 0.0 or deformation[slot, 1] != 0.0
            if manifolds.features[slot] != ABSENT and (points[slot, GAP] <= margin or strained):
                if count == most:
                    return FULL
                contact = records.contacts[pairs[p].contact]
                a, b = contact.body_a, contact.body_b
                enter_rows(a, b, records.bodies, pose, points[slot], terms.rows, count, terms.entries)
                terms.lever[count] = 1.0
                terms.gap[count] = points[slot, GAP]
                terms.friction[count] = contact.friction
                terms.restitution[count] = contact.restitution
                terms.contact_stiffness[count, 0, 0] = contact.stiffness
                terms.contact_stiffness[count, 1, 1] = contact.tangential_stiffness
                terms.contact_damping[count, 0, 0] = contact.damping
                terms.contact_damping[count, 1, 1] = contact.tangential_damping
                coupling = contact.coupling_stiffness
                terms.contact_stiffness[count, 0, 1] = terms.contact_stiffness[count, 1, 0] = coupling
                coupling = contact.coupling_damping
                terms.contact_damping[count, 0, 1] = terms.contact_damping[count, 1, 0] = coupling
                terms.deformation[2 * count] = deformation[slot, 0]
                terms.deformation[2 * count + 1] = deformation[slot, 1]
                slots[count] = slot
                count += 1
    for i in range(coordinates.shape[0]):
        if not prescribed[i]:
            slot, lever = 2 * pairs.shape[0] + 2 * i, coordinates[i].lever
            if math.isfinite(coordinates[i].lower):
                stop(lever * (q[i] - coordinates[i].lower), lever, count, terms)
                _hold_at(i, lever, count, terms)
                slots[count] = slot
                count += 1
            if math.isfinite(coordinates[i].upper):
                stop(lever * (coordinates[i].upper - q[i]), lever, count, terms)
                _hold_at(i, -lever, count, terms)
                slots[count] = slot + 1
                count += 1
    return count


@inner_kernel
def _hold_at(i: int, lever: float, count: int, terms: Terms) -> None:
    """The travel limit that was added has an entry for coordinate i alone."""
    if is_crowded(terms.entries):
        set_spans(terms.entries.rows, count, i, i + 1, i + 1, i + 1)
    clear_rows(terms.entries, count, 2, terms.rows)
    terms.rows[2 * count, place_in(terms.entries.rows, count, i)] = lever


@kernel
def stop(gap: float, lever: float, count: int, terms: Terms) -> None:
    """Add a travel limit: a rigid frictionless contact (infinite stiffness means rigid), its row left to
    fill."""
    terms.lever[count] = lever
    terms.gap[count] = gap
    terms.friction[count] = terms.restitution[count] = 0.0
    for d in range(2):
        terms.contact_stiffness[count, d, d] = math.inf
        terms.contact_damping[count, d, d] = 0.0
        terms.contact_stiffness[count, d, 1 - d] = terms.contact_damping[count, d, 1 - d] = 0.0
        terms.deformation[2 * count + d] = 0.0

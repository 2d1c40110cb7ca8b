"""What laws of contact beside the common ones do in the plane: each is off unless the scene names it.

What pulls is added to the loads, and steps end where a point enters or leaves the range of a pull: a pull
that acts on for the rest of a step would do far more work than the range allows. The laws themselves are in
`scene.fields.laws`; what sticks is in `simulation.core.laws.static_friction`, impacts in
`simulation.core.laws.poisson_impact`.
"""

from __future__ import annotations

from rungwise.contact.step import OPEN
from rungwise.kernel import RecordArray, kernel, rare_kernel
from rungwise.models.assemble import approach
from rungwise.scene.fields.laws.contact import POISSON, PULLS, REBOUNDS, pull, rebound, until_edge
from rungwise.scene.template.records import Records
from rungwise.simulation.core.state import IMPULSIVE, KINETIC, STATIC
from rungwise.simulation.core.tolerances import ACROSS
from rungwise.simulation.planar.state.workspace import Scratch, State, Workspace
from rungwise.system.planar.contact_manifold import ABSENT, GAP, NORMAL_X, NORMAL_Y, POINT_X, POINT_Y
from rungwise.system.planar.near import near_pairs, pair_at
from rungwise.system.planar.place import coordinate_count, lever
from rungwise.system.terms import Terms


@rare_kernel
def tell_laws(records: Records, state: State) -> None:
    """Friction of what sticks and of what slides, and whether impacts have two phases, for the slots of each
    pair."""
    for p in range(records.pairs.shape[0]):
        contact = records.contacts[records.pairs[p].contact]
        for slot in range(2 * p, 2 * p + 2):
            state.laws[STATIC, slot], state.laws[KINETIC, slot] = contact.static_friction, contact.friction
            state.laws[IMPULSIVE, slot] = 1.0 if contact.laws & POISSON else 0.0


@rare_kernel
def soften(records: Records, contacts: int, state: State, terms: Terms, scratch: Scratch) -> None:
    """Let restitution of the contacts be what it is at the speed of their approach."""
    clock = state.clock[0]
    for k in range(contacts):
        slot = scratch.slots[k]
        if slot < 2 * records.pairs.shape[0] and terms.restitution[k] > 0.0:
            contact = records.contacts[records.pairs[slot // 2].contact]
            if contact.laws & REBOUNDS:
                speed = -approach(2 * k, terms, state.v, state.speed, state.free, clock.free, clock.eps)
                terms.restitution[k] = rebound(contact, terms.restitution[k], speed)


@rare_kernel
def add_pulls(records: Records, state: State, terms: Terms) -> None:
    """Add the pull of each point of contact to the loads."""
    points, features, pose = state.manifolds.points, state.manifolds.features, state.placed.pose
    for i in range(near_pairs(state.manifolds, records.pairs.shape[0])):
        p = pair_at(state.manifolds, i)
        contact = records.contacts[records.pairs[p].contact]
        if contact.laws & PULLS == 0:
            continue
        for slot in range(2 * p, 2 * p + 2):
            if features[slot] == ABSENT:
                continue
            # What ends at the edge of the range is within it, whatever rounding leaves.
            pulls = pull(contact, points[slot, GAP] - terms.rounding[0], state.modes[slot] != OPEN)
            for side in range(2 if pulls != 0.0 else 0):
                b = contact.body_a if side == 0 else contact.body_b
                body = records.bodies[b]
                for j in range(coordinate_count(body)):
                    x, y = lever(body, pose[b], j, points[slot, POINT_X], points[slot, POINT_Y])
                    push = (
                        (2.0 * side - 1.0) * pulls * (points[slot, NORMAL_X] * x + points[slot, NORMAL_Y] * y)
                    )
                    terms.load[body.coordinate + j] += push
                    state.passive[body.coordinate + j] += push
    for i in range(terms.fall.shape[0]):
        if records.coordinates[i].mass > 0.0:
            terms.fall[i] = terms.load[i] / records.coordinates[i].mass


@rare_kernel
def until_edges(records: Records, rung: RecordArray, workspace: Workspace, h: float) -> float:
    """The step, but no longer than a point that is pulled takes at its present rate to a place just across
    the edge of a range. Without momentum none has a rate of its own, and neither has one at which rigid
    bodies pushed in the last step, and did not bounce."""
    state, points = workspace.state, workspace.state.manifolds.points
    for i in range(near_pairs(state.manifolds, records.pairs.shape[0]) if rung[0].inertia > 0.0 else 0):
        p = pair_at(state.manifolds, i)
        contact = records.contacts[records.pairs[p].contact]
        for slot in range(2 * p, 2 * p + 2 if contact.laws & PULLS else 2 * p):
            held = state.modes[slot] != OPEN and not rung[0].compliant and state.clock[0].bounced == 0
            if held or state.manifolds.features[slot] == ABSENT:
                continue
            rate = _opening(records, state, p, slot)
            rounding = workspace.terms.rounding[0]
            h = until_edge(contact, points[slot, GAP], rate, ACROSS, rounding, h)
    return h


@kernel
def _opening(records: Records, state: State, p: int, slot: int) -> float:
    """The rate at which a point of contact opens."""
    contact, points, rate = records.contacts[records.pairs[p].contact], state.manifolds.points, 0.0
    for side in range(2):
        b = contact.body_a if side == 0 else contact.body_b
        body = records.bodies[b]
        for j in range(coordinate_count(body)):
            i = body.coordinate + j
            x, y = lever(body, state.placed.pose[b], j, points[slot, POINT_X], points[slot, POINT_Y])
            along = (1.0 - 2.0 * side) * (points[slot, NORMAL_X] * x + points[slot, NORMAL_Y] * y)
            rate += along * (state.speed[i] if state.prescribed[i] else state.v[i])
    return rate

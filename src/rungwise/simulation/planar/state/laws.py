"""Laws of contact beside the common ones, in the plane: each is off unless the scene names it.

Adhesion: each point of contact pulls its bodies together with a constant force while its gap is at most its
range, so that the load that parts them is that force. A contact that pushed in the last step is within it,
whatever gap the bodies' curves have left, and steps end where one enters or leaves its range: a pull that
acts on for the rest of a step would do far more work than the range allows. Source: Derjaguin, Muller and
Toporov, J. Colloid Interface Sci. 53 (1975) 314-326 (the pull beside the elastic force); Maugis, ibid. 150
(1992) 243-269 (Dugdale's constant force within a range).

Restitution that falls with speed: e at approaches up to the speed at which the material yields, and e times
the ratio of the two speeds to the power -1/4 above. Source: Johnson, Contact Mechanics (1985), section 11.5.

Static friction: see `simulation.core.sticking`; Poisson's restitution: see `simulation.core.impacts`.
"""

from __future__ import annotations

from rungwise.contact.step import OPEN
from rungwise.kernel import RecordArray, inner_kernel, kernel, rare_kernel
from rungwise.models.assemble import approach
from rungwise.scene.template.records import ADHERES, FADES, POISSON, Records
from rungwise.simulation.core.state import IMPULSIVE, KINETIC, STATIC
from rungwise.simulation.planar.state.workspace import Scratch, State, Workspace
from rungwise.system.planar.manifold import ABSENT, GAP, NORMAL_X, NORMAL_Y, POINT_X, POINT_Y
from rungwise.system.planar.near import near_pairs, pair_at
from rungwise.system.planar.place import coordinate_count, lever
from rungwise.system.terms import Terms

FALL = -0.25
"""Power of the approach speed with which restitution falls where the contact yields."""
ACROSS = 1e-3
"""How far across the edge of the range of a pull a step ends that crosses it, over the range."""


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
def fade(records: Records, contacts: int, state: State, terms: Terms, scratch: Scratch) -> None:
    """Let restitution of the contacts be what it is at the speed of their approach."""
    clock = state.clock[0]
    for k in range(contacts):
        slot = scratch.slots[k]
        if slot < 2 * records.pairs.shape[0] and terms.restitution[k] > 0.0:
            contact = records.contacts[records.pairs[slot // 2].contact]
            if contact.laws & FADES:
                speed = -approach(2 * k, terms, state.v, state.speed, state.free, clock.free, clock.eps)
                if speed > contact.yield_speed:
                    terms.restitution[k] *= (speed / contact.yield_speed) ** FALL


@rare_kernel
def adhere(records: Records, state: State, terms: Terms) -> None:
    """Add the pull of each point of contact within its range to the loads."""
    points, features, pose = state.manifolds.points, state.manifolds.features, state.placed.pose
    for i in range(near_pairs(state.manifolds, records.pairs.shape[0])):
        p = pair_at(state.manifolds, i)
        contact = records.contacts[records.pairs[p].contact]
        if contact.laws & ADHERES == 0:
            continue
        for slot in range(2 * p, 2 * p + 2):
            if features[slot] != ABSENT and _is_within(contact.adhesion_range, slot, state):
                for side in range(2):
                    b = contact.body_a if side == 0 else contact.body_b
                    body, pull = records.bodies[b], (2.0 * side - 1.0) * contact.adhesion
                    for j in range(coordinate_count(body)):
                        x, y = lever(body, pose[b], j, points[slot, POINT_X], points[slot, POINT_Y])
                        push = pull * (points[slot, NORMAL_X] * x + points[slot, NORMAL_Y] * y)
                        terms.load[body.coordinate + j] += push
                        state.passive[body.coordinate + j] += push
    for i in range(terms.fall.shape[0]):
        if records.coordinates[i].mass > 0.0:
            terms.fall[i] = terms.load[i] / records.coordinates[i].mass


@inner_kernel
def _is_within(reach: float, slot: int, state: State) -> bool:
    """Whether a point of contact pulls."""
    return bool(state.manifolds.points[slot, GAP] <= reach or state.modes[slot] != OPEN)


@rare_kernel
def until_edge(records: Records, rung: RecordArray, workspace: Workspace, h: float) -> float:
    """The step, but no longer than a point that adheres takes at its present rate to a place just across the
    edge of its range. Without momentum none has a rate of its own, and neither has one at which rigid bodies
    pushed in the last step, and did not bounce."""
    state, points = workspace.state, workspace.state.manifolds.points
    for i in range(near_pairs(state.manifolds, records.pairs.shape[0]) if rung[0].inertia > 0.0 else 0):
        p = pair_at(state.manifolds, i)
        contact = records.contacts[records.pairs[p].contact]
        for slot in range(2 * p, 2 * p + 2 if contact.laws & ADHERES else 2 * p):
            held = state.modes[slot] != OPEN and not rung[0].compliant and state.clock[0].bounced == 0
            if held or state.manifolds.features[slot] == ABSENT:
                continue
            rate, beyond = _opening(records, state, p, slot), points[slot, GAP] - contact.adhesion_range
            leaves, enters = rate > 0.0 and beyond <= 0.0, rate < 0.0 and beyond > 0.0
            room = abs(beyond) + max(ACROSS * contact.adhesion_range, workspace.terms.rounding[0])
            if (leaves or enters) and abs(rate) * h > room:
                h = room / abs(rate)
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

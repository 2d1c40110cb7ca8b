"""Laws of contact beside the common ones, in the plane: each is off unless the scene names it.

Adhesion: each point of contact pulls its bodies together with a constant force while its gap is at most its
range, so that the load that parts them is that force. Source: Derjaguin, Muller and Toporov, J. Colloid
Interface Sci. 53 (1975) 314-326 (the pull beside the elastic force); Maugis, ibid. 150 (1992) 243-269
(Dugdale's constant force within a range).

Restitution that falls with speed: e at approaches up to the speed at which the material yields, and e times
the ratio of the two speeds to the power -1/4 above. Source: Johnson, Contact Mechanics (1985), section 11.5.

Static friction: see `simulation.core.sticking`; Poisson's restitution: see `simulation.core.impacts`.
"""

from __future__ import annotations

from rungwise.kernel import rare_kernel
from rungwise.models.assemble import approach
from rungwise.scene.template.records import ADHERES, FADES, POISSON, Records
from rungwise.simulation.core.state import IMPULSIVE, KINETIC, STATIC
from rungwise.simulation.planar.state.workspace import Scratch, State
from rungwise.system.planar.manifold import ABSENT, GAP, NORMAL_X, NORMAL_Y, POINT_X, POINT_Y
from rungwise.system.planar.near import near_pairs, pair_at
from rungwise.system.planar.place import coordinate_count, lever
from rungwise.system.terms import Terms

FALL = -0.25
"""Power of the approach speed with which restitution falls where the contact yields."""


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
            if features[slot] != ABSENT and points[slot, GAP] <= contact.adhesion_range:
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

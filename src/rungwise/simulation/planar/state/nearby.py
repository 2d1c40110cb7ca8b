"""Which contacts are near enough to matter: looking for them, and how far to look."""

from __future__ import annotations

import math

from rungwise.contact.step import diagonal
from rungwise.kernel import Reals, RecordArray, inner_kernel, kernel, rare_kernel
from rungwise.scene.fields.laws.contact import PULLS, REBOUNDS, pulls_within
from rungwise.scene.template.records import FREE, HINGE, Records
from rungwise.simulation.core.tolerances import NEAR, OVERLAP
from rungwise.simulation.planar.state.laws import add_pulls, soften
from rungwise.simulation.planar.state.workspace import State, Workspace
from rungwise.system.planar import joints, supports
from rungwise.system.planar import terms as planar
from rungwise.system.planar.contact_manifold import ABSENT, GAP, LANDED, LIFTED
from rungwise.system.planar.find_contacts import find_contacts
from rungwise.system.planar.place import coordinate_count, turns
from rungwise.system.planar.seams import find_seams
from rungwise.system.terms import Terms

AHEAD = 2.0
"""Steps for which the motion is followed to find the faces that will touch."""


@kernel
def look(records: Records, workspace: Workspace, v: Reals) -> None:
    """Look for contacts within clock.margin at the placed bodies, which move on with `v` (n,)."""
    state, seams, course = workspace.state, workspace.seams, workspace.course
    course.horizon[0] = AHEAD * max(state.clock[0].tried, state.clock[0].next)
    if seams.neighbours.shape[0] > seams.still[0]:
        find_seams(records, state.placed, seams)
    state.clock[0].least_gap = find_contacts(
        records, state.placed, v, state.clock[0].margin, state.manifolds, seams, course
    )


@kernel
def widen(records: Records, workspace: Workspace, margin: float) -> None:
    """Let contacts up to `margin` count: look again when the last look did not reach so far."""
    clock = workspace.state.clock[0]
    margin = max(margin, NEAR * clock.reach)
    clock.near = margin
    if margin > clock.margin:
        clock.margin = 2.0 * margin
        look(records, workspace, workspace.state.v)
    elif margin < clock.margin / 32.0:
        clock.margin = 2.0 * margin
    if clock.lifts and _is_other(records, workspace.state):
        look(records, workspace, workspace.state.v)


@rare_kernel
def _is_other(records: Records, state: State) -> bool:
    """Whether bodies were raised or lowered since the last look."""
    other = False
    for c in range(records.contacts.shape[0]):
        other |= (records.contacts[c].raised > 0.0) != (state.manifolds.lifted[c] == LIFTED)
    return other


@rare_kernel
def lands(records: Records, workspace: Workspace) -> bool:
    """Whether a body that was raised is so no more, and overlaps another by more than steps may: at the
    contact `clock.landed`. It counts as raised until a shorter step asks again."""
    state = workspace.state
    clock = state.clock[0]
    if not _is_other(records, state):
        return False
    look(records, workspace, state.v)
    most = max(OVERLAP * clock.smallest, workspace.terms.rounding[0])
    for c in range(records.contacts.shape[0]):
        if state.manifolds.lifted[c] == LANDED and state.manifolds.gaps[c] < -most:
            clock.landed, state.manifolds.lifted[c] = c, LIFTED
            return True
    return False


@kernel
def gather(records: Records, workspace: Workspace) -> int:
    """Fill the rows that depend on where the bodies are; returns how many contacts there are.

    Where more are near than there is room for, `clock.near` is less afterwards.
    """
    if records.supports.shape[0] > 0:
        supports.turn_supports(records, workspace.state.placed.pose, workspace.terms)
    state, scratch, n = workspace.state, workspace.scratch, workspace.state.q.shape[0]
    contacts = _gather(records, workspace)
    while contacts == planar.FULL and state.clock[0].near > 0.0:
        near = 0.5 * min(state.clock[0].near, _farthest(state))
        state.clock[0].near = near if near > workspace.terms.rounding[0] else 0.0
        contacts = _gather(records, workspace)
    contacts = max(contacts, 0)
    if state.clock[0].laws & REBOUNDS:
        soften(records, contacts, state, workspace.terms, scratch)
    if records.joints.shape[0] == 0:
        return contacts
    return joints.stops(
        records, state.placed.pose, state.q, contacts, 2 * records.pairs.shape[0] + 2 * n, workspace.terms,
        scratch.slots, scratch.row,
    )  # fmt: skip


@rare_kernel
def _farthest(state: State) -> float:
    """The greatest gap of a contact."""
    features, points, farthest = state.manifolds.features, state.manifolds.points, 0.0
    for slot in range(features.shape[0]):
        if features[slot] != ABSENT:
            farthest = max(farthest, points[slot, GAP])
    return float(farthest)


@inner_kernel
def _gather(records: Records, workspace: Workspace) -> int:
    state = workspace.state
    return planar.gather(
        records, state.placed.pose, state.manifolds, state.q, state.prescribed, state.clock[0].near,
        workspace.terms, workspace.scratch.slots,
    )  # fmt: skip


@kernel
def begin_step(records: Records, rung: RecordArray, workspace: Workspace, h: float) -> None:
    """Fill in loads and errors of servos for a step of length h, and measure and fill in the joints."""
    state, scratch = workspace.state, workspace.scratch
    if rung[0].loads:
        planar.loads(
            records, state.placed.pose, state.q, state.v, state.start, state.clock[0].time, h, rung[0].theta,
            state.passive, workspace.terms,
        )  # fmt: skip
        if state.clock[0].laws & PULLS:
            attract(records, workspace)
    if records.joints.shape[0] > 0:
        joints.values(records, state.placed.pose, state.q, scratch.row, scratch.measures)
        join(records, rung, workspace, h)


@rare_kernel
def attract(records: Records, workspace: Workspace) -> None:
    """Add what pulls at contacts to the loads of the placed bodies."""
    state, far = workspace.state, 0.0
    for c in range(records.contacts.shape[0]):
        far = max(far, pulls_within(records.contacts[c]))
    if state.clock[0].margin < far:
        state.clock[0].margin = 2.0 * far
        look(records, workspace, state.v)
    add_pulls(records, state, workspace.terms)


@kernel
def join(records: Records, rung: RecordArray, workspace: Workspace, h: float) -> None:
    """Rows of the joints where the bodies are placed, in a step that began at `scratch.measures`."""
    state, scratch = workspace.state, workspace.scratch
    clock = state.clock[0]
    joints.rows(
        records, state.placed.pose, state.q, scratch.measures, state.start, clock.time + rung[0].theta * h,
        h, rung[0].metric, clock.drives, workspace.terms, scratch.row,
    )  # fmt: skip


@inner_kernel
def swing(records: Records, state: State, i: int) -> float:
    """The factor that makes coordinate i a distance: 1, or the longest lever of an angle."""
    coordinate = records.coordinates[i]
    is_angle = turns(records.bodies[coordinate.body], i)
    return float(max(state.clock[0].reach, coordinate.lever)) if is_angle else 1.0


@kernel
def farthest(records: Records, state: State, change: Reals) -> float:
    """Greatest distance by which a change of coordinates (n,) displaces a body: the distance of its places,
    in any frame, or what it turns by times the longest lever."""
    found = 0.0
    for b in range(records.bodies.shape[0]):
        body = records.bodies[b]
        first = body.coordinate
        if body.motion == FREE:
            found = max(found, math.hypot(change[first], change[first + 1]))
            first += 2
        for i in range(first, body.coordinate + coordinate_count(body)):
            found = max(found, swing(records, state, i) * abs(change[i]))
    return found


@kernel
def fastest_pair(
    records: Records, rung: RecordArray, terms: Terms, state: State, v: Reals, h: float
) -> float:
    """Bound on the relative speed of any two points, with the change by loads during h."""
    fastest = 0.0
    for b in range(records.bodies.shape[0]):
        body = records.bodies[b]
        along, across, spin = 0.0, 0.0, 0.0
        for j in range(coordinate_count(body)):
            i = body.coordinate + j
            rate = abs(state.speed[i]) if state.prescribed[i] else abs(v[i])
            if h > 0.0 and rung[0].inertia > 0.0 and not state.prescribed[i]:
                own = rung[0].inertia * diagonal(terms.inertia, terms.entries.matrices, i)
                rate += h * abs(terms.load[i]) / own
            if turns(body, i):
                spin = rate
            elif j == 0:
                along = rate
            else:
                across = rate
        lever = state.clock[0].reach
        if body.motion == HINGE:
            lever += math.hypot(
                state.placed.pose[b, 0] - body.pivot_x, state.placed.pose[b, 1] - body.pivot_y
            )
        fastest = max(fastest, math.sqrt(along * along + across * across) + spin * lever)
    return 2.0 * fastest

"""Rows in the middle of a step: the mean of those at its start and at a trial end.

Where nothing has inertia and no spring pulls, velocities follow from the place alone, v = f(q), and a step
with the rows at its start is Euler's. With mean rows it is of second order (the trapezoidal rule), and gaps
still are met at the level of places: the gap that goes with a mean row is chosen such that the linear model
is right at the trial end. The first solution is a part of the second: half the distance between their ends is
what two halves of Euler's step would differ by from the whole.

Where contacts yield, forces belong to the middle too, and deformations to the end. They differ by what a
contact yields in half a step, which the first solution tells. A deformation that is not the one that balances
(a contact that has just closed) comes to minus a half of its error in each step, however long. So where loads
or drives jumped, and in a tiny step bodies go where contacts balance them, rows are those of the start.
"""

from __future__ import annotations

import math

from rungwise.contact.step import OPEN, span
from rungwise.kernel import RecordArray, copy, kernel, rare_kernel
from rungwise.scene.template.records import HINGE, Records
from rungwise.simulation.planar.state.nearby import farthest, swing
from rungwise.simulation.planar.state.workspace import State, Workspace
from rungwise.system.entries import is_crowded
from rungwise.system.planar import joints
from rungwise.system.planar.contact_manifold import ABSENT
from rungwise.system.planar.jacobian import contact_rows
from rungwise.system.terms import Terms

STRAIGHT = 1e-6
"""Part of the allowed error that rows may cause which turn in a step of a single solution."""
SAME, BENT, LOST = 0, 1, 2
"""Rows at the trial end: as at the start, otherwise, or of other contacts."""
HELD = 0
"""Feature of a travel limit, which always is the same."""


@kernel
def is_centred(rung: RecordArray, allowed: float, terms: Terms, state: State) -> bool:
    """Whether steps take rows in their middle: under error control, where velocities follow from the place
    alone, all is implicit, and nothing is chosen among several motions."""
    clock = state.clock[0]
    centred = allowed > 0.0 and rung[0].inertia == 0.0 and rung[0].theta == 1.0 and not clock.chooses
    for r in range(clock.limited):
        centred &= not 0.0 < terms.gains[r, 0] < math.inf
    for i in range(state.v.shape[0]):
        for j in range(terms.stiffness.shape[1]):
            centred &= terms.stiffness[i, j] == 0.0
    return centred


@kernel
def note_early(records: Records, contacts: int, workspace: Workspace) -> None:
    """Remember the gaps of a step whose first solution was found and, if it is centred, rows, loads and that
    solution."""
    state, terms, early = workspace.state, workspace.terms, workspace.early
    clock = state.clock[0]
    for slot in range(early.features.shape[0]):
        early.features[slot] = ABSENT
    for k in range(contacts):
        slot = workspace.scratch.slots[k]
        early.features[slot] = _feature(slot, state)
        early.gap[slot] = terms.gap[k]
        early.number[slot] = k
        if clock.centred:
            for i in range(terms.rows.shape[1]):
                early.rows[2 * k, i] = terms.rows[2 * k, i]
                early.rows[2 * k + 1, i] = terms.rows[2 * k + 1, i]
            for i in range(4 if is_crowded(terms.entries) else 0):
                early.spans[k, i] = terms.entries.rows[k, i]
    if not clock.centred:
        return
    for r in range(clock.limited):
        for i in range(state.v.shape[0]):
            early.limited[r, i] = terms.limited[r, i]
    for m in range(records.measures.shape[0]):
        joints.measure(records.measures[m], records, state.placed.pose, state.q, early.measures[m])
    copy(terms.load, early.pull)
    copy(state.passive, early.passive)
    copy(workspace.scratch.v_new, early.v)


@kernel
def _feature(slot: int, state: State) -> int:
    features = state.manifolds.features
    return int(features[slot]) if slot < features.shape[0] else HELD


@kernel
def early_slot(slot: int, workspace: Workspace) -> int:
    """The slot that had this slot's feature at the start, its own or the other of its pair; -1 if none."""
    state, features = workspace.state, workspace.early.features
    if features[slot] == _feature(slot, state):
        return slot
    if slot < state.manifolds.features.shape[0] and features[slot ^ 1] == state.manifolds.features[slot]:
        return slot ^ 1
    return -1


@kernel
def compare_rows(records: Records, h: float, allowed: float, contacts: int, workspace: Workspace) -> int:
    """Whether rows that matter differ at the trial end from those at the start (of contacts that push, of
    joints and supports, and the loads), or a contact that pushes yields further. LOST where a contact that
    pushed is no more: its rows at the end are not known."""
    state = workspace.state
    path = h * farthest(records, state, workspace.early.v)
    if path == 0.0:
        return SAME
    turned = max(STRAIGHT * allowed, workspace.terms.rounding[0]) / path
    found = SAME
    for k in range(contacts):
        first = workspace.scratch.slots[k]
        if workspace.scratch.mode[k] != OPEN and first < state.manifolds.features.shape[0]:
            slot = _slot_now(first, workspace)
            if slot < 0:
                return LOST
            if found == SAME and _turns(first, slot, turned, records, workspace):
                found = BENT
            if found == SAME and _yields(first, slot, turned * path, workspace):
                found = BENT
    if found == SAME and records.joints.shape[0] > 0 and _joints_turn(turned, records, workspace):
        found = BENT
    if found == SAME and records.supports.shape[0] > 0 and _supports_turn(h, turned, records, workspace):
        found = BENT
    return BENT if found == SAME and _weighs_otherwise(h, turned, records, workspace) else found


@kernel
def _slot_now(first: int, workspace: Workspace) -> int:
    """The slot of the contact that began in slot `first`, or -1 if it is no more."""
    features, feature = workspace.state.manifolds.features, workspace.early.features[first]
    if features[first] == feature:
        return first
    return first ^ 1 if features[first ^ 1] == feature else -1


@kernel
def _turns(first: int, slot: int, turned: float, records: Records, workspace: Workspace) -> bool:
    """Whether the rows of the contact that began in slot `first` and is in `slot` now differ."""
    state, early = workspace.state, workspace.early
    row = 2 * early.number[first]
    contact = records.contacts[records.pairs[slot // 2].contact]
    contact_rows(
        contact.body_a, contact.body_b, records.bodies, state.placed.pose, state.manifolds.points[slot],
        early.trial, 0,
    )  # fmt: skip
    for side in range(2):
        low, high, shift = span(early.spans, row // 2, side, state.v.shape[0])
        for d in range(2):
            for i in range(low, high):
                change = abs(early.trial[d, i] - early.rows[row + d, i - shift])
                if change > turned * swing(records, state, i):
                    return True
    return False


@kernel
def _yields(first: int, slot: int, least: float, workspace: Workspace) -> bool:
    """Whether the contact that began in slot `first` and is in `slot` now yielded by more than `least`."""
    now, before = workspace.state.deformation[slot], workspace.before.deformation[first]
    return bool(max(abs(now[0] - before[0]), abs(now[1] - before[1])) > least)


@rare_kernel
def _joints_turn(turned: float, records: Records, workspace: Workspace) -> bool:
    state, early, row = workspace.state, workspace.early, workspace.scratch.row
    for m in range(records.measures.shape[0]):
        joints.measure(records.measures[m], records, state.placed.pose, state.q, row)
        for i in range(state.v.shape[0]):
            if abs(row[i] - early.measures[m, i]) > turned * swing(records, state, i):
                return True
    return False


@kernel
def _supports_turn(h: float, turned: float, records: Records, workspace: Workspace) -> bool:
    """Whether a body turned whose support presses beside its centre."""
    for k in range(records.supports.shape[0]):
        support = records.supports[k]
        if support.row >= 0 and (support.centre_x != 0.0 or support.centre_y != 0.0):
            turn = records.bodies[support.body].coordinate + 2
            beside = math.hypot(support.centre_x, support.centre_y)
            if beside * abs(h * workspace.early.v[turn]) > turned * swing(records, workspace.state, turn):
                return True
    return False


@kernel
def _weighs_otherwise(h: float, turned: float, records: Records, workspace: Workspace) -> bool:
    """Whether a body under load turned about its hinge."""
    early = workspace.early
    for b in range(records.bodies.shape[0]):
        i = records.bodies[b].coordinate
        if records.bodies[b].motion == HINGE and early.passive[i] != 0.0 and abs(h * early.v[i]) > turned:
            return True
    return False


@kernel
def take_means(contacts: int, workspace: Workspace) -> None:
    """Replace rows, loads and deformations at the trial end by those of the middle; a contact that was not
    there keeps its rows."""
    state, terms, early = workspace.state, workspace.terms, workspace.early
    clock = state.clock[0]
    for k in range(contacts):
        first = early_slot(workspace.scratch.slots[k], workspace)
        _yield_half(k, first, workspace)
        if first >= 0:  # of the same bodies, so that rows have entries in the same columns
            for d in range(2):
                other = 2 * early.number[first] + d
                for i in range(terms.rows.shape[1]):
                    terms.rows[2 * k + d, i] = 0.5 * (terms.rows[2 * k + d, i] + early.rows[other, i])
    for r in range(clock.limited):
        for i in range(state.v.shape[0]):
            terms.limited[r, i] = 0.5 * (terms.limited[r, i] + early.limited[r, i])
    for i in range(state.v.shape[0]):
        terms.load[i] = 0.5 * (terms.load[i] + early.pull[i])
        state.passive[i] = 0.5 * (state.passive[i] + early.passive[i])


@kernel
def _yield_half(k: int, first: int, workspace: Workspace) -> None:
    """Let the force of contact k, which began in slot `first`, be that of its deformation in the middle: what
    it yields in half a step, by the first solution, is taken from deformations and added to the gap."""
    terms, early, before = workspace.terms, workspace.early, workspace.before.deformation
    after = workspace.state.deformation[workspace.scratch.slots[k]]
    for d in range(2):
        start = before[first, d] if first >= 0 else 0.0
        early.yielded[2 * k + d] = 0.5 * (after[d] - start) if first >= 0 else 0.0
        terms.deformation[2 * k + d] = start - early.yielded[2 * k + d]
    terms.gap[k] += early.yielded[2 * k]


@kernel
def yield_fully(contacts: int, workspace: Workspace) -> None:
    """Add to the deformations of contacts that push what they yield in the second half of the step."""
    state, scratch = workspace.state, workspace.scratch
    for k in range(contacts):
        if scratch.mode[k] != OPEN:
            for d in range(2):
                state.deformation[scratch.slots[k], d] += workspace.early.yielded[2 * k + d]


@kernel
def bend(records: Records, h: float, workspace: Workspace) -> float:
    """Half the greatest distance between the ends of the step just solved and of its first solution."""
    change = workspace.scratch.row
    for i in range(workspace.early.v.shape[0]):
        change[i] = workspace.scratch.v_new[i] - workspace.early.v[i]
    return 0.5 * h * farthest(records, workspace.state, change)


@rare_kernel
def meets(closed: float, workspace: Workspace) -> bool:
    """Whether something touches in the step just solved that was apart at its start, by more than
    `closed`."""
    scratch, early, kept = workspace.scratch, workspace.early, workspace.kept
    for k in range(workspace.state.clock[0].contacts):
        if scratch.mode[k] != OPEN:
            first = early_slot(scratch.slots[k], workspace)
            if first < 0 or (early.gap[first] > closed and kept.modes[first] == OPEN):
                return True
    return False

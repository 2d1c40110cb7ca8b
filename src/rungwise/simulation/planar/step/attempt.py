"""One attempt at a step of given length: linearise, solve, move, and accept or go back."""

from __future__ import annotations

import math

from rungwise.contact.step import OPEN, has_column, place_in, span
from rungwise.kernel import Reals, RecordArray, copy, inner_kernel, kernel, rare_kernel
from rungwise.models.assemble import approach
from rungwise.scene.template.records import SERVO, Records
from rungwise.simulation.core.step import UNSOLVED, UNSUPPORTED
from rungwise.simulation.core.tolerances import DRIVEN, EXACT, LINEARISATIONS, OVERLAP
from rungwise.simulation.core.update_state import accept_forces, account, end_velocity
from rungwise.simulation.planar.state.memory import bring_back, remember
from rungwise.simulation.planar.state.nearby import begin_step, fastest_pair, gather, look, widen
from rungwise.simulation.planar.state.passing import passes
from rungwise.simulation.planar.state.verdicts import sense
from rungwise.simulation.planar.state.workspace import Scratch, State, Workspace, trial_in
from rungwise.simulation.planar.step.blame import blame
from rungwise.simulation.planar.step.held import displacement, is_held
from rungwise.simulation.planar.step.jumps import jumps
from rungwise.simulation.planar.step.linearise import linearise, restart, take_back
from rungwise.simulation.planar.step.midpoint_rows import (
    BENT,
    LOST,
    SAME,
    bend,
    compare_rows,
    note_early,
    yield_fully,
)
from rungwise.simulation.planar.step.opened_contacts import note_opened
from rungwise.simulation.planar.step.preferred_motion import SUDDEN, choose_motion
from rungwise.system.entries import rate
from rungwise.system.moving import SLIP
from rungwise.system.planar import joints
from rungwise.system.planar.contact_manifold import ABSENT, GAP
from rungwise.system.planar.near import forget_forces
from rungwise.system.planar.place import place
from rungwise.system.terms import Terms

TAKEN, REFUSED, LEFT_UNSUPPORTED, TOO_COARSE, UNDEFINED = 0, 1, 2, 3, 4
ABSORBED, PASSED, COARSE = 3, 4, 6
"""Statuses beside the statuses of `solve_step`."""
ASKED, GREATEST = 0.1, 1e-2
"""Overlap, over the error allowed in a step, up to which one that is centred is not linearised again; under
error control none is beyond this overlap over the smallest shape's reach."""
TORN = 1e-3
"""Opening of a rigid joint, over its lever, beyond which a step that adds to it is halved."""
ROUNDED = 1e-14
"""Rounding of the work of a contact, relative to its impulse times the speeds there."""
UNSEEN = 1e-3
"""Overlap without deformation where compliant bodies with momentum meet, over the error allowed in a step."""


@kernel
def attempt(records: Records, rung: RecordArray, workspace: Workspace, h: float, shortest: float) -> int:
    """Try a step of length h: on TAKEN the state has advanced, otherwise it is as before.

    A step longer than `shortest` is TOO_COARSE in which an impact begins at a contact that should bounce, a
    preferred motion begins, or compliant bodies sink into each other unseen.
    """
    state, terms, scratch = workspace.state, workspace.terms, workspace.scratch
    clock = state.clock[0]
    begin_step(records, rung, workspace, h)
    copy(terms.load, workspace.early.load)
    open_before = _opening(records, workspace)
    remember(state, workspace.before)
    gap_before = clock.least_gap
    widen(records, workspace, 4.0 * h * fastest_pair(records, rung, terms, state, state.v, h))
    contacts = gather(records, workspace)
    status, least, jumped, first, closed = UNSOLVED, -math.inf, False, True, True
    clock.tried, clock.bend, clock.lost = h, 0.0, 0
    for _ in range(LINEARISATIONS):
        clock.contacts = contacts
        status = choose_motion(records, rung, h, contacts, shortest, workspace)
        if status in (UNSOLVED, SUDDEN):
            break
        reach = 2.0 * h * fastest_pair(records, rung, terms, state, scratch.v_new, 0.0)
        if reach > clock.near:
            bring_back(records, workspace, workspace.before)
            widen(records, workspace, 2.0 * reach)
            contacts = gather(records, workspace)
            if not first:
                restart(records, rung, workspace, h)
                least, first = -math.inf, True
            continue
        if status == UNSUPPORTED:
            status = UNSUPPORTED if first else UNSOLVED
            break
        if first and _leaves_momentum_out(rung) and not is_held(records, rung, h, shortest, workspace):
            status = COARSE if h > shortest else UNSUPPORTED
            break
        if rung[0].metric and _follows_far(records, h, contacts, workspace):
            status = UNSOLVED
            break
        if first and clock.bounces and h > shortest and _absorbs(terms, contacts, h, state, scratch):
            status = ABSORBED
            break
        if first:
            jumped = jumps(records, rung, h, contacts, workspace)
        forget_forces(state.manifolds, state.force)
        accept_forces(trial_in(rung, h, contacts, workspace))
        if not first and clock.centred and not clock.lost and rung[0].compliant:
            yield_fully(contacts, workspace)
        if first and math.isfinite(terms.low[0]):
            note_early(records, contacts, workspace)
        _move(records, workspace, h)
        if not _is_finite(state.q):
            status = UNSOLVED
            break
        clock.bend = 0.0 if first or not clock.centred or clock.lost else bend(records, h, workspace)
        if clock.bend > terms.low[0]:
            status = COARSE
            break
        if rung[0].compliant and h > shortest and (_sinks(rung, workspace) or _outruns(contacts, workspace)):
            status = COARSE
            break
        overlap = tolerated(rung, workspace)
        closed = _opening(records, workspace) <= max(_open(rung, workspace), open_before)
        fits = closed and (
            rung[0].compliant or clock.least_gap >= min(gap_before - terms.rounding[0], -overlap)
        )
        rows = SAME
        if first and clock.centred:
            settles = clock.leaping > 0.0 or clock.leapt > 0.0
            rows = LOST if settles else compare_rows(records, h, terms.low[0], contacts, workspace)
            clock.lost = rows == LOST
        bent = rows == BENT
        if fits and not bent:
            if 0.5 * reach > SLIP * clock.thin and passes(records, workspace):
                status = PASSED
                break
            if jumped:
                clock.jump_time = clock.jump_time if clock.jumps > 0 else clock.time
                clock.jumps += 1
            _finish(records, rung, h, contacts, workspace)
            return TAKEN
        if not fits and not rung[0].metric:
            worse = (not closed and not bent) or clock.least_gap < 0.5 * least or clock.bounced
            moved, driven = displacement(records, h, workspace)
            thrown = not worse and rung[0].inertia > 0.0 and moved > DRIVEN * driven
            if thrown and first and not rung[0].compliant and take_back(h, contacts, workspace):
                least, first = clock.least_gap, False
                continue
            if worse or thrown:
                status = UNSOLVED
                break
        least, first = min(clock.least_gap, 0.0) if fits else clock.least_gap, False
        contacts = linearise(records, rung, workspace, h)
    if status != UNSUPPORTED:
        blame(status in (ABSORBED, SUDDEN, PASSED, COARSE), not closed, contacts, workspace)
    bring_back(records, workspace, workspace.before)
    clock.least_gap = gap_before
    if status in (ABSORBED, SUDDEN, PASSED, COARSE):
        return TOO_COARSE
    return LEFT_UNSUPPORTED if status == UNSUPPORTED else REFUSED


@inner_kernel
def _leaves_momentum_out(rung: RecordArray) -> bool:
    """Whether forces balance without inertia."""
    return bool(rung[0].inertia == 0.0 and rung[0].loads)


@kernel
def _sinks(rung: RecordArray, workspace: Workspace) -> bool:
    """Whether compliant bodies overlap at the trial end by more than contacts are deformed and the error that
    is allowed: the step led past where they met. Where bodies have momentum, overlap that no deformation
    explains turns into speed: where they meet only a small part of that error is allowed."""
    state, allowed, rounding = workspace.state, workspace.terms.low[0], workspace.terms.rounding[0]
    meeting = UNSEEN * allowed if rung[0].inertia > 0.0 else allowed
    if math.isinf(allowed) or state.clock[0].least_gap >= -max(meeting, rounding):
        return False
    features, points = state.manifolds.features, state.manifolds.points
    for slot in range(features.shape[0]):
        if features[slot] != ABSENT:
            met = workspace.before.deformation[slot, 0] != 0.0
            yielded = max(state.deformation[slot, 0], 0.0)
            if -points[slot, GAP] > yielded + max(allowed if met else meeting, rounding):
                return True
    return False


@kernel
def _outruns(contacts: int, workspace: Workspace) -> bool:
    """Whether a compliant contact that pushes went round a corner, and is deformed by more than bodies
    overlap there and the error that is allowed: the step led straight on past the end of a face."""
    state, slots, allowed = workspace.state, workspace.scratch.slots, workspace.terms.low[0]
    features, before = state.manifolds.features, workspace.before.features
    for k in range(contacts):
        slot = slots[k]
        if workspace.scratch.mode[k] != OPEN and slot < features.shape[0]:
            goes = before[slot] != features[slot] and before[slot] != features[slot ^ 1]
            yielded = state.deformation[slot, 0]
            if goes and yielded > 0.0 and state.manifolds.points[slot, GAP] + yielded > allowed:
                return True
    return False


@kernel
def tolerated(rung: RecordArray, workspace: Workspace) -> float:
    """Overlap beyond which a rigid step that adds to it is linearised again, or halved: under error control
    it is related to the allowed error."""
    clock, error = workspace.state.clock[0], workspace.terms.low[0]
    if math.isinf(error):
        return float((EXACT if rung[0].metric else OVERLAP) * clock.smallest)
    least = EXACT if rung[0].metric else OVERLAP
    part = ASKED if clock.centred else 1.0
    return float(min(max(part * error, least * clock.smallest), GREATEST * clock.smallest))


@kernel
def _open(rung: RecordArray, workspace: Workspace) -> float:
    """Opening of joints, over their levers, beyond which a step that adds to it is linearised again, or
    halved."""
    clock, least = workspace.state.clock[0], EXACT if rung[0].metric else TORN
    if clock.centred:
        least = min(max(ASKED * workspace.terms.low[0] / clock.reach, least), TORN)
    return float(least)


@kernel
def _is_finite(q: Reals) -> bool:
    finite = True
    for i in range(q.shape[0]):
        finite &= math.isfinite(q[i])
    return finite


@kernel
def _follows_far(records: Records, h: float, contacts: int, workspace: Workspace) -> bool:
    """Whether a servo that is followed exactly moves something farther than the smallest shape in the step,
    and with it what it pushes or holds: where its target jumps, no step is short enough."""
    state, far = workspace.state, False
    for i in range(state.q.shape[0]):
        c = records.coordinates[i]
        if c.drive == SERVO and h * c.lever * abs(state.speed[i]) > state.clock[0].smallest:
            far |= _takes_along(i, contacts, workspace)
    return far


@rare_kernel
def _takes_along(i: int, contacts: int, workspace: Workspace) -> bool:
    """Whether coordinate i takes part in a contact that pushes, or in a joint."""
    clock, terms, takes = workspace.state.clock[0], workspace.terms, False
    for k in range(contacts):
        if workspace.scratch.contact_force[2 * k] > 0.0 and has_column(terms.entries.rows, k, i):
            takes |= terms.rows[2 * k, place_in(terms.entries.rows, k, i)] != 0.0
    for r in range(clock.drives, clock.limited):
        takes |= terms.limited[r, i] != 0.0
    return takes


@kernel
def _opening(records: Records, workspace: Workspace) -> float:
    """How far rigid joints are open where the bodies are placed; 0 without joints."""
    if records.joints.shape[0] == 0:
        return 0.0
    state = workspace.state
    return joints.opening(records, state.placed.pose, state.q, workspace.scratch.row)


@rare_kernel
def _absorbs(terms: Terms, contacts: int, h: float, state: State, scratch: Scratch) -> bool:
    """Whether a contact with restitution, open at the start, closes at speed during the step: it would not
    bounce."""
    clock = state.clock[0]
    for k in range(contacts):
        if (
            terms.restitution[k] > 0.0
            and terms.gap[k] > terms.rounding[0]
            and scratch.contact_force[2 * k] > 0.0
        ):
            moved = rate(terms.entries, terms.rows, 2 * k, 2, scratch.v_new)
            met = abs(terms.gap[k] + h * moved) <= 1e-6 * terms.gap[k]
            if met and approach(2 * k, terms, state.v, state.speed, state.free, clock.free, clock.eps) < 0.0:
                return True
    return False


@kernel
def _move(records: Records, workspace: Workspace, h: float) -> None:
    """Place the bodies at q + h v and look for contacts there."""
    state, scratch = workspace.state, workspace.scratch
    for i in range(state.q.shape[0]):
        state.q[i] = workspace.before.q[i] + h * scratch.v_new[i]
        if state.prescribed[i]:
            c = records.coordinates[i]
            state.q[i] = min(max(state.q[i], c.lower), c.upper)
    place(records, state.q, state.placed, False)
    look(records, workspace, scratch.v_new)


@rare_kernel
def _rounding_of_work(h: float, terms: Terms, contacts: int, state: State, scratch: Scratch) -> float:
    """Contact work in a step that is no more than rounding, or the residual, of the work exchanged."""
    exchanged = 0.0
    for r in range(2 * contacts):
        before, after = 0.0, 0.0
        for side in range(2):
            first, end, shift = span(terms.entries.rows, r // 2, side, state.v.shape[0])
            for i in range(first, end):
                before += abs(terms.rows[r, i - shift] * state.v[i])
                after += abs(terms.rows[r, i - shift] * scratch.v_new[i])
        exchanged += h * abs(scratch.contact_force[r]) * max(before, after)
    tolerated: float = max(ROUNDED, state.clock[0].residual)
    return tolerated * exchanged


@kernel
def _finish(records: Records, rung: RecordArray, h: float, contacts: int, workspace: Workspace) -> None:
    """Set velocities, work and the contact forces that conditions read."""
    state, terms, scratch = workspace.state, workspace.terms, workspace.scratch
    note_opened(records, h, contacts, workspace)
    state.clock[0].leapt = state.clock[0].leaping
    work = state.clock[0].contact_work
    account(trial_in(rung, h, contacts, workspace))
    work = state.clock[0].contact_work - work
    if state.clock[0].bounced and work > _rounding_of_work(h, terms, contacts, state, scratch):
        state.clock[0].gained += work
    for i in range(state.v.shape[0]):
        state.v[i] = end_velocity(state.clock[0].theta, state.v[i], scratch.v_new[i], state.prescribed[i])
    sense(records, rung, h, state)
    for k in range(contacts):
        slot = scratch.slots[k]
        for i in range(state.impulse.shape[1]):
            state.impulse[slot, i] += h * state.force[slot, i]

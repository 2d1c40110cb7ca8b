"""The compiled planar loop: steps, halving, events and verdicts, until the run ends or its turn is over."""

from __future__ import annotations

import math

from rungwise.kernel import copy, kernel
from rungwise.outcome import Code
from rungwise.scene.bind import evaluate_numbers
from rungwise.scene.expression import evaluate
from rungwise.scene.records import FORCE, HINGE, SERVO, SPEED
from rungwise.simulation.frames import record
from rungwise.simulation.step import SUPPORTED, UNSOLVED, UNSUPPORTED, accept_forces, account, solve_step
from rungwise.system.planar import terms as planar
from rungwise.system.planar.gap import find_contacts
from rungwise.system.planar.place import coordinate_count, place, start

RUNNING, GOAL, UNSAFE, DOOMED = int(Code.RUNNING), int(Code.GOAL), int(Code.UNSAFE), int(Code.DOOMED)
JAMMED, NO_SUPPORT, MISSED, TIMEOUT = (
    int(Code.JAMMED),
    int(Code.UNSUPPORTED),
    int(Code.MISSED),
    int(Code.TIMEOUT),
)
MODEL_INVALID, INVALID, NOT_CONVERGED = int(Code.MODEL_INVALID), int(Code.INVALID), int(Code.NOT_CONVERGED)

TAKEN, REFUSED, LEFT_UNSUPPORTED, TOO_COARSE = 0, 1, 2, 3
ABSORBED = 3
"""Beside the statuses of `solve_step`."""
MAX_HALVINGS = 60
MAX_LINEARISATIONS = 12
ROUNDING = 1e-12
"""Rounding of positions, relative to the extent of the scene."""
NEAR = 1e-4
"""Gaps below this fraction of the longest lever always count as contacts."""
ONSET = 0.05
"""First step of a compliant impact under error control, relative to the time sqrt(M / K) of the contact."""
SHORT_OF = 1.0 - 1e-9
"""A step that is to end at a contact ends a little short of it: the impact belongs to the next step."""
SOON = 0.01
"""Part of a fixed step within which an impact counts as being at its beginning; a later one ends the step."""
SINKING = 0.1
"""Deformation, as a fraction of the smallest shape's reach, beyond which the compliant model no longer holds."""
DRIFT = 1e-2
"""New overlap, as a fraction of the same reach, that a rigid step may leave before it is halved."""


@kernel
def begin(records, rung, control, workspace):  # type: ignore[no-untyped-def]
    """State at t = 0; returns RUNNING, a verdict that holds at once, or INVALID when bodies overlap."""
    state, terms = workspace.state, workspace.terms
    clock = state.clock[0]
    start(records.bodies, records.coordinates, state.q, state.v)
    copy(state.q, state.start)
    n = state.q.shape[0]
    clock.free = 0
    for i in range(n):
        drive = records.coordinates[i].drive
        state.prescribed[i] = drive == SPEED or (rung[0].metric and drive == SERVO)
        if not state.prescribed[i]:
            state.free[clock.free] = i
            clock.free += 1
        elif drive == SPEED:
            state.v[i] = records.coordinates[i].drive_speed
    clock.limited = 0
    if rung[0].loads:
        clock.limited = planar.constants(records.coordinates, records.potentials, records.terms, terms)
    else:
        for i in range(n):
            terms.metric[i, i] = records.coordinates[i].metric
    for c in range(records.contacts.shape[0]):
        newton = not rung[0].compliant and rung[0].inertia > 0.0
        clock.bounces |= newton and records.contacts[c].restitution > 0.0
    clock.size = math.inf
    for s in range(records.shapes.shape[0]):
        reach = records.shapes[s].reach
        if reach > 0.0 and math.isfinite(reach):
            clock.size = min(clock.size, reach)
            clock.reach = max(clock.reach, reach)
    place(records.bodies, records.shapes, records.vertices, state.q, state.pose, state.outline, True)
    extent = clock.reach
    for b in range(records.bodies.shape[0]):
        extent = max(extent, abs(state.pose[b, 0]), abs(state.pose[b, 1]))
    terms.rounding[0] = ROUNDING * extent
    clock.margin = control[0].tolerance
    _look(records, workspace)
    clock.next = control[0].step
    if clock.least_gap < -1e-9 * clock.reach:
        return INVALID
    return RUNNING


@kernel
def _look(records, workspace):  # type: ignore[no-untyped-def]
    """Contacts at the placed bodies, within clock.margin."""
    state = workspace.state
    state.clock[0].least_gap = find_contacts(
        records.bodies, records.shapes, records.contacts, records.pairs, state.pose, state.outline,
        state.clock[0].margin, state.points, state.features, state.deformation, state.modes, state.gaps,
        workspace.scratch.fresh,
    )  # fmt: skip


@kernel
def advance(records, timed, conditions, buffer, rung, control, workspace, turns):  # type: ignore[no-untyped-def]
    """Take at most `turns` steps; returns the outcome, RUNNING if the run has not ended.

    `timed` and `conditions` are (code, constants, table[, targets]) of the scene's programs.
    """
    state = workspace.state
    clock = state.clock[0]
    if clock.steps == 0 and clock.frames == 0:
        clock.outcome = _judge(conditions, state, workspace.scratch)
        record(records, rung, workspace, True)
    for _ in range(turns):
        if clock.outcome != RUNNING:
            break
        clock.outcome = _step(records, timed, conditions, buffer, rung, control, workspace)
        record(records, rung, workspace, clock.outcome != RUNNING)
    return clock.outcome


@kernel
def _step(records, timed, conditions, buffer, rung, control, workspace):  # type: ignore[no-untyped-def]
    """One accepted step, halved as long as it has no solution."""
    state = workspace.state
    clock = state.clock[0]
    h = min(clock.next, control[0].longest, control[0].duration - clock.time)
    for _ in range(MAX_HALVINGS):
        h, moving = _drive(records, timed, buffer, rung, workspace, h)
        status, h, following = _take(records, timed, buffer, rung, control, workspace, h)
        if status == TAKEN:
            clock.steps += 1
            clock.taken = h
            clock.next = following
            if rung[0].compliant and _has_sunk(state):
                return MODEL_INVALID
            verdict = _judge(conditions, state, workspace.scratch)
            if verdict != RUNNING:
                return verdict
            return _spent(records, rung, control, workspace, moving, timed)
        if status == LEFT_UNSUPPORTED:
            return NO_SUPPORT
        if status == REFUSED and h * moving < 0.25 * control[0].tolerance and moving > 0.0:
            return JAMMED
        h = following if status == TOO_COARSE else 0.5 * h
    return NOT_CONVERGED


@kernel
def _take(records, timed, buffer, rung, control, workspace, h):  # type: ignore[no-untyped-def]
    """Advance by h, or under error control by two halves of at most h that agree with the whole.

    Returns the status, the step taken or refused, and the one to try next.
    """
    state = workspace.state
    clock = state.clock[0]
    allowed = control[0].error
    parts, following = 1, 2.0 * h
    if allowed > 0.0:
        parts, following = 3, max(h, clock.next)
        h, begins = _until_contact(records, rung, workspace, h, 1e-3 * allowed, 0.0)
        following = h if begins else following
        _keep(workspace)
    elif clock.bounces:
        h, _ = _until_contact(records, rung, workspace, h, 0.0, SOON)
    for part in range(parts):
        length = h if part == 0 else 0.5 * h
        if part > 0 or allowed > 0.0 or clock.bounces:
            length, _ = _drive(records, timed, buffer, rung, workspace, length)
        status = _attempt(records, rung, workspace, length, SOON * control[0].step)
        clock.attempts += 1
        if status != TAKEN:
            if part > 0:
                _restore(records, workspace)
            return status, h, 0.5 * h
        if parts > 1 and part == 0:
            copy(state.q, workspace.whole.q)
            copy(state.v, workspace.whole.v)
            _restore(records, workspace)
        else:
            clock.time += length
            clock.worst_residual = max(clock.worst_residual, clock.residual)
    if allowed == 0.0:
        return TAKEN, h, following
    error = _disagreement(records, rung, control, workspace)
    factor = min(max(0.9 * math.sqrt(allowed / max(error, 1e-300)), 0.1), 4.0)
    if error > allowed and h > 1e-12 * control[0].duration:
        _restore(records, workspace)
        return TOO_COARSE, h, min(factor, 0.5) * h
    return TAKEN, h, max(following, factor * h) if factor > 1.0 else factor * h


@kernel
def _disagreement(records, rung, control, workspace):  # type: ignore[no-untyped-def]
    """Greatest distance between where two half steps and one whole step put any coordinate, now and, where
    velocities are continuous (compliant contact), a longest step later."""
    state, whole, worst = workspace.state, workspace.whole, 0.0
    later = control[0].longest if rung[0].compliant and rung[0].inertia > 0.0 else 0.0
    for b in range(records.bodies.shape[0]):
        body = records.bodies[b]
        for j in range(coordinate_count(body)):
            i = body.coordinate + j
            turns = body.motion == HINGE or j == 2
            lever = state.clock[0].reach if turns and state.clock[0].reach > 0.0 else 1.0
            worst = max(worst, lever * abs(state.q[i] - whole.q[i]))
            worst = max(worst, lever * later * abs(state.v[i] - whole.v[i]))
    return worst


@kernel
def _until_contact(records, rung, workspace, h, closed, soon):  # type: ignore[no-untyped-def]
    """The step, no longer than the time in which the first open gap (beyond `closed`, and beyond what closes within
    the fraction `soon` of the step) closes at its present rate.

    A compliant impact begins with a small part of its own period: a step that spans it all looks plastic, and so do
    two halves. Returns the step, and whether such an impact begins.
    """
    state, terms = workspace.state, workspace.terms
    sprung, begins = rung[0].compliant and rung[0].inertia > 0.0, False
    _widen(records, workspace, 4.0 * h * _fastest(records, rung, terms, state, state.v, 0.0))
    for k in range(_gather(records, workspace)):
        rate, ease = 0.0, 0.0
        for i in range(state.v.shape[0]):
            row = terms.rows[2 * k, i]
            rate += row * (state.speed[i] if state.prescribed[i] else state.v[i])
            if sprung and not state.prescribed[i]:
                ease += row * row * terms.contact_stiffness[k, 0, 0] / (rung[0].inertia * terms.inertia[i, i])
        if terms.gap[k] > closed:
            if rate * h < -terms.gap[k] < soon * rate * h:
                h = SHORT_OF * terms.gap[k] / -rate
        elif ease > 0.0 and rate < 0.0 and terms.deformation[2 * k] == 0.0:
            h, begins = min(h, ONSET / math.sqrt(ease)), True
    return h, begins


@kernel
def _keep(workspace):  # type: ignore[no-untyped-def]
    """Keep all that `_restore` brings back."""
    state, kept = workspace.state, workspace.kept
    _remember(state, kept)
    kept.clock[0] = state.clock[0]
    copy(state.v, kept.v)
    copy(state.force, kept.force)
    copy(state.impulse, kept.impulse)
    copy(workspace.scratch.limited_mode, kept.limited_mode)


@kernel
def _restore(records, workspace):  # type: ignore[no-untyped-def]
    """Back to the kept state, but for the count of attempts."""
    state, kept = workspace.state, workspace.kept
    attempts = state.clock[0].attempts
    state.clock[0] = kept.clock[0]
    state.clock[0].attempts = attempts
    copy(kept.v, state.v)
    copy(kept.force, state.force)
    copy(kept.impulse, state.impulse)
    copy(kept.limited_mode, workspace.scratch.limited_mode)
    _return(records, workspace, kept)
    state.clock[0].least_gap = kept.clock[0].least_gap


@kernel
def _drive(records, timed, buffer, rung, workspace, h):  # type: ignore[no-untyped-def]
    """Speeds of prescribed coordinates for a step of at most h; returns the step that ends at the first travel
    limit, and the greatest prescribed speed."""
    state = workspace.state
    clock = state.clock[0]
    n = state.q.shape[0]
    if timed[3].shape[0] > 0:
        state.values[_time_slot(state)] = clock.time + h
        evaluate_numbers(
            timed[0], timed[1], timed[2], timed[3], state.values, workspace.scratch.stack, buffer
        )
    moving = 0.0
    shortest = h
    for i in range(n):
        state.speed[i] = 0.0
        if not state.prescribed[i]:
            continue
        c = records.coordinates[i]
        speed = c.drive_speed
        if c.drive == SERVO:
            speed = (planar.target(c, state.start[i], clock.time + h) - state.q[i]) / h
        stop = c.upper if speed > 0.0 else c.lower
        room = abs(stop - state.q[i])
        if math.isfinite(stop) and room <= 1e-12 * (abs(stop) + abs(speed) * h):
            continue
        state.speed[i] = speed
        moving = max(moving, abs(speed))
        if abs(speed) * shortest > room:
            shortest = room / abs(speed)
    return shortest, moving


@kernel
def _attempt(records, rung, workspace, h, shortest):  # type: ignore[no-untyped-def]
    """Try a step of length h: on TAKEN the state has advanced, otherwise it is as before.

    A step longer than `shortest` in which an impact begins at a contact that should bounce is TOO_COARSE.
    """
    state, terms, scratch = workspace.state, workspace.terms, workspace.scratch
    clock = state.clock[0]
    if rung[0].loads:
        planar.loads(
            records.world, records.bodies, records.coordinates, records.potentials, records.terms, state.pose,
            state.q, state.start, clock.time + h, state.passive, terms,
        )  # fmt: skip
    _remember(state, workspace.before)
    gap_before = clock.least_gap
    _widen(records, workspace, 4.0 * h * _fastest(records, rung, terms, state, state.v, h))
    contacts = _gather(records, workspace)
    status = UNSOLVED
    clock.tried = h
    for _ in range(MAX_LINEARISATIONS):
        clock.contacts = contacts
        status = solve_step(rung, h, terms, contacts, state, scratch, workspace.problem)
        if status == UNSOLVED:
            break
        reach = 2.0 * h * _fastest(records, rung, terms, state, scratch.v_new, 0.0)
        if reach > clock.near:
            _return(records, workspace, workspace.before)
            _widen(records, workspace, 2.0 * reach)
            contacts = _gather(records, workspace)
            continue
        if status == UNSUPPORTED:
            break
        if clock.bounces and h > shortest and _absorbs(terms, contacts, h, scratch):
            status = ABSORBED
            break
        accept_forces(rung, h, terms, contacts, state, scratch, workspace.problem)
        _move(records, rung, workspace, h)
        allowed = min(gap_before, 0.0) - (1e-9 if rung[0].metric else DRIFT) * clock.size
        if rung[0].compliant or clock.least_gap >= allowed:
            _finish(records, rung, h, contacts, workspace)
            return TAKEN
        if not rung[0].metric:
            status = UNSOLVED
            break
        contacts = _gather(records, workspace)
        _shift(h, contacts, terms, scratch)
    _return(records, workspace, workspace.before)
    clock.least_gap = gap_before
    if status == ABSORBED:
        return TOO_COARSE
    return LEFT_UNSUPPORTED if status == UNSUPPORTED else REFUSED


@kernel
def _absorbs(terms, contacts, h, scratch):  # type: ignore[no-untyped-def]
    """Whether a contact with restitution, open at the start of the step, is met in its course: it would not bounce."""
    for k in range(contacts):
        if terms.restitution[k] > 0.0 and scratch.contact_force[2 * k] > 0.0:
            rate = 0.0
            for i in range(scratch.v_new.shape[0]):
                rate += terms.rows[2 * k, i] * scratch.v_new[i]
            if terms.gap[k] > 0.0 and abs(terms.gap[k] + h * rate) <= 1e-6 * terms.gap[k]:
                return True
    return False


@kernel
def _remember(state, saved):  # type: ignore[no-untyped-def]
    for i in range(state.q.shape[0]):
        saved.q[i] = state.q[i]
    for slot in range(state.features.shape[0]):
        saved.features[slot] = state.features[slot]
        saved.modes[slot] = state.modes[slot]
        for i in range(state.deformation.shape[1]):
            saved.deformation[slot, i] = state.deformation[slot, i]


@kernel
def _return(records, workspace, saved):  # type: ignore[no-untyped-def]
    """Back to the saved coordinates, contacts and deformations."""
    state = workspace.state
    for i in range(state.q.shape[0]):
        state.q[i] = saved.q[i]
    place(records.bodies, records.shapes, records.vertices, state.q, state.pose, state.outline, False)
    _look(records, workspace)
    for slot in range(state.features.shape[0]):
        state.features[slot] = saved.features[slot]
        state.modes[slot] = saved.modes[slot]
        for i in range(state.deformation.shape[1]):
            state.deformation[slot, i] = saved.deformation[slot, i]


@kernel
def _widen(records, workspace, margin):  # type: ignore[no-untyped-def]
    """Contacts up to `margin` matter now: look again when the last look did not reach so far."""
    clock = workspace.state.clock[0]
    margin = max(margin, NEAR * clock.reach)
    clock.near = margin
    if margin > clock.margin:
        clock.margin = 2.0 * margin
        _look(records, workspace)
    elif margin < clock.margin / 32.0:
        clock.margin = 2.0 * margin


@kernel
def _gather(records, workspace):  # type: ignore[no-untyped-def]
    state, scratch = workspace.state, workspace.scratch
    return planar.gather(
        records.bodies, records.coordinates, records.contacts, records.pairs, state.pose, state.points,
        state.features, state.deformation, state.q, state.prescribed, state.clock[0].near, workspace.terms,
        scratch.slots,
    )  # fmt: skip


@kernel
def _fastest(records, rung, terms, state, v, h):  # type: ignore[no-untyped-def]
    """Bound on the relative speed of any two points, with what loads add during h."""
    fastest = 0.0
    for b in range(records.bodies.shape[0]):
        body = records.bodies[b]
        speed = 0.0
        for j in range(coordinate_count(body)):
            i = body.coordinate + j
            rate = abs(state.speed[i]) if state.prescribed[i] else abs(v[i])
            if h > 0.0 and rung[0].inertia > 0.0 and not state.prescribed[i]:
                rate += h * abs(terms.load[i]) / (rung[0].inertia * terms.inertia[i, i])
            turns = body.motion == HINGE or j == 2
            if turns:
                rate *= state.clock[0].reach + (
                    math.hypot(state.pose[b, 0] - body.pivot_x, state.pose[b, 1] - body.pivot_y)
                    if body.motion == HINGE
                    else 0.0
                )
            speed += rate
        fastest = max(fastest, speed)
    return 2.0 * fastest


@kernel
def _shift(h, contacts, terms, scratch):  # type: ignore[no-untyped-def]
    """Linearise about the trial state: gap less what the trial velocity contributed."""
    for k in range(contacts):
        for j in range(scratch.v_new.shape[0]):
            terms.gap[k] -= h * terms.rows[2 * k, j] * scratch.v_new[j]


@kernel
def _move(records, rung, workspace, h):  # type: ignore[no-untyped-def]
    """Place the bodies at q + h v and look for contacts there."""
    state, scratch = workspace.state, workspace.scratch
    for i in range(state.q.shape[0]):
        state.q[i] = workspace.before.q[i] + h * scratch.v_new[i]
        if state.prescribed[i]:
            c = records.coordinates[i]
            state.q[i] = min(max(state.q[i], c.lower), c.upper)
    place(records.bodies, records.shapes, records.vertices, state.q, state.pose, state.outline, False)
    _look(records, workspace)


@kernel
def _finish(records, rung, h, contacts, workspace):  # type: ignore[no-untyped-def]
    """Velocities, work and the contact forces that conditions read."""
    state, terms, scratch = workspace.state, workspace.terms, workspace.scratch
    account(rung, h, terms, contacts, state, scratch, state.v)
    theta = rung[0].theta
    for i in range(state.v.shape[0]):
        if state.prescribed[i]:
            state.v[i] = state.speed[i]
        else:
            state.v[i] = (scratch.v_new[i] - (1.0 - theta) * state.v[i]) / theta
    for c in range(state.pushes.shape[0]):
        state.pushes[c] = 0.0
    for p in range(records.pairs.shape[0]):
        state.pushes[records.pairs[p].contact] += state.force[2 * p, 0] + state.force[2 * p + 1, 0]


@kernel
def _time_slot(state):  # type: ignore[no-untyped-def]
    """Where expressions read t: values are parameters, t, q, v, gaps, forces, tolerance."""
    return state.values.shape[0] - 2 - 2 * (state.q.shape[0] + state.gaps.shape[0])


@kernel
def _judge(conditions, state, scratch):  # type: ignore[no-untyped-def]
    """Verdict of the scene's conditions: unsafe before goal before doomed; those not stated have no program."""
    code, constants, table = conditions
    state.values[_time_slot(state)] = state.clock[0].time
    for index, verdict in ((1, UNSAFE), (0, GOAL), (2, DOOMED)):
        first, last = table[index, 0], table[index, 1]
        if last > first and evaluate(code, constants, first, last, state.values, scratch.stack) >= 0.0:
            return verdict
    return RUNNING


@kernel
def _has_sunk(state):  # type: ignore[no-untyped-def]
    """Whether some deformation is too large for the shapes that carry it."""
    for slot in range(state.features.shape[0]):
        if abs(state.deformation[slot, 0]) > SINKING * state.clock[0].size:
            return True
    return False


@kernel
def _spent(records, rung, control, workspace, moving, timed):  # type: ignore[no-untyped-def]
    """Verdict of a state that no condition decides: out of time, or at rest with all inputs spent."""
    state = workspace.state
    clock = state.clock[0]
    driven, others = clock.free < state.q.shape[0], timed[3].shape[0] + records.potentials.shape[0]
    over = clock.time >= control[0].duration * (1.0 - 1e-12)
    if over:
        return MISSED if driven and moving == 0.0 else TIMEOUT
    if not driven or moving > 0.0 or others > 0:
        return RUNNING
    for i in range(state.q.shape[0]):
        drive = records.coordinates[i].drive
        if abs(state.v[i]) * control[0].duration > 1e-6 * control[0].tolerance:
            return RUNNING
        if not state.prescribed[i] and (drive == SERVO or drive == FORCE):
            return RUNNING
    return MISSED

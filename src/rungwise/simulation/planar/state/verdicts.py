"""Verdicts on a state: of the conditions, and of limits that end a run without them."""

from __future__ import annotations

import math

from rungwise.contact.step import TOLERANCE
from rungwise.kernel import RecordArray, copy, inner_kernel, kernel, rare_kernel
from rungwise.outcome import Code
from rungwise.scene.language.expression import TIMES, evaluate, holds
from rungwise.scene.template.records import FORCE, SERVO, Records
from rungwise.simulation.core.tolerances import SINKING
from rungwise.simulation.planar.state.held_since import (
    STATED,
    has_turned,
    interpolate,
    is_possible,
    lasts,
    note_times,
    times_end,
)
from rungwise.simulation.planar.state.inputs import (
    OWN,
    Inputs,
    note_until,
    until_end,
    until_lasts,
    until_margin,
    until_row,
)
from rungwise.simulation.planar.state.nearby import swing
from rungwise.simulation.planar.state.passing import thickness
from rungwise.simulation.planar.state.workspace import Conditions, Scratch, State, Workspace, time_slot
from rungwise.system.planar import joints
from rungwise.system.planar.near import hears_all, listen, near_pairs, pair_at

RUNNING, GOAL, UNSAFE, DOOMED = int(Code.RUNNING), int(Code.GOAL), int(Code.UNSAFE), int(Code.DOOMED)
JAMMED, NO_SUPPORT, MISSED, TIMEOUT = (
    int(Code.JAMMED),
    int(Code.UNSUPPORTED),
    int(Code.MISSED),
    int(Code.TIMEOUT),
)
MODEL_INVALID, INVALID, NOT_CONVERGED = int(Code.MODEL_INVALID), int(Code.INVALID), int(Code.NOT_CONVERGED)
SIGHTS = 10
"""How often conditions are looked at in a step of the greatest length."""
LASTING = 0.5
"""Part of the force found in a step: while conditions read less than this, steps are nominal until it is
known whether the force lasts."""


@inner_kernel
def judge(conditions: Conditions, state: State, scratch: Scratch) -> int:
    """Verdict of the scene's conditions: unsafe before goal before doomed; a condition not stated has no
    program."""
    state.values[time_slot(state)] = state.clock[0].time
    return _verdict(conditions, state, scratch)


@kernel
def _verdict(conditions: Conditions, state: State, scratch: Scratch) -> int:
    code, constants, table = conditions
    for index, verdict in ((1, UNSAFE), (0, GOAL), (2, DOOMED)):
        first, last = table[index, 0], table[index, 1]
        if last > first and holds(code, constants, first, last, state.values, scratch.stack):
            return verdict
    return RUNNING


@kernel
def margins(conditions: Conditions, state: State, scratch: Scratch) -> tuple[float, float]:
    """Signed margins, in the state last judged, of the goal, and of the unsafe or the doomed condition,
    whichever is nearer: a condition holds from 0 on; -inf where none is stated."""
    code, constants, table = conditions
    goal, danger = -math.inf, -math.inf
    for index in range(3):
        first, last = table[index, 0], table[index, 1]
        if last > first:
            found = evaluate(code, constants, first, last, state.values, scratch.stack)
            if index == 0:
                goal = found
            elif found > danger:
                danger = found
    return goal, danger


@kernel
def look_back(
    verdict: int,
    conditions: Conditions,
    inputs: Inputs,
    control: RecordArray,
    h: float,
    workspace: Workspace,
) -> float:
    """Part of the step just taken, of length h, up to which no condition holds, neither one of the scene nor
    the one that ends the present segment, and no part turns that must hold for a time; 1 if there is none.

    `verdict` is that of its end; `scratch.begun` holds the values that conditions read at its start. Between
    start and end places and gaps are linear in time, looked at `SIGHTS` times in a step of the greatest
    length, and the first condition is dated to a quarter of the nominal step.
    """
    state, scratch = workspace.state, workspace.scratch
    copy(state.values, scratch.ended)
    count = max(1, math.ceil(SIGHTS * h / control[0].longest - 1e-9))
    before, after = 0.0, 1.0
    found = verdict != RUNNING or until_margin(inputs, workspace) >= 0.0
    lasting = lasts(conditions) or until_lasts(inputs)
    found |= lasting and _turns(conditions, inputs, state, scratch)
    for k in range(1, count):
        interpolate(k / count, h, state, scratch)
        if _is_met(conditions, inputs, lasting, workspace):
            after, found = k / count, True
            break
        before = k / count
    while found and (after - before) * h > 0.25 * control[0].step:
        middle = 0.5 * (before + after)
        if not before < middle < after:
            break
        interpolate(middle, h, state, scratch)
        if _is_met(conditions, inputs, lasting, workspace):
            after = middle
        else:
            before = middle
    copy(scratch.ended, state.values)
    return before if found else 1.0


@kernel
def _is_met(conditions: Conditions, inputs: Inputs, lasting: bool, workspace: Workspace) -> bool:
    """Whether a condition holds or, where some are `lasting`, a part turned that must hold for a time."""
    state, scratch = workspace.state, workspace.scratch
    met = _verdict(conditions, state, scratch) != RUNNING or until_margin(inputs, workspace) >= 0.0
    return met or (lasting and _turns(conditions, inputs, state, scratch))


@rare_kernel
def _turns(conditions: Conditions, inputs: Inputs, state: State, scratch: Scratch) -> bool:
    """Whether some part that must hold for a time turned on the way of the step."""
    code, constants, table = conditions
    if lasts(conditions) and has_turned(code, constants, table, STATED, 0, OWN, state, scratch):
        return True
    return until_lasts(inputs) and has_turned(
        inputs.code, inputs.constants, inputs.table, until_row(inputs, state), OWN, TIMES, state, scratch
    )


@kernel
def first_times(conditions: Conditions, inputs: Inputs, workspace: Workspace) -> bool:
    """Note at the beginning of a run what holds; returns whether times to hold for are possible."""
    state, scratch, now = workspace.state, workspace.scratch, workspace.state.clock[0].time
    code, constants, table = conditions
    state.values[time_slot(state)] = now
    if lasts(conditions):
        if not is_possible(code, constants, table, STATED, OWN, state, scratch):
            return False
        note_times(code, constants, table, STATED, 0, OWN, 0.0, state, scratch)
        times_end(code, constants, table, STATED, 0, OWN, now, state, scratch)
    if until_lasts(inputs):
        s = inputs.durations.shape[0]
        if not is_possible(inputs.code, inputs.constants, inputs.table, s, TIMES * s, state, scratch):
            return False
        note_until(inputs, 0.0, workspace)
        until_end(inputs, now, workspace)
    return True


@kernel
def note_all(conditions: Conditions, inputs: Inputs, h: float, workspace: Workspace) -> None:
    """Note, after a step of length h, since when parts hold that must hold for a time."""
    state, scratch = workspace.state, workspace.scratch
    if lasts(conditions):
        note_times(conditions[0], conditions[1], conditions[2], STATED, 0, OWN, h, state, scratch)
    if until_lasts(inputs):
        note_until(inputs, h, workspace)


@kernel
def next_end(conditions: Conditions, inputs: Inputs, reached: float, workspace: Workspace) -> float:
    """When the first part will have held long enough, inf if none waits; those that have by the time
    `reached` do from now on."""
    state, scratch = workspace.state, workspace.scratch
    soonest = math.inf
    if lasts(conditions):
        soonest = times_end(
            conditions[0], conditions[1], conditions[2], STATED, 0, OWN, reached, state, scratch
        )
    if until_lasts(inputs):
        soonest = min(soonest, until_end(inputs, reached, workspace))
    return soonest


@inner_kernel
def sense(records: Records, rung: RecordArray, h: float, state: State) -> None:
    """Set normal forces and impulses that conditions read, after an attempt of length h that was taken.

    Where contact is rigid and bodies have momentum, velocities jump, and a step finds impulse / h. A jump
    takes one step, or two where the first step ends at the contact. So the least force of the last three
    steps is the force, which tends to the force of the motion between impacts. The impulse is the integral
    over time from the start. The kinematic rung knows neither.
    """
    if not listen(state.manifolds):
        _sense_near(records, rung, h, state)
        return
    for c in range(state.pushes.shape[0]):
        state.pushes[c] = 0.0
    if rung[0].metric:
        return
    for i in range(near_pairs(state.manifolds, records.pairs.shape[0])):
        _push(pair_at(state.manifolds, i), records, state)
    jumps = rung[0].inertia > 0.0 and not rung[0].compliant
    for c in range(state.pushes.shape[0]):
        _hear(c, h, jumps, state)


@rare_kernel
def _sense_near(records: Records, rung: RecordArray, h: float, state: State) -> None:
    """The same for contacts with listed pairs, where those of all others are zero."""
    pairs, manifolds = records.pairs, state.manifolds
    for i in range(manifolds.listed[0]):
        state.pushes[pairs[manifolds.near[i]].contact] = 0.0
    if rung[0].metric:
        return
    for i in range(manifolds.listed[0]):
        _push(manifolds.near[i], records, state)
    jumps, last = rung[0].inertia > 0.0 and not rung[0].compliant, -1
    for i in range(manifolds.listed[0]):
        c = pairs[manifolds.near[i]].contact
        if c != last:
            _hear(c, h, jumps, state)
        last = c


@inner_kernel
def _push(p: int, records: Records, state: State) -> None:
    """Add the forces of a pair to those of its contact."""
    state.pushes[records.pairs[p].contact] += state.force[2 * p, 0] + state.force[2 * p + 1, 0]


@inner_kernel
def _hear(c: int, h: float, jumps: bool, state: State) -> None:
    push = state.pushes[c]
    state.impulses[c] += h * push
    if jumps:
        state.pushes[c] = min(push, state.recent[0, c], state.recent[1, c])
        state.recent[1, c], state.recent[0, c] = state.recent[0, c], push


@inner_kernel
def withholds(records: Records, state: State) -> bool:
    """Whether a force that conditions read is still less than in the last step, until that force lasts."""
    holds, manifolds = False, state.manifolds
    if hears_all(manifolds):
        for c in range(state.pushes.shape[0]):
            holds |= _is_withheld(c, records, state)
    else:
        for i in range(near_pairs(manifolds, records.pairs.shape[0])):
            holds |= _is_withheld(records.pairs[pair_at(manifolds, i)].contact, records, state)
    return holds


@inner_kernel
def _is_withheld(c: int, records: Records, state: State) -> bool:
    # Forces first: records lie far apart, of many contacts.
    return bool(state.pushes[c] < LASTING * state.recent[0, c]) and bool(records.contacts[c].weighed)


@inner_kernel
def has_sunk(records: Records, state: State) -> bool:
    """Whether some deformation is too large for the shapes that carry it."""
    for i in range(near_pairs(state.manifolds, records.pairs.shape[0])):
        p = pair_at(state.manifolds, i)
        deepest = max(abs(state.deformation[2 * p, 0]), abs(state.deformation[2 * p + 1, 0]))
        if deepest > 0.0:
            a, b = records.shapes[records.pairs[p].shape_a], records.shapes[records.pairs[p].shape_b]
            if deepest > SINKING * min(state.clock[0].smallest, 0.5 * thickness(a, b)):
                return True
    return False


@rare_kernel
def crushed(rung: RecordArray, workspace: Workspace) -> int:
    """The contact, among those of a last step without momentum, that yields most under forces that balance
    the loads, if it yields too far for its model, so that no step is short enough for what it moves; else
    -1."""
    terms, scratch, clock = workspace.terms, workspace.scratch, workspace.state.clock[0]
    deepest, most = -1, SINKING * clock.smallest
    if not rung[0].compliant or rung[0].inertia > 0.0 or clock.residual > TOLERANCE:
        return deepest
    for k in range(clock.contacts):
        yields = scratch.contact_force[2 * k] / terms.contact_stiffness[k, 0, 0]
        if yields > most and scratch.slots[k] < workspace.state.manifolds.features.shape[0]:
            deepest, most = k, yields
    return deepest


@inner_kernel
def spent(
    records: Records,
    control: RecordArray,
    workspace: Workspace,
    moving: float,
    inputs: Inputs,
    waits: bool,
) -> int:
    """Verdict of a state that no condition decides: out of time, at rest with all inputs spent, unless some
    part of a condition `waits` to have held long enough, or at the end of the schedule with which the run
    ends."""
    state = workspace.state
    clock = state.clock[0]
    left = inputs.durations.shape[0] - clock.segment
    if control[0].ends and left == 0:
        return MISSED
    driven, others = clock.free < state.q.shape[0], clock.varies + left + records.potentials.shape[0]
    others += joints.any_driven(records) + inputs.timed[1] + waits
    over = clock.time >= control[0].duration * (1.0 - 1e-12)
    if over:
        return MISSED if driven and moving == 0.0 else TIMEOUT
    if not driven or moving > 0.0 or others > 0:
        return RUNNING
    for i in range(state.q.shape[0]):
        drive = records.coordinates[i].drive
        speed = swing(records, state, i) * abs(state.v[i])
        if speed * control[0].duration > 1e-6 * control[0].tolerance:
            return RUNNING
        if not state.prescribed[i] and drive in (SERVO, FORCE):
            return RUNNING
    return MISSED

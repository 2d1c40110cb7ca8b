"""Verdicts on a state: of the conditions, and of limits that end a run without them."""

from __future__ import annotations

import math

from rungwise.kernel import RecordArray, copy, inner_kernel, kernel
from rungwise.outcome import Code
from rungwise.scene.language.expression import evaluate, holds
from rungwise.scene.template.records import FORCE, SERVO, Records
from rungwise.simulation.core.tolerances import SINKING
from rungwise.simulation.planar.state.inputs import Inputs, until_margin
from rungwise.simulation.planar.state.nearby import swing
from rungwise.simulation.planar.state.passing import thickness
from rungwise.simulation.planar.state.workspace import Conditions, Scratch, State, Workspace, time_slot
from rungwise.system.planar import joints

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
    the one that ends the present segment; 1 if none holds at all.

    `verdict` is that of its end; `scratch.begun` holds the values that conditions read at its start. Between
    start and end places and gaps are linear in time, looked at `SIGHTS` times in a step of the greatest
    length, and the first condition is dated to a quarter of the nominal step.
    """
    state, scratch = workspace.state, workspace.scratch
    copy(state.values, scratch.ended)
    count = max(1, math.ceil(SIGHTS * h / control[0].longest - 1e-9))
    before, after = 0.0, 1.0
    found = verdict != RUNNING or until_margin(inputs, workspace) >= 0.0
    for k in range(1, count):
        _interpolate(k / count, h, state, scratch)
        if _is_met(conditions, inputs, workspace):
            after, found = k / count, True
            break
        before = k / count
    while found and (after - before) * h > 0.25 * control[0].step:
        middle = 0.5 * (before + after)
        if not before < middle < after:
            break
        _interpolate(middle, h, state, scratch)
        if _is_met(conditions, inputs, workspace):
            after = middle
        else:
            before = middle
    copy(scratch.ended, state.values)
    return before if found else 1.0


@kernel
def _is_met(conditions: Conditions, inputs: Inputs, workspace: Workspace) -> bool:
    met = _verdict(conditions, workspace.state, workspace.scratch) != RUNNING
    return met or until_margin(inputs, workspace) >= 0.0


@kernel
def _interpolate(part: float, h: float, state: State, scratch: Scratch) -> None:
    """Places, gaps and time at a part of the last step; speeds and forces are those of its end."""
    n, contacts, at = state.q.shape[0], state.manifolds.gaps.shape[0], time_slot(state)
    state.values[at] = state.clock[0].time - (1.0 - part) * h
    for i in range(at + 1, at + 1 + n):
        state.values[i] = part * scratch.ended[i] + (1.0 - part) * scratch.begun[i]
    for i in range(at + 1 + 2 * n, at + 1 + 2 * n + contacts):
        far = math.isinf(scratch.ended[i]) or math.isinf(scratch.begun[i])
        state.values[i] = (
            scratch.ended[i] if far else part * scratch.ended[i] + (1.0 - part) * scratch.begun[i]
        )


@inner_kernel
def sense(records: Records, rung: RecordArray, h: float, state: State) -> None:
    """Set normal forces and impulses that conditions read, after an attempt of length h that was taken.

    Where contact is rigid and bodies have momentum, velocities jump, and a step finds impulse / h. A jump
    takes one step, or two where the first step ends at the contact. So the least force of the last three
    steps is the force, which tends to the force of the motion between impacts. The impulse is the integral
    over time from the start. The kinematic rung knows neither.
    """
    for c in range(state.pushes.shape[0]):
        state.pushes[c] = 0.0
    if rung[0].metric:
        return
    for p in range(records.pairs.shape[0]):
        state.pushes[records.pairs[p].contact] += state.force[2 * p, 0] + state.force[2 * p + 1, 0]
    jumps = rung[0].inertia > 0.0 and not rung[0].compliant
    for c in range(state.pushes.shape[0]):
        push = state.pushes[c]
        state.impulses[c] += h * push
        if jumps:
            state.pushes[c] = min(push, state.recent[0, c], state.recent[1, c])
            state.recent[1, c], state.recent[0, c] = state.recent[0, c], push


@inner_kernel
def withholds(records: Records, state: State) -> bool:
    """Whether a force that conditions read is still less than in the last step, until that force lasts."""
    holds = False
    for c in range(state.pushes.shape[0]):
        holds |= records.contacts[c].weighed and state.pushes[c] < LASTING * state.recent[0, c]
    return holds


@inner_kernel
def has_sunk(records: Records, state: State) -> bool:
    """Whether some deformation is too large for the shapes that carry it."""
    for p in range(records.pairs.shape[0]):
        deepest = max(abs(state.deformation[2 * p, 0]), abs(state.deformation[2 * p + 1, 0]))
        if deepest > 0.0:
            a, b = records.shapes[records.pairs[p].shape_a], records.shapes[records.pairs[p].shape_b]
            if deepest > SINKING * min(state.clock[0].smallest, 0.5 * thickness(a, b)):
                return True
    return False


@inner_kernel
def spent(
    records: Records,
    control: RecordArray,
    workspace: Workspace,
    moving: float,
    inputs: Inputs,
) -> int:
    """Verdict of a state that no condition decides: out of time, at rest with all inputs spent, or at the end
    of the schedule with which the run ends."""
    state = workspace.state
    clock = state.clock[0]
    left = inputs.durations.shape[0] - clock.segment
    if control[0].ends and left == 0:
        return MISSED
    driven, others = clock.free < state.q.shape[0], clock.varies + left + records.potentials.shape[0]
    others += joints.any_driven(records) + inputs.timed[1]
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

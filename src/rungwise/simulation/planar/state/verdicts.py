"""Forces that conditions read, and limits that end a run without conditions."""

from __future__ import annotations

from rungwise.contact.step import TOLERANCE
from rungwise.kernel import RecordArray, inner_kernel, rare_kernel
from rungwise.outcome import Code
from rungwise.scene.template.records import FORCE, SERVO, Records
from rungwise.simulation.core.tolerances import SINKING
from rungwise.simulation.planar.state.nearby import swing
from rungwise.simulation.planar.state.passing import thickness
from rungwise.simulation.planar.state.workspace import State, Workspace
from rungwise.simulation.watched.inputs import Inputs
from rungwise.simulation.watched.verdicts import RUNNING
from rungwise.system.planar import joints
from rungwise.system.planar.near import hears_all, listen, near_pairs, pair_at

JAMMED, NO_SUPPORT, MISSED, TIMEOUT = (
    int(Code.JAMMED),
    int(Code.UNSUPPORTED),
    int(Code.MISSED),
    int(Code.TIMEOUT),
)
MODEL_INVALID, INVALID, NOT_CONVERGED = int(Code.MODEL_INVALID), int(Code.INVALID), int(Code.NOT_CONVERGED)
LASTING = 0.5
"""Part of the force found in a step: while conditions read less than this, steps are nominal until it is
known whether the force lasts."""


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

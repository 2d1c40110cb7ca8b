"""Verdicts on a state: what the conditions say, and what ends a run that they do not decide."""

from __future__ import annotations

from rungwise.kernel import RecordArray, kernel
from rungwise.outcome import Code
from rungwise.scene.expression import evaluate
from rungwise.scene.records import FORCE, SERVO, Records
from rungwise.simulation.state import Conditions, Scratch, State, Timed, Workspace
from rungwise.system.planar import joints

RUNNING, GOAL, UNSAFE, DOOMED = int(Code.RUNNING), int(Code.GOAL), int(Code.UNSAFE), int(Code.DOOMED)
JAMMED, NO_SUPPORT, MISSED, TIMEOUT = (
    int(Code.JAMMED),
    int(Code.UNSUPPORTED),
    int(Code.MISSED),
    int(Code.TIMEOUT),
)
MODEL_INVALID, INVALID, NOT_CONVERGED = int(Code.MODEL_INVALID), int(Code.INVALID), int(Code.NOT_CONVERGED)
SINKING = 0.1
"""Deformation, as a fraction of the smallest shape's reach, beyond which the compliant model fails."""


@kernel
def judge(conditions: Conditions, state: State, scratch: Scratch) -> int:
    """Verdict of the scene's conditions: unsafe before goal before doomed; one not stated has no program."""
    code, constants, table = conditions
    state.values[time_slot(state)] = state.clock[0].time
    for index, verdict in ((1, UNSAFE), (0, GOAL), (2, DOOMED)):
        first, last = table[index, 0], table[index, 1]
        if last > first and evaluate(code, constants, first, last, state.values, scratch.stack) >= 0.0:
            return verdict
    return RUNNING


@kernel
def has_sunk(state: State) -> bool:
    """Whether some deformation is too large for the shapes that carry it."""
    for slot in range(state.features.shape[0]):
        if abs(state.deformation[slot, 0]) > SINKING * state.clock[0].size:
            return True
    return False


@kernel
def spent(
    records: Records,
    control: RecordArray,
    workspace: Workspace,
    moving: float,
    timed: Timed,
) -> int:
    """Verdict of a state that no condition decides: out of time, or at rest with all inputs spent."""
    state = workspace.state
    clock = state.clock[0]
    driven, others = clock.free < state.q.shape[0], timed[3].shape[0] + records.potentials.shape[0]
    others += joints.any_driven(records.measures)
    over = clock.time >= control[0].duration * (1.0 - 1e-12)
    if over:
        return MISSED if driven and moving == 0.0 else TIMEOUT
    if not driven or moving > 0.0 or others > 0:
        return RUNNING
    for i in range(state.q.shape[0]):
        drive = records.coordinates[i].drive
        if abs(state.v[i]) * control[0].duration > 1e-6 * control[0].tolerance:
            return RUNNING
        if not state.prescribed[i] and drive in (SERVO, FORCE):
            return RUNNING
    return MISSED


@kernel
def time_slot(state: State) -> int:
    """Where expressions read t: values are parameters, t, q, v, gaps, forces, tolerance."""
    return state.values.shape[0] - 2 - 2 * (state.q.shape[0] + state.gaps.shape[0])

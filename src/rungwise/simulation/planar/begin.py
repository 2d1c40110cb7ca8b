"""Beginning a run at places and speeds that no run has left."""

from __future__ import annotations

from rungwise.kernel import RecordArray, kernel
from rungwise.scene.template.records import SERVO, Records
from rungwise.simulation.planar.loop import CLOSED, begin
from rungwise.simulation.planar.state.verdicts import INVALID
from rungwise.simulation.planar.state.workspace import State, Workspace
from rungwise.system.planar.place import start


@kernel
def take_start(records: Records, rung: RecordArray, state: State) -> None:
    """Let the scene's start be the state; rungs without momentum begin at rest."""
    start(records, state.q, state.v)
    if rung[0].inertia == 0.0:
        state.v[:] = 0.0


@kernel
def begin_by_hand(records: Records, rung: RecordArray, control: RecordArray, workspace: Workspace) -> int:
    """Prepare a run from the q, v and time of the state; returns RUNNING, or INVALID when bodies overlap,
    joints are open or a place is outside its travel. Servos that follow a speed pass through the state."""
    state, measures = workspace.state, records.measures
    n, time = state.q.shape[0], state.clock[0].time
    if outside_travel(records, workspace) >= 0:
        return INVALID
    code = begin(records, rung, control, workspace)
    for i in range(n):
        if records.coordinates[i].drive == SERVO and not records.coordinates[i].has_target:
            state.start[i] -= records.coordinates[i].target_speed * time
    for m in range(measures.shape[0]):
        if measures[m].drive == SERVO and not measures[m].has_target:
            state.start[n + m] -= measures[m].target_speed * time
    return code


@kernel
def outside_travel(records: Records, workspace: Workspace) -> int:
    """The first coordinate whose place is outside its travel, or -1."""
    q = workspace.state.q
    for i in range(q.shape[0]):
        c = records.coordinates[i]
        slack = CLOSED * abs(q[i])
        if not c.lower - slack <= q[i] <= c.upper + slack:
            return i
    return -1

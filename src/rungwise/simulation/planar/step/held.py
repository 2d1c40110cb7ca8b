"""Steps without momentum: the one question whether what is closed at their start balances the loads.

See `core.held`. Contacts that are closed, or that driven motion closes in the step, have to balance the
loads alone; and a motion that does not vanish with the step leads out of balance. It settles, because loads
or drives have jumped, and is in balance after one step; or it goes on, and momentum decides where it rests
(von Mises' truss).
"""

from __future__ import annotations

from rungwise.kernel import Reals, RecordArray, inner_kernel, kernel, rare_kernel
from rungwise.scene.template.records import Records
from rungwise.simulation.core.held import is_bound_by_inertia, keep_near, pushes_far, vanishes
from rungwise.simulation.core.step import SUPPORTED, solve_step
from rungwise.simulation.core.tolerances import DRIVEN, NEAR, SHORTER
from rungwise.simulation.planar.state.nearby import begin_step, gather
from rungwise.simulation.planar.state.prescribed_speeds import set_speeds
from rungwise.simulation.planar.state.workspace import Workspace, trial_in
from rungwise.simulation.planar.step.preferred_motion import choose_motion
from rungwise.simulation.watched.inputs import Inputs


@kernel
def is_held(records: Records, rung: RecordArray, h: float, shortest: float, workspace: Workspace) -> bool:
    """Whether the contacts closed at the start of the step just solved, of length h and without momentum,
    balance the loads. The solution is as it was, or if not, the problem of these contacts is left. Notes in
    `clock.leaping` how far the motion leads out of balance, 0 where it vanishes with the step."""
    clock = workspace.state.clock[0]
    clock.leaping = 0.0
    trial, near = trial_in(rung, h, clock.contacts, workspace), NEAR * clock.reach
    moved = _out_of_proportion(records, h, workspace)
    if moved > 0.0 or pushes_far(trial, near):
        clock.contacts = keep_near(trial, near)
        alone = trial_in(rung, h, clock.contacts, workspace)
        if solve_step(alone) != SUPPORTED or is_bound_by_inertia(alone):
            return False
        clock.contacts = gather(records, workspace)
        choose_motion(records, rung, h, clock.contacts, shortest, workspace)
    if moved > 0.0 and not vanishes(trial):
        clock.leaping = moved
    if moved > 0.0:
        solve_again(rung, h, workspace)
    return True


@kernel
def _out_of_proportion(records: Records, h: float, workspace: Workspace) -> float:
    """The farthest displacement in the step just solved, as a length, where it is far beyond what is driven,
    and twice what the pace of the last step explains; else 0."""
    state, clock, pace = workspace.state, workspace.state.clock[0], 0.0
    moved, driven = displacement(records, h, workspace)
    if clock.chooses or moved <= max(min(NEAR * clock.smallest, workspace.terms.low[0]), DRIVEN * driven):
        return 0.0
    for i in range(state.v.shape[0]):
        pace = max(pace, records.coordinates[i].lever * abs(state.v[i]))
    return moved if 0.5 * moved > h * pace else 0.0


@rare_kernel
def snaps_on(
    records: Records, inputs: Inputs, buffer: Reals, rung: RecordArray, workspace: Workspace, h: float
) -> bool:
    """Whether what led out of balance in the last step does so by half as much at least in a part of a step
    of length h. Inputs that begin with this step explain it."""
    clock = workspace.state.clock[0]
    if clock.time <= clock.switched:
        return False
    part, _ = set_speeds(records, inputs, buffer, rung, workspace, SHORTER * min(h, clock.taken))
    if workspace.watched.undefined[0] >= 0:
        return False
    begin_step(records, rung, workspace, part)
    clock.contacts = gather(records, workspace)
    supported = solve_again(rung, part, workspace) == SUPPORTED
    moved, driven = displacement(records, part, workspace)
    return supported and moved >= max(0.5 * clock.leapt, DRIVEN * driven)


@inner_kernel
def displacement(records: Records, h: float, workspace: Workspace) -> tuple[float, float]:
    """The farthest displacement, as a length, in the step just solved: of free and of driven coordinates."""
    state, moved, driven = workspace.state, 0.0, 0.0
    for i in range(state.q.shape[0]):
        far = h * records.coordinates[i].lever * abs(workspace.scratch.v_new[i])
        if state.prescribed[i]:
            driven = max(driven, far)
        else:
            moved = max(moved, far)
    return moved, driven


@rare_kernel
def solve_again(rung: RecordArray, h: float, workspace: Workspace) -> int:
    return solve_step(trial_in(rung, h, workspace.state.clock[0].contacts, workspace))

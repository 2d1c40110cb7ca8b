"""Contacts out of the reach of what is driven, in steps without momentum.

Without inertia a step's problem asks for balance at its end alone. What nothing holds where the step begins
then comes to rest against whatever lies in its way, however far. So the contacts that are closed when the
step begins, or that driven motion closes in it, have to balance the loads alone, with springs, dampers,
drives and dry friction: what balances only against others got there by momentum, which the rung leaves out.
"""

from __future__ import annotations

from rungwise.contact.step import SOLVED, stretch
from rungwise.kernel import RecordArray, kernel, rare_kernel
from rungwise.models.limit import greatest_load
from rungwise.scene.template.records import Records
from rungwise.simulation.core.balance import is_balanced, keep_near, pushes_far
from rungwise.simulation.core.step import SUPPORTED, solve_assembled
from rungwise.simulation.core.tolerances import NEAR
from rungwise.simulation.planar.state.nearby import gather
from rungwise.simulation.planar.state.workspace import Workspace, trial_in
from rungwise.simulation.planar.step.leaps import HEAVIER, LEFT, displacement, solve_again
from rungwise.simulation.planar.step.preferred_motion import choose_motion


@kernel
def strides(rung: RecordArray, h: float, contacts: int, workspace: Workspace) -> bool:
    """Whether the step just solved has no momentum and takes bodies to contacts that were out of the reach of
    driven motion, or far with more inertia in the balance than the limit leaves there."""
    if rung[0].inertia > 0.0 or not rung[0].loads:
        return False
    state, terms, trial = workspace.state, workspace.terms, trial_in(rung, h, contacts, workspace)
    met = pushes_far(trial, NEAR * state.clock[0].reach)
    if met and greatest_load(terms, state.clock[0].free, state.free)[0] == 0.0:
        return False
    return met or (state.clock[0].leaping > 0.0 and not is_balanced(trial, LEFT))


@rare_kernel
def stands(records: Records, rung: RecordArray, h: float, shortest: float, workspace: Workspace) -> bool:
    """Whether contacts within that reach balance the loads alone, in a motion that inertia does not bound. If
    not, their problem is left in the workspace, else the solution is as it was."""
    clock = workspace.state.clock[0]
    clock.contacts = keep_near(trial_in(rung, h, clock.contacts, workspace), NEAR * clock.reach)
    held = solve_again(rung, h, workspace) == SUPPORTED and not _is_bound_by_inertia(
        records, rung, h, workspace
    )
    if held:
        clock.contacts = gather(records, workspace)
        choose_motion(records, rung, h, clock.contacts, shortest, workspace)
    return held


@rare_kernel
def _is_bound_by_inertia(records: Records, rung: RecordArray, h: float, workspace: Workspace) -> bool:
    """Whether bodies move less than half as far with `HEAVIER` times the inertia that stands for none."""
    state, terms, scratch, problem = workspace.state, workspace.terms, workspace.scratch, workspace.problem
    clock = state.clock[0]
    moved, _ = displacement(records, h, workspace)
    more = (HEAVIER - 1.0) * clock.eps / h
    for i in range(clock.free):
        a = state.free[i]
        first, end = stretch(terms.entries.matrices, a, state.q.shape[0])
        for b in range(first, end):
            problem.c[i] -= more * terms.inertia[a, b - first] * state.speed[b]
        low, high = stretch(terms.entries.couplings, i, clock.free)
        for j in range(low, high):
            problem.H[i, j - low] += more * terms.inertia[a, state.free[j] - first]
    status = solve_assembled(trial_in(rung, h, clock.contacts, workspace), False)
    if status != SOLVED:
        return True
    for i in range(clock.free):
        scratch.v_new[state.free[i]] = scratch.x[i]
    less, _ = displacement(records, h, workspace)
    return bool(less < 0.5 * moved)

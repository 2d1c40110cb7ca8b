"""Velocities that jump though nothing collides: rigid contact with friction may leave no other way out.

Where the acceleration of a sliding contact with friction has no solution, or several, an impulse without a
collision is a solution (Painleve; Genot and Brogliato, New results on Painleve paradoxes, 1999). A step's
problem has the impulse as its solution and does not say so. The limit tells a jump: the change of velocity in
a far shorter step is as large, and without friction it is not.
"""

from __future__ import annotations

import math

from rungwise.contact.step import stretch
from rungwise.kernel import RecordArray, kernel, rare_kernel
from rungwise.models.assemble import approach
from rungwise.scene.template.records import Records
from rungwise.simulation.core.step import SUPPORTED, solve_step
from rungwise.simulation.core.tolerances import SHORTER
from rungwise.simulation.planar.state.nearby import gather
from rungwise.simulation.planar.state.workspace import Workspace, trial_in

GROWN = 2.0
"""A jump is looked for only where acceleration has grown by this factor since the last step."""
ROUNDED = 1e-9
"""Change of velocity, over the velocity and the change by loads, that is rounding and no jump."""


@kernel
def jumps(records: Records, rung: RecordArray, h: float, contacts: int, workspace: Workspace) -> bool:
    """Whether in the step just solved velocities jump, by friction, without a collision. The solution is left
    as it was."""
    state, terms = workspace.state, workspace.terms
    clock = state.clock[0]
    if rung[0].compliant or rung[0].inertia == 0.0 or contacts == 0 or _collides(contacts, workspace):
        return False
    change = _norm(workspace, 1.0)
    before, clock.shake = clock.shake, change / h
    if not (clock.shake > GROWN * before and _rubs(contacts, workspace)):
        return False
    if change <= ROUNDED * (_norm(workspace, 0.0) + h * _pull(workspace)):
        return False
    found = _changes_so_soon(rung, h, contacts, workspace, change)
    if found:
        for k in range(contacts):
            terms.friction[k] = 0.0
        found = not _changes_so_soon(rung, h, contacts, workspace, change)
        gather(records, workspace)
    solve_step(trial_in(rung, h, contacts, workspace))
    return found


@rare_kernel
def _changes_so_soon(rung: RecordArray, h: float, contacts: int, workspace: Workspace, change: float) -> bool:
    """Whether velocity changes by half as much at least in a far shorter step."""
    status = solve_step(trial_in(rung, SHORTER * h, contacts, workspace))
    return status == SUPPORTED and _norm(workspace, 1.0) > 0.5 * change


@kernel
def _collides(contacts: int, workspace: Workspace) -> bool:
    """Whether something that approached is met in the step."""
    state, terms, scratch = workspace.state, workspace.terms, workspace.scratch
    clock, met = state.clock[0], False
    for k in range(contacts):
        if scratch.contact_force[2 * k] > 0.0:
            met |= terms.gap[k] > terms.rounding[0]
            met |= approach(2 * k, terms, state.v, state.speed, state.free, clock.free, clock.eps) < 0.0
    return met


@kernel
def _rubs(contacts: int, workspace: Workspace) -> bool:
    """Whether friction acts."""
    rubs = False
    for k in range(contacts):
        rubs |= workspace.scratch.contact_force[2 * k + 1] != 0.0
    return rubs


@kernel
def _pull(workspace: Workspace) -> float:
    """Norm of the acceleration that the loads alone would cause, by the diagonal of the inertia."""
    state, terms, total = workspace.state, workspace.terms, 0.0
    for i in range(state.clock[0].free):
        a = state.free[i]
        total += terms.load[a] * terms.fall[a]
    return math.sqrt(total)


@kernel
def _norm(workspace: Workspace, less: float) -> float:
    """Norm, in the metric of the inertia, of the velocity after the solved step less a part `less` of the
    velocity before it: with 1 of the change, with 0 of the velocity."""
    v, v_new, inertia = workspace.state.v, workspace.scratch.v_new, workspace.terms.inertia
    total = 0.0
    for i in range(v.shape[0]):
        first, end = stretch(workspace.terms.entries.matrices, i, v.shape[0])
        for j in range(first, end):
            total += (v_new[i] - less * v[i]) * inertia[i, j - first] * (v_new[j] - less * v[j])
    return math.sqrt(max(total, 0.0))

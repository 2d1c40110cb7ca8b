"""Which contact keeps steps short, and why: a vote of all steps that are refused or end early; and runs whose
steps lead nowhere.

The vote is that of Boyer and Moore (MJRTY, 1991): what more than half of the steps name is what is left.
"""

from __future__ import annotations

import math

from rungwise.contact.step import TOLERANCE
from rungwise.kernel import RecordArray, inner_kernel, rare_kernel
from rungwise.simulation.planar.workspace import State, Workspace
from rungwise.system.planar.manifold import ABSENT, GAP

UNSOLVED, OVERLAPPING, TORN, MISSING, MEETING = 1, 2, 3, 4, 5
"""Causes: the step's problem has no solution; bodies would overlap; a rigid joint would open; contacts would
be missed on the way; bodies meet that may bounce."""
CAUSES = 8
"""A vote is CAUSES slot + cause; where no slot is to blame, it is the cause alone, less CAUSES."""
PATIENCE, LEAST = 100_000, 0.1
"""Attempts at steps that may lead no farther than one nominal step, and the least part of it for which they
are counted. Shipped scenes need up to 4000, where the error allowed is a millionth of their shapes."""


@inner_kernel
def crawls(control: RecordArray, state: State) -> bool:
    """Whether steps, just now one more, have led no farther than a nominal step, or a part of it, for so many
    attempts that the run would not end."""
    clock = state.clock[0]
    if clock.time - clock.mark >= control[0].step:
        clock.mark, clock.crowd = clock.time, 0
    return bool(clock.crowd > PATIENCE * max((clock.time - clock.mark) / control[0].step, LEAST))


@rare_kernel
def vote(cause: int, slot: int, state: State) -> None:
    """One step was shorter for this cause at this slot, or at none (-1)."""
    clock, ballot = state.clock[0], CAUSES * slot + cause
    clock.refusal = ballot
    if clock.votes == 0:
        clock.blamed, clock.votes = ballot, 1
    elif clock.blamed == ballot:
        clock.votes += 1
    else:
        clock.votes -= 1


@rare_kernel
def blame(unfit: bool, torn: bool, contacts: int, workspace: Workspace) -> None:
    """Vote on an attempt that was refused, with the bodies where it led; `unfit`: it missed contacts on the
    way; `torn`: it opened a rigid joint."""
    state = workspace.state
    if unfit:
        vote(MISSING, _pressed(contacts, workspace), state)
    elif state.clock[0].residual > TOLERANCE:
        vote(UNSOLVED, _violated(contacts, workspace), state)
    elif torn:
        vote(TORN, -1, state)
    else:
        vote(OVERLAPPING, _deepest(state), state)


@rare_kernel
def _deepest(state: State) -> int:
    """The slot of the deepest overlap, or -1."""
    deepest, least = -1, 0.0
    for slot in range(state.manifolds.features.shape[0]):
        if state.manifolds.features[slot] != ABSENT and state.manifolds.points[slot, GAP] < least:
            deepest, least = slot, state.manifolds.points[slot, GAP]
    return deepest


@rare_kernel
def _pressed(contacts: int, workspace: Workspace) -> int:
    """The slot of the greatest normal force, or -1."""
    pressed, most = -1, 0.0
    for k in range(contacts):
        if workspace.scratch.contact_force[2 * k] > most:
            pressed, most = int(workspace.scratch.slots[k]), workspace.scratch.contact_force[2 * k]
    return pressed


@rare_kernel
def _violated(contacts: int, workspace: Workspace) -> int:
    """The slot of the contact whose bodies approach most in what was found last of a problem without
    solution, or else of the greatest force, or -1."""
    problem, scratch, n = workspace.problem, workspace.scratch, workspace.state.clock[0].free
    violated, least = -1, 0.0
    for k in range(contacts):
        rate = problem.w[2 * k]
        for i in range(n):
            rate += problem.W[2 * k, i] * scratch.x[i]
        for j in range(2):
            rate += problem.R[k, 0, j] * scratch.contact_force[2 * k + j]
        if math.isfinite(rate) and rate < least:
            violated, least = int(scratch.slots[k]), rate
    return violated if violated >= 0 else _pressed(contacts, workspace)

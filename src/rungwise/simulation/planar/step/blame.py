"""Which contact keeps steps short, and why: steps that are refused or end early vote (see `core.crawl`)."""

from __future__ import annotations

import math

from rungwise.contact.step import TOLERANCE, span
from rungwise.kernel import RecordArray, inner_kernel, rare_kernel
from rungwise.simulation.core.crawl import (
    CAUSES,
    INSOLUBLE,
    MISSING,
    OVERLAPPING,
    TORN,
    lead_nowhere,
    voted,
)
from rungwise.simulation.planar.state.workspace import State, Workspace
from rungwise.system.planar.contact_manifold import ABSENT, GAP


@inner_kernel
def crawls(control: RecordArray, state: State) -> bool:
    """Whether steps, just now one more, have led no farther than a nominal step, or a part of it, for so many
    attempts that the run would not end."""
    clock = state.clock[0]
    if clock.time - clock.mark >= control[0].step:
        clock.mark, clock.crowd = clock.time, 0
    return lead_nowhere(clock.crowd, clock.time - clock.mark, control[0].step)


@rare_kernel
def vote(cause: int, slot: int, state: State) -> None:
    """One step was shorter for this cause at this slot, or at none (-1)."""
    clock, ballot = state.clock[0], CAUSES * slot + cause
    clock.refusal = ballot
    clock.blamed, clock.votes = voted(ballot, clock.blamed, clock.votes)


@rare_kernel
def blame(unfit: bool, torn: bool, contacts: int, workspace: Workspace) -> None:
    """Vote on an attempt that was refused, with the bodies where it led; `unfit`: it missed contacts on the
    way; `torn`: it opened a rigid joint."""
    state = workspace.state
    if unfit:
        vote(MISSING, _pressed(contacts, workspace), state)
    elif state.clock[0].residual > TOLERANCE:
        vote(INSOLUBLE, _violated(contacts, workspace), state)
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
    violated, least, columns = -1, 0.0, workspace.terms.entries.columns
    for k in range(contacts):
        rate = problem.w[2 * k]
        for side in range(2):
            first, end, shift = span(columns, k, side, n)
            for i in range(first, end):
                rate += problem.W[2 * k, i - shift] * scratch.x[i]
        for j in range(2):
            rate += problem.R[k, 0, j] * scratch.contact_force[2 * k + j]
        if math.isfinite(rate) and rate < least:
            violated, least = int(scratch.slots[k]), rate
    return violated if violated >= 0 else _pressed(contacts, workspace)

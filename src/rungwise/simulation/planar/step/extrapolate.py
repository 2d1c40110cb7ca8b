"""Two half steps and a whole one, extrapolated to a step of second order (Richardson)."""

from __future__ import annotations

import math

from rungwise.contact.step import OPEN, span, stretch
from rungwise.kernel import RecordArray, kernel, rare_kernel
from rungwise.scene.template.records import Records
from rungwise.simulation.planar.state.memory import bring_back, remember
from rungwise.simulation.planar.state.nearby import look
from rungwise.simulation.planar.state.passing import passes
from rungwise.simulation.planar.state.workspace import Workspace
from rungwise.simulation.planar.step.attempt import tolerated
from rungwise.system.planar.place import place
from rungwise.system.terms import INERTIA

PRESSED = 0.1
"""Part of what contact forces change speeds by in a half step, up to which the whole step and the halves may
differ where a rigid contact pushes: else bodies would bounce on what is extrapolated. Chosen by trial."""


@kernel
def flies(workspace: Workspace) -> bool:
    """Whether nothing touched anything since the state that was kept."""
    state, flies = workspace.state, True
    for slot in range(state.modes.shape[0]):
        flies &= state.modes[slot] == OPEN and workspace.kept.modes[slot] == OPEN
        flies &= state.deformation[slot, 0] == 0.0 and workspace.kept.deformation[slot, 0] == 0.0
    return flies


@kernel
def is_alike(rung: RecordArray, workspace: Workspace) -> bool:
    """Whether the half step just taken and the whole one have the same contacts in the same modes, and are
    both implicit: then their difference is proportional to the step."""
    state, whole = workspace.state, workspace.whole
    if rung[0].theta < 1.0 or state.clock[0].chooses:
        return False
    for slot in range(state.modes.shape[0]):
        if state.modes[slot] != whole.modes[slot]:
            return False
    for slot in range(state.manifolds.features.shape[0]):
        if state.manifolds.features[slot] != whole.features[slot]:
            return False
    for r in range(state.clock[0].limited):
        if workspace.scratch.limited_mode[r] != whole.limited_mode[r]:
            return False
    return True


@kernel
def is_pressed(h: float, workspace: Workspace) -> bool:
    """Whether the contacts of the half step just taken, of length h, push so much that no body leaves one by
    the difference of speeds after the halves and the whole step."""
    state, terms, scratch, whole = workspace.state, workspace.terms, workspace.scratch, workspace.whole
    for k in range(state.clock[0].contacts):
        if scratch.mode[k] != OPEN:
            change, ease = 0.0, 0.0
            for side in range(2):
                first, end, shift = span(terms.entries.rows, k, side, state.v.shape[0])
                for i in range(first, end):
                    row = terms.rows[2 * k, i - shift]
                    change += row * (state.v[i] - whole.v[i])
                    if not state.prescribed[i]:
                        ease += row * row / terms.heft[i, INERTIA]
            if abs(change) > PRESSED * h * ease * scratch.contact_force[2 * k]:
                return False
    return True


@rare_kernel
def extrapolate(records: Records, rung: RecordArray, workspace: Workspace) -> None:
    """Add to two half steps their gain over the whole step.

    The halves stay as they are where the sum would overlap something, lie beyond it, or pull at a contact.
    """
    state, whole, halves = workspace.state, workspace.whole, workspace.before
    remember(state, halves)
    clock = state.clock[0]
    touches = not flies(workspace)
    least = min(clock.least_gap, -tolerated(rung, workspace)) if touches else 0.0
    fits = True
    state.manifolds.turn[0] += 1
    for slot in range(state.deformation.shape[0]):
        for d in range(2):
            state.deformation[slot, d] += state.deformation[slot, d] - whole.deformation[slot, d]
        fits &= state.deformation[slot, 0] >= 0.0 or halves.deformation[slot, 0] < 0.0
    for i in range(state.q.shape[0]):
        if not state.prescribed[i]:
            state.q[i] += state.q[i] - whole.q[i]
        fits &= math.isfinite(state.q[i])
    if fits:
        place(records, state.q, state.placed, False)
        look(records, workspace, state.v)
        fits = (rung[0].compliant and touches) or clock.least_gap >= least
        for slot in range(state.manifolds.features.shape[0]):
            fits &= not touches or state.manifolds.features[slot] == halves.features[slot]
    if not fits or passes(records, workspace):
        bring_back(records, workspace, halves)
        return
    if rung[0].inertia > 0.0:
        _balance(rung, workspace)
    for i in range(state.v.shape[0]):
        if not state.prescribed[i]:
            state.v[i] += state.v[i] - whole.v[i]
    for slot in range(state.impulse.shape[0]):
        for d in range(2):
            state.impulse[slot, d] += state.impulse[slot, d] - whole.impulse[slot, d]
    for c in range(state.impulses.shape[0]):
        state.impulses[c] += state.impulses[c] - whole.impulses[c]


@rare_kernel
def _balance(rung: RecordArray, workspace: Workspace) -> None:
    """Extrapolate the works. Kinetic energy is a square: it ends higher than the extrapolated one by that of
    twice the correction of velocity, halved, which the works share in proportion to their changes."""
    state, terms = workspace.state, workspace.terms
    whole, kept = workspace.whole, workspace.kept.clock[0]
    clock, far = state.clock[0], whole.clock[0]
    square = 0.0
    for i in range(state.v.shape[0]):
        first, end = stretch(terms.entries.matrices, i, state.v.shape[0])
        for j in range(first, end):
            change = (state.v[i] - whole.v[i]) * (state.v[j] - whole.v[j])
            square += rung[0].inertia * terms.inertia[i, j - first] * change
    clock.drive_work += clock.drive_work - far.drive_work
    clock.load_work += clock.load_work - far.load_work
    clock.contact_work += clock.contact_work - far.contact_work
    clock.support_work += clock.support_work - far.support_work
    clock.joint_work += clock.joint_work - far.joint_work
    drive, load = abs(clock.drive_work - kept.drive_work), abs(clock.load_work - kept.load_work)
    contact = abs(clock.contact_work - kept.contact_work)
    support = abs(clock.support_work - kept.support_work)
    joint = abs(clock.joint_work - kept.joint_work)
    total = drive + load + contact + support + joint
    if total > 0.0:
        clock.drive_work += square * drive / total
        clock.load_work += square * load / total
        clock.contact_work += square * contact / total
        clock.support_work += square * support / total
        clock.joint_work += square * joint / total

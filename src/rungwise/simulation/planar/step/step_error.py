"""How far two halves of a step and the whole lead apart, and which contacts closed in it."""

from __future__ import annotations

import math

from rungwise.contact.linear import solve_in_place
from rungwise.contact.step import OPEN, STICK, diagonal, entry, span
from rungwise.kernel import Ints, Reals, RecordArray, kernel, rare_kernel
from rungwise.scene.template.records import Records
from rungwise.simulation.planar.state.nearby import farthest, join
from rungwise.simulation.planar.state.workspace import Workspace
from rungwise.system.planar.seams import mode_before
from rungwise.system.terms import APART, INERTIA, SUPPORT

AHEAD = 0.1
"""How long an error of velocity acts, as a part of the longest step."""
SETTLED = 10.0
"""A compliant contact that swings by this angle at least in a half step takes out errors of velocity by
itself. Chosen by trial."""
SWEEPS = 8
"""How often the rows of contacts are gone through, one after the other."""


@rare_kernel
def disagreement(
    records: Records, rung: RecordArray, control: RecordArray, h: float, workspace: Workspace
) -> float:
    """Greatest distance between the places of a body after two half steps, of length h, and after one whole
    step, now and, where velocities are continuous, a while later."""
    state, whole = workspace.state, workspace.whole
    continuous = rung[0].inertia > 0.0 and (rung[0].compliant or not closes(workspace))
    later = AHEAD * control[0].longest if continuous else 0.0
    change = workspace.scratch.v_new
    for i in range(state.v.shape[0]):
        change[i] = state.v[i] - whole.v[i]
    if later > 0.0 and records.joints.shape[0] > 0:
        join(records, rung, workspace, control[0].step)
        _keep_joints_closed(workspace, change)
    if later > 0.0:
        _keep_contacts(rung, h, workspace, change)
        _keep_until_rest(rung, 2.0 * h, later, workspace, change)
    worst = later * farthest(records, state, change)
    for i in range(state.q.shape[0]):
        change[i] = state.q[i] - whole.q[i]
    return max(worst, farthest(records, state, change))


@rare_kernel
def _keep_joints_closed(workspace: Workspace, change: Reals) -> None:
    """Take from a change of velocity the part that would open rigid joints, as the next step does, by
    impulses along their rows, M change' - J^T y = M change, J change' = 0. Unknowns and rows are in units in
    which M has a unit diagonal."""
    state, terms, a = workspace.state, workspace.terms, workspace.scratch.matrix
    clock, stretches = state.clock[0], terms.entries.matrices
    free = clock.free
    size = free
    for r in range(clock.drives, clock.limited):
        size += math.isinf(terms.limit[r]) and math.isinf(terms.gains[r, 0])
    root = workspace.scratch.x
    for i in range(free):
        root[i] = math.sqrt(diagonal(terms.inertia, stretches, state.free[i]))
    a[:size, : size + 1] = 0.0
    for i in range(free):
        for j in range(free):
            a[i, j] = entry(terms.inertia, stretches, state.free[i], state.free[j]) / (root[i] * root[j])
            a[i, size] += a[i, j] * root[j] * change[state.free[j]]
    row = free
    for r in range(clock.drives, clock.limited):
        if math.isinf(terms.limit[r]) and math.isinf(terms.gains[r, 0]):
            length = 0.0
            for i in range(free):
                length += (terms.limited[r, state.free[i]] / root[i]) ** 2
            length = math.sqrt(length)
            for i in range(free):
                if length > 0.0:
                    a[row, i] = terms.limited[r, state.free[i]] / (root[i] * length)
                a[i, row] = -a[row, i]
            row += 1
    solve_in_place(a, size, 1, workspace.scratch.order)
    for i in range(free):
        change[state.free[i]] = a[i, size] / root[i]


@rare_kernel
def _keep_contacts(rung: RecordArray, h: float, workspace: Workspace, change: Reals) -> None:
    """Take from a change of velocity the part along contacts that push, as the next step does: where faces
    turn, it is of the order of the step, though no error of the motion. Stiff contacts count, and where they
    stick both rows."""
    clock, terms, scratch = workspace.state.clock[0], workspace.terms, workspace.scratch
    whole = terms.entries.rows[:0]
    for _ in range(SWEEPS):
        for k in range(clock.contacts):
            for d in range(2):
                mode = scratch.mode[k]
                if mode == STICK or (mode != OPEN and d == 0):
                    stiff = terms.contact_stiffness[k, d, d] if rung[0].compliant else math.inf
                    _keep_row(h, stiff, terms.rows[2 * k + d], terms.entries.rows, k, workspace, change)
        for r in range(clock.drives, clock.limited):
            if math.isinf(terms.limit[r]) and math.isinf(terms.gains[r, 0]):
                _keep_row(h, math.inf, terms.limited[r], whole, 0, workspace, change)


@rare_kernel
def _keep_until_rest(rung: RecordArray, h: float, later: float, workspace: Workspace, change: Reals) -> None:
    """Scale the changes of velocity that dry friction ends, so that they act for no longer than it takes to
    stop what it holds from its present speed, |s| / (F S M^-1 S^T - loads), and for a step of length h."""
    clock, terms, v = workspace.state.clock[0], workspace.terms, workspace.state.v
    first = 0
    while first < clock.drives:
        last = first + 1
        while last < clock.drives and terms.surface[last] == terms.surface[first] != APART:
            last += 1
        if terms.account[first] == SUPPORT:
            pace, slowing = 0.0, math.inf
            for r in range(first, last):
                rate, ease, load = 0.0, 0.0, 0.0
                for i in range(v.shape[0]):
                    rate += terms.limited[r, i] * v[i]
                    own = diagonal(terms.inertia, terms.entries.matrices, i)
                    ease += terms.limited[r, i] ** 2 / (rung[0].inertia * own)
                    load += abs(terms.limited[r, i] * terms.fall[i])
                pace += rate * rate
                slowing = min(slowing, terms.limit[r] * ease - load / rung[0].inertia)
            if slowing * later > math.sqrt(pace):
                acts = min(1.0, (math.sqrt(pace) / slowing + h) / later)
                for i in range(v.shape[0]):
                    for r in range(first, last):
                        if terms.limited[r, i] != 0.0:
                            change[i] *= acts
                            break
        first = last


@kernel
def _keep_row(
    h: float, stiff: float, row: Reals, spans: Ints, k: int, workspace: Workspace, change: Reals
) -> None:
    """Take the part along a row, with entries in spans k, from a change of velocity, by an impulse along
    it."""
    state, heft = workspace.state, workspace.terms.heft
    rate, ease = 0.0, 0.0
    for side in range(2):
        first, end, shift = span(spans, k, side, change.shape[0])
        for i in range(first, end):
            if not state.prescribed[i]:
                rate += row[i - shift] * change[i]
                ease += row[i - shift] * row[i - shift] / heft[i, INERTIA]
    for side in range(2 if ease > 0.0 and h * h * stiff * ease > SETTLED * SETTLED else 0):
        first, end, shift = span(spans, k, side, change.shape[0])
        for i in range(first, end):
            if not state.prescribed[i]:
                change[i] -= rate / ease * row[i - shift] / heft[i, INERTIA]


@kernel
def closes(workspace: Workspace) -> bool:
    """Whether a contact closed since the state that was kept: a rigid one makes velocities jump."""
    modes, closes = workspace.state.modes, False
    for slot in range(modes.shape[0]):
        closes |= modes[slot] != OPEN and mode_at_start(slot, workspace) == OPEN
    return closes


@kernel
def mode_at_start(slot: int, workspace: Workspace) -> int:
    """Mode in the kept state of the contact that is in the slot now."""
    state, kept = workspace.state, workspace.kept
    if workspace.seams.outlines.joined[0] == 0:
        return int(kept.modes[slot])
    return mode_before(
        slot, state.manifolds, kept.features, kept.modes, state.placed.outline, workspace.seams.outlines
    )

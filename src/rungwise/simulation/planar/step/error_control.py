"""Steps of controlled length: two halves that agree with the whole, and the onset of impacts.

A step in which nothing changes its speed, its contact modes or the direction of a contact is exact, and is
not repeated in halves.
"""

from __future__ import annotations

import math

from rungwise.contact.step import OPEN, diagonal, span
from rungwise.kernel import Reals, RecordArray, inner_kernel, kernel, rare_kernel
from rungwise.scene.fields.laws.contact import PULLS
from rungwise.scene.template.records import Records
from rungwise.simulation.core.crawl import MEETING
from rungwise.simulation.planar.state.laws import until_edges
from rungwise.simulation.planar.state.memory import keep, restore
from rungwise.simulation.planar.state.nearby import fastest_pair, gather, swing, widen
from rungwise.simulation.planar.state.prescribed_speeds import set_speeds
from rungwise.simulation.planar.state.workspace import Workspace
from rungwise.simulation.planar.step.attempt import TAKEN, TOO_COARSE, UNDEFINED, attempt
from rungwise.simulation.planar.step.blame import vote
from rungwise.simulation.planar.step.extrapolate import extrapolate, flies, is_alike, is_pressed
from rungwise.simulation.planar.step.held import snaps_on
from rungwise.simulation.planar.step.midpoint_rows import meets
from rungwise.simulation.planar.step.step_error import AHEAD, closes, disagreement, mode_at_start
from rungwise.simulation.watched.inputs import Inputs
from rungwise.system.planar.contact_manifold import VERTICES
from rungwise.system.planar.place import turns

LEAPT = 5
"""Status beside the statuses of `attempt`: bodies move on however short the step."""
ONSET = 0.2
"""First step of a compliant impact under error control, relative to the time sqrt(M / K) of the contact."""
SHORT_OF = 1.0 - 1e-9
"""A step that should end at a contact ends a little short of it: the impact belongs to the next step."""
CLOSED = 1e-3
"""Gap, over the allowed error, up to which bodies touch under error control."""
SHORTEST = 1e-12
"""Part of the duration beyond which a step whose error is too great is not shortened."""
UNIFORM = 1e-6
"""Part of the allowed error that a change of speed may cause in a step that counts as exact."""
GROWTH = 100.0
"""How much longer the step after an exact one may be."""
SOON = 0.01
"""Part of a fixed step within which an impact counts as at its beginning; a later impact ends the step."""


@kernel
def controlled_step(
    records: Records,
    inputs: Inputs,
    buffer: Reals,
    rung: RecordArray,
    control: RecordArray,
    workspace: Workspace,
    h: float,
) -> tuple[int, float, float]:
    """Advance by h, or under error control by two halves of at most h that agree with the whole.

    Returns the status, the step taken or refused, and the one to try next.
    """
    state = workspace.state
    clock = state.clock[0]
    allowed = control[0].error
    parts, following, smooth = 1, 2.0 * h, True
    steady = not clock.varies
    if allowed > 0.0:
        parts, following = 3, max(h, clock.next)
        h, begins = until_contact(
            records, rung, workspace, h, CLOSED * allowed, allowed, 0.0, control[0].step
        )  # fmt: skip
        following = h if begins else following
        keep(workspace, workspace.kept)
    elif clock.bounces:
        length, _ = until_contact(records, rung, workspace, h, 0.0, 0.0, SOON, math.inf)
        if length < h:
            vote(MEETING, clock.meets, state)
        h = length
    if clock.laws & PULLS:
        h = until_edges(records, rung, workspace, h)
    shortest = SOON * control[0].step
    for part in range(parts):
        length = h if part == 0 else 0.5 * h
        probed = clock.leapt > 0.0
        if probed and snaps_on(records, inputs, buffer, rung, workspace, length):
            if part > 0:
                restore(records, workspace)
            return (TOO_COARSE if h > shortest else LEAPT), h, 0.5 * h
        if part > 0 or probed or allowed > 0.0 or clock.bounces:
            length, _ = set_speeds(records, inputs, buffer, rung, workspace, length)
        status = UNDEFINED
        if workspace.watched.undefined[0] < 0:
            status = attempt(records, rung, workspace, length, shortest)
            clock.attempts += 1
            clock.crowd += 1
        if status != TAKEN:
            bent, following = clock.bend > allowed > 0.0, 0.5 * h
            if bent:
                following = _next(control, clock.bend, h, h)
            if part > 0:
                restore(records, workspace)
            if bent:
                clock.next = following
            return status, h, following
        if parts > 1 and part == 0:
            smooth = not clock.lost and not meets(2.0 * CLOSED * allowed, workspace)
            once = smooth and clock.centred
            if steady and (once or _is_uniform(records, rung, control, workspace, length)):
                return _take_once(control, workspace, length, following)
            keep(workspace, workspace.whole)
            restore(records, workspace)
        else:
            clock.time += length
            clock.worst_residual = max(clock.worst_residual, clock.residual)
            smooth &= parts > 1 and is_alike(rung, workspace)
    if allowed == 0.0:
        return TAKEN, h, following
    error = disagreement(records, rung, control, 0.5 * h, workspace)
    following = _next(control, error, h, following)
    smooth &= not _jumps(rung, 0.5 * h, workspace)
    if error > allowed and h > SHORTEST * control[0].duration:
        restore(records, workspace)
        clock.next = following if smooth else clock.next
        return TOO_COARSE, h, following
    if smooth or (rung[0].inertia > 0.0 and flies(workspace)):
        extrapolate(records, rung, workspace)
    return TAKEN, h, following


@kernel
def _take_once(
    control: RecordArray, workspace: Workspace, h: float, following: float
) -> tuple[int, float, float]:
    """Accept the step just taken; returns as `controlled_step`."""
    clock = workspace.state.clock[0]
    clock.time += h
    clock.worst_residual = max(clock.worst_residual, clock.residual)
    if clock.bend <= UNIFORM * control[0].error:
        return TAKEN, h, max(following, GROWTH * h)
    return TAKEN, h, _next(control, clock.bend, h, following)


@inner_kernel
def _next(control: RecordArray, error: float, h: float, following: float) -> float:
    """The step to try after one of length h with this error, as the step is or, where it is too coarse,
    again."""
    factor = min(max(0.9 * math.sqrt(control[0].error / error), 0.1), 8.0) if error > 0.0 else 8.0
    if error > control[0].error:
        return min(factor, 0.5) * h
    return max(following, factor * h) if factor > 1.0 else factor * h


@kernel
def _jumps(rung: RecordArray, h: float, workspace: Workspace) -> bool:
    """Whether velocities jumped since the state that was kept, in two halves of length h: a rigid contact
    closed, bounced, or does not hold what it meets."""
    clock, kept = workspace.state.clock[0], workspace.kept.clock[0]
    jumps: bool = clock.bounced != 0 or clock.jumps != kept.jumps
    if rung[0].inertia == 0.0 or not rung[0].compliant:
        jumps |= closes(workspace)
    if rung[0].inertia > 0.0 and not rung[0].compliant:
        jumps |= not is_pressed(h, workspace)
    return jumps


@rare_kernel
def _is_uniform(
    records: Records, rung: RecordArray, control: RecordArray, workspace: Workspace, h: float
) -> bool:
    """Whether two halves of the step just taken would lead to the same place: speeds are as they were, no
    contact closed (or, where it is compliant and pushes until it opens, opened), no body in contact or with a
    joint turns, and no deformed contact is between two corners, where it turns as they pass each other."""
    state, kept = workspace.state, workspace.kept
    features, passes = state.manifolds.features, False
    touches = records.joints.shape[0] > 0
    for slot in range(state.modes.shape[0]):
        touches |= state.modes[slot] != OPEN
        before = mode_at_start(slot, workspace)
        if state.modes[slot] != before and (rung[0].compliant or before == OPEN):
            return False
        if slot < features.shape[0] and state.deformation[slot, 0] != 0.0:
            passes |= max(features[slot], kept.features[slot]) >= VERTICES * VERTICES
    span = h + (AHEAD * control[0].longest if rung[0].inertia > 0.0 else 0.0)
    allowed = UNIFORM * control[0].error
    for i in range(state.v.shape[0]):
        lever = swing(records, state, i)
        if lever * span * abs(state.v[i] - kept.v[i]) > allowed:
            return False
        is_angle = turns(records.bodies[records.coordinates[i].body], i)
        if (passes or (is_angle and touches)) and lever * h * abs(state.v[i]) > allowed:
            return False
    return True


@kernel
def until_contact(
    records: Records,
    rung: RecordArray,
    workspace: Workspace,
    h: float,
    closed: float,
    held: float,
    soon: float,
    impact: float,
) -> tuple[float, bool]:
    """The step, but no longer than the first open gap (beyond `closed`, and beyond gaps that close within the
    fraction `soon` of the step) takes to close at its present rate. A contact that pushed in the last step,
    and is open by `held` at most, does not count.

    A compliant impact begins with a small part of its own period: a step that spans the whole impact looks
    plastic, and so do two halves. A rigid impact of bodies with momentum takes a step of `impact` at most, in
    which they approach by no more than `held`, if that is not 0: the next contact of the thrown body is known
    after it. Returns the step, and whether a compliant impact begins.
    """
    state, terms = workspace.state, workspace.terms
    sprung, begins = rung[0].compliant and rung[0].inertia > 0.0, False
    widen(records, workspace, 4.0 * h * fastest_pair(records, rung, terms, state, state.v, 0.0))
    for k in range(gather(records, workspace)):
        rate, ease = 0.0, 0.0
        yields = sprung and math.isfinite(terms.contact_stiffness[k, 0, 0])
        for side in range(2):
            first, end, shift = span(terms.entries.rows, k, side, state.v.shape[0])
            for i in range(first, end):
                row = terms.rows[2 * k, i - shift]
                rate += row * (state.speed[i] if state.prescribed[i] else state.v[i])
                if yields and not state.prescribed[i]:
                    own = rung[0].inertia * diagonal(terms.inertia, terms.entries.matrices, i)
                    ease += row * row * terms.contact_stiffness[k, 0, 0] / own
        pushes = state.modes[workspace.scratch.slots[k]] != OPEN and terms.gap[k] <= held
        if pushes and not sprung:
            continue
        if terms.gap[k] > max(closed, terms.rounding[0]):
            if rate * h < -terms.gap[k] < soon * rate * h:
                h = SHORT_OF * terms.gap[k] / -rate
                state.clock[0].meets = workspace.scratch.slots[k]
        elif ease > 0.0 and rate < 0.0 and terms.deformation[2 * k] == 0.0:
            h, begins = min(h, ONSET / math.sqrt(ease)), True
        elif rung[0].inertia > 0.0 and not rung[0].compliant and -rate * h > max(closed, terms.rounding[0]):
            h = min(h, impact)
            if held > 0.0:
                h = min(h, max(held, terms.rounding[0]) / -rate)
    return h, begins

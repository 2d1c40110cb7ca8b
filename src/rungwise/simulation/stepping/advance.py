"""One step after another, of any system: how long each is, and what is taken over of it.

The way of one step: `advance` halves its length until an attempt holds (`stepping.attempt`), or its error is
what is allowed. Then forces, deformations and work are taken over (`take`).
"""

from __future__ import annotations

import math
from typing import Any

from rungwise.kernel import Reals, copy, inner_kernel, kernel, system_kernel
from rungwise.simulation.core.crawl import BENT, CAUSES, OVERLAPPING, culprit, lead_nowhere, voted
from rungwise.simulation.core.step import SUPPORTED, UNSUPPORTED, solve_step
from rungwise.simulation.core.tolerances import MAX_HALVINGS, SHORTER, SINKING
from rungwise.simulation.core.update_state import accept
from rungwise.simulation.stepping.attempt import (
    CROWDED,
    HALTED,
    STUCK,
    Setting,
    attempt,
    fill_terms,
    landing,
    reach_of,
    trial_of,
)
from rungwise.simulation.watched.inputs import set_rest, set_speeds
from rungwise.simulation.watched.values import TIME
from rungwise.system import contract
from rungwise.system.contract import fastest, fill_speeds, follow, lacks_room, least_gap, until_edge

NO_ROOM, UNDEFINED, SNAPS, SUNK, NOWHERE = 5, 6, 7, 8, 9
"""Statuses beside those of an attempt: the system had no room for its contacts, and nothing was done; a
number that is told is not finite; what leapt goes on (see `snaps_on`); and, of steps that were taken: a
contact yields too far for its model, or steps lead nowhere (see `core.crawl`)."""
CAUTION, LEAST, MOST = 0.9, 0.2, 2.0
"""A step is made longer or shorter for an error of its own size, times the first, by factors between the
others: as is usual (Hairer, Norsett, Wanner: Solving Ordinary Differential Equations I, section II.4)."""


@inner_kernel
def is_taken(status: int) -> bool:
    """Whether a step was taken."""
    return status in (SUPPORTED, SUNK, NOWHERE)


@system_kernel
def advance(system: Any, s: Setting, h: float, tol: float, looks: bool) -> int:
    """Take one step of length h, or shorter: halved as long as it has no solution, and shortened where its
    error is above `tol`, a length; `clock.next` is then the length for the next step. `looks`: whether
    contacts are looked at where it ends. Returns SUPPORTED, or why the run does not go on.

    To leading order the error of a step of first order is h |v' - v| / 2; a fall along a parabola has
    none. Where nothing moves farther than `tol` in the step, it is small enough.
    """
    clock, note, a = s.state.clock[0], s.attempt.note[0], s.attempt
    landed = False
    note.follows = tol < math.inf
    note.allowed = tol if tol < math.inf and s.rung[0].inertia == 0.0 else 0.0
    if note.within > -math.inf:
        if not lead(system, s, h):
            return UNDEFINED
        if fill_here(system, s, h) == SUPPORTED:
            h = until_edge(system, trial_of(s, h))
    planned, shortest = h, math.ldexp(h, -MAX_HALVINGS)
    if note.resumed > 0.0:
        h, note.resumed = note.resumed, 0.0
    while True:
        if not lead(system, s, h):
            return UNDEFINED
        clock.attempts += 1
        clock.crowd += 1
        note.outran = 0
        status = attempt(system, s, h)
        if looks and status == SUPPORTED:
            least_gap(system, a.trial)
        if lacks_room(system):
            note.resumed = h
            return NO_ROOM
        if status in (HALTED, CROWDED):
            return status
        if note.outran and a.ran[1] == 0.0:
            _keep_motion(clock.time, h, note.far, a.v, a.ran)
        if status == SUPPORTED:
            error, moved = _error(system, s, h) if tol < math.inf else (0.0, 0.0)
            following = MOST * h
            if error > 0.0:
                following = h * min(max(CAUTION * math.sqrt(tol / error), LEAST), MOST)
            if error <= tol or moved <= tol:
                clock.next = max(following, planned) if landed else following
                return take(system, s, h)
            _vote(s, BENT, -1)
            lands = landing(s, h)
            if lands > 0.0:  # what an impact changes does not shrink with the step
                h, landed = max(lands, CAUTION * h * tol / error), True
            else:
                h = following
            continue
        for i in range(len(a.pace)):
            a.pace[i] = max(abs(a.v[i]), abs(s.state.speed[i]))
        moved, stuck = h * fastest(system, a.q, a.pace), min(STUCK * note.length, note.thin)
        still = STUCK * stuck if note.cause == OVERLAPPING and s.rung[0].inertia > 0.0 else stuck
        if status == UNSUPPORTED or moved < still or h <= shortest:
            clock.next = h
            return status
        _vote(s, note.cause, culprit(note.cause, note.contacts, s.scratch.slots, s.state.force, s.terms.gap))
        h *= 0.5


@system_kernel
def lead(system: Any, s: Setting, h: float) -> bool:
    """Give the system its inputs in a step of length h: speeds as in its middle, so that ways are exact, all
    else as at its end. Whether all numbers are finite."""
    w, time = s.watched, s.state.clock[0].time
    told = w.values[: w.slots[TIME] + 1]
    set_speeds(s.inputs, s.buffer, time + 0.5 * h, w)
    follow(system, told, h, False)
    if w.undefined[0] < 0:
        set_rest(s.inputs, s.buffer, time + h, w)
    follow(system, told, h, True)
    drive(system, s)
    return bool(w.undefined[0] < 0)


@system_kernel
def drive(system: Any, s: Setting) -> None:
    """Set which coordinates are free, and how fast the others move."""
    state = s.state
    clock, free = state.clock[0], 0
    fill_speeds(system, clock.time, state.speed)
    for i in range(len(state.speed)):
        state.prescribed[i] = not math.isnan(state.speed[i])
        if state.prescribed[i]:
            continue
        state.speed[i] = 0.0
        state.free[free] = i
        free += 1
    clock.free = free


@system_kernel
def fill_here(system: Any, s: Setting, h: float) -> int:
    """Fill in terms where the step begins, for one of length h; returns as `fill_terms`."""
    a = s.attempt
    copy(a.q, a.trial)
    copy(s.state.v, a.led)
    return fill_terms(system, s, h, reach_of(system, s, h), True)


@system_kernel
def snaps_on(system: Any, s: Setting, h: float) -> int:
    """SNAPS where what leapt in the last step would go on so in a small part of a step of length h, under the
    same drives: then momentum decides where it rests, and the run is over. SUPPORTED where not, or why that
    is not known."""
    part = SHORTER * h
    drive(system, s)
    filled = fill_here(system, s, part)
    if lacks_room(system):
        return NO_ROOM
    if filled != SUPPORTED:
        return CROWDED if filled == CROWDED else SUPPORTED
    status = solve_step(trial_of(s, part))
    if s.scratch.halt[0] != 0:
        return HALTED
    moved = 0.5 * part * fastest(system, s.attempt.q, s.scratch.v_new)
    return SNAPS if status == SUPPORTED and moved >= 0.5 * s.state.clock[0].leapt else SUPPORTED


@system_kernel
def _error(system: Any, s: Setting, h: float) -> tuple[float, float]:
    """Estimated error of the step that was tried, and how far anything moves in it, as lengths."""
    state, a = s.state, s.attempt
    for i in range(len(a.pace)):
        old = a.v[i] if state.prescribed[i] == 1 else state.v[i]
        a.pace[i] = abs(a.v[i] - a.fell[i] - old)
    change = 0.5 * h * fastest(system, a.q, a.pace)
    for i in range(len(a.pace)):
        old = a.v[i] if state.prescribed[i] == 1 else state.v[i]
        a.pace[i] = max(abs(a.v[i]), abs(old))
    return 0.5 * change, 0.5 * h * fastest(system, a.q, a.pace)


@kernel
def _vote(s: Setting, cause: int, slot: int) -> None:
    """One step was shorter for this cause at this slot, or at none (-1)."""
    clock = s.state.clock[0]
    clock.blamed, clock.votes = voted(CAUSES * slot + cause, clock.blamed, clock.votes)


@kernel
def _keep_motion(time: float, h: float, far: float, v: Reals, kept: Reals) -> None:
    """Keep a motion that goes so far in a step (see `core.crawl.Leap`)."""
    kept[0], kept[1], kept[2] = time, h, far
    copy(v, kept[3:])


@system_kernel
def take(system: Any, s: Setting, h: float) -> int:
    """Take the step over that was tried."""
    clock, note, a = s.state.clock[0], s.attempt.note[0], s.attempt
    begun = clock.time
    sunk = accept(trial_of(s, h))
    contract.accept(system, a.trial, s.state.v, trial_of(s, h))
    copy(a.trial, a.q)
    clock.worst_residual = max(clock.worst_residual, clock.residual)
    clock.leapt = note.leaping
    if clock.leapt > 0.0:
        note.leaps += 1
        if note.leaps == 1:
            _keep_motion(begun, h, clock.leapt, s.state.v, a.leapt)
    if s.rung[0].compliant and sunk > SINKING * note.length:
        return SUNK
    if clock.time - clock.mark >= note.step:
        clock.mark, clock.crowd = clock.time, 0
    elif lead_nowhere(clock.crowd, clock.time - clock.mark, note.step):
        return NOWHERE
    return SUPPORTED

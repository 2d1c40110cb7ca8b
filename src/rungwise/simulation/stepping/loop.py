"""The loop of a run of any system: inputs, steps, conditions and verdicts, until the run ends or its turn is
over.

The way of one step, from the outside in:

    take_steps     the steps of a turn
    run_step       a step, taken back where a condition begins to hold on its way; conditions, schedule
    advance        a step that is as long as it may be: halving, error control
    attempt        one attempt at a length: terms, solution, motion, gaps
    solve_step     the rung's problem; inertia and restitution
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from rungwise.block import Block
from rungwise.kernel import Ints, Reals, RecordArray, copy, inner_kernel, kernel, system_kernel
from rungwise.outcome import Code
from rungwise.simulation.core.step import SUPPORTED, UNSOLVED, UNSUPPORTED
from rungwise.simulation.core.tolerances import ROUNDING
from rungwise.simulation.stepping.advance import advance, is_taken, snaps_on
from rungwise.simulation.stepping.attempt import Setting
from rungwise.simulation.stepping.record import Recorded, record
from rungwise.simulation.watched.held_since import DATINGS, lasts
from rungwise.simulation.watched.inputs import (
    is_guarded,
    shortened,
    show_inputs,
    switch_inputs,
    until_lasts,
    until_margin,
)
from rungwise.simulation.watched.values import FORCES, SPEEDS, TIME, Conditions
from rungwise.simulation.watched.verdicts import (
    RUNNING,
    ended,
    first_times,
    judge,
    look_back,
    margins,
    next_end,
)
from rungwise.system.contract import hear, keep, take_back, tell_values
from rungwise.system.moving import ANYTHING, Asked

MISSED, TIMEOUT = int(Code.MISSED), int(Code.TIMEOUT)
FULL = 10
"""Status beside those of steps: there is no room for a frame of the step that was taken."""
STOPPED = 0
"""Place, among the signals, of the signal to stop."""
GAINED = 1e-12
"""Work of contacts in a step, over all of it, that is rounding."""


class Snapshot(Block):
    """What a step changes of the core's arrays (see `State`, `Scratch`)."""

    clock: RecordArray
    q: Reals
    v: Reals
    modes: Ints
    deformation: Reals
    force: Reals
    impulse: Reals
    limited_force: Reals
    limited_mode: Ints
    fall: Reals


def allocate_snapshot(s: Setting) -> Snapshot:
    """As large as the arrays of a run."""
    state, scratch = s.state, s.scratch
    return Snapshot(
        clock=state.clock.copy(), q=s.attempt.q.copy(), v=state.v.copy(), modes=state.modes.copy(),
        deformation=state.deformation.copy(), force=state.force.copy(), impulse=state.impulse.copy(),
        limited_force=scratch.limited_force.copy(), limited_mode=scratch.limited_mode.copy(),
        fall=s.terms.fall.copy(),
    )  # fmt: skip


class Loop(NamedTuple):
    """What a run is made by: what its steps are taken with; programs of the scene's conditions; control of
    steps; what conditions ask of states; what is kept of the run before a step; the greatest margins so far,
    of the goal, and of the unsafe or doomed condition that is nearer (2,); the verdict as it stands, and
    whether it is that a segment's condition did not hold in its time (2,); and its frames."""

    setting: Setting
    conditions: Conditions
    control: RecordArray
    asked: Asked
    kept: Snapshot
    margins: Reals
    verdict: Ints
    recorded: Recorded


@system_kernel
def begin_run(system: Any, run: Loop) -> None:
    """Read and judge the state with which a run begins; segments whose condition holds already end there."""
    s = run.setting
    see(system, run, s.attempt.q, 0.0)
    first_times(run.conditions, s.inputs, s.watched)
    run.verdict[0] = _judge(run, 0.0)


@system_kernel
def take_steps(system: Any, run: Loop, steps: int, signals: Ints) -> int:
    """Take at most so many steps, until signalled to stop, the verdict stands, or a segment of the schedule
    has ended; returns how the last one ended (see `stepping.advance`)."""
    clock = run.setting.state.clock[0]
    segment = clock.segment
    for _ in range(steps):
        if signals[STOPPED] != 0 or run.verdict[0] != RUNNING or clock.segment != segment:
            break
        status = run_step(system, run)
        if status != SUPPORTED:
            return int(status)
        run.recorded.note[0].since += 1
        if not record(system, run.setting, run.margins, run.recorded, run.verdict[0] != RUNNING):
            return FULL
    return SUPPORTED


@system_kernel
def run_step(system: Any, run: Loop) -> int:
    """Take a step, or a shorter one where a condition begins to hold within it, and judge where it led.
    Returns SUPPORTED, or why the run does not go on; then the step counts only if it was taken."""
    s, conditions, control = run.setting, run.conditions, run.control[0]
    w, inputs, clock = s.watched, s.inputs, s.state.clock[0]
    tol = control.error if control.error > 0.0 else math.inf
    guarded, lasting, stop = is_guarded(inputs, w), lasts(conditions) or until_lasts(inputs), clock.switch
    if lasting:
        stop = min(stop, next_end(conditions, inputs, -math.inf, w))
    planned = clock.next
    h = min(planned, control.duration - clock.time, stop - clock.time)
    looks = guarded or lasting or (_states(conditions) and h > control.step)
    if clock.leapt > 0.0:
        status = snaps_on(system, s, h)
        if status != SUPPORTED:
            return int(status)
    if looks:
        _keep(system, run)
    before = until_margin(inputs, w) if guarded else -math.inf
    cut, work, solved, dated = h < planned, clock.contact_work, 0.0, 0
    while True:
        status = advance(system, s, h, tol, run.asked.reads[ANYTHING] != 0)
        if status != SUPPORTED and solved > 0.0 and (is_taken(status) or status in (UNSUPPORTED, UNSOLVED)):
            # What a longer step solves is not given up for its date.
            _take_back(system, run)
            h, solved, looks = solved, 0.0, False
            continue
        if not is_taken(status):
            clock.next, w.values[w.slots[TIME]] = planned, clock.time
            show_inputs(inputs, w)
            return int(status)
        took, following = clock.tried, clock.next
        see(system, run, s.attempt.q, took)
        if status != SUPPORTED:
            return int(status)
        if not looks:
            if lasting:
                ended(conditions, inputs, took, False, w)
            break
        if took > control.step:
            clear = look_back(judge(conditions, w), conditions, inputs, run.control, took, w)
            if clear < 1.0:
                _take_back(system, run)
                h = max(min(clear, 0.5) * took if solved > 0.0 else clear * took, control.step)
                solved = took
                continue
        part = shortened(inputs, run.control, before, took, w) if guarded else 1.0
        if part < 1.0:
            _take_back(system, run)
            h, solved = part * took, took
            continue
        if lasting:
            end = ended(conditions, inputs, took, dated < DATINGS, w)
            if end < clock.time:
                _take_back(system, run)
                h, solved, dated = end - clock.time, took, dated + 1
                continue
        following = min(following, control.step) if solved > 0.0 else following
        break
    clock.next = control.step
    if tol < math.inf:
        clock.next = min(max(following, planned if cut else 0.0), control.longest)
    added = clock.contact_work - work
    if clock.bounced and added > GAINED * abs(work):
        clock.gained += added
    run.verdict[0] = _judge(run, took)
    return SUPPORTED


@inner_kernel
def _states(conditions: Conditions) -> bool:
    """Whether the scene states a condition."""
    return bool(conditions[0].shape[0] > 0)


@system_kernel
def see(system: Any, run: Loop, q: Reals, h: float) -> None:
    """Let conditions read the state that a step of length h led to."""
    s = run.setting
    w, asked = s.watched, run.asked
    time, speeds = w.slots[TIME], w.slots[SPEEDS]
    w.values[time] = s.state.clock[0].time
    copy(q, w.values[time + 1 : speeds])
    copy(s.state.v, w.values[speeds : speeds + len(s.state.v)])
    show_inputs(s.inputs, w)
    if asked.reads[ANYTHING]:
        for k in range(len(asked.place)):
            w.values[w.slots[FORCES] + asked.place[k]] = 0.0
        tell_values(system, asked, q, s.state.v, w.values)
        hear(system, asked, s.state.force, h, w.values)


@kernel
def _judge(run: Loop, h: float) -> int:
    """The verdict on the state after a step of length h: of conditions, of the schedule, of the time."""
    s, conditions, control = run.setting, run.conditions, run.control[0]
    w, clock, count = s.watched, s.state.clock[0], s.inputs.durations.shape[0]
    verdict = judge(conditions, w)
    if _states(conditions):
        goal, danger = margins(conditions, w)
        run.margins[0], run.margins[1] = max(run.margins[0], goal), max(run.margins[1], danger)
    if verdict != RUNNING:
        return int(verdict)
    if switch_inputs(s.inputs, s.buffer, h, w):
        run.verdict[1] = 1
        return TIMEOUT
    if control.ends and clock.segment >= count:
        return MISSED if conditions[2][0, 1] > conditions[2][0, 0] else TIMEOUT
    return TIMEOUT if clock.time >= control.duration * (1.0 - ROUNDING) else RUNNING


@system_kernel
def _keep(system: Any, run: Loop) -> None:
    """Keep the run as it is before a step."""
    s, kept = run.setting, run.kept
    kept.clock[0] = s.state.clock[0]
    copy(s.attempt.q, kept.q)
    copy(s.state.v, kept.v)
    copy(s.state.modes, kept.modes)
    copy(s.state.deformation, kept.deformation)
    copy(s.state.force, kept.force)
    copy(s.state.impulse, kept.impulse)
    copy(s.scratch.limited_force, kept.limited_force)
    copy(s.scratch.limited_mode, kept.limited_mode)
    copy(s.terms.fall, kept.fall)
    copy(s.watched.values, s.watched.begun)
    keep(system)


@system_kernel
def _take_back(system: Any, run: Loop) -> None:
    """Bring back the run as it was kept, but for the counts of attempts and of problems solved, and for votes
    on what keeps steps short."""
    s, kept, clock = run.setting, run.kept, run.setting.state.clock[0]
    attempts, solves, crowd, blamed, votes = (
        clock.attempts, clock.solves, clock.crowd, clock.blamed, clock.votes
    )  # fmt: skip
    s.state.clock[0] = kept.clock[0]
    clock.attempts, clock.solves, clock.crowd = attempts, solves, crowd
    clock.blamed, clock.votes = blamed, votes
    copy(kept.q, s.attempt.q)
    copy(kept.v, s.state.v)
    copy(kept.modes, s.state.modes)
    copy(kept.deformation, s.state.deformation)
    copy(kept.force, s.state.force)
    copy(kept.impulse, s.state.impulse)
    copy(kept.limited_force, s.scratch.limited_force)
    copy(kept.limited_mode, s.scratch.limited_mode)
    copy(kept.fall, s.terms.fall)
    copy(s.watched.begun, s.watched.values)
    take_back(system)


def allocate_margins() -> Reals:
    """Of a run in which nothing was judged yet."""
    return np.full(2, -math.inf)

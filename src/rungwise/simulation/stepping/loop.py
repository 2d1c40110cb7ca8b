"""The loop of a run of any system: inputs, steps, conditions and verdicts, until the run ends or its turn is
over.

The way of one step, from the outside in:

    take_steps     the steps of a turn
    core.run_step  a step, taken back where a condition begins to hold on its way; conditions, schedule
    advance        a step that is as long as it may be: halving, error control
    attempt        one attempt at a length: terms, solution, motion, gaps
    solve_step     the rung's problem; inertia and restitution
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from rungwise.block import Block
from rungwise.kernel import Ints, Reals, RecordArray, copy, system_kernel
from rungwise.simulation.core.loop import TIMEOUT, is_taken, run_step
from rungwise.simulation.core.step import SUPPORTED
from rungwise.simulation.core.tolerances import ROUNDING
from rungwise.simulation.stepping.advance import advance, snaps_on
from rungwise.simulation.stepping.attempt import Setting
from rungwise.simulation.stepping.record import Recorded, record
from rungwise.simulation.watched.inputs import show_inputs
from rungwise.simulation.watched.values import FORCES, SPEEDS, TIME, Conditions
from rungwise.simulation.watched.verdicts import RUNNING
from rungwise.system.contract import hear, keep, take_back, tell_values
from rungwise.system.moving import ANYTHING, Asked

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
        if not record(system, run.setting, run.asked, run.margins, run.recorded, run.verdict[0] != RUNNING):
            return FULL
    return SUPPORTED


@system_kernel
def advance_loop(system: Any, run: Loop, h: float) -> int:
    """Take a step (see `core.loop`), unless what leapt in the last one goes on."""
    s, control = run.setting, run.control[0]
    clock, work = s.state.clock[0], s.state.clock[0].contact_work
    if clock.leapt > 0.0:
        status = snaps_on(system, s, h)
        if status != SUPPORTED:
            return int(status)
    tol = control.error if control.error > 0.0 else math.inf
    status = advance(system, s, h, tol, run.asked.reads[ANYTHING] != 0)
    if is_taken(status):
        added = clock.contact_work - work
        if clock.bounced and added > GAINED * abs(work):
            clock.gained += added
    return int(status)


@system_kernel
def see_state(system: Any, run: Loop, h: float) -> None:
    """Let conditions read the state that a step of length h led to."""
    s = run.setting
    w, asked = s.watched, run.asked
    q, time, speeds = s.attempt.q, w.slots[TIME], w.slots[SPEEDS]
    w.values[time] = s.state.clock[0].time
    copy(q, w.values[time + 1 : speeds])
    copy(s.state.v, w.values[speeds : speeds + len(s.state.v)])
    show_inputs(s.inputs, w)
    if asked.reads[ANYTHING]:
        for k in range(len(asked.place)):
            w.values[w.slots[FORCES] + asked.place[k]] = 0.0
        tell_values(system, asked, q, s.state.v, w.values)
        hear(system, asked, s.state.force, h, w.values)


@system_kernel
def spent_loop(_system: Any, run: Loop, _waits: bool) -> int:
    """The verdict where the time is over."""
    control = run.control[0]
    over = run.setting.state.clock[0].time >= control.duration * (1.0 - ROUNDING)
    return TIMEOUT if over else RUNNING


@system_kernel
def keep_loop(system: Any, run: Loop) -> None:
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
    keep(system)


@system_kernel
def take_back_loop(system: Any, run: Loop) -> None:
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
    take_back(system)


def allocate_margins() -> Reals:
    """Of a run in which nothing was judged yet."""
    return np.full(2, -math.inf)

"""A step of a run of any system: inputs, conditions, schedule, and verdict, around what takes steps.

How a step ended: TAKEN; taken for the last time, as SUNK (a contact yields too far for its model) or NOWHERE
(steps lead nowhere, see `core.crawl`); UNSUPPORTED or UNSOLVED, however short; or for other reasons, which
are the system's own.
"""

from __future__ import annotations

import math
from typing import Any

from rungwise.kernel import copy, inner_kernel, kernel, system_kernel
from rungwise.outcome import Code
from rungwise.simulation.core.step import SUPPORTED, UNSOLVED, UNSUPPORTED
from rungwise.simulation.watched.held_since import DATINGS, is_over, lasts
from rungwise.simulation.watched.inputs import (
    is_guarded,
    shortened,
    show_inputs,
    switch_inputs,
    until_lasts,
    until_margin,
)
from rungwise.simulation.watched.values import TIME, Conditions
from rungwise.simulation.watched.verdicts import (
    RUNNING,
    ended,
    first_times,
    judge,
    look_back,
    margins,
    next_end,
)
from rungwise.system.contract import keep_run, see, spent, take_back_run, take_step

TAKEN, SUNK, NOWHERE = SUPPORTED, 8, 9
INVALID, TIMEOUT = int(Code.INVALID), int(Code.TIMEOUT)


@inner_kernel
def is_taken(status: int) -> bool:
    """Whether a step was taken."""
    return status in (TAKEN, SUNK, NOWHERE)


@system_kernel
def begin_run(system: Any, run: Any) -> None:
    """Read and judge the state with which a run begins; segments whose condition holds already end there."""
    see(system, run, 0.0)
    possible = first_times(run.conditions, run.setting.inputs, run.setting.watched)
    run.verdict[0] = _judge(run, 0.0) if possible else INVALID


@system_kernel
def run_step(system: Any, run: Any) -> int:
    """Take a step, or a shorter one where a condition begins to hold within it, and judge where it led;
    returns how it ended.

    A step longer than a nominal step ends before a condition holds, so that the condition's beginning is
    known to a nominal step.
    """
    w, inputs, conditions, control = run.setting.watched, run.setting.inputs, run.conditions, run.control[0]
    clock = w.clock[0]
    guarded, lasting, stop = is_guarded(inputs, w), lasts(conditions) or until_lasts(inputs), clock.switch
    if lasting:
        stop = min(stop, next_end(conditions, inputs, -math.inf, w))
    planned = min(clock.next, control.longest)
    h = min(planned, control.duration - clock.time, stop - clock.time)
    cut = stop - clock.time < planned
    looks = guarded or lasting or (_is_stated(conditions) and h > control.step)
    if looks:
        copy(w.values, w.begun)
        keep_run(system, run)
    before = until_margin(inputs, w) if guarded else -math.inf
    solved, dated, waits = 0.0, 0, False
    while True:
        status = take_step(system, run, h)
        if solved > 0.0 and status in (UNSUPPORTED, UNSOLVED):
            # What a longer step solves is not given up for its date.
            _take_back(system, run)
            h, solved, looks = solved, 0.0, False
            continue
        if not is_taken(status):
            clock.next = planned
            if w.undefined[0] < 0:  # or else it is told when a number is not finite
                w.values[w.slots[TIME]] = clock.time
                show_inputs(inputs, w)
            return int(status)
        took, following = clock.taken, clock.next
        see(system, run, took)
        if looks and took > control.step:
            clear = look_back(judge(conditions, w), conditions, inputs, run.control, took, w)
            if clear < 1.0:
                _take_back(system, run)
                h = max(min(clear, 0.5) * took if solved > 0.0 else clear * took, control.step)
                solved = took
                continue
        part = shortened(inputs, run.control, before, took, w) if guarded and looks else 1.0
        if part < 1.0:
            _take_back(system, run)
            h, solved = part * took, took
            continue
        if lasting:
            end = ended(conditions, inputs, took, looks and dated < DATINGS, w)
            if end < clock.time:
                _take_back(system, run)
                h, solved, dated, stop, cut = end - clock.time, took, dated + 1, end, True
                continue
            waits = end < math.inf
        break
    clock.next = control.step if solved > 0.0 else following
    if cut and following >= took and is_over(stop, clock.time, took):
        clock.next = max(clock.next, planned)
    if status != TAKEN:
        return int(status)
    run.verdict[0] = _judge(run, took)
    if run.verdict[0] == RUNNING:
        run.verdict[0] = spent(system, run, waits)
    return TAKEN


@inner_kernel
def _is_stated(conditions: Conditions) -> bool:
    """Whether the scene states a condition."""
    return bool(conditions[0].shape[0] > 0)


@kernel
def _judge(run: Any, h: float) -> int:
    """The verdict on the state after a step of length h: of conditions, and of the schedule."""
    s, w, conditions = run.setting, run.setting.watched, run.conditions
    verdict = judge(conditions, w)
    if run.margins.shape[0] > 0 and _is_stated(conditions):
        aim, danger = margins(conditions, w)
        run.margins[0], run.margins[1] = max(run.margins[0], aim), max(run.margins[1], danger)
    if verdict != RUNNING:
        return int(verdict)
    if switch_inputs(s.inputs, s.buffer, h, w):
        run.verdict[1] = 1
        return TIMEOUT
    if run.control[0].ends and w.clock[0].segment >= s.inputs.durations.shape[0]:
        return int(run.control[0].ends)
    return RUNNING


@system_kernel
def _take_back(system: Any, run: Any) -> None:
    """Bring back the run as it was before the step."""
    copy(run.setting.watched.begun, run.setting.watched.values)
    run.verdict[0] = RUNNING
    take_back_run(system, run)

"""Verdicts of conditions on a state, and on the way of a step."""

from __future__ import annotations

import math

from rungwise.kernel import RecordArray, copy, inner_kernel, kernel, rare_kernel
from rungwise.outcome import Code
from rungwise.scene.language.expression import TIMES, evaluate, holds
from rungwise.simulation.watched.held_since import (
    REACHED,
    STATED,
    has_turned,
    interpolate,
    is_possible,
    lasts,
    note_times,
    times_end,
)
from rungwise.simulation.watched.inputs import (
    OWN,
    Inputs,
    note_until,
    until_end,
    until_lasts,
    until_margin,
    until_row,
)
from rungwise.simulation.watched.values import TIME, Conditions, Watched

RUNNING, GOAL, UNSAFE, DOOMED = int(Code.RUNNING), int(Code.GOAL), int(Code.UNSAFE), int(Code.DOOMED)
SIGHTS = 10
"""How often conditions are looked at in a step of the greatest length."""


@inner_kernel
def judge(conditions: Conditions, w: Watched) -> int:
    """Verdict of the scene's conditions: unsafe before goal before doomed; a condition not stated has no
    program."""
    w.values[w.slots[TIME]] = w.clock[0].time
    return _verdict(conditions, w)


@kernel
def _verdict(conditions: Conditions, w: Watched) -> int:
    code, constants, table = conditions
    for index, verdict in ((1, UNSAFE), (0, GOAL), (2, DOOMED)):
        first, last = table[index, 0], table[index, 1]
        if last > first and holds(code, constants, first, last, w.values, w.stack):
            return verdict
    return RUNNING


@kernel
def margins(conditions: Conditions, w: Watched) -> tuple[float, float]:
    """Signed margins, in the state last judged, of the goal, and of the unsafe or the doomed condition,
    whichever is nearer: a condition holds from 0 on; -inf where none is stated."""
    code, constants, table = conditions
    goal, danger = -math.inf, -math.inf
    for index in range(3):
        first, last = table[index, 0], table[index, 1]
        if last > first:
            found = evaluate(code, constants, first, last, w.values, w.stack)
            if index == 0:
                goal = found
            elif found > danger:
                danger = found
    return goal, danger


@kernel
def look_back(
    verdict: int,
    conditions: Conditions,
    inputs: Inputs,
    control: RecordArray,
    h: float,
    w: Watched,
) -> float:
    """Part of the step just taken, of length h, up to which no condition holds, neither one of the scene nor
    the one that ends the present segment, and no part turns that must hold for a time; 1 if there is none.

    `verdict` is that of its end; `begun` holds the values that conditions read at its start. Between
    start and end places and gaps are linear in time, looked at `SIGHTS` times in a step of the greatest
    length, and the first condition is dated to a quarter of the nominal step.
    """
    copy(w.values, w.ended)
    count = max(1, math.ceil(SIGHTS * h / control[0].longest - 1e-9))
    before, after = 0.0, 1.0
    found = verdict != RUNNING or until_margin(inputs, w) >= 0.0
    lasting = lasts(conditions) or until_lasts(inputs)
    found |= lasting and _turns(conditions, inputs, w)
    for k in range(1, count):
        interpolate(k / count, h, w)
        if _is_met(conditions, inputs, lasting, w):
            after, found = k / count, True
            break
        before = k / count
    while found and (after - before) * h > 0.25 * control[0].step:
        middle = 0.5 * (before + after)
        if not before < middle < after:
            break
        interpolate(middle, h, w)
        if _is_met(conditions, inputs, lasting, w):
            after = middle
        else:
            before = middle
    copy(w.ended, w.values)
    return before if found else 1.0


@kernel
def _is_met(conditions: Conditions, inputs: Inputs, lasting: bool, w: Watched) -> bool:
    """Whether a condition holds or, where some are `lasting`, a part turned that must hold for a time."""
    met = _verdict(conditions, w) != RUNNING or until_margin(inputs, w) >= 0.0
    return met or (lasting and _turns(conditions, inputs, w))


@rare_kernel
def _turns(conditions: Conditions, inputs: Inputs, w: Watched) -> bool:
    """Whether some part that must hold for a time turned on the way of the step."""
    code, constants, table = conditions
    if lasts(conditions) and has_turned(code, constants, table, STATED, 0, OWN, w):
        return True
    return until_lasts(inputs) and has_turned(
        inputs.code, inputs.constants, inputs.table, until_row(inputs, w), OWN, TIMES, w
    )


@kernel
def first_times(conditions: Conditions, inputs: Inputs, w: Watched) -> bool:
    """Note at the beginning of a run what holds; returns whether times to hold for are possible."""
    now = w.clock[0].time
    code, constants, table = conditions
    w.values[w.slots[TIME]] = now
    if lasts(conditions):
        if not is_possible(code, constants, table, STATED, OWN, w):
            return False
        note_times(code, constants, table, STATED, 0, OWN, 0.0, w)
        times_end(code, constants, table, STATED, 0, OWN, now, w)
    if until_lasts(inputs):
        s = inputs.durations.shape[0]
        if not is_possible(inputs.code, inputs.constants, inputs.table, s, TIMES * s, w):
            return False
        note_until(inputs, 0.0, w)
        until_end(inputs, now, w)
    return True


@kernel
def note_all(conditions: Conditions, inputs: Inputs, h: float, w: Watched) -> None:
    """Note, after a step of length h, since when parts hold that must hold for a time."""
    if lasts(conditions):
        note_times(conditions[0], conditions[1], conditions[2], STATED, 0, OWN, h, w)
    if until_lasts(inputs):
        note_until(inputs, h, w)


@kernel
def next_end(conditions: Conditions, inputs: Inputs, reached: float, w: Watched) -> float:
    """When the first part will have held long enough, inf if none waits; those that have by the time
    `reached` do from now on."""
    soonest = math.inf
    if lasts(conditions):
        soonest = times_end(conditions[0], conditions[1], conditions[2], STATED, 0, OWN, reached, w)
    if until_lasts(inputs):
        soonest = min(soonest, until_end(inputs, reached, w))
    return soonest


@rare_kernel
def ended(conditions: Conditions, inputs: Inputs, h: float, exact: bool, w: Watched) -> float:
    """Note since when parts of conditions hold, after a step of length h; returns when the first of them will
    have held long enough, inf if none waits. With `exact` this may be within the step, which is then to be
    taken back."""
    now = w.clock[0].time
    note_all(conditions, inputs, h, w)
    end = next_end(conditions, inputs, -math.inf, w)
    if exact and now - h < end < now - REACHED * h:
        return end
    return next_end(conditions, inputs, now + REACHED * h, w)

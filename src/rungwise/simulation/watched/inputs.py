"""Inputs over time: a schedule's segments, their switches, and the numbers that follow the inputs."""

from __future__ import annotations

import math

import numpy as np

from rungwise.block import Block
from rungwise.kernel import Ints, Reals, RecordArray, inner_kernel, kernel
from rungwise.scene.language.expression import SLOTS, TIMES, Programs, evaluate
from rungwise.scene.template.numbers import evaluate_numbers
from rungwise.scene.template.template import Numbers, block_of
from rungwise.simulation.watched.held_since import clear_times, is_over, note_times, times_end
from rungwise.simulation.watched.values import TIME, Watched

LOCATED = 1e-3
"""Part of the nominal step to which the time is known at which a segment's condition begins to hold."""
OWN = SLOTS - TIMES
"""Slots of times since when parts of the scene's own conditions have held, before those of a segment's."""


class Inputs(Block):
    """The numbers that change during a run, and the schedule of the inputs (u,) that they read, in s
    segments.

    speeds     programs of the speeds of drives, which a step takes as they are in its middle
    numbers    programs of the other numbers
    timed      (2,)    whether some number reads t, and whether a condition of the scene does
    rests      (1,)    whether some condition asks for rest
    columns    (u,)    where expressions read the inputs
    durations  (s,)    lengths of the segments; time-outs of segments that end with a condition
    levels     (s, u)  inputs in a segment, or at its end where it ramps; nan: as before
    ramps      (s,)    whether the inputs of a segment go to their levels linearly
    code, constants, table (s, 2)  programs of the conditions that end segments; empty for the others; where
               some part of them must hold for a time, for each of `TIMES` slots of each segment a program of
               that part and one of its time
    """

    speeds: Numbers
    numbers: Numbers
    timed: Ints
    rests: Ints
    columns: Ints
    durations: Reals
    levels: Reals
    ramps: Ints
    code: Ints
    constants: Reals
    table: Ints


def no_inputs() -> Inputs:
    """The schedule of a run whose numbers stay as they are."""
    nothing, none, empty = block_of(Programs([]), np.zeros(0, np.int64)), np.zeros(0, np.int64), Programs([])
    return Inputs(
        speeds=nothing, numbers=nothing, timed=np.zeros(2, np.int64), rests=np.zeros(1, np.int64),
        columns=none, durations=np.zeros(0), levels=np.zeros((0, 0)), ramps=none,
        code=empty.code, constants=empty.constants, table=empty.table,
    )  # fmt: skip


@kernel
def begin_inputs(inputs: Inputs, buffer: Reals, w: Watched) -> None:
    """Begin the schedule now, at its first segment that lasts."""
    clock = w.clock[0]
    clock.segment, clock.opened = 0, clock.time if inputs.durations.shape[0] > 0 else 0.0
    _enter(inputs, buffer, False, w)


@kernel
def switch_inputs(inputs: Inputs, buffer: Reals, h: float, w: Watched) -> bool:
    """After a step of length h, begin the next segment where this one has ended; returns whether it ran out
    of time before its condition held."""
    clock = w.clock[0]
    if clock.segment >= inputs.durations.shape[0]:
        return False
    over = is_over(clock.switch, clock.time, h)
    if over:
        clock.time = clock.switch
        _set_levels(inputs, w, clock.switch)
    ended = until_margin(inputs, w) >= 0.0
    if not ended and not over:
        return False
    if not ended and is_guarded(inputs, w):
        return True
    clock.segment += 1
    _enter(inputs, buffer, True, w)
    return not clock.switch > clock.time


@kernel
def _enter(inputs: Inputs, buffer: Reals, looks: bool, w: Watched) -> None:
    """Begin the segment `clock.segment`, or the first one after it that lasts; if it `looks`, a segment whose
    condition holds already does not."""
    clock = w.clock[0]
    while clock.segment < inputs.durations.shape[0]:
        k = clock.segment
        clock.switched, clock.switch = clock.time, clock.time + inputs.durations[k]
        clock.varies = inputs.timed[0] or inputs.ramps[k]
        for j in range(inputs.columns.shape[0]):
            w.levels[j] = w.values[inputs.columns[j]]
        w.values[w.slots[TIME]] = clock.time
        if until_lasts(inputs):
            clear_times(OWN, w)
            note_until(inputs, 0.0, w)
            until_end(inputs, clock.time, w)
        held = looks and until_margin(inputs, w) >= 0.0
        if (clock.switch > clock.time or is_guarded(inputs, w)) and not held:
            break
        _set_levels(inputs, w, clock.time if held else clock.switch)
        clock.segment += 1
    if clock.segment == inputs.durations.shape[0]:
        clock.switched, clock.switch = 0.0, math.inf
        clock.varies = inputs.timed[0]
    else:
        _set_levels(inputs, w, clock.time)
    set_all(inputs, buffer, w)


@kernel
def _set_levels(inputs: Inputs, w: Watched, time: float) -> None:
    """Write the inputs at this time of the present segment where expressions read them."""
    clock = w.clock[0]
    k = clock.segment
    part = 1.0
    if inputs.ramps[k] and time < clock.switch:
        part = (time - clock.switched) / (clock.switch - clock.switched)
    for j in range(inputs.columns.shape[0]):
        level = inputs.levels[k, j]
        if not math.isnan(level):
            before = (1.0 - part) * w.levels[j] if part < 1.0 else 0.0
            w.values[inputs.columns[j]] = before + part * level


@kernel
def show_inputs(inputs: Inputs, w: Watched) -> None:
    """Let conditions read the inputs as they are now."""
    clock = w.clock[0]
    if clock.varies and clock.segment < inputs.durations.shape[0]:
        _set_levels(inputs, w, clock.time)


@kernel
def set_numbers(inputs: Inputs, buffer: Reals, h: float, theta: float, w: Watched) -> None:
    """Set the numbers that vary in the present segment for a step of length h: speeds as in its middle, so
    that ways are of second order, the others at theta."""
    clock = w.clock[0]
    if not clock.varies:
        return
    set_speeds(inputs, buffer, clock.time + 0.5 * h, w)
    if w.undefined[0] < 0:
        set_rest(inputs, buffer, clock.time + theta * h, w)


@kernel
def set_speeds(inputs: Inputs, buffer: Reals, time: float, w: Watched) -> None:
    """Set speeds as they are at a time of the present segment."""
    _set_time(inputs, time, w)
    w.undefined[0] = _evaluate(inputs.speeds, buffer, w)


@kernel
def set_rest(inputs: Inputs, buffer: Reals, time: float, w: Watched) -> None:
    """Set all other numbers as they are at a time of the present segment."""
    _set_time(inputs, time, w)
    w.undefined[0] = _evaluate(inputs.numbers, buffer, w)


@kernel
def _set_time(inputs: Inputs, time: float, w: Watched) -> None:
    """Let expressions read the time, and the inputs at that time."""
    w.values[w.slots[TIME]] = time
    if w.clock[0].segment < inputs.durations.shape[0]:
        _set_levels(inputs, w, time)


@kernel
def set_all(inputs: Inputs, buffer: Reals, w: Watched) -> None:
    """Set all numbers that read t or inputs as they are now."""
    speeds = _evaluate(inputs.speeds, buffer, w)
    w.undefined[0] = max(_evaluate(inputs.numbers, buffer, w), speeds)


@kernel
def _evaluate(numbers: Numbers, buffer: Reals, w: Watched) -> int:
    return evaluate_numbers(numbers, w.values, w.stack, buffer)


@inner_kernel
def is_guarded(inputs: Inputs, w: Watched) -> bool:
    """Whether a condition ends the present segment."""
    k = w.clock[0].segment
    return bool(k < inputs.durations.shape[0] and inputs.table[k, 1] > inputs.table[k, 0])


@inner_kernel
def until_lasts(inputs: Inputs) -> bool:
    """Whether some part of a segment's condition must hold for a time."""
    return bool(inputs.table.shape[0] > inputs.durations.shape[0])


@inner_kernel
def until_row(inputs: Inputs, w: Watched) -> int:
    """Where the programs of such parts begin in the table, of the present segment or, after the last one, of
    that."""
    s = inputs.durations.shape[0]
    return int(s + 2 * TIMES * min(w.clock[0].segment, s - 1))


@kernel
def note_until(inputs: Inputs, h: float, w: Watched) -> None:
    """Note since when parts of the segment's condition hold, after a step of length h (see `note_times`)."""
    row = until_row(inputs, w)
    note_times(inputs.code, inputs.constants, inputs.table, row, OWN, TIMES, h, w)


@kernel
def until_end(inputs: Inputs, reached: float, w: Watched) -> float:
    """When the first part of the segment's condition will have held long enough (see `times_end`)."""
    row = until_row(inputs, w)
    return times_end(inputs.code, inputs.constants, inputs.table, row, OWN, TIMES, reached, w)


@kernel
def until_margin(inputs: Inputs, w: Watched) -> float:
    """Signed margin of the condition that ends the present segment; -inf where there is none."""
    if not is_guarded(inputs, w):
        return -math.inf
    first, last = inputs.table[w.clock[0].segment, 0], inputs.table[w.clock[0].segment, 1]
    return evaluate(inputs.code, inputs.constants, first, last, w.values, w.stack)


@kernel
def shortened(inputs: Inputs, control: RecordArray, before: float, h: float, w: Watched) -> float:
    """The part of a step of length h to take instead, so that a segment's condition, whose margin was
    `before` at the start, does not hold long before the step's end; 1 where the step may stay."""
    after = until_margin(inputs, w)
    if not after >= 0.0 or h <= LOCATED * control[0].step:
        return 1.0
    part = before / (before - after)
    return min(max(part, 0.1), 0.5) if math.isfinite(part) else 0.5

"""Inputs over time: a schedule's segments, their switches, and the numbers that follow the inputs."""

from __future__ import annotations

import math

from rungwise.block import Block
from rungwise.kernel import Ints, Reals, RecordArray, inner_kernel, kernel
from rungwise.scene.language.expression import SLOTS, TIMES, evaluate
from rungwise.scene.template.numbers import evaluate_numbers
from rungwise.scene.template.template import Numbers
from rungwise.simulation.planar.state.held_since import clear_times, is_over, note_times, times_end
from rungwise.simulation.planar.state.workspace import State, Workspace, time_slot

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


@kernel
def begin_inputs(inputs: Inputs, buffer: Reals, workspace: Workspace) -> None:
    """Begin the schedule now, at its first segment that lasts."""
    clock = workspace.state.clock[0]
    clock.segment, clock.opened = 0, clock.time if inputs.durations.shape[0] > 0 else 0.0
    _enter(inputs, buffer, False, workspace)


@kernel
def switch_inputs(inputs: Inputs, buffer: Reals, h: float, workspace: Workspace) -> bool:
    """After a step of length h, begin the next segment where this one has ended; returns whether it ran out
    of time before its condition held."""
    clock = workspace.state.clock[0]
    if clock.segment >= inputs.durations.shape[0]:
        return False
    over = is_over(clock.switch, clock.time, h)
    if over:
        clock.time = clock.switch
        if clock.lifts:
            _set_levels(inputs, workspace.state, clock.switch)
    ended = until_margin(inputs, workspace) >= 0.0
    if not ended and not over:
        return False
    if not ended and is_guarded(inputs, workspace.state):
        return True
    clock.segment += 1
    _enter(inputs, buffer, True, workspace)
    return False


@kernel
def _enter(inputs: Inputs, buffer: Reals, looks: bool, workspace: Workspace) -> None:
    """Begin the segment `clock.segment`, or the first one after it that lasts; if it `looks`, a segment whose
    condition holds already does not."""
    state = workspace.state
    clock = state.clock[0]
    while clock.segment < inputs.durations.shape[0]:
        k = clock.segment
        clock.switched, clock.switch = clock.time, clock.time + inputs.durations[k]
        clock.varies = inputs.timed[0] or inputs.ramps[k]
        for j in range(inputs.columns.shape[0]):
            state.levels[j] = state.values[inputs.columns[j]]
        state.values[time_slot(state)] = clock.time
        if until_lasts(inputs):
            clear_times(OWN, state)
            note_until(inputs, 0.0, workspace)
            until_end(inputs, clock.time, workspace)
        held = looks and until_margin(inputs, workspace) >= 0.0
        if clock.switch > clock.time and not held:
            break
        _set_levels(inputs, state, clock.time if held else clock.switch)
        clock.segment += 1
    if clock.segment == inputs.durations.shape[0]:
        clock.switched, clock.switch = 0.0, math.inf
        clock.varies = inputs.timed[0]
    else:
        _set_levels(inputs, state, clock.time)
    set_all(inputs, buffer, workspace)


@kernel
def _set_levels(inputs: Inputs, state: State, time: float) -> None:
    """Write the inputs at this time of the present segment where expressions read them."""
    clock = state.clock[0]
    k = clock.segment
    part = 1.0
    if inputs.ramps[k] and time < clock.switch:
        part = (time - clock.switched) / (clock.switch - clock.switched)
    for j in range(inputs.columns.shape[0]):
        level = inputs.levels[k, j]
        if not math.isnan(level):
            before = (1.0 - part) * state.levels[j] if part < 1.0 else 0.0
            state.values[inputs.columns[j]] = before + part * level


@kernel
def show_inputs(inputs: Inputs, state: State) -> None:
    """Let conditions read the inputs as they are now."""
    clock = state.clock[0]
    if clock.varies and clock.segment < inputs.durations.shape[0]:
        _set_levels(inputs, state, clock.time)


@kernel
def set_numbers(inputs: Inputs, buffer: Reals, h: float, theta: float, workspace: Workspace) -> None:
    """Set the numbers that vary in the present segment for a step of length h: speeds as in its middle, so
    that ways are of second order, the others at theta."""
    clock, scratch = workspace.state.clock[0], workspace.scratch
    if not clock.varies:
        return
    _set_time(inputs, clock.time + 0.5 * h, workspace.state)
    scratch.undefined[0] = _evaluate(inputs.speeds, buffer, workspace)
    if scratch.undefined[0] < 0:
        _set_time(inputs, clock.time + theta * h, workspace.state)
        scratch.undefined[0] = _evaluate(inputs.numbers, buffer, workspace)


@kernel
def _set_time(inputs: Inputs, time: float, state: State) -> None:
    """Let expressions read the time, and the inputs at that time."""
    state.values[time_slot(state)] = time
    if state.clock[0].segment < inputs.durations.shape[0]:
        _set_levels(inputs, state, time)


@kernel
def set_all(inputs: Inputs, buffer: Reals, workspace: Workspace) -> None:
    """Set all numbers that read t or inputs as they are now."""
    speeds = _evaluate(inputs.speeds, buffer, workspace)
    workspace.scratch.undefined[0] = max(_evaluate(inputs.numbers, buffer, workspace), speeds)


@kernel
def _evaluate(numbers: Numbers, buffer: Reals, workspace: Workspace) -> int:
    return evaluate_numbers(numbers, workspace.state.values, workspace.scratch.stack, buffer)


@inner_kernel
def is_guarded(inputs: Inputs, state: State) -> bool:
    """Whether a condition ends the present segment."""
    k = state.clock[0].segment
    return bool(k < inputs.durations.shape[0] and inputs.table[k, 1] > inputs.table[k, 0])


@inner_kernel
def until_lasts(inputs: Inputs) -> bool:
    """Whether some part of a segment's condition must hold for a time."""
    return bool(inputs.table.shape[0] > inputs.durations.shape[0])


@inner_kernel
def until_row(inputs: Inputs, state: State) -> int:
    """Where the programs of such parts begin in the table, of the present segment or, after the last one, of
    that."""
    s = inputs.durations.shape[0]
    return int(s + 2 * TIMES * min(state.clock[0].segment, s - 1))


@kernel
def note_until(inputs: Inputs, h: float, workspace: Workspace) -> None:
    """Note since when parts of the segment's condition hold, after a step of length h (see `note_times`)."""
    state, row = workspace.state, until_row(inputs, workspace.state)
    note_times(inputs.code, inputs.constants, inputs.table, row, OWN, TIMES, h, state, workspace.scratch)


@kernel
def until_end(inputs: Inputs, reached: float, workspace: Workspace) -> float:
    """When the first part of the segment's condition will have held long enough (see `times_end`)."""
    state, row = workspace.state, until_row(inputs, workspace.state)
    return times_end(
        inputs.code, inputs.constants, inputs.table, row, OWN, TIMES, reached, state, workspace.scratch
    )


@kernel
def until_margin(inputs: Inputs, workspace: Workspace) -> float:
    """Signed margin of the condition that ends the present segment; -inf where there is none."""
    state = workspace.state
    if not is_guarded(inputs, state):
        return -math.inf
    first, last = inputs.table[state.clock[0].segment, 0], inputs.table[state.clock[0].segment, 1]
    return evaluate(inputs.code, inputs.constants, first, last, state.values, workspace.scratch.stack)


@kernel
def shortened(inputs: Inputs, control: RecordArray, before: float, h: float, workspace: Workspace) -> float:
    """The part of a step of length h to take instead, so that a segment's condition, whose margin was
    `before` at the start, does not hold long before the step's end; 1 where the step may stay."""
    after = until_margin(inputs, workspace)
    if not after >= 0.0 or h <= LOCATED * control[0].step:
        return 1.0
    part = before / (before - after)
    return min(max(part, 0.1), 0.5) if math.isfinite(part) else 0.5

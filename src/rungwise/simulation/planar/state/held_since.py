"""Since when parts of conditions hold that must hold for a time (see `Lasting`)."""

from __future__ import annotations

import math

from rungwise.kernel import Ints, Reals, copy, inner_kernel, kernel, rare_kernel
from rungwise.scene.language.expression import evaluate, holds
from rungwise.scene.template.records import FREE, HINGE, Records
from rungwise.simulation.planar.state.workspace import Conditions, Scratch, State, time_slot
from rungwise.system.planar.place import coordinate_count

REACHED = 1e-9
"""Part of a step that is rounding between its end and a switch, or the end of a time to hold for."""
ULPS = 1e-15
"""Part of a time that is rounding of it: steps that are no longer do not lead on."""
HALVES = 60
"""Halvings of a step with which the time at which a part of a condition begins to hold is found: to
rounding."""
DATINGS = 3
"""A step is taken back this many times at most, so that it ends where a condition has held long enough."""
STATED = 3
"""Conditions that a scene states, before those of its schedule."""


@inner_kernel
def is_over(end: float, time: float, h: float) -> bool:
    """Whether a time has come to which a step of length h led, up to rounding."""
    return end - time <= max(REACHED * h, ULPS * abs(end))


@inner_kernel
def lasts(conditions: Conditions) -> bool:
    """Whether some part of the scene's conditions must hold for a time."""
    return bool(conditions[2].shape[0] > STATED)


@inner_kernel
def clear_times(first: int, state: State) -> None:
    """Let nothing hold, from this slot on."""
    for slot in range(first, state.dates.shape[0]):
        state.dates[slot] = math.inf


@kernel
def set_ways(records: Records, state: State) -> None:
    """How far the farthest point of each body goes in a nominal step at the velocities of the state."""
    for b in range(records.bodies.shape[0]):
        body = records.bodies[b]
        count = coordinate_count(body)
        speed, spin = 0.0, 0.0
        if count > 0:
            speed = abs(state.v[body.coordinate])
        if body.motion == HINGE:
            speed, spin = 0.0, speed
        elif body.motion == FREE:
            speed = math.hypot(speed, state.v[body.coordinate + 1])
            spin = abs(state.v[body.coordinate + 2])
        if spin > 0.0:
            reach = 0.0
            for s in range(body.first_shape, body.end_shape):
                reach = max(reach, records.shapes[s].reach)
            if body.motion == HINGE:
                reach += math.hypot(body.x - body.pivot_x, body.y - body.pivot_y)
            speed += spin * reach
        state.ways[b] = records.world[0].step * speed


@kernel
def is_possible(
    code: Ints, constants: Reals, table: Ints, first: int, count: int, state: State, scratch: Scratch
) -> bool:
    """Whether the times to hold for, of `count` slots whose programs begin at the row `first`, are times."""
    for j in range(count):
        row = first + 2 * j + 1
        begin, end = table[row, 0], table[row, 1]
        if end > begin:
            time = evaluate(code, constants, begin, end, state.values, scratch.stack)
            if not 0.0 <= time < math.inf:
                return False
    return True


@kernel
def has_turned(
    code: Ints, constants: Reals, table: Ints, first: int, slot: int, count: int, state: State,
    scratch: Scratch,
) -> bool:  # fmt: skip
    """Whether some part holds that did not at the start of the step, or the other way round."""
    for j in range(count):
        begin, end = table[first + 2 * j, 0], table[first + 2 * j, 1]
        if end > begin:
            now = holds(code, constants, begin, end, state.values, scratch.stack)
            if now != (state.dates[slot + j] < math.inf):
                return True
    return False


@kernel
def note_times(
    code: Ints, constants: Reals, table: Ints, first: int, slot: int, count: int, h: float, state: State,
    scratch: Scratch,
) -> None:  # fmt: skip
    """Note since when parts hold at the end of a step of length h, which began at `scratch.begun`; since now
    where h is 0."""
    for j in range(count):
        begin, end = table[first + 2 * j, 0], table[first + 2 * j, 1]
        if end == begin:
            continue
        if not holds(code, constants, begin, end, state.values, scratch.stack):
            state.dates[slot + j] = math.inf
        elif state.dates[slot + j] == math.inf:
            now = state.clock[0].time
            state.dates[slot + j] = (
                now if h == 0.0 else _turned(code, constants, begin, end, h, state, scratch)
            )


@kernel
def times_end(
    code: Ints, constants: Reals, table: Ints, first: int, slot: int, count: int, reached: float,
    state: State, scratch: Scratch,
) -> float:  # fmt: skip
    """When the first part will have held long enough, inf if none waits; those that have by the time
    `reached` do from now on."""
    soonest = math.inf
    for j in range(count):
        since = float(state.dates[slot + j])
        if not math.isfinite(since):
            continue
        row = first + 2 * j + 1
        time = evaluate(code, constants, table[row, 0], table[row, 1], state.values, scratch.stack)
        over = since + time if time > 0.0 else -math.inf
        if over <= reached:
            state.dates[slot + j] = -math.inf
        else:
            soonest = min(soonest, float(over))
    return soonest


@rare_kernel
def _turned(
    code: Ints, constants: Reals, begin: int, end: int, h: float, state: State, scratch: Scratch
) -> float:
    """When a part began to hold on the way of a step (see `interpolate`)."""
    copy(state.values, scratch.ended)
    low, high = 0.0, 1.0
    for _ in range(HALVES):
        middle = 0.5 * (low + high)
        if not low < middle < high:
            break
        interpolate(middle, h, state, scratch)
        if holds(code, constants, begin, end, state.values, scratch.stack):
            high = middle
        else:
            low = middle
    copy(scratch.ended, state.values)
    return float(state.clock[0].time - (1.0 - high) * h)


@inner_kernel
def interpolate(part: float, h: float, state: State, scratch: Scratch) -> None:
    """Places, gaps and time at a part of the last step, linear in time; speeds and forces are those of its
    end."""
    n, contacts, at = state.q.shape[0], state.manifolds.gaps.shape[0], time_slot(state)
    state.values[at] = state.clock[0].time - (1.0 - part) * h
    for i in range(at + 1, at + 1 + n):
        state.values[i] = part * scratch.ended[i] + (1.0 - part) * scratch.begun[i]
    for i in range(at + 1 + 2 * n, at + 1 + 2 * n + contacts):
        far = math.isinf(scratch.ended[i]) or math.isinf(scratch.begun[i])
        state.values[i] = (
            scratch.ended[i] if far else part * scratch.ended[i] + (1.0 - part) * scratch.begun[i]
        )

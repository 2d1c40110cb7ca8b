"""Since when parts of conditions hold that must hold for a time (see `Lasting`)."""

from __future__ import annotations

import math

from rungwise.kernel import Ints, Reals, copy, inner_kernel, kernel, rare_kernel
from rungwise.scene.language.expression import evaluate, holds
from rungwise.simulation.watched.values import FORCES, POSES, SPEEDS, TIME, Conditions, Watched

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
def clear_times(first: int, w: Watched) -> None:
    """Let nothing hold, from this slot on."""
    for slot in range(first, w.dates.shape[0]):
        w.dates[slot] = math.inf


@kernel
def is_possible(code: Ints, constants: Reals, table: Ints, first: int, count: int, w: Watched) -> bool:
    """Whether the times to hold for, of `count` slots whose programs begin at the row `first`, are times."""
    for j in range(count):
        row = first + 2 * j + 1
        begin, end = table[row, 0], table[row, 1]
        if end > begin:
            time = evaluate(code, constants, begin, end, w.values, w.stack)
            if not 0.0 <= time < math.inf:
                return False
    return True


@kernel
def has_turned(
    code: Ints, constants: Reals, table: Ints, first: int, slot: int, count: int, w: Watched,
) -> bool:  # fmt: skip
    """Whether some part holds that did not at the start of the step, or the other way round."""
    for j in range(count):
        begin, end = table[first + 2 * j, 0], table[first + 2 * j, 1]
        if end > begin:
            now = holds(code, constants, begin, end, w.values, w.stack)
            if now != (w.dates[slot + j] < math.inf):
                return True
    return False


@kernel
def note_times(
    code: Ints, constants: Reals, table: Ints, first: int, slot: int, count: int, h: float, w: Watched,
) -> None:  # fmt: skip
    """Note since when parts hold at the end of a step of length h, which began at `w.begun`; since now
    where h is 0."""
    for j in range(count):
        begin, end = table[first + 2 * j, 0], table[first + 2 * j, 1]
        if end == begin:
            continue
        if not holds(code, constants, begin, end, w.values, w.stack):
            w.dates[slot + j] = math.inf
        elif w.dates[slot + j] == math.inf:
            now = w.clock[0].time
            w.dates[slot + j] = now if h == 0.0 else _turned(code, constants, begin, end, h, w)


@kernel
def times_end(
    code: Ints, constants: Reals, table: Ints, first: int, slot: int, count: int, reached: float,
    w: Watched,
) -> float:  # fmt: skip
    """When the first part will have held long enough, inf if none waits; those that have by the time
    `reached` do from now on."""
    soonest = math.inf
    for j in range(count):
        since = float(w.dates[slot + j])
        if not math.isfinite(since):
            continue
        row = first + 2 * j + 1
        time = evaluate(code, constants, table[row, 0], table[row, 1], w.values, w.stack)
        over = since + time if time > 0.0 else -math.inf
        if over <= reached:
            w.dates[slot + j] = -math.inf
        else:
            soonest = min(soonest, float(over))
    return soonest


@rare_kernel
def _turned(code: Ints, constants: Reals, begin: int, end: int, h: float, w: Watched) -> float:
    """When a part began to hold on the way of a step (see `interpolate`)."""
    copy(w.values, w.ended)
    low, high = 0.0, 1.0
    for _ in range(HALVES):
        middle = 0.5 * (low + high)
        if not low < middle < high:
            break
        interpolate(middle, h, w)
        if holds(code, constants, begin, end, w.values, w.stack):
            high = middle
        else:
            low = middle
    copy(w.ended, w.values)
    return float(w.clock[0].time - (1.0 - high) * h)


@inner_kernel
def interpolate(part: float, h: float, w: Watched) -> None:
    """Places, gaps and time at a part of the last step, linear in time; speeds and forces are those of its
    end."""
    time = w.slots[TIME]
    w.values[time] = w.clock[0].time - (1.0 - part) * h
    for first, last in ((time + 1, w.slots[SPEEDS]), (w.slots[POSES], w.slots[FORCES])):
        for i in range(first, last):
            far = math.isinf(w.ended[i]) or math.isinf(w.begun[i])
            w.values[i] = w.ended[i] if far else part * w.ended[i] + (1.0 - part) * w.begun[i]

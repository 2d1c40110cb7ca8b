"""Frames of a run: what it hands on from step to step, and what else is to be known of its state, in rows."""

from __future__ import annotations

from typing import Any

import numpy as np

from rungwise.block import Block
from rungwise.kernel import Ints, Reals, RecordArray, inner_kernel, record_type, system_kernel
from rungwise.simulation.stepping.attempt import Setting
from rungwise.simulation.watched.values import DATES
from rungwise.system.contract import remember, tell_frame
from rungwise.system.moving import OF_GAPS, Asked

NOTE = record_type("frames since stride most room", "")
"""Frames in the rows, steps since the last one, from one to the next, how many may be kept in all, none where
this is 0, and how many now."""
WORK = ("drive_work", "load_work", "contact_work", "support_work", "joint_work")
HEAD = 2 + len(WORK)
"""Numbers of a row before the memory: where that ends within the row, the residual, and the work of all
steps."""


class Recorded(Block):
    """Frames that were recorded since they were taken out last: note (1,), see `NOTE`; rows, one after
    another, `bits`, the same numbers as integers, and where each ends (most + 1,)."""

    note: RecordArray
    rows: Reals
    bits: Ints
    ends: Ints


def allocate_recorded(most: int, stride: int, room: int, frames: int) -> Recorded:
    """With room for so many numbers, and for so many frames at once."""
    note, rows = np.zeros(1, NOTE), np.zeros(room)
    note["most"], note["room"], note["stride"], note["since"] = most, most, stride, stride
    return Recorded(note=note, rows=rows, bits=rows.view(np.int64), ends=np.zeros(frames + 1, np.int64))


@system_kernel
def record(system: Any, s: Setting, asked: Asked, margins: Reals, recorded: Recorded, always: bool) -> bool:
    """Record the state of a run now, if it is its turn or `always`; False where there is no room."""
    note = recorded.note[0]
    if note.most == 0 or (not always and note.since < note.stride):
        return True
    if note.frames >= note.room or note.frames + 1 >= recorded.ends.shape[0]:
        return False
    rows, begin = recorded.rows, recorded.ends[note.frames]
    at = begin + HEAD
    if at > rows.shape[0]:
        return False
    end = put_memory(system, s, asked, margins, rows, recorded.bits, at)
    if end < 0:
        return False
    clock = s.state.clock[0]
    rows[begin], rows[begin + 1] = end - begin, clock.residual
    rows[begin + 2], rows[begin + 3] = clock.drive_work, clock.load_work
    rows[begin + 4], rows[begin + 5], rows[begin + 6] = (
        clock.contact_work, clock.support_work, clock.joint_work
    )  # fmt: skip
    end = tell_frame(system, s, rows, end)
    if end < 0:
        return False
    note.frames += 1
    recorded.ends[note.frames] = end
    note.since = 0
    return True


@system_kernel
def put_memory(system: Any, s: Setting, asked: Asked, margins: Reals, out: Reals, bits: Ints, at: int) -> int:
    """Write what a run hands on (see `simulation.moving.memory.Parts`) into `out` from `at` on; returns where
    it ends, -1 where there is no room."""
    w, clock = s.watched, s.state.clock[0]
    gaps, count, pairs = asked.firsts[OF_GAPS], asked.contacts[0], asked.place.shape[0]
    rest = w.slots[DATES]
    if at + 8 + w.levels.shape[0] + gaps + 4 * pairs + w.values.shape[0] - rest > out.shape[0]:
        return -1
    out[at], out[at + 1] = clock.segment, clock.varies
    out[at + 2], out[at + 3], out[at + 4] = clock.opened, clock.switched, clock.switch
    at = put(w.levels, out, at + 5)
    at = put(margins, out, at)
    at = put(w.values[:gaps], out, at)
    out[at] = pairs
    at += 1
    for k in range(pairs):
        out[at] = asked.place[k]
        for which in range(3):
            out[at + 1 + which] = w.values[gaps + which * count + asked.place[k]]
        at += 4
    return int(remember(system, s, out, bits, put(w.values[rest:], out, at)))


@inner_kernel
def put(source: Reals, out: Reals, at: int) -> int:
    """Copy numbers (k,) into others; returns where they end."""
    for i in range(source.shape[0]):
        out[at + i] = source[i]
    return at + int(source.shape[0])


@inner_kernel
def put_bits(source: Ints, bits: Ints, at: int) -> int:
    """Copy integers (k,) into others; returns where they end."""
    for i in range(source.shape[0]):
        bits[at + i] = source[i]
    return at + int(source.shape[0])

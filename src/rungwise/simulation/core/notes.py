"""Notes of hard steps: the compiled loop writes problems, as it tried to solve them, into one flat array."""

from __future__ import annotations

from dataclasses import dataclass

from rungwise.contact.step import ContactProblem, Sizes, allocate_problem
from rungwise.kernel import Reals, kernel
from rungwise.simulation.core.state import Scratch, State

_FIRST, _HEAD = 2, 9
"""The array begins with the place after the last note, and the number of notes, stored or not."""
_FIELDS = ("H", "c", "W", "R", "w", "mu", "S", "R_s", "w_s", "F", "quantum")


@dataclass(frozen=True, eq=False)
class Note:
    """A step's problem and its solution: `stage` is the last stage of `solve_planar`, v (n,) its answer."""

    status: int
    stage: int
    residual: float
    time: float
    length: float
    step: int
    problem: ContactProblem
    v: Reals


@kernel
def note(
    problem: ContactProblem,
    sizes: Sizes,
    status: int,
    stage: int,
    state: State,
    scratch: Scratch,
) -> None:
    """Add the problem and its outcome to `scratch.hard`, unless it is full."""
    n, contacts, limited = sizes
    out, clock, p = scratch.hard, state.clock[0], problem
    out[1] += 1.0
    at = max(int(out[0]), _FIRST)
    if at + _size(n, contacts, limited) > out.shape[0]:
        return
    out[at], out[at + 1], out[at + 2] = n, contacts, limited
    out[at + 3], out[at + 4], out[at + 5] = status, stage, clock.residual
    out[at + 6], out[at + 7], out[at + 8] = clock.time, clock.tried, clock.steps
    at += _HEAD
    d = p.R.shape[1]
    at = _put_matrix(p.H, n, n, out, at)
    at = _put(p.c, n, out, at)
    at = _put_matrix(p.W, contacts * d, n, out, at)
    at = _put(p.R.reshape(p.R.size), contacts * d * d, out, at)
    at = _put(p.w, contacts * d, out, at)
    at = _put(p.mu, contacts, out, at)
    at = _put_matrix(p.S, limited, n, out, at)
    at = _put(p.R_s, limited, out, at)
    at = _put(p.w_s, limited, out, at)
    at = _put(p.F, limited, out, at)
    at = _put(p.quantum, 1, out, at)
    at = _put(scratch.x, n, out, at)
    out[0] = at


@kernel
def _size(n: int, contacts: int, limited: int) -> int:
    return _HEAD + n * n + 2 * n + contacts * (2 * n + 7) + limited * (n + 3) + 1


@kernel
def _put(source: Reals, size: int, out: Reals, at: int) -> int:
    for i in range(size):
        out[at + i] = source[i]
    return at + size


@kernel
def _put_matrix(source: Reals, rows: int, columns: int, out: Reals, at: int) -> int:
    for r in range(rows):
        at = _put(source[r], columns, out, at)
    return at


def taken(hard: Reals) -> tuple[list[Note], int]:
    """The notes in the array, which is then empty, and the number of notes that found no room."""
    notes, end, meant = [], int(hard[0]), int(hard[1])
    at = _FIRST
    while at < end:
        head = hard[at : at + _HEAD]
        n, contacts, limited = (int(x) for x in head[:3])
        last = at + _size(n, contacts, limited)
        problem = allocate_problem(n, contacts, limited)
        at += _HEAD
        for name in _FIELDS:
            field = getattr(problem, name)
            field[...] = hard[at : at + field.size].reshape(field.shape)
            at += field.size
        status, stage, step = int(head[3]), int(head[4]), int(head[8])
        residual, time, length = (float(x) for x in head[5:8])
        notes.append(Note(status, stage, residual, time, length, step, problem, hard[at:last].copy()))
        at = last
    hard[:_FIRST] = 0.0
    return notes, meant - len(notes)

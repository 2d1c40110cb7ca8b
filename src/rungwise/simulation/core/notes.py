"""Notes of steps: the compiled loop writes problems, what it began with and found, into a flat array."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rungwise.contact.step import (
    ContactProblem,
    Sizes,
    Unknowns,
    allocate_problem,
    has_column,
    place_in,
    stretch,
)
from rungwise.kernel import Ints, Reals, kernel
from rungwise.simulation.core.state import Scratch, State
from rungwise.system.terms import Terms

_NEXT, _COUNT, _ALL, _FIRST, _HEAD = 0, 1, 2, 3, 10
"""The array begins with the place after the last note, the number of notes, stored or not, and whether all
steps are noted; else the hard ones are."""
_FIELDS = ("H", "c", "W", "R", "w", "mu", "S", "R_s", "w_s", "F", "quantum")


@dataclass(frozen=True, eq=False)
class Note:
    """A step's problem, with the supports (limited,) whose limit surfaces its limited rows belong to, if any
    (as if these were ellipsoids: pressures are not noted); from where its solution began, and how that ended:
    `stage` is the last stage of the chain."""

    status: int
    stage: int
    residual: float
    time: float
    length: float
    step: int
    problem: ContactProblem
    surface: Ints
    start: Unknowns
    answer: Unknowns


@kernel
def notes_all(scratch: Scratch) -> bool:
    """Whether all steps are to be noted."""
    return bool(scratch.hard[_ALL] != 0.0)


@kernel
def note_start(problem: ContactProblem, sizes: Sizes, scratch: Scratch) -> None:
    """Write from where the solution of a problem begins to where its note will have it, unless that is
    full."""
    at, room = _place(sizes, problem.R.shape[1], scratch)
    if room:
        _put_unknowns(sizes, problem.R.shape[1], scratch, at + _HEAD + _size(sizes, problem.R.shape[1]))


@kernel
def note(
    problem: ContactProblem,
    sizes: Sizes,
    terms: Terms,
    status: int,
    stage: int,
    state: State,
    scratch: Scratch,
) -> None:
    """Add the problem, after `note_start`, and its outcome to `scratch.hard`, unless it is full."""
    n, contacts, limited = sizes
    out, clock, p, d = scratch.hard, state.clock[0], problem, problem.R.shape[1]
    out[_COUNT] += 1.0
    at, room = _place(sizes, d, scratch)
    if not room:
        return
    out[at], out[at + 1], out[at + 2], out[at + 3] = n, contacts, limited, d
    out[at + 4], out[at + 5], out[at + 6] = status, stage, clock.residual
    out[at + 7], out[at + 8], out[at + 9] = clock.time, clock.tried, clock.steps
    at += _HEAD
    for i in range(n):
        at = _put_line(p.H, terms.entries.couplings, i, n, out, at)
    at = _put(p.c, n, out, at)
    for r in range(contacts * d):
        at = _put_row(p.W[r], terms.entries.columns, r // d, n, out, at)
    at = _put(p.R.reshape(p.R.size), contacts * d * d, out, at)
    at = _put(p.w, contacts * d, out, at)
    at = _put(p.mu, contacts, out, at)
    at = _put_matrix(p.S, limited, n, out, at)
    at = _put(p.R_s, limited, out, at)
    at = _put(p.w_s, limited, out, at)
    at = _put(p.F, limited, out, at)
    at = _put(p.quantum, 1, out, at)
    for r in range(limited):
        out[at + r] = terms.surface[r]
    at += limited + _unknowns_size(sizes, d)
    _put_unknowns(sizes, d, scratch, at)
    out[_NEXT] = at + _unknowns_size(sizes, d)


@kernel
def _place(sizes: Sizes, d: int, scratch: Scratch) -> tuple[int, bool]:
    """Where the next note begins, and whether there is room for it."""
    at = max(int(scratch.hard[_NEXT]), _FIRST)
    length = _HEAD + _size(sizes, d) + 2 * _unknowns_size(sizes, d)
    return at, at + length <= scratch.hard.shape[0]


@kernel
def _size(sizes: Sizes, d: int) -> int:
    """Numbers of a problem."""
    n, contacts, limited = sizes
    return n * n + n + contacts * (d * n + d * d + d + 1) + limited * (n + 4) + 1


@kernel
def _unknowns_size(sizes: Sizes, d: int) -> int:
    n, contacts, limited = sizes
    return n + contacts * (d + 1) + 2 * limited


@kernel
def _put_unknowns(sizes: Sizes, d: int, scratch: Scratch, at: int) -> None:
    n, contacts, limited = sizes
    out = scratch.hard
    for i in range(contacts + limited):
        out[at + i] = scratch.mode[i]
    at = _put(scratch.x, n, out, at + contacts + limited)
    at = _put(scratch.contact_force, contacts * d, out, at)
    _put(scratch.limited_force, limited, out, at)


@kernel
def _put(source: Reals, size: int, out: Reals, at: int) -> int:
    for i in range(size):
        out[at + i] = source[i]
    return at + size


@kernel
def _put_row(row: Reals, columns: Ints, k: int, n: int, out: Reals, at: int) -> int:
    """Write all n columns of a row of contact k."""
    for i in range(n):
        out[at + i] = row[place_in(columns, k, i)] if has_column(columns, k, i) else 0.0
    return at + n


@kernel
def _put_line(matrix: Reals, couplings: Ints, i: int, n: int, out: Reals, at: int) -> int:
    """Write all n columns of row i of a matrix."""
    low, high = stretch(couplings, i, n)
    for j in range(n):
        out[at + j] = matrix[i, j - low] if low <= j < high else 0.0
    return at + n


@kernel
def _put_matrix(source: Reals, rows: int, columns: int, out: Reals, at: int) -> int:
    for r in range(rows):
        at = _put(source[r], columns, out, at)
    return at


def note_all(hard: Reals) -> None:
    """Let all steps be noted."""
    hard[_ALL] = 1.0


def room_for_notes(n: int, contacts: int, limited: int, d: int, count: int = 1) -> int:
    """Numbers of an array for so many notes of problems of at most these sizes."""
    sizes = Sizes(n, contacts, limited)
    return _FIRST + count * int(_HEAD + _size(sizes, d) + 2 * _unknowns_size(sizes, d))


def taken(hard: Reals) -> tuple[list[Note], int]:
    """The notes in the array, which is then empty, and the number of notes that found no room."""
    notes, at, meant = list[Note](), _FIRST, int(hard[_COUNT])

    def numbers(size: int) -> Reals:
        nonlocal at
        at += size
        return hard[at - size : at].copy()

    def unknowns() -> Unknowns:
        mode = numbers(contacts + limited).astype(np.int64)
        return Unknowns(mode, numbers(n), numbers(contacts * d), numbers(limited))

    while at < int(hard[_NEXT]):
        head = numbers(_HEAD)
        n, contacts, limited, d, status, stage = (int(x) for x in head[:6])
        problem = allocate_problem(n, contacts, limited, d)
        for name in _FIELDS:
            field = getattr(problem, name)
            field[...] = numbers(field.size).reshape(field.shape)
        surface = numbers(limited).astype(np.int64)
        residual, time, length = (float(x) for x in head[6:9])
        notes.append(
            Note(
                status, stage, residual, time, length, int(head[9]), problem, surface, unknowns(), unknowns()
            )
        )
    hard[[_NEXT, _COUNT]] = 0.0
    return notes, meant - len(notes)


def kept(notes: Sequence[Note]) -> Reals:
    """The array that holds these notes, with no room for more."""
    rows: list[NDArray[Any]] = [np.zeros(_FIRST)]
    for each in notes:
        p = each.problem
        n, contacts, limited, d = len(p.c), len(p.mu), len(p.F), p.R.shape[1]
        head = (
            n,
            contacts,
            limited,
            d,
            each.status,
            each.stage,
            each.residual,
            each.time,
            each.length,
            each.step,
        )
        rows += [np.array(head, float), *(np.ravel(getattr(p, name)) for name in _FIELDS), each.surface]
        for mode, v, force, tau in (each.start, each.answer):
            rows += [mode[: contacts + limited], v[:n], force[: contacts * d], tau[:limited]]
    found = np.concatenate(rows).astype(float)
    found[[_NEXT, _COUNT]] = len(found), len(notes)
    return found

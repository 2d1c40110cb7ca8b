"""What the core and the features of a run in space hand on from step to step, as one array."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rungwise.kernel import Ints, Reals, kernel, steady
from rungwise.simulation.core.state import CLOCK, State
from rungwise.simulation.moving.memory import restored, written
from rungwise.simulation.stepping.record import put, put_bits
from rungwise.simulation.stepping.stepper import Stepper
from rungwise.system import contract
from rungwise.system.spatial.features import FREE, Features
from rungwise.system.spatial.mechanism import Mechanism, kept_in
from rungwise.system.spatial.space import Space

HEAD = 6
"""Numbers before all others: margin of contacts, limited rows, slots of the state and of features, and how
many of them are in use."""


class _Arrays(NamedTuple):
    """Arrays of a run: whole ones, and rows by slot of the state and of features."""

    whole: list[NDArray[Any]]
    state: list[NDArray[Any]]
    features: list[NDArray[Any]]


def _arrays(stepper: Stepper, space: Space) -> _Arrays:
    state, scratch, kept = stepper.state, stepper.scratch, space.kept
    return _Arrays(
        [
            space.activation, stepper.tried.clock, scratch.limited_force, scratch.limited_mode,
            stepper.terms.fall, kept.used,
        ],
        [state.modes, state.deformation, state.force, state.impulse],
        [kept.geoms, kept.place, kept.along, kept.world],
    )  # fmt: skip


def remembered(stepper: Stepper, space: Space) -> Reals:
    """The memory (w,) of a run: only slots in use are kept, so that w differs from state to state."""
    mechanism, setting, put_all = space.mechanism, stepper.setting, steady(remember)
    return written(lambda out, bits: int(put_all(mechanism, setting, out, bits, 0)))


@contract.remember.given_by(Mechanism)
@kernel
def remember(m: Mechanism, s: Any, out: Reals, bits: Ints, at: int) -> int:
    state, scratch, kept, active, known = s.state, s.scratch, kept_in(m), m.active, m.known
    actives, knowns, size = used_slots(state, kept, active, known)
    whole = m.activation.shape[0] + s.attempt.clock.shape[0] + 2 * scratch.limited_force.shape[0]
    whole += s.terms.fall.shape[0] + 1
    if at + HEAD + actives + knowns + whole + size > out.shape[0]:
        return -1
    out[at], out[at + 1], out[at + 2] = m.margin[0], scratch.limited_force.shape[0], state.modes.shape[0]
    out[at + 3], out[at + 4], out[at + 5] = kept.geoms.shape[0], actives, knowns
    at += HEAD
    for k in range(actives):
        out[at + k] = active[k]
    at += actives
    for k in range(knowns):
        out[at + k] = known[k]
    at = put(s.attempt.clock, out, put(m.activation, out, at + knowns))
    at = put_bits(scratch.limited_mode, bits, put(scratch.limited_force, out, at))
    at = put_bits(kept.used, bits, put(s.terms.fall, out, at))
    return put_rows(state, kept, active[:actives], known[:knowns], out, bits, at)


@kernel
def used_slots(state: State, kept: Features, active: Ints, known: Ints) -> tuple[int, int, int]:
    """Fill in which slots of the state and of features are in use; returns how many, and the numbers of their
    rows."""
    actives = knowns = 0
    for s in range(state.modes.shape[0]):
        used = state.modes[s] != 0
        for rows in (state.deformation, state.force, state.impulse):
            for k in range(rows.shape[1]):
                used |= rows[s, k] != 0.0
        if used:
            active[actives] = s
            actives += 1
    for s in range(kept.used[0]):
        if kept.geoms[s, 0] >= 0:
            known[knowns] = s
            knowns += 1
    of_state = 1 + state.deformation.shape[1] + state.force.shape[1] + state.impulse.shape[1]
    of_feature = 2 + kept.place.shape[1] + kept.along.shape[1] + kept.world.shape[1]
    return actives, knowns, actives * of_state + knowns * of_feature


@kernel
def put_rows(
    state: State, kept: Features, active: Ints, known: Ints, rows: Reals, bits: Ints, at: int
) -> int:  # fmt: skip
    """Fill rows with those of the state and of features in use, in the order of `_arrays`, from `at` on;
    `bits` are the same numbers as integers. Returns where they end."""
    for s in active:
        bits[at] = state.modes[s]
        at += 1
    for of_state in (state.deformation, state.force, state.impulse):
        at = _put(of_state, active, rows, at)
    for s in known:
        bits[at], bits[at + 1] = kept.geoms[s, 0], kept.geoms[s, 1]
        at += 2
    for of_feature in (kept.place, kept.along, kept.world):
        at = _put(of_feature, known, rows, at)
    return at


@kernel
def _put(source: Reals, slots: Ints, rows: Reals, at: int) -> int:
    """Copy these rows of an array into others; returns where they end."""
    for s in slots:
        for k in range(source.shape[1]):
            rows[at] = source[s, k]
            at += 1
    return at


def activations(core: Reals, count: int) -> Reals:
    """The activations (k,) in such a memory."""
    first = HEAD + int(core[4:HEAD].sum())
    return core[first : first + count].copy()


def _sizes(stepper: Stepper, space: Space) -> list[int]:
    return [len(stepper.scratch.limited_force), len(stepper.state.modes), len(space.kept.geoms)]


def recall(stepper: Stepper, space: Space, values: Reals) -> None:
    """Go on as the run with this memory would; what follows it in the array is not read. Raises ValueError
    where it is of another model."""
    arrays = _arrays(stepper, space)
    if len(values) < HEAD or values[1:4].tolist() != _sizes(stepper, space):
        raise ValueError("the memory is of another model")
    space.look_within(float(values[0]))
    counts, at = values[4:HEAD].astype(np.int64), HEAD
    active = values[at : at + counts[0]].astype(np.int64)
    known = values[at + counts[0] : at + counts.sum()].astype(np.int64)
    at += int(counts.sum())
    for part in arrays.whole:
        part[...] = restored(values[at : at + part.size], part)
        at += part.size
    for part in arrays.state:
        part[...] = 0
    space.kept.geoms[:] = FREE
    for rows, parts in ((active, arrays.state), (known, arrays.features)):
        for part in parts:
            size = len(rows) * part[0].size
            part[rows] = values[at : at + size].view(part.dtype).reshape(len(rows), *part.shape[1:])
            at += size


class Kept(NamedTuple):
    """What a memory says of contacts, of those of features in use (c,): geoms (c, 2), world (c, 11) (see
    `Features`), force (c, d) and mode (c,)."""

    geoms: Ints
    world: Reals
    force: Reals
    mode: Ints


def contacts_in(core: Reals, space: Space) -> Kept:
    """The contacts in such a memory."""
    limited, actives, knowns = int(core[1]), int(core[4]), int(core[5])
    whole = space.model.na + CLOCK.itemsize // 8 + 2 * limited + space.model.nv + 1
    active, known = np.split(core[HEAD : HEAD + actives + knowns].astype(np.int64), [actives])
    at, d = HEAD + actives + knowns + whole, space.directions
    modes = core[at : at + actives].view(np.int64)
    at += actives * (1 + d)
    forces = core[at : at + actives * d].reshape(actives, d)
    at += 2 * actives * d
    geoms = core[at : at + 2 * knowns].view(np.int64).reshape(knowns, 2)
    at += (2 + 6 + 6) * knowns
    world = core[at : at + 11 * knowns].reshape(knowns, 11)
    where = np.searchsorted(active, known)
    found = np.zeros(knowns, bool)
    inside = where < actives
    found[inside] = active[where[inside]] == known[inside]
    force, mode = np.zeros((knowns, d)), np.zeros(knowns, np.int64)
    force[found], mode[found] = forces[where[found]], modes[where[found]]
    return Kept(geoms, world, force, mode)

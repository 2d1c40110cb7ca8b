"""The arrays of a run of a planar scene, allocated by copying what they were when first asked for."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from rungwise.contact.step import STICK, Widths, allocate_problem
from rungwise.kernel import Reals
from rungwise.mould import Mould
from rungwise.scene.fields.laws.contact import POISSON, STICKS
from rungwise.scene.language.expression import SLOTS
from rungwise.scene.template.records import Records, views
from rungwise.scene.template.template import Template
from rungwise.simulation.core import state as core
from rungwise.simulation.core.notes import room_for_notes
from rungwise.simulation.planar.state.workspace import (
    CLOCK,
    SCALARS,
    Early,
    Frames,
    Scratch,
    Snapshot,
    State,
    Workspace,
)  # fmt: skip
from rungwise.simulation.watched.values import Slots, allocate_watched
from rungwise.system.entries import CROWDED
from rungwise.system.planar.contact_manifold import ABSENT, allocate_manifolds
from rungwise.system.planar.corners import allocate_course
from rungwise.system.planar.place import allocate_placement
from rungwise.system.planar.pressed import allocate_surfaces
from rungwise.system.planar.seams import allocate_seams
from rungwise.system.planar.supports import foot_rows
from rungwise.system.planar.terms import couple
from rungwise.system.terms import allocate_terms

Fields: TypeAlias = dict[str, tuple[tuple[int, ...], np.dtype[Any] | type]]
"""Shapes and types of fields, by name."""

RECORDED = 100_000_000
"""Numbers (800 MB) in the frames of a crowded run, at most, but for three frames: each has a place for each
pair of shapes that may touch."""
BODY = 3
"""Coordinates of a body at most."""
NEAR_EACH = 8
"""Contacts near each shape that a crowded step has room for."""
ROOM = 1_000_000
"""Numbers (8 MB) for the notes of hard steps between two looks at them; more if one might not fit."""


def _in_one_array(fields: Fields) -> tuple[Reals, dict[str, NDArray[Any]]]:
    """An array of zeros, and fields of these shapes and types, whose elements are 8 bytes long or several
    times that, as views of it."""
    length = {name: math.prod(shape) * np.dtype(kind).itemsize // 8 for name, (shape, kind) in fields.items()}
    memory, views, at = np.zeros(sum(length.values())), {}, 0
    for name, (shape, kind) in fields.items():
        views[name] = memory[at : at + length[name]].view(kind).reshape(shape)
        at += length[name]
    return memory, views


def _snapshot(memory: Reals, carried: dict[str, NDArray[Any]], at: int, n: int) -> Snapshot:
    """A snapshot in this memory, whose values have n places from `at` on, then speeds."""
    values, contacts = carried["values"], carried["recent"].shape[1]
    return Snapshot(
        memory=memory,
        clock=carried["clock"],
        q=values[at : at + n],
        v=values[at + n : at + 2 * n],
        features=carried["features"],
        deformation=carried["deformation"],
        modes=carried["modes"],
        limited_mode=carried["limited_mode"],
        force=carried["force"],
        impulse=np.zeros_like(carried["force"]),
        impulses=values[at + 2 * n + 2 * contacts : at + 2 * n + 3 * contacts],
        dates=values[at + 2 * n + 3 * contacts :][:SLOTS],
        recent=carried["recent"],
        turn=np.zeros(1, np.int64),
    )


def most_contacts(records: Records) -> int:
    """Contacts that a crowded step has room for, travel limits among them: of convex bodies in the plane each
    touches less than six others on average. Where more are near, a step looks less far."""
    stops = 2 * len(records.coordinates) + 2 * len(records.measures)
    return NEAR_EACH * len(records.shapes) + stops


def _side(records: Records, limited: int) -> int:
    """Side of the matrix in which velocities are led along joints, if there are any."""
    return len(records.coordinates) + limited if len(records.measures) > 0 else 0


def _widths(records: Records) -> Widths:
    """Columns at most of a contact, which is of two bodies or holds a coordinate, and of a row of
    matrices."""
    n = len(records.coordinates)
    stretches = np.zeros((n, 2), np.int64)
    couple(records, stretches)
    return Widths(min(2 * BODY, n), int((stretches[:, 1] - stretches[:, 0]).max()))


def allocate(template: Template, values: Reals, frames: int, noted: bool = False) -> Workspace:
    """Arrays for a scene bound at these values; q, v, gaps and forces are views into a copy of `values`,
    where conditions read them.

    `noted` makes room for notes of hard steps.
    """
    made = _mould(template, frames, noted).cast()
    made.state.values[:] = values
    return made


@lru_cache(maxsize=64)
def _mould(template: Template, frames: int, noted: bool) -> Mould[Workspace]:
    """What workspaces of a scene are at first, at all parameters."""
    return Mould(_allocated(template, frames, noted))


def _allocated(template: Template, frames: int, noted: bool) -> Workspace:
    """A workspace, with values yet to be told."""
    records, values = views(template.buffer, template.counts), np.zeros(template.value_count)
    n, contacts, pairs = len(records.coordinates), len(records.contacts), len(records.pairs)
    slots = 2 * pairs + 2 * n + 2 * len(records.measures)
    limited, d, crowded = 2 * n + foot_rows(records) + 3 * len(records.measures), 2, n >= CROWDED
    rows = min(slots, most_contacts(records)) if crowded else slots
    at, inputs, named = len(template.parameters) + 1, len(template.inputs), records.contacts["laws"]
    impacts = rows if (named & POISSON).any() else 0
    limited, surfaces = limited + impacts, allocate_surfaces(records)
    widths = _widths(records) if crowded else None
    problem = allocate_problem(n, rows, limited, d, widths)
    notes = max(ROOM, room_for_notes(n, rows, limited, d)) if noted else 0
    fields: Fields = {  # in the order of `in_memory`
        "clock": ((1,), CLOCK),
        "values": (values.shape, np.float64),
        "start": ((n + len(records.measures),), np.float64),
        "levels": ((inputs,), np.float64),
        "recent": ((2, contacts), np.float64),
        "features": ((2 * pairs,), np.int64),
        "points": ((2 * pairs, 5), np.float64),
        "deformation": ((slots, d), np.float64),
        "modes": ((slots,), np.int64),
        "force": ((slots, d), np.float64),
        "limited_mode": ((limited,), np.int64),
        "limited_force": ((limited,), np.float64),
    }
    memory, carried = _in_one_array(fields)
    carried["features"][:], carried["limited_mode"][:] = ABSENT, STICK
    values = carried["values"]
    state = State(
        clock=carried["clock"],
        v=values[at + n : at + 2 * n],
        **core.state_arrays(n, slots, d)
        | {name: carried[name] for name in ("deformation", "modes", "force")}
        | {"laws": np.zeros((3, slots if (named & (STICKS | POISSON)).any() else 0))},
        memory=memory,
        values=values,
        q=values[at : at + n],
        pushes=values[at + 2 * n + contacts : at + 2 * n + 2 * contacts],
        impulses=values[at + 2 * n + 2 * contacts : at + 2 * n + 3 * contacts],
        dates=values[at + 2 * n + 3 * contacts :][:SLOTS],
        ways=values[at + 2 * n + 3 * contacts + SLOTS : -1],
        recent=carried["recent"],
        start=carried["start"],
        levels=carried["levels"],
        prefer=np.zeros(n),
        placed=allocate_placement(records),
        manifolds=allocate_manifolds(
            records,
            features=carried["features"],
            points=carried["points"],
            deformation=carried["deformation"][: 2 * pairs],
            modes=carried["modes"][: 2 * pairs],
            force=carried["force"][: 2 * pairs],
            gaps=values[at + 2 * n : at + 2 * n + contacts],
        ),
    )
    scratch = Scratch(
        **core.scratch_arrays(n, rows, limited, notes, side=_side(records, limited) if crowded else None)
        | {name: carried[name] for name in ("limited_mode", "limited_force")}
        | {"impact": np.zeros((4, impacts))},
        slowest=np.zeros(n),
        held=np.zeros(n, np.int64),
        probe=np.zeros((2, 5)),
        row=np.zeros(n),
        measures=np.zeros(len(records.measures)),
    )
    if crowded:
        frames = min(frames, max(3, RECORDED // (len(memory) + 2 * slots)))
    before, kept, whole = (_snapshot(*_in_one_array(fields), at, n) for _ in range(3))
    terms = allocate_terms(n, rows, limited, d, widths, surfaces)
    early = Early(
        rows=np.zeros_like(terms.rows),
        spans=np.zeros_like(terms.entries.rows),
        gap=np.zeros(slots),
        number=np.zeros(slots, np.int64),
        features=np.full(slots, ABSENT, np.int64),
        limited=np.zeros((limited, n)),
        measures=np.zeros((len(records.measures), n)),
        trial=np.zeros((2, n)),
        load=np.zeros(n),
        pull=np.zeros(n),
        passive=np.zeros(n),
        v=np.zeros(n),
        yielded=np.zeros(2 * rows),
    )
    recorded = Frames(
        memory=np.zeros((frames, len(memory))),
        impulse=np.zeros((frames, slots, d)),
        reaction=np.zeros((frames, n)),
        joint=np.zeros((frames, len(records.measures))),
        joint_force=np.zeros((frames, len(records.measures))),
        scalars=np.zeros((frames, len(SCALARS))),
    )
    first_gap = at + 2 * n
    slots_of = Slots(at - 1, at + n, first_gap, first_gap + contacts, first_gap + 3 * contacts)
    return Workspace(
        state=state,
        watched=allocate_watched(state.clock, values, state.levels, slots_of),
        terms=terms,
        seams=allocate_seams(records),
        course=allocate_course(records),
        problem=problem,
        scratch=scratch,
        before=before,
        kept=kept,
        whole=whole,
        early=early,
        frames=recorded,
    )

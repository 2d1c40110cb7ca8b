"""State and arrays that a run of a planar scene carries from step to step, allocated once."""

from __future__ import annotations

import math
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from rungwise.block import Block
from rungwise.contact.step import STICK, ContactProblem, allocate_problem
from rungwise.kernel import Ints, Reals, RecordArray, inner_kernel, record_type
from rungwise.scene.language.expression import SLOTS, STACK
from rungwise.scene.template.records import POISSON, STICKS, Records
from rungwise.scene.template.template import Template
from rungwise.simulation.core import state as core
from rungwise.system.entries import CROWDED
from rungwise.system.planar.corners import Course, allocate_course
from rungwise.system.planar.manifold import ABSENT, Manifolds, allocate_manifolds
from rungwise.system.planar.place import Placement, allocate_placement
from rungwise.system.planar.pressed import allocate_surfaces
from rungwise.system.planar.seams import Seams, allocate_seams
from rungwise.system.terms import Terms, allocate_terms

Conditions: TypeAlias = tuple[Ints, Reals, Ints]
"""Programs of the scene's conditions: code, constants and table."""
Fields: TypeAlias = dict[str, tuple[tuple[int, ...], np.dtype[Any] | type]]
"""Shapes and types of fields, by name."""

CLOCK = record_type(
    core.COUNTS
    + " attempts outcome contacts frames since stride bounces drives chooses leaper jumps segment varies"
    " lifts laws landed centred lost stalled snapped crowd blamed votes refusal meets",
    core.TIMES
    + " taken next margin extent near least_gap worst_residual reach smallest thin gained leap leap_time"
    " leap_step jump_time shake stray stray_time stray_step opened switched switch bend"
    " leapt leaping mark",
)
"""Fields beside the fields of the core: `chooses`: whether some motion is preferred; `bounces`: whether some
contact may bounce. `taken` is the last step's length, `next` the length to try next; `reach` is the longest
lever arm, `extent` the farthest distance at the start, `smallest` the least reach of a shape, `thin` the
thickness of the thinnest pair. `gained` is energy that bounces added. In the step of `leap_step` up to
`leap_time` the servo of coordinate `leaper` moved it by `leap`, farther than in any other (kinematic rung).
`jumps` counts jumps of velocity without a collision, the first at `jump_time`; `shake` is the last
acceleration, in the norm of the inertia. `stray` is the widest gap of a contact that carried load in the step
to its end (see `planar.strays`), of `stray_step` from `stray_time`. The schedule began at `opened`, its
`segment` at `switched`, and ends at `switch` at the latest; `varies`: whether numbers change in it.
`lifts`: whether some body may be raised off the plane; `laws`: the sum of those of contact beside the common
ones (see `records.CONTACT`); `landed` is the contact at which one came down on
another.
`centred`: whether steps take rows in their middle; `bend` is then how far the last step went from what one
with the rows at its start and two of half its length would have made of it (see `planar.middle`); `lost` says
that rows were those of the start, for a contact is no more at the end, or bodies settled. `stalled` counts
the last steps that went nearly nowhere, each in place of a longer one without solution. `leapt` is how far
the last step moved bodies by what does not vanish with its length, `leaping` the one that is tried, and
`snapped` says that such a motion ended the run (see `planar.snaps`). At `mark`
the last nominal step began, `crowd` attempts ago; `blamed` keeps most steps short, by `votes`, `refusal`
the last one, and `meets` is the slot of the contact that ended one (see `planar.blame`)."""

CONTROL = record_type("ends", "step longest duration tolerance error jam")
"""ends: whether the run ends with its schedule; step: first step; longest: longest step (the same for fixed
steps); tolerance: the goal's; error: allowed per step, 0 for steps of fixed length; jam: greatest motion in a
step without solution that counts as a jam."""


RECORDED = 100_000_000
"""Numbers (800 MB) in the frames of a crowded run, at most, but for three frames: each has a place for each
pair of shapes that may touch."""
NEAR_EACH = 8
"""Contacts near each shape that a crowded step has room for."""
ROOM = 1_000_000
"""Numbers (8 MB) for the notes of hard steps between two looks at them; more if one might not fit."""


class State(core.State):
    """q (n,); levels (u,) are the inputs before the present segment; the gaps of
    the manifolds, `pushes` and `impulses` (contacts,) are what conditions read, and so are `dates` (slots,),
    the times since when parts of them have held (see `Lasting`), and `ways` (bodies,), how far each body goes
    in a nominal step; `recent` (2, contacts) the
    normal forces of the last two steps. Slots are two for each pair of shapes, then two travel limits for
    each coordinate and for each measure of a joint; the deformations and modes of the first ones are those of
    the manifolds, in the same memory. `prefer` (n,): preferred velocities in multiples of the pace (see
    `planar.choice`), zero for the slowest motion; `wish` the same as velocities, while a motion is chosen.
    `memory` is all that a step hands on to the next, in one array: the clock, `values`, `start`, `levels`,
    `recent`, and what belongs to slots and limited rows are views of it. `start` (n + measures,): where
    servos without target are led from at t = 0, coordinates first, then measures of joints; of all
    others the place at the start."""

    memory: Reals
    values: Reals
    q: Reals
    pushes: Reals
    impulses: Reals
    dates: Reals
    ways: Reals
    recent: Reals
    start: Reals
    levels: Reals
    prefer: Reals
    placed: Placement
    manifolds: Manifolds


class Scratch(core.Scratch):
    """The slowest solution, the coordinates held in another solution, the values that conditions read at the
    start and the end of a step, in `undefined` (1,) the place of a number that is not finite now, or -1."""

    slowest: Reals
    held: Ints
    probe: Reals
    row: Reals
    measures: Reals
    stack: Reals
    begun: Reals
    ended: Reals
    undefined: Ints


class Early(Block):
    """What a step began with: rows of each contact, gap and feature of each slot (ABSENT where nothing was
    near) and the number of its contact, the rows of joints and of their measures, the load without and with
    the forces in joints, the passive load; `v` is the first solution, `yielded` half of what contacts yield
    in it; `trial` (2, n) are rows at its end."""

    rows: Reals
    gap: Reals
    number: Ints
    features: Ints
    limited: Reals
    measures: Reals
    trial: Reals
    load: Reals
    pull: Reals
    passive: Reals
    v: Reals
    yielded: Reals


class Snapshot(Block):
    """The state that is restored when a step is not accepted, or the end of one that is compared: a memory
    like that of the state, with views of it, and impulses; `turn` (1,) is that of the manifolds then."""

    memory: Reals
    clock: RecordArray
    q: Reals
    v: Reals
    features: Ints
    deformation: Reals
    modes: Ints
    limited_mode: Ints
    force: Reals
    impulse: Reals
    impulses: Reals
    dates: Reals
    recent: Reals
    turn: Ints


class Frames(Block):
    """Recorded states, each the memory of the run then, with the impulses of slots since the frame before;
    when full, every other frame is dropped and the stride doubles."""

    memory: Reals
    impulse: Reals
    reaction: Reals
    joint: Reals
    joint_force: Reals
    scalars: Reals


SCALARS = (
    "residual", "kinetic_energy", "potential_energy", "elastic_energy",
    "drive_work", "load_work", "contact_work", "support_work", "joint_work",
)  # fmt: skip


class Workspace(Block):
    """Arrays of one run; `before` is the state before an attempt, `kept` the state before a controlled
    step, `whole` the state after it in one piece, for comparison with two halves."""

    state: State
    terms: Terms
    seams: Seams
    course: Course
    problem: ContactProblem
    scratch: Scratch
    before: Snapshot
    kept: Snapshot
    whole: Snapshot
    early: Early
    frames: Frames


@inner_kernel
def trial_in(rung: RecordArray, h: float, contacts: int, workspace: Workspace) -> core.Trial:
    w = workspace
    return core.Trial(rung, h, w.terms, contacts, w.state, w.scratch, w.problem)


@inner_kernel
def time_slot(state: State) -> int:
    """Where expressions read t (see `Template` for the order of values)."""
    after = state.dates.shape[0] + state.ways.shape[0]
    return int(state.values.shape[0] - 2 - 2 * state.q.shape[0] - 3 * state.manifolds.gaps.shape[0] - after)


def recorded(workspace: Workspace, name: str) -> NDArray[Any]:
    """A field of the memory over the recorded frames (see `in_memory`)."""
    memories = workspace.frames.memory[: int(workspace.state.clock[0]["frames"])]
    return in_memory(workspace.state, name, memories)


def in_memory(state: State, name: str, memories: Reals) -> NDArray[Any]:
    """A field of memories (m, w) of a state like this one, by its name in `State`, in `Manifolds` or in the
    clock. Pickled states are copies whose fields are no views any more: the order of the fields decides."""
    if name in (CLOCK.names or ()):
        return np.asarray(in_memory(state, "clock", memories)[:, 0][name])
    m, values = state.manifolds, state.values
    told = (state.q, state.v, m.gaps, state.pushes, state.impulses, state.dates, state.ways)
    first = len(values) - 1 - sum(part.size for part in told)
    fields = {
        "clock": state.clock, "before": values[:first], "q": state.q, "v": state.v, "gaps": m.gaps,
        "pushes": state.pushes, "impulses": state.impulses, "dates": state.dates,
        "ways": state.ways, "after": values[-1:], "start": state.start,
        "levels": state.levels, "recent": state.recent, "features": m.features, "points": m.points,
        "deformation": state.deformation,
        "modes": state.modes, "force": state.force,
    }  # fmt: skip
    if name == "values":
        at = state.clock.nbytes // 8
        return np.ascontiguousarray(memories[:, at : at + len(values)])
    at = sum(field.nbytes // 8 for field in list(fields.values())[: list(fields).index(name)])
    own = fields[name]
    part = np.ascontiguousarray(memories[:, at : at + own.nbytes // 8])
    return part.view(own.dtype).reshape(len(part), *own.shape)


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


def allocate(
    records: Records, values: Reals, template: Template, frames: int, noted: bool = False
) -> Workspace:
    """Arrays for a scene bound at these values; q, v, gaps and forces are views into a copy of `values`,
    where conditions read them.

    `noted` makes room for notes of hard steps.
    """
    n, contacts, pairs = len(records.coordinates), len(records.contacts), len(records.pairs)
    slots = 2 * pairs + 2 * n + 2 * len(records.measures)
    limited, d, crowded = 2 * n + 3 * len(records.measures), 2, n >= CROWDED
    rows = min(slots, most_contacts(records)) if crowded else slots
    at, inputs, named = len(template.parameters) + 1, len(template.inputs), records.contacts["laws"]
    impacts = rows if (named & POISSON).any() else 0
    limited, surfaces = limited + impacts, allocate_surfaces(records)
    exact = len(surfaces["exact"])
    problem = allocate_problem(n, rows, limited)
    notes = max(ROOM, (n + 4) * (n + 2 * rows + limited) + 16) if noted else 0
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
    carried["values"][:], carried["features"][:], carried["limited_mode"][:] = values, ABSENT, STICK
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
        | {"impact": np.zeros((4, impacts)), "bare": np.zeros((3 * exact, n))}
        | {"ellipsoid": np.zeros((exact, core.ELLIPSOID))},
        slowest=np.zeros(n),
        held=np.zeros(n, np.int64),
        probe=np.zeros((2, 5)),
        row=np.zeros(n),
        measures=np.zeros(len(records.measures)),
        stack=np.zeros(STACK),
        begun=np.zeros(len(values)),
        ended=np.zeros(len(values)),
        undefined=np.full(1, -1, np.int64),
    )
    if crowded:
        frames = min(frames, max(3, RECORDED // (len(memory) + 2 * slots)))
    before, kept, whole = (_snapshot(*_in_one_array(fields), at, n) for _ in range(3))
    early = Early(
        rows=np.zeros((2 * rows, n)),
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
    return Workspace(
        state=state,
        terms=allocate_terms(n, rows, limited, d, crowded, surfaces),
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

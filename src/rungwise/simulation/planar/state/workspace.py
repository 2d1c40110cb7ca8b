"""State and arrays that a run of a planar scene carries from step to step, allocated once."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from rungwise.block import Block
from rungwise.contact.step import ContactProblem
from rungwise.kernel import Ints, Reals, RecordArray, inner_kernel, record_type
from rungwise.simulation.core import state as core
from rungwise.simulation.watched.values import Watched
from rungwise.system.planar.contact_manifold import Manifolds
from rungwise.system.planar.corners import Course
from rungwise.system.planar.place import Placement
from rungwise.system.planar.seams import Seams
from rungwise.system.terms import Terms

CLOCK = record_type(
    core.COUNTS
    + " contacts frames since stride bounces drives chooses leaper jumps lifts laws landed centred"
    " lost snapped refusal meets",
    core.TIMES + " margin extent near least_gap reach smallest thin leap leap_time leap_step jump_time shake"
    " stray stray_time stray_step bend leaping moving",
)
"""Fields beside the fields of the core: `chooses`: whether some motion is preferred; `bounces`: whether some
contact may bounce. `reach` is the longest
lever arm, `extent` the farthest distance at the start, `smallest` the least reach of a shape, `thin` the
thickness of the thinnest pair. In the step of `leap_step` up to
`leap_time` the servo of coordinate `leaper` moved it by `leap`, farther than in any other (kinematic rung).
`jumps` counts jumps of velocity without a collision, the first at `jump_time`; `shake` is the last
acceleration, in the norm of the inertia. `stray` is the widest gap of a contact that carried load in the step
to its end (see `opened_contacts`), of `stray_step` from `stray_time`.
`lifts`: whether some body may be raised off the plane; `laws`: the sum of those of contact beside the common
ones (see `records.CONTACT`); `landed` is the contact at which one came down on
another.
`centred`: whether steps take rows in their middle; `bend` is then how far the last step went from what one
with the rows at its start and two of half its length would have made of it (see `midpoint_rows`); `lost` says
that rows were those of the start, for a contact is no more at the end, or bodies settled. `leaping` is how
far the step that is tried moves bodies by what does not vanish with its length, and `snapped` says that such
a motion ended the run (see `step.held`). `moving` is the speed of the fastest that is
driven; `refusal` is what the last step was short for, and `meets` is the
slot of the contact that ended one (see `step.blame`)."""


class State(core.State):
    """q (n,); levels (u,) are the inputs before the present segment; the gaps of
    the manifolds, `pushes` and `impulses` (contacts,) are what conditions read, and so are `dates` (slots,),
    the times since when parts of them have held (see `Lasting`), and `ways` (bodies,), how far each body goes
    in a nominal step; `recent` (2, contacts) the
    normal forces of the last two steps. Slots are two for each pair of shapes, then two travel limits for
    each coordinate and for each measure of a joint; the deformations and modes of the first ones are those of
    the manifolds, in the same memory. `prefer` (n,): preferred velocities in multiples of the pace (see
    `preferred_motion`), zero for the slowest motion; `wish` the same as velocities, while a motion is chosen.
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
    """The slowest solution, and the coordinates held in another solution."""

    slowest: Reals
    held: Ints
    probe: Reals
    row: Reals
    measures: Reals


class Early(Block):
    """What a step began with: rows of each contact and their spans, gap and feature of each slot (ABSENT
    where nothing was near) and the number of its contact, the rows of joints and of their measures, the load
    without and with the forces in joints, the passive load; `v` is the first solution, `yielded` half of what
    contacts yield in it; `trial` (2, n) are rows at its end."""

    rows: Reals
    spans: Ints
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
    watched: Watched
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

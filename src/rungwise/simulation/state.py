"""What a run carries from step to step, allocated once."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rungwise.block import Block

from rungwise.contact.problem import ContactProblem, allocate_problem
from rungwise.scene.expression import STACK
from rungwise.scene.records import Records
from rungwise.system.planar.manifold import ABSENT
from rungwise.system.terms import Terms, allocate_terms

CLOCK = np.dtype(
    [(name, np.int64) for name in ("steps", "attempts", "outcome", "limited", "contacts", "frames", "since", "stride",
                                   "free", "spent")]
    + [(name, np.float64) for name in (
        "time", "taken", "tried", "next", "eps", "margin", "near", "least_gap", "residual", "worst_residual", "reach", "size",
        "drive_work", "load_work", "contact_work", "support_work",
    )]
)  # fmt: skip
"""Counters and clocks. `taken` is the last step's length, `tried` that of the last attempt, `next` the one to try next; `reach` is the longest lever arm."""

CONTROL = np.dtype([(name, np.float64) for name in ("step", "longest", "duration", "tolerance", "error")])
"""step: first step; longest: longest step (the same for fixed steps); tolerance: the goal's; error: allowed per step,
0 for steps of fixed length."""


class State(Block):
    """q, v (n,), start (n,) is q at t = 0; `gaps` and `pushes` (contacts,) are what conditions read.

    Per slot (two for each pair of shapes, then two travel limits for each coordinate): features, deformation (, d),
    modes, force (, d), impulse (, d) since the last frame. `prescribed` (n,), `free` the indices of the others,
    `speed` (n,) that of prescribed coordinates in this step, `reaction` (n,) force of each drive.
    """

    clock: NDArray[np.void]
    values: NDArray[np.float64]
    q: NDArray[np.float64]
    v: NDArray[np.float64]
    gaps: NDArray[np.float64]
    pushes: NDArray[np.float64]
    start: NDArray[np.float64]
    prescribed: NDArray[np.int64]
    free: NDArray[np.int64]
    speed: NDArray[np.float64]
    passive: NDArray[np.float64]
    reaction: NDArray[np.float64]
    pose: NDArray[np.float64]
    outline: NDArray[np.float64]
    points: NDArray[np.float64]
    features: NDArray[np.int64]
    deformation: NDArray[np.float64]
    modes: NDArray[np.int64]
    force: NDArray[np.float64]
    impulse: NDArray[np.float64]


class Scratch(Block):
    """Workspace of one step: the solution, the solver's matrix."""

    x: NDArray[np.float64]
    v_new: NDArray[np.float64]
    contact_force: NDArray[np.float64]
    limited_force: NDArray[np.float64]
    mode: NDArray[np.int64]
    slots: NDArray[np.int64]
    limited_mode: NDArray[np.int64]
    matrix: NDArray[np.float64]
    order: NDArray[np.int64]
    fresh: NDArray[np.int64]
    after: NDArray[np.float64]
    stack: NDArray[np.float64]


class Whole(Block):
    """Where one whole step led, to compare two halves with."""

    q: NDArray[np.float64]
    v: NDArray[np.float64]


class Snapshot(Block):
    """What a step that is not accepted restores."""

    clock: NDArray[np.void]
    q: NDArray[np.float64]
    v: NDArray[np.float64]
    features: NDArray[np.int64]
    deformation: NDArray[np.float64]
    modes: NDArray[np.int64]
    limited_mode: NDArray[np.int64]
    force: NDArray[np.float64]
    impulse: NDArray[np.float64]


class Frames(Block):
    """Recorded states; when full, every other frame is dropped and the stride doubles."""

    time: NDArray[np.float64]
    q: NDArray[np.float64]
    v: NDArray[np.float64]
    gap: NDArray[np.float64]
    mode: NDArray[np.int64]
    force: NDArray[np.float64]
    impulse: NDArray[np.float64]
    reaction: NDArray[np.float64]
    scalars: NDArray[np.float64]


SCALARS = (
    "residual", "kinetic_energy", "potential_energy", "elastic_energy", "drive_work", "load_work", "contact_work",
    "support_work",
)  # fmt: skip


class Workspace(Block):
    """All arrays of one run; `before` is the state before an attempt, `kept` that before a controlled step."""

    state: State
    terms: Terms
    problem: ContactProblem
    scratch: Scratch
    before: Snapshot
    kept: Snapshot
    whole: Whole
    frames: Frames


def allocate(records: Records, values: NDArray[np.float64], parameters: int, frames: int) -> Workspace:
    """Arrays for a bound scene; q, v, gaps and forces are views into `values`, where conditions read them."""
    n, contacts, pairs = len(records.coordinates), len(records.contacts), len(records.pairs)
    slots = 2 * pairs + 2 * n
    rows, limited, d = slots, 2 * n, 2
    at = parameters + 1
    problem = allocate_problem(n, rows, limited)
    state = State(
        clock=np.zeros(1, CLOCK),
        values=values,
        q=values[at : at + n],
        v=values[at + n : at + 2 * n],
        gaps=values[at + 2 * n : at + 2 * n + contacts],
        pushes=values[at + 2 * n + contacts : at + 2 * n + 2 * contacts],
        start=np.zeros(n),
        prescribed=np.zeros(n, np.int64),
        free=np.zeros(n, np.int64),
        speed=np.zeros(n),
        passive=np.zeros(n),
        reaction=np.zeros(n),
        pose=np.zeros((len(records.bodies), 4)),
        outline=np.zeros((len(records.vertices), 4)),
        points=np.zeros((2 * pairs, 5)),
        features=np.full(2 * pairs, ABSENT, np.int64),
        deformation=np.zeros((slots, d)),
        modes=np.zeros(slots, np.int64),
        force=np.zeros((slots, d)),
        impulse=np.zeros((slots, d)),
    )
    size = n + rows * d + limited
    scratch = Scratch(
        x=np.zeros(n),
        v_new=np.zeros(n),
        contact_force=np.zeros(rows * d),
        limited_force=np.zeros(limited),
        mode=np.zeros(rows + limited, np.int64),
        slots=np.zeros(rows, np.int64),
        limited_mode=np.ones(limited, np.int64),
        matrix=np.zeros((size, size + 1)),
        order=np.zeros(size, np.int64),
        fresh=np.zeros(2, np.int64),
        after=np.zeros(d),
        stack=np.zeros(STACK),
    )
    before, kept = (
        Snapshot(
            clock=np.zeros(1, CLOCK),
            q=np.zeros(n),
            v=np.zeros(n),
            features=np.zeros(2 * pairs, np.int64),
            deformation=np.zeros((slots, d)),
            modes=np.zeros(slots, np.int64),
            limited_mode=np.zeros(limited, np.int64),
            force=np.zeros((slots, d)),
            impulse=np.zeros((slots, d)),
        )
        for _ in range(2)
    )
    recorded = Frames(
        time=np.zeros(frames),
        q=np.zeros((frames, n)),
        v=np.zeros((frames, n)),
        gap=np.zeros((frames, contacts)),
        mode=np.zeros((frames, slots), np.int64),
        force=np.zeros((frames, slots, d)),
        impulse=np.zeros((frames, slots, d)),
        reaction=np.zeros((frames, n)),
        scalars=np.zeros((frames, len(SCALARS))),
    )
    return Workspace(
        state=state,
        terms=allocate_terms(n, rows, limited),
        problem=problem,
        scratch=scratch,
        before=before,
        kept=kept,
        whole=Whole(q=np.zeros(n), v=np.zeros(n)),
        frames=recorded,
    )

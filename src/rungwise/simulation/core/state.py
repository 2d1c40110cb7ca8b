"""State that every step hands on to the next, and scratch of a step, for any system."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rungwise.block import Block
from rungwise.contact.step import ContactProblem, Elimination, Sizes, Unknowns, matrix_size
from rungwise.kernel import Ints, Reals, RecordArray, inner_kernel, record_type
from rungwise.simulation.watched.values import PLACE
from rungwise.system.terms import Terms

STATIC, KINETIC, IMPULSIVE = 0, 1, 2
"""Rows of `State.laws`."""

COUNTS = "steps attempts solves limited free bounced leans surfaces crowd blamed votes " + PLACE[0]
TIMES = (
    "time tried taken next eps theta residual worst_residual drive_work load_work contact_work support_work"
    " joint_work gained leapt mark " + PLACE[1]
)
CLOCK = record_type(COUNTS, TIMES)
"""steps taken, attempts at them, and problems solved for all that was tried; limited rows and free
coordinates in use; `bounced`: whether restitution applied in this step; `leans`: whether its problem starts
from the velocity `wish`; `surfaces`: whether rows share limit surfaces. `tried` is the length of the last
attempt, `taken` of the last step, `next` the one to try next; `eps` and `theta` belong to its problem; then
its residual and the worst so far, the work of all steps taken, and `gained`, the energy that bounces added.
`leapt` is how far the last step moved bodies by what does not vanish with its length. At `mark` the last
nominal step began, `crowd` attempts ago; `blamed` keeps most steps short, by `votes` (see `core.crawl`). For
the rest see `PLACE`."""


class State(Block):
    """v (n,) at the start of the step. `prescribed` (n,) says which coordinates move at `speed` (n,), zero
    on the others, which `free` lists. `wish` (n,) is a preferred velocity, zero if there is none,
    `passive` (n,) is the push of loads other than drives, `reaction` (n,) the force of each drive.

    Per slot, the place that a contact's feature keeps from step to step: deformation, force (, d), mode, and
    impulse (, d) since the last frame. `laws` (3, slots): friction of what sticks, and of what slides (see
    `core.laws.static_friction`), and whether impacts have two phases (`core.laws.poisson_impact`); (3, 0)
    where no contact names one.
    """

    clock: RecordArray
    v: Reals
    prescribed: Ints
    free: Ints
    speed: Reals
    wish: Reals
    passive: Reals
    reaction: Reals
    deformation: Reals
    modes: Ints
    force: Reals
    impulse: Reals
    laws: Reals


class Scratch(Block):
    """Workspace of one step: the solution x of the free coordinates, all velocities, forces and modes of the
    contacts and limited rows, the slot of each contact, the solver's matrix, a deformation, in `hard` the
    notes of `notes.note`, if it has room. `other` (n + 1,) is another motion
    that solved a step in which bodies were held, the first such in a run, and when; -1 if there is none.
    `impact` (2 + d, contacts) is of impacts in two phases, empty where there are none. `halt` (1,) is set
    from outside where the step is to be given up."""

    x: Reals
    v_new: Reals
    contact_force: Reals
    limited_force: Reals
    mode: Ints
    slots: Ints
    limited_mode: Ints
    matrix: Reals
    order: Ints
    after: Reals
    hard: Reals
    other: Reals
    impact: Reals
    halt: Ints


class Trial(NamedTuple):
    """A step of length h that is tried on a rung, with the first `contacts` of its terms."""

    rung: RecordArray
    h: float
    terms: Terms
    contacts: int
    state: State
    scratch: Scratch
    problem: ContactProblem


@inner_kernel
def sizes_in(trial: Trial) -> Sizes:
    clock = trial.state.clock[0]
    return Sizes(clock.free, trial.contacts, clock.limited)


@inner_kernel
def unknowns_in(scratch: Scratch) -> Unknowns:
    return Unknowns(scratch.mode, scratch.x, scratch.contact_force, scratch.limited_force)


@inner_kernel
def elimination_in(scratch: Scratch) -> Elimination:
    return Elimination(scratch.matrix, scratch.order)


def state_arrays(n: int, slots: int, d: int = 2) -> dict[str, NDArray[Any]]:
    """Fields of `State`, but for clock and v, for n coordinates."""
    return {
        "prescribed": np.zeros(n, np.int64),
        "free": np.zeros(n, np.int64),
        "speed": np.zeros(n),
        "wish": np.zeros(n),
        "passive": np.zeros(n),
        "reaction": np.zeros(n),
        "deformation": np.zeros((slots, d)),
        "modes": np.zeros(slots, np.int64),
        "force": np.zeros((slots, d)),
        "impulse": np.zeros((slots, d)),
        "laws": np.zeros((3, 0)),
    }


def scratch_arrays(
    n: int, contacts: int, limited: int, notes: int = 0, d: int = 2, side: int | None = None
) -> dict[str, NDArray[Any]]:
    """Fields of `Scratch` for at most so many contacts and limited rows, and so many numbers of notes; `side`
    is the size of the matrix where it is not that of the solver in the plane."""
    size = matrix_size(n, contacts, limited) if d == 2 else 0  # modes are guessed in the plane alone
    size = size if side is None else side
    return {
        "x": np.zeros(n),
        "v_new": np.zeros(n),
        "contact_force": np.zeros(contacts * d),
        "limited_force": np.zeros(limited),
        "mode": np.zeros(contacts + limited, np.int64),
        "slots": np.zeros(contacts, np.int64),
        "limited_mode": np.ones(limited, np.int64),
        "matrix": np.zeros((size, size + 1)),
        "order": np.zeros(size, np.int64),
        "after": np.zeros(d),
        "hard": np.zeros(notes),
        "other": np.append(np.zeros(n), -1.0),
        "impact": np.zeros((4, 0)),
        "halt": np.zeros(1, np.int64),
    }

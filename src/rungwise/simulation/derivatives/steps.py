"""What derivatives ask of a world: steps, and the data that they assemble with discrete choices held."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, NamedTuple, Protocol, Self, TypeAlias

import numpy as np
from numpy.typing import NDArray

from rungwise.contact.analysis import Sensitivity
from rungwise.contact.solver.problem import solve_problem
from rungwise.contact.step import SOLVED, ContactProblem, Elimination, Sizes, Unknowns, matrix_size
from rungwise.deadline import go_on
from rungwise.kernel import RecordArray
from rungwise.models.ladder import Rung
from rungwise.simulation.options import ModelError

Array: TypeAlias = NDArray[np.float64]
Ints: TypeAlias = NDArray[np.int64]
Data: TypeAlias = dict[str, Array]
"""Fields of the problem, `speed`, `stiffness`, `damping`, and what `handed_on` takes; in changes, directions
are the last axis."""
MEMORY = ("activation", "tangent")
"""What systems hand on from step to step beside q, v and deformation."""
SEEN = 2.0
"""Distance within which contacts are looked for, over that within which they count as closed."""


@dataclass(frozen=True)
class Start:
    """The state before a step: q (n_q,), v (n,), deformation (slots, d), what the world knows of the features
    of the slots, if anything, activation (k,) of actuators, and tangent (t,), the directions in bodies along
    which contacts are deformed, where a world keeps some."""

    q: Array
    v: Array
    deformation: Array
    time: float = 0.0
    features: Any = None
    activation: Array = field(default_factory=lambda: np.zeros(0))
    tangent: Array = field(default_factory=lambda: np.zeros(0))


@dataclass(frozen=True, kw_only=True)
class Held:
    """Discrete choices of a step: slots of the contacts, their gaps, stiffness and damping (c, d, d), whether
    they bounce; eps and theta."""

    slots: Ints
    gap: Array
    stiffness: Array
    damping: Array
    bounced: NDArray[np.bool_]
    eps: float
    theta: float


def at_solution(problem: ContactProblem, found: Unknowns, halt: Ints) -> Sensitivity:
    """The sensitivity of a problem at its solution, which is found again, from where it was, if its forces
    were set to zero because they vanish in a limit. Raises ModelError, and TimeOver."""
    sizes = Sizes(len(problem.c), len(problem.mu), len(problem.F))
    if not (found.force.any() or found.tau.any()):
        found = Unknowns(found.mode.copy(), found.v.copy(), found.force.copy(), found.tau.copy())
        size, none = matrix_size(*sizes), np.zeros((0, 4), np.int64)
        room = Elimination(np.zeros((size, size + 1)), np.zeros(size, np.int64))
        if solve_problem(problem, sizes, found, none[:, 0], none, none, room, halt)[0] != SOLVED:
            go_on(halt)
            raise ModelError("step: it could not be repeated")
    return Sensitivity(problem, found.v, found.force, found.tau)


class Linearised(NamedTuple):
    """A contact problem that a step solves: choices, its sensitivity, and all speeds (n,) of its solution."""

    held: Any
    contact: Sensitivity
    speed: Array


class Taken(NamedTuple):
    """A step that was taken: all speeds (n,) in it, what was known of features before it, and its end."""

    speed: Array
    features: Any
    end: Start


class Steps(Protocol):
    """A scene at one set of parameters, whose steps of length h on a rung are taken and assembled.

    `reach` is the size of the smallest shape; `lever` (n,) how far a unit of each velocity leads points.
    Positions change along velocities: their changes have n entries. `begun` is the beginning of the scene.
    """

    h: float
    rung: RecordArray
    reach: float
    lever: Array
    begun: Start

    @property
    def halt(self) -> Ints:
        """Set from outside where steps are to be given up."""

    @property
    def free(self) -> Ints:
        """The velocities (m,) that are not prescribed."""

    def like(self, scene: Any, model: Rung | str, values: dict[str, float]) -> Self:
        """The same at other parameters."""

    def named(self, kind: str, i: int) -> str:
        """What velocity i, or what is counted along it, is called."""

    def moved(self, start: Start, kind: str, by: Array) -> Start:
        """The start with "q", "v" or "deformation" changed."""

    def apart(self, q: Array, other: Array) -> Array:
        """The velocities (n,) that lead from q (n_q,) to another place in a unit of time."""

    def taken(self, start: Start) -> Taken:
        """Take the step. Raises ModelError where it cannot be taken as it is, and TimeOver."""

    def tell(self, levels: Array) -> None:
        """Give the scene's inputs (u,) these values from now on."""

    def solved_near(self, start: Start, near: float) -> tuple[Sensitivity, Array]:
        """The linearised problem of a step whose bodies reach farther by `near` [length], so that contacts
        nearer than that are closed, and all speeds (n,) of its solution. Raises ModelError, and TimeOver."""

    def data_near(self, start: Start, near: float) -> Data:
        """Data of that problem, solved last, with the inputs told since, and `speed`."""

    def linearised(self, start: Start, taken: Taken, /) -> Iterator[Linearised]:
        """The problems that the step solves one after another, each where the solution of the one before
        leads. Raises ModelError, and TimeOver."""

    def data(self, held: Any, start: Start, trial: Array | None, faster: Array | None = None) -> Data:
        """Data of the problem from `start` at the place to which trial speeds (n,) lead, contacts in the
        order held, with their `gap`, and `speed` (n,) of the prescribed velocities, which are `faster`. The
        gaps in the data are the held gaps.

        Raises ModelError when other points touch than the held contacts.
        """

    def look_for_bends(self, held: Any, low: Data, high: Data, base: Data, way: float) -> None:
        """Raise ModelError where the data of a contact have two slopes at the base, seen from places that
        are a way to either side of it."""

    def ended(self, start: Start, speed: Array, dq: Array, dspeed: Array, /) -> Array:
        """The change (n, m) of the end of a step from changes of its start and of its speeds (n, m)."""

    def followed(self, taken: Taken, found: Array, /) -> Array:
        """Derivatives (slots d, m) of deformations in the slots to which their features have gone."""

    def handed_on(self, held: Any, data: Data, /) -> dict[str, Array]:
        """Derivatives (unknowns, m) of the kinds of `MEMORY` after the step, from those of its data."""

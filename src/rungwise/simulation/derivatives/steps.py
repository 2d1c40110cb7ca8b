"""Steps that are differentiated, and the data that they assemble with discrete choices held.

A system says where a step begins and ends, which contacts it sees, and which of them are those of another
assembly; what the step's problem is made of is the same in the plane and in space.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Collection, Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple, Self, TypeAlias

import numpy as np
from numpy.typing import NDArray

from rungwise.contact.analysis import DATA, Sensitivity
from rungwise.contact.solver.problem import solve_problem
from rungwise.contact.step import (
    NO_SURFACES,
    SOLVED,
    ContactProblem,
    Elimination,
    Sizes,
    Unknowns,
    matrix_size,
)
from rungwise.deadline import go_on
from rungwise.kernel import RecordArray, steady
from rungwise.models.assemble import Step, assemble
from rungwise.models.entries import Velocities, trimmed
from rungwise.models.ladder import Rung
from rungwise.simulation.core.state import Scratch, State, Trial
from rungwise.simulation.core.step import SUPPORTED, solve_step
from rungwise.simulation.options import ModelError
from rungwise.system.entries import is_crowded
from rungwise.system.terms import Terms
from rungwise.wording import listed

Array: TypeAlias = NDArray[np.float64]
Ints: TypeAlias = NDArray[np.int64]
Data: TypeAlias = dict[str, Array]
"""Fields of the problem, `speed`, `stiffness`, `damping`, and what `handed_on` takes; in changes, directions
are the last axis."""
MEMORY = ("activation", "tangent")
"""What systems hand on from step to step beside q, v and deformation."""
SEEN = 2.0
"""Distance within which contacts are looked for, over that within which they count as closed."""
TURN = 1e-4
"""Angle by which turns are differenced. Chosen by trial, to a decade."""
CHANGING = "step: a contact's feature is about to change; there is no derivative here"
LAW = ("gap", "friction", "restitution", "contact_stiffness", "contact_damping")
"""Terms with one entry for each contact."""


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
    """Discrete choices of a step: slots of the contacts, their terms (see `terms_of`), whether they bounce;
    eps, theta and `ease` (see `models.assemble`)."""

    slots: Ints
    terms: dict[str, Array]
    bounced: NDArray[np.bool_]
    eps: float
    theta: float
    ease: float


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


class Steps(ABC):
    """A scene at one set of parameters, whose steps of length h on a rung are taken and assembled.

    `reach` is the size of the smallest shape; `lever` (n,) how far a unit of each velocity leads points.
    Positions change along velocities, which are called `velocities`: their changes have n entries. `begun`
    is the beginning of the scene.
    """

    h: float
    theta: float
    rung: RecordArray
    reach: float
    lever: Array
    velocities: tuple[str, ...]
    begun: Start
    state: State
    scratch: Scratch
    terms: Terms
    problem: ContactProblem

    @abstractmethod
    def __init__(
        self, scene: Any, model: Rung | str, values: dict[str, float], h: float | None, theta: float
    ) -> None:
        """Steps as long as the scene's own if h is not given. Raises ModelError."""

    @abstractmethod
    def tell(self, levels: Array) -> None:
        """Give the scene's inputs (u,) these values from now on."""

    @abstractmethod
    def taken(self, start: Start) -> Taken:
        """Take the step. Raises ModelError where it cannot be taken as it is, and TimeOver."""

    @abstractmethod
    def linearised(self, start: Start, taken: Taken, /) -> Iterator[Linearised]:
        """The problems that the step solves one after another, each where the solution of the one before
        leads. Raises ModelError, and TimeOver."""

    @abstractmethod
    def _seen(self, held: Any, start: Start, trial: Array | None, faster: Array | None) -> int:
        """Fill in the terms of a step from `start` at the place to which trial speeds (n,) lead, where
        prescribed velocities are `faster`; returns how many contacts there are."""

    @abstractmethod
    def _seen_near(self, start: Start, near: float) -> int:
        """Fill in the terms of a step with contacts nearer than `near`; returns how many there are."""

    @abstractmethod
    def _order(self, held: Any, count: int) -> Ints:
        """Where each held contact (c,) is among those just seen; -1 for one without force that is not.

        Raises ModelError when other points touch than the held contacts.
        """

    @abstractmethod
    def followed(self, taken: Taken, found: Array, /) -> Array:
        """Derivatives (slots d, m) of deformations in the slots to which their features have gone."""

    @abstractmethod
    def look_for_bends(self, held: Any, low: Data, high: Data, base: Data, way: float) -> None:
        """Raise ModelError where the data of a contact have two slopes at the base, seen from places that
        are a way to either side of it."""

    def integrate(self, q: Array, v: Array, h: float) -> Array:
        """The place (n_q,) to which velocities lead in a time."""
        return q + h * v

    def apart(self, q: Array, other: Array) -> Array:
        """The velocities (n,) that lead from q (n_q,) to another place in a unit of time."""
        return other - q

    def handed_on(self, _held: Any, data: Data, /) -> dict[str, Array]:
        """Derivatives (unknowns, m) of the kinds of `MEMORY` after the step, from those of its data."""
        return {kind: np.zeros((0, data["speed"].shape[1])) for kind in MEMORY}

    def _gaps(self, _held: Any, _trial: Array | None, gap: Array) -> Array:
        """Gaps (c,) of the held contacts as they enter the derivative, from those seen."""
        return gap

    def _memory(self, _held: Any, _start: Start) -> Data:
        """What `handed_on` takes, of the step just assembled."""
        return {}

    @cached_property
    def _assemble(self) -> Any:
        return steady(assemble)

    @property
    def halt(self) -> Ints:
        """Set from outside where steps are to be given up."""
        return self.scratch.halt

    @property
    def free(self) -> Ints:
        """The velocities (m,) that are not prescribed."""
        free: Ints = self.state.free[: int(self.state.clock[0]["free"])]
        return free

    def named(self, kind: str, i: int) -> str:
        """What velocity i, or what is counted along it, is called."""
        return f"{self.velocities[i]} of {kind}"

    def like(self, scene: Any, model: Rung | str, values: dict[str, float]) -> Self:
        """The same at other parameters."""
        return type(self)(scene, model, values, self.h, self.theta)

    def moved(self, start: Start, kind: str, by: Array) -> Start:
        """The start with what it has of a kind changed."""
        if kind == "q":
            return replace(start, q=self.integrate(start.q, by, 1.0))
        old = getattr(start, kind)
        return replace(start, **{kind: old + by.reshape(old.shape)})

    def ended(self, start: Start, speed: Array, dq: Array, dspeed: Array) -> Array:
        """The change (n, m) of the end of a step from changes of its start and of its speeds (n, m); turns
        are those of the axes at the end."""
        n, h = len(self.lever), self.h
        if len(start.q) == n:
            return dq + h * dspeed
        end = self.integrate(start.q, speed, h)
        by_q, by_speed = np.zeros((2, n, n))
        for i, one in enumerate(TURN * np.eye(n)):
            for side in (-1.0, 1.0):
                other = self.integrate(start.q, side * one, 1.0)
                by_q[:, i] += side * self.apart(end, self.integrate(other, speed, h))
                other = self.integrate(start.q, h * speed + side * one, 1.0)
                by_speed[:, i] += side * self.apart(end, other)
        change: Array = (by_q @ dq + h * (by_speed @ dspeed)) / (2.0 * TURN)
        return change

    def data(self, held: Any, start: Start, trial: Array | None, faster: Array | None = None) -> Data:
        """Data of the problem from `start` at the place to which trial speeds (n,) lead, contacts in the
        order held, with their `gap`, and `speed` (n,) of the prescribed velocities, which are `faster`. The
        gaps in the data are the held gaps.

        Raises ModelError when other points touch than the held contacts.
        """
        count, terms = self._seen(held, start, trial, faster), self.terms
        order = self._order(held, count)
        known, now, k = order >= 0, terms_of(terms, count), len(order)
        own = {name: kept.copy() for name, kept in held.terms.items()}
        for name, values in own.items():
            values[known] = now[name][order[known]]
        put_terms(terms, own)
        terms.gap[:k] = held.terms["gap"]
        terms.restitution[:k][~held.bounced] = 0.0
        step = Step(self.h, held.theta, held.eps, held.ease)
        problem = self.assembled(step, k, bool(held.bounced.any()))
        return {
            **{name: getattr(problem, name) for name in DATA},
            "gap": self._gaps(held, trial, own["gap"]),
            "speed": self.state.speed.copy(),
            "stiffness": own["contact_stiffness"],
            "damping": own["contact_damping"],
            **self._memory(held, start),
        }

    def solved_near(self, start: Start, near: float) -> tuple[Sensitivity, Array]:
        """The linearised problem of a step whose bodies reach farther by `near` [length], so that contacts
        nearer than that are closed, and all speeds (n,) of its solution. Raises ModelError, and TimeOver."""
        return self.solution(self._reaching(start, near)), self.scratch.v_new.copy()

    def data_near(self, start: Start, near: float) -> Data:
        """Data of that problem, solved last, with the inputs told since, and `speed`."""
        count = self._reaching(start, near)
        step = Step(self.h, self.theta, float(self.state.clock[0]["eps"]), float(self.terms.pause[0]))
        problem = self.assembled(step, count, False)
        return {name: getattr(problem, name) for name in DATA} | {"speed": self.state.speed.copy()}

    def _reaching(self, start: Start, near: float) -> int:
        """Fill in the terms of a step whose bodies reach farther; returns how many contacts there are."""
        count = self._seen_near(start, near)
        self.terms.gap[:count] -= near
        self.terms.restitution[:count] = 0.0
        return count

    def solution(self, count: int) -> Sensitivity:
        """Solve the step of the terms that there are. Raises ModelError, and TimeOver."""
        trial = Trial(self.rung, self.h, self.terms, count, self.state, self.scratch, self.problem)
        if solve_step(trial) != SUPPORTED:
            go_on(self.halt)
            raise ModelError("step: it has no solution")
        return at_solution(*found_in(trial), self.halt)

    def assembled(self, step: Step, count: int, bounce: bool) -> ContactProblem:
        """The problem of the terms that there are, with so many contacts."""
        state, clock = self.state, self.state.clock[0]
        n, limited = int(clock["free"]), int(clock["limited"])
        velocities = Velocities(state.free, n, state.v, state.speed)
        self._assemble(self.rung, step, self.terms, count, limited, velocities, bounce, self.problem)
        return trimmed(self.problem, self.terms, n, count, limited)


def refuse_rough(titles: Collection[str]) -> None:
    """Raise ModelError where there are laws of contact, by their titles, that jump."""
    if titles:
        raise ModelError(f"contacts: steps with {listed(titles)} cannot be differentiated; leave them out")


def terms_of(terms: Terms, count: int) -> dict[str, Array]:
    """The terms of the first contacts: rows (c, d w) as they are kept, where, and deformations (c, d) among
    them."""
    d = terms.contact_stiffness.shape[1]
    found = {name: getattr(terms, name)[:count].copy() for name in LAW}
    found["rows"] = terms.rows[: count * d].reshape(count, d * terms.rows.shape[1]).copy()
    if is_crowded(terms.entries):
        found["spans"] = terms.entries.rows[:count].copy()
    found["deformation"] = terms.deformation[: count * d].reshape(count, d).copy()
    return found


def put_terms(terms: Terms, own: dict[str, Array]) -> None:
    """Let the first contacts have these terms."""
    k, d, width = len(own["gap"]), terms.contact_stiffness.shape[1], terms.rows.shape[1]
    for name in LAW:
        getattr(terms, name)[:k] = own[name]
    terms.rows[: k * d], terms.deformation[: k * d] = (
        own["rows"].reshape(k * d, width),
        own["deformation"].ravel(),
    )
    if is_crowded(terms.entries):
        terms.entries.rows[:k] = own["spans"]


def found_in(trial: Trial) -> tuple[ContactProblem, Unknowns]:
    """The problem of a step that was just solved, and its answer."""
    scratch, clock, count = trial.scratch, trial.state.clock[0], trial.contacts
    n, limited, d = int(clock["free"]), int(clock["limited"]), trial.problem.R.shape[1]
    found = Unknowns(
        scratch.mode[: count + limited].copy(), scratch.x[:n].copy(),
        scratch.contact_force[: count * d].copy(), scratch.limited_force[:limited].copy(),
    )  # fmt: skip
    return trimmed(trial.problem, trial.terms, n, count, limited), found


def at_solution(problem: ContactProblem, found: Unknowns, halt: Ints) -> Sensitivity:
    """The sensitivity of a problem at its solution, which is found again, from where it was, if its forces
    were set to zero because they vanish in a limit. Raises ModelError, and TimeOver."""
    sizes = Sizes(len(problem.c), len(problem.mu), len(problem.F))
    if not (found.force.any() or found.tau.any()):
        found = Unknowns(found.mode.copy(), found.v.copy(), found.force.copy(), found.tau.copy())
        size, none = matrix_size(*sizes), np.zeros((0, 4), np.int64)
        room = Elimination(np.zeros((size, size + 1)), np.zeros(size, np.int64))
        if solve_problem(problem, sizes, found, NO_SURFACES, none, none, room, halt)[0] != SOLVED:
            go_on(halt)
            raise ModelError("step: it could not be repeated")
    return Sensitivity(problem, found.v, found.force, found.tau)

"""A run of any system, step after step: its arrays, and what the failure of a step means.

Steps are taken by kernels (`stepping.advance`). A step that has no solution however short is a jam, or an end
of support, if a certificate proves it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from rungwise.block import Block
from rungwise.contact.judge import Certificate
from rungwise.contact.step import ContactProblem, allocate_problem
from rungwise.deadline import Deadline, go_on
from rungwise.kernel import Reals, steady
from rungwise.models.entries import trimmed
from rungwise.models.ladder import Rung
from rungwise.outcome import Code
from rungwise.simulation.core.crawl import FAR, OVERLAPPING, Leap
from rungwise.simulation.core.last_resort import RAN_AWAY, ask, lacking, unsupported
from rungwise.simulation.core.laws.further import Further, further_rows, law_arrays
from rungwise.simulation.core.limit_surface import without_law
from rungwise.simulation.core.loop import NOWHERE, SUNK
from rungwise.simulation.core.state import CLOCK, Scratch, State, Trial, scratch_arrays, state_arrays
from rungwise.simulation.core.step import SUPPORTED, UNSUPPORTED, solve_step
from rungwise.simulation.core.tolerances import NEAR, PAUSE, ROUNDING
from rungwise.simulation.stepping.advance import (
    NO_ROOM,
    SNAPS,
    UNDEFINED,
    advance,
    fill_here,
    lead,
    snaps_on,
    take,
)
from rungwise.simulation.stepping.attempt import (
    CROWDED,
    HALTED,
    Attempt,
    Setting,
    allocate_attempt,
    attempt,
    fill_terms,
    reach_of,
)
from rungwise.simulation.stepping.overlap import crushes
from rungwise.simulation.stepping.plain import PlainSystem, ToldSystem
from rungwise.simulation.watched.inputs import Inputs, no_inputs
from rungwise.simulation.watched.values import Slots, Watched, allocate_watched
from rungwise.system.moving import Crowded, System
from rungwise.system.terms import APART, Terms, allocate_terms

NOWHERE_TOLD = Slots(0, 1, 1, 1, 1)
"""Of a run that tells nothing but the time."""


class UndefinedNumber(Exception):
    """A number that follows inputs is not finite: `args[0]` is its place in the buffer of the scene's
    numbers."""


@dataclass
class Stepper:
    """A run of `system` on `rung` in steps of length `step`; `theta` as in the theta rule.

    `values` (w,) are what conditions read, `slots` where in them the time, places and speeds are (see
    `Watched`), and `inputs` follow them into the `buffer` of the scene's numbers; a system without inputs
    needs none.
    `outcome` is RUNNING until a step has no solution, JAMMED or UNSUPPORTED with a checked `certificate`, or
    NOT_CONVERGED; or until a contact has yielded too much for its model, MODEL_INVALID.
    `clock` is the state's, as Python reads it fastest; `snaps`: whether the run ended because a leap goes on;
    `lack` says what the last attempt of a run that is NOT_CONVERGED lacks. Steps raise TimeOver where the
    `deadline` has come, or the scratch's halt is set; then none was taken.
    """

    system: System
    rung: Rung
    step: float
    theta: float = 1.0
    values: Reals = field(default_factory=lambda: np.zeros(1))
    slots: Slots = NOWHERE_TOLD
    inputs: Inputs = field(default_factory=no_inputs)
    buffer: Reals = field(default_factory=lambda: np.zeros(0))
    outcome: Code = Code.RUNNING
    certificate: Certificate | None = None
    lack: str = ""
    deadline: Deadline = field(default_factory=Deadline)
    state: State = field(init=False)
    scratch: Scratch = field(init=False)
    terms: Terms = field(init=False)
    problem: ContactProblem = field(init=False)
    watched: Watched = field(init=False)
    clock: np.void = field(init=False)
    snaps: bool = field(init=False, default=False)
    tried: Attempt = field(init=False)
    note: np.void = field(init=False)

    def __post_init__(self) -> None:
        size = self.system.size
        if hasattr(self.system, "prepare"):
            self.system.prepare(self.rung.inertia)
        n, d = size.velocities, size.directions
        q, v = (np.array(part, float) for part in self.system.start())
        if self.rung.inertia == 0.0:
            v[:] = 0.0
        laws, impact = law_arrays(size)
        limited = size.limited + further_rows(size)
        self._further = None if size.laws is None else Further(size.laws, n)
        clock = np.zeros(1, CLOCK)
        self.state = State(clock=clock, v=v, **state_arrays(n, size.slots, d) | {"laws": laws})
        self.scratch = Scratch(**scratch_arrays(n, size.slots, limited, d=d) | {"impact": impact})
        most = size.slots if size.at_once is None else size.at_once
        width = n if size.widths is None else size.widths.rows
        try:
            self.terms = allocate_terms(n, most, limited, d, size.widths, skewed=size.skewed)
            self.problem = allocate_problem(n, most, limited, d, size.widths)
        except MemoryError:
            raise Crowded(
                f"scene: rows of {most} contacts by {width} velocities, twice, do not fit into memory; take"
                " fewer bodies that move, or fewer or simpler geoms that may touch"
            ) from None
        self.terms.rounding[0] = ROUNDING * size.length
        self.terms.pause[0] = PAUSE * self.step
        self.terms.low[0] = math.inf
        self._record = self.rung.record(self.theta)
        self.clock = clock.view(np.dtype(clock.dtype.descr)).view(np.ndarray)[0]
        pulls = self._further is not None and self._further.pulls
        weighs = self.rung.inertia == 1.0 and self.rung.loads and not (size.limited or pulls)
        falls = getattr(self.system, "falls", None) if weighs else None
        within = -math.inf if self._further is None else self._further.named.within
        self.tried = allocate_attempt(
            size, clock.view(np.float64), np.zeros(n) if falls is None else falls, within, self.step
        )
        self.tried.q[:] = q
        self.note = self.tried.note.view(np.dtype(self.tried.note.dtype.descr)).view(np.ndarray)[0]
        self.watched = allocate_watched(clock, self.values, np.zeros(len(self.inputs.columns)), self.slots)
        self._has_kernels = isinstance(getattr(self.system, "mechanism", None), Block)
        self._told = (ToldSystem if self._has_kernels else PlainSystem)(self.system, self._further)
        self._solve, self._advance_in = steady(solve_step), self.steady(advance)
        self._lead_in, self._here_in, self._snaps_in = map(self.steady, (lead, fill_here, snaps_on))
        self._attempt_in, self._fill_in, self._reach_in = map(self.steady, (attempt, fill_terms, reach_of))
        self.clock["limited"] = size.limited
        self.clock["surfaces"] = bool((self.terms.surface != APART).any())
        self.clock["next"] = self.step

    @property
    def is_compiled(self) -> bool:
        """Whether steps are compiled: those of a system of kernels without further laws of contact."""
        return self._further is None and self._has_kernels

    def steady(self, kernel: Any) -> Any:
        """A caller of a kernel of systems, for this run alone; plain Python where its steps are."""
        return steady(kernel) if self.is_compiled else kernel

    @property
    def inside(self) -> Any:
        """The system as the steps see it."""
        return self.system.mechanism if self.is_compiled else self._told  # type: ignore[attr-defined]

    @property
    def setting(self) -> Setting:
        """What steps are taken with."""
        return Setting(
            self._record, self.terms, self.state, self.scratch, self.problem, self.tried, self.watched,
            self.inputs, self.buffer,
        )  # fmt: skip

    @property
    def q(self) -> Reals:
        """Coordinates (n_q,) now."""
        return self.tried.q

    @q.setter
    def q(self, place: Reals) -> None:
        self.tried.q[:] = place

    @property
    def v(self) -> Reals:
        """Velocities (n_v,) at the end of the last step."""
        return self.state.v

    @property
    def time(self) -> float:
        """The time now."""
        return float(self.clock["time"])

    @time.setter
    def time(self, now: float) -> None:
        self.clock["time"] = now

    @property
    def contacts(self) -> int:
        """Contacts of the terms."""
        return int(self.note["contacts"])

    @property
    def attempts(self) -> int:
        """Attempts at steps, those that were refused, too."""
        return int(self.clock["attempts"])

    @property
    def residual(self) -> float:
        """The worst residual of all steps."""
        return float(self.clock["worst_residual"])

    @property
    def leapt(self) -> float:
        """How far the last step leapt, or 0 (see `stepping.attempt`)."""
        return float(self.clock["leapt"])

    @property
    def leaps(self) -> int:
        """Leaps of steps without momentum."""
        return int(self.note["leaps"])

    @property
    def first_leap(self) -> Leap | None:
        """The first leap."""
        return _motion(self.tried.leapt)

    @property
    def outran(self) -> Leap | None:
        """The first step that was shortened because things moved too far in it."""
        return _motion(self.tried.ran)

    def run(self, duration: float) -> Code:
        """Take steps until the time has grown by `duration`, or until a step has no solution."""
        end = self.time + duration
        while self.outcome == Code.RUNNING and self.time < end * (1.0 - 1e-12):
            if self.leapt == 0.0 or not self.snaps_on(self.step):
                self.advance(min(self.step, end - self.time))
        return self.outcome

    def advance(self, h: float, tol: float = math.inf) -> float:
        """Take one step of length h, or shorter (see `stepping.advance`). Where there is none, however short,
        `rw.solve` is asked once, for forces to start from or for a proof. Returns the length for the next
        step."""
        asked = False
        while True:
            status = int(self._advance_in(self.inside, self.setting, h, tol, False))
            if self.settles(status, asked):
                return float(self.clock["next"])
            asked |= status != NO_ROOM

    def snaps_on(self, h: float) -> bool:
        """Whether what leapt in the last step goes on (see `advance.snaps_on`); then the run is over."""
        while not self.settles(int(self._snaps_in(self.inside, self.setting, h)), True):
            pass
        return self.snaps

    def settles(self, status: int, asked: bool) -> bool:
        """Set the outcome by how a step ended (see `stepping.advance`); False where it is to be tried again.
        Raises TimeOver, Crowded, UndefinedNumber."""
        if status == NO_ROOM:
            self.system.makes_room()  # type: ignore[attr-defined]
            return False
        if status == HALTED:
            go_on(self.scratch.halt)
        if status == CROWDED:
            raise self._crowded()
        if status == UNDEFINED:
            raise UndefinedNumber(int(self.watched.undefined[0]))
        if status == SUNK:
            self.outcome = Code.MODEL_INVALID
        elif status == NOWHERE:
            self.outcome = Code.NOT_CONVERGED
        elif status == SNAPS:
            self.outcome, self.snaps = Code.MODEL_INVALID, True
        elif status != SUPPORTED and not self._explain(status, asked):
            self.note["resumed"] = self.clock["tried"]
            return False
        return True

    def _crowded(self) -> Crowded:
        """What says that more contacts are near than a system has room for."""
        if self._has_kernels:
            return self.system.crowded(float(self.note["reach"]))  # type: ignore[attr-defined, no-any-return]
        return self._told.crowded

    def again(self, h: float) -> int:
        """Solve the problem of a step of length h from the terms that there are. Raises TimeOver."""
        status = int(self._solve(self.trial(h)))
        go_on(self.scratch.halt)
        return status

    def trial(self, h: float) -> Trial:
        """The step of length h with the terms that there are."""
        return Trial(self._record, h, self.terms, self.contacts, self.state, self.scratch, self.problem)

    def lead(self, h: float) -> None:
        """Give the system its inputs in a step of length h. Raises UndefinedNumber."""
        if not self._lead_in(self.inside, self.setting, h):
            raise UndefinedNumber(int(self.watched.undefined[0]))

    def attempt(self, h: float) -> int:
        """The status of a step of length h (see `stepping.attempt`). Raises TimeOver, UndefinedNumber."""
        self.lead(h)
        status = int(self._attempt_in(self.inside, self.setting, h))
        while self._has_kernels and self.system.makes_room():  # type: ignore[attr-defined]
            status = int(self._attempt_in(self.inside, self.setting, h))
        if status in (HALTED, CROWDED):
            self.settles(status, True)
        return status

    def accept(self, h: float) -> None:
        """Take the step over that was tried."""
        take(self.inside, self.setting, h)

    def fill(self, h: float, reach: float | None = None) -> bool:
        """Fill in terms where a step of length h begins. False where more contacts than there is room for are
        within reach of a long step."""
        return self._fill(self.q, self.state.v, h, reach, True)

    def fill_at(self, q: Reals, v: Reals, h: float, reach: float | None = None) -> bool:
        """The same at q (n_q,), where v (n_v,) leads within the step."""
        return self._fill(q, v, h, reach, False)

    def _fill(self, q: Reals, v: Reals, h: float, reach: float | None, at_start: bool) -> bool:
        self.tried.trial[:], self.tried.led[:] = q, v
        far = float(self._reach_in(self.inside, self.setting, h)) if reach is None else reach
        status = int(self._fill_in(self.inside, self.setting, h, far, at_start))
        while self._has_kernels and self.system.makes_room():  # type: ignore[attr-defined]
            status = int(self._fill_in(self.inside, self.setting, h, far, at_start))
        if status == CROWDED:
            raise self._crowded()
        return status == SUPPORTED

    def _explain(self, status: int, asked: bool) -> bool:
        """Set the outcome: a contact that yields too much, a jam or a missing support if proved, else not
        converged. False where `rw.solve`, unless it was asked before, solves the step: its forces are the
        forces to start from."""
        clock, terms, state = self.clock, self.terms, self.state
        if not np.isfinite(self.problem.c[: int(clock["free"])]).all():
            self.outcome, self.lack = Code.NOT_CONVERGED, RAN_AWAY
            return True
        tried = self.trial(float(clock["tried"]))
        if int(self.note["cause"]) in (OVERLAPPING, FAR) and crushes(self.rung, self.system.size, tried):
            self.outcome = Code.MODEL_INVALID
            return True
        overlaps = int(self.note["cause"]) == OVERLAPPING
        slow, outcome = self.rung.inertia == 0.0 and self.rung.loads, Code.UNSUPPORTED
        if status == UNSUPPORTED or self.note["leaping"] > 0.0:  # to ask for solutions takes far longer
            self.certificate = self._unsupported(status != UNSUPPORTED)
        if status != UNSUPPORTED and self.certificate is None:
            free, limited = int(clock["free"]), int(clock["limited"])
            problem = trimmed(self.problem, terms, free, self.contacts, limited)
            problem = without_law(problem, terms, state.free, self.rung.inertia)
            self.certificate, solved = ask(problem, terms, state, self.scratch, self.deadline)
            if solved and not asked:
                self.system.accept()  # or new contacts would forget these forces
                return False
            if self.certificate is not None or not slow:
                outcome = Code.JAMMED
            else:
                self.certificate = self._unsupported(True)
        self.outcome = Code.NOT_CONVERGED if self.certificate is None else outcome
        if self.certificate is None:
            self.lack = lacking(status == UNSUPPORTED, overlaps, float(clock["residual"]))
        return True

    def _unsupported(self, anew: bool) -> Certificate | None:
        """A proof that nothing balances the loads; `anew`: in a step that is linearised where it begins."""
        h, residual = float(self.clock["tried"]), float(self.clock["residual"])
        if anew:
            if not self.fill(h):
                return None
            self.again(h)
        self.clock["residual"], near = residual, NEAR * self.system.size.length
        return unsupported(self.trial(h), near, self.deadline)


def _motion(kept: Reals) -> Leap | None:
    """A motion as kernels keep it, if there was one."""
    return None if kept[1] == 0.0 else Leap(float(kept[0]), float(kept[1]), float(kept[2]), kept[3:].copy())

"""Steps of any system, one after another: what of a step is tried, and what its failure means.

The way of one step: `advance` halves its length until an attempt holds (`core.attempt`). Then forces,
deformations and work are taken over (`_accept`). A step that has no solution however short is a jam, or an
end of support, if a certificate proves it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
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
from rungwise.simulation.core.attempt import (
    CROWDED,
    HALTED,
    STUCK,
    Attempt,
    Setting,
    allocate_attempt,
    attempt,
    fill_terms,
    landing,
    reach_of,
)
from rungwise.simulation.core.crawl import BENT, FAR, OVERLAPPING, Crawl, Leap, culprit
from rungwise.simulation.core.last_resort import RAN_AWAY, ask, lacking, unsupported
from rungwise.simulation.core.laws.further import Further, further_rows, law_arrays
from rungwise.simulation.core.limit_surface import without_law
from rungwise.simulation.core.overlap import crushes
from rungwise.simulation.core.plain import PlainSystem
from rungwise.simulation.core.state import CLOCK, Scratch, State, Trial, scratch_arrays, state_arrays
from rungwise.simulation.core.step import SUPPORTED, UNSUPPORTED, solve_step
from rungwise.simulation.core.tolerances import MAX_HALVINGS, NEAR, PAUSE, ROUNDING, SHORTER, SINKING
from rungwise.simulation.core.update_state import accept
from rungwise.system.moving import Crowded, System
from rungwise.system.terms import APART, Terms, allocate_terms

CAUTION, LEAST, MOST = 0.9, 0.2, 2.0
"""A step is made longer or shorter for an error of its own size, times the first, by factors between the
others: as is usual (Hairer, Norsett, Wanner: Solving Ordinary Differential Equations I, section II.4)."""


def nothing(_time: float, _h: float) -> None:
    """What a system whose inputs do not change is told."""


@dataclass
class Stepper:
    """A run of `system` on `rung` in steps of length `step`; `theta` as in the theta rule.

    Before a step of length h is tried, `tell(time, h)` gives the system its inputs in it.
    `outcome` is RUNNING until a step has no solution, JAMMED or UNSUPPORTED with a checked `certificate`, or
    NOT_CONVERGED; or until a contact has yielded too much for its model, MODEL_INVALID.
    `residual` is the worst of all steps, `attempts` counts those refused, too; `clock` is the state's, as
    Python reads it fastest. `leaps` are those of steps without momentum, `leapt` the last step's or 0,
    `snaps` whether the run ended because a leap goes on; `outran` is the first step that was shortened
    because things moved too far in it; `crawl` says what keeps steps short, and `lack` what the last attempt
    of a run that is NOT_CONVERGED lacks. Steps raise TimeOver where the `deadline` has come, or the
    scratch's halt is set; then none was taken.
    """

    system: System
    rung: Rung
    step: float
    theta: float = 1.0
    tell: Callable[[float, float], None] = nothing
    time: float = 0.0
    outcome: Code = Code.RUNNING
    certificate: Certificate | None = None
    residual: float = 0.0
    leaps: list[Leap] = field(default_factory=list)
    outran: Leap | None = None
    lack: str = ""
    deadline: Deadline = field(default_factory=Deadline)
    q: Reals = field(init=False)
    state: State = field(init=False)
    scratch: Scratch = field(init=False)
    terms: Terms = field(init=False)
    problem: ContactProblem = field(init=False)
    clock: np.void = field(init=False)
    attempts: int = field(init=False, default=0)
    _speeds: bytes = field(init=False, default=b"")
    crawl: Crawl = field(init=False)
    leapt: float = field(init=False, default=0.0)
    snaps: bool = field(init=False, default=False)
    tried: Attempt = field(init=False)
    note: np.void = field(init=False)
    _told: float = field(init=False, default=math.nan)

    def __post_init__(self) -> None:
        size = self.system.size
        if hasattr(self.system, "prepare"):
            self.system.prepare(self.rung.inertia)
        n, d = size.velocities, size.directions
        self.q, v = (np.array(part, float) for part in self.system.start())
        if self.rung.inertia == 0.0:
            v[:] = 0.0
        laws, impact = law_arrays(size)
        limited = size.limited + further_rows(size)
        self._further = None if size.laws is None else Further(size.laws, n)
        self.state = State(clock=np.zeros(1, CLOCK), v=v, **state_arrays(n, size.slots, d) | {"laws": laws})
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
        self.crawl = Crawl(self.step, self.time)
        self._record = self.rung.record(self.theta)
        self.clock_numbers = self.state.clock.view(np.float64)
        self.clock = self.state.clock.view(np.dtype(self.state.clock.dtype.descr)).view(np.ndarray)[0]
        pulls = self._further is not None and self._further.pulls
        weighs = self.rung.inertia == 1.0 and self.rung.loads and not (size.limited or pulls)
        falls = getattr(self.system, "falls", None) if weighs else None
        within = -math.inf if self._further is None else self._further.named.within
        self.tried = allocate_attempt(size, np.zeros(n) if falls is None else falls, within)
        self.note = self.tried.note.view(np.dtype(self.tried.note.dtype.descr)).view(np.ndarray)[0]
        self.setting = Setting(self._record, self.terms, self.state, self.scratch, self.problem, self.tried)
        self._plain = PlainSystem(self.system, self._further)
        self._solve, self._take, self._landing = steady(solve_step), steady(accept), steady(landing)
        self._attempt_in = steady(attempt) if self._is_compiled else attempt
        self._fill_in = steady(fill_terms) if self._is_compiled else fill_terms
        self._reach_in = steady(reach_of) if self._is_compiled else reach_of
        self.clock["limited"] = size.limited
        self.clock["surfaces"] = bool((self.terms.surface != APART).any())

    @property
    def _is_compiled(self) -> bool:
        """Whether the system is a block, whose steps are compiled."""
        return self._further is None and isinstance(getattr(self.system, "mechanism", None), Block)

    @property
    def _inside(self) -> Any:
        """The system as the steps see it."""
        return self.system.mechanism if self._is_compiled else self._plain  # type: ignore[attr-defined]

    @property
    def contacts(self) -> int:
        """Contacts of the terms."""
        return int(self.note["contacts"])

    @property
    def v(self) -> Reals:
        """Velocities (n_v,) at the end of the last step."""
        return self.state.v

    def run(self, duration: float) -> Code:
        """Take steps until the time has grown by `duration`, or until a step has no solution."""
        end = self.time + duration
        while self.outcome == Code.RUNNING and self.time < end * (1.0 - 1e-12):
            if self.leapt == 0.0 or not self.snaps_on(self.step):
                self.advance(min(self.step, end - self.time))
        return self.outcome

    def advance(self, h: float, tol: float = math.inf) -> float:
        """Take one step of length h, or shorter: halved as long as it has no solution, and shortened where
        its error is above `tol`, a length. Where there is none, however short, `rw.solve` is asked once, for
        forces to start from or for a proof. Returns the length for the next step.

        To leading order the error of a step of first order is h |v' - v| / 2; a fall along a parabola has
        none. Where nothing moves farther than `tol` in the step, it is small enough.
        """
        asked, landed, self._told = False, False, math.nan
        self.note["follows"] = tol < math.inf
        self.note["allowed"] = tol if tol < math.inf and self.rung.inertia == 0.0 else 0.0
        planned = h = self._until_edge(h)
        shortest = math.ldexp(h, -MAX_HALVINGS)
        while True:
            status, v = self._attempt(h)
            if status == SUPPORTED:
                error, moved = self._error(h, v) if tol < math.inf else (0.0, 0.0)
                wish = (
                    h * min(max(CAUTION * math.sqrt(tol / error), LEAST), MOST) if error > 0.0 else MOST * h
                )
                if error <= tol or moved <= tol:
                    self._accept(h)
                    return max(wish, planned) if landed else wish
                self.crawl.vote(BENT, -1)
                lands = float(self._landing(self.setting, h))
                # What an impact changes does not shrink with the step.
                h, landed = (max(lands, CAUTION * h * tol / error), True) if lands > 0.0 else (wish, landed)
                continue
            moved = h * self.system.fastest(self.q, np.maximum(np.abs(v), np.abs(self.state.speed)))
            stuck = min(STUCK * self.system.size.length, self.system.size.thin)
            still = STUCK * stuck if self._cause == OVERLAPPING and self.rung.inertia > 0.0 else stuck
            if status == UNSUPPORTED or moved < still or h <= shortest:
                if self._explain(status, asked):
                    return h
                asked = True
                continue
            slots = self.scratch.slots[: self.contacts]
            self.crawl.vote(self._cause, culprit(self._cause, slots, self.state.force, self.terms.gap))
            h *= 0.5

    def _until_edge(self, h: float) -> float:
        """The step, or less where a contact comes to the edge of a pull."""
        if self._further is None or not self._further.pulls:
            return h
        self._begin(h)
        filled = self._fill(h)
        return self._further.until_edge(self._tried(h)) if filled else h

    @property
    def _cause(self) -> int:
        """What the last attempt failed by."""
        return int(self.note["cause"])

    def _error(self, h: float, v: Reals) -> tuple[float, float]:
        """Estimated error of a step to velocities v, and how far anything moves in it, as lengths."""
        old = np.where(self.state.prescribed == 1, v, self.state.v)
        change = 0.5 * h * self.system.fastest(self.q, np.abs(v - self.tried.fell - old))
        return 0.5 * change, 0.5 * h * self.system.fastest(self.q, np.maximum(np.abs(v), np.abs(old)))

    def _attempt(self, h: float) -> tuple[int, Reals]:
        """The status of a step of length h, and its velocities (n_v,), or how fast things would move if it is
        refused (see `core.attempt`). Raises TimeOver."""
        self.attempts += 1
        self.crawl.attempts += 1
        self._begin(h)
        self.tried.q[:], self.note["time"], self.note["outran"] = self.q, self.time, False
        status = int(self._attempt_in(self._inside, self.setting, h))
        while self._makes_room():
            status = int(self._attempt_in(self._inside, self.setting, h))
        if status == HALTED:
            go_on(self.scratch.halt)
        if status == CROWDED:
            raise self._crowded()
        v = self.tried.v.copy()
        if self.note["outran"]:
            self.outran = self.outran or Leap(self.time, h, float(self.note["far"]), v)
        return status, v

    def _makes_room(self) -> bool:
        """Whether the system had no room for what it found, and has made some."""
        return self._is_compiled and bool(self.system.makes_room())  # type: ignore[attr-defined]

    def _crowded(self) -> Crowded:
        """What says that more contacts are near than a system has room for."""
        if self._is_compiled:
            return self.system.crowded(float(self.note["reach"]))  # type: ignore[attr-defined, no-any-return]
        return self._plain.crowded

    def snaps_on(self, h: float) -> bool:
        """Whether what leapt in the last step would go on so in a small part of a step of length h, under the
        same drives: then momentum decides where it rests, and the run is over."""
        part = SHORTER * h
        self._drive()
        filled = self._fill(part)
        supported = filled and self._again(part) == SUPPORTED
        if supported and 0.5 * part * self.system.fastest(self.q, self.scratch.v_new) >= 0.5 * self.leapt:
            self.outcome, self.snaps = Code.MODEL_INVALID, True
        return self.snaps

    def _again(self, h: float) -> int:
        """Solve the problem of a step of length h from the terms that there are. Raises TimeOver."""
        status = int(self._solve(self._tried(h)))
        go_on(self.scratch.halt)
        return status

    def _tried(self, h: float) -> Trial:
        return Trial(self._record, h, self.terms, self.contacts, self.state, self.scratch, self.problem)

    def _begin(self, h: float) -> None:
        """Give the system its inputs in a step of length h."""
        if h != self._told:
            self.tell(self.time, h)
            self._told = h
        self._drive()

    def _drive(self) -> None:
        """Set which coordinates are free, and how fast the others move."""
        speeds, clock = self.system.speeds(self.time), self.clock
        if speeds.tobytes() == self._speeds:
            return
        self._speeds = speeds.tobytes()
        free = np.flatnonzero(np.isnan(speeds))
        self.state.speed[:] = np.nan_to_num(speeds)
        self.state.prescribed[:] = ~np.isnan(speeds)
        self.state.free[: len(free)] = free
        clock["free"] = len(free)

    def _fill(self, h: float, reach: float | None = None) -> bool:
        """Fill in terms where steps begin, for a step of length h. False where more contacts than there is
        room for are within reach of a long step."""
        return self.fill_at(self.q, self.state.v, h, reach)

    def fill_at(self, q: Reals, v: Reals, h: float, reach: float | None = None) -> bool:
        """The same at q (n_q,), where v (n_v,) leads from where the step begins."""
        self.tried.q[:], self.tried.trial[:], self.tried.led[:] = self.q, q, v
        self.note["time"], at_start = self.time, q is self.q
        far = float(self._reach_in(self._inside, self.setting, h)) if reach is None else reach
        status = int(self._fill_in(self._inside, self.setting, h, far, at_start))
        while self._makes_room():
            status = int(self._fill_in(self._inside, self.setting, h, far, at_start))
        if status == CROWDED:
            raise self._crowded()
        return status == SUPPORTED

    def _accept(self, h: float) -> None:
        self.clock["time"] = self.time
        sunk = self._take(self._tried(h))
        self.system.accept()
        self.residual = max(self.residual, float(self.clock["residual"]))
        self.leapt = float(self.note["leaping"])
        if self.leapt > 0.0:
            self.leaps.append(Leap(self.time, h, self.leapt, self.state.v.copy()))
        self.q, self.time = self.tried.trial.copy(), self.time + h
        if self.rung.compliant and sunk > SINKING * self.system.size.length:
            self.outcome = Code.MODEL_INVALID
        elif self.crawl.ends(self.time):
            self.outcome = Code.NOT_CONVERGED

    def _explain(self, status: int, asked: bool) -> bool:
        """Set the outcome: a contact that yields too much, a jam or a missing support if proved, else not
        converged. False where `rw.solve`, unless it was asked before, solves the step: its forces are the
        forces to start from."""
        clock, terms, state = self.clock, self.terms, self.state
        if not np.isfinite(self.problem.c[: int(clock["free"])]).all():
            self.outcome, self.lack = Code.NOT_CONVERGED, RAN_AWAY
            return True
        tried = self._tried(float(clock["tried"]))
        if self._cause in (OVERLAPPING, FAR) and crushes(self.rung, self.system.size, tried):
            self.outcome = Code.MODEL_INVALID
            return True
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
            self.lack = lacking(status == UNSUPPORTED, self._cause == OVERLAPPING, float(clock["residual"]))
        return True

    def _unsupported(self, anew: bool) -> Certificate | None:
        """A proof that nothing balances the loads; `anew`: in a step that is linearised where it begins."""
        h, residual = float(self.clock["tried"]), float(self.clock["residual"])
        if anew:
            if not self._fill(h):
                return None
            self._again(h)
        self.clock["residual"], near = residual, NEAR * self.system.size.length
        return unsupported(self._tried(h), near, self.deadline)

"""Steps of any system, one after another, in Python around the core's kernels.

The way of one step: `advance` halves its length until an attempt holds; an attempt (`_attempt`) asks the
system for terms, solves (`core.step.solve_step`, which assembles the rung's problem and chooses inertia and
restitution), moves, and looks at the gaps; where gaps are not linear over the step, it solves again from
there. Then forces, deformations and work are taken over (`_accept`). A step that has no solution however
short is a jam, or an end of support, if a certificate proves it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from rungwise.contact.judge import Certificate
from rungwise.contact.step import ContactProblem, allocate_problem, trim
from rungwise.deadline import Deadline, go_on
from rungwise.kernel import Reals, steady
from rungwise.models.ladder import Rung
from rungwise.outcome import Code
from rungwise.simulation.core.balance import ask_speeds, keep_near, pushes_far
from rungwise.simulation.core.crawl import BENT, FAR, INSOLUBLE, OVERLAPPING, Crawl, Leap, culprit
from rungwise.simulation.core.fall import Fall
from rungwise.simulation.core.last_resort import RAN_AWAY, ask, lacking, unsupported
from rungwise.simulation.core.laws.further import Further, further_rows, law_arrays
from rungwise.simulation.core.limit_surface import without_law
from rungwise.simulation.core.overlap import crushes, least_allowed, open_added
from rungwise.simulation.core.state import CLOCK, Scratch, State, Trial, scratch_arrays, state_arrays
from rungwise.simulation.core.step import SUPPORTED, UNSOLVED, UNSUPPORTED, solve_step
from rungwise.simulation.core.tolerances import (
    DRIVEN,
    LINEARISATIONS,
    MAX_HALVINGS,
    NEAR,
    PAUSE,
    ROUNDING,
    SHORTER,
    SINKING,
)
from rungwise.simulation.core.update_state import accept, fill_pace, take_slots
from rungwise.system.moving import Crowded, Moment, System
from rungwise.system.terms import APART, INERTIA, METRIC, Terms, allocate_terms

ROUNDED = 4
"""Linearisations on the other rungs, where bodies that roll would overlap by curvature; chosen by trial."""
SEEN = 2.0
"""Distance within which contacts are looked for, over the farthest motion in the step."""
STUCK = 1e-3
"""Motion over the system's length in a step: below this a step without solution has none, however short."""
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
    contacts: int = field(init=False, default=0)
    _speeds: bytes = field(init=False, default=b"")
    _trial: Reals = field(init=False)
    _cause: int = field(init=False, default=INSOLUBLE)
    crawl: Crawl = field(init=False)
    _deep: float = field(init=False, default=0.0)
    leapt: float = field(init=False, default=0.0)
    snaps: bool = field(init=False, default=False)
    _leaping: float = field(init=False, default=0.0)
    _allowed: float = field(init=False, default=0.0)
    _fall: Fall = field(init=False)
    _told: float = field(init=False, default=math.nan)
    _asked: Reals = field(init=False)

    def __post_init__(self) -> None:
        size = self.system.size
        n, d = size.velocities, size.directions
        self.q, v = (np.array(part, float) for part in self.system.start())
        if self.rung.inertia == 0.0:
            v[:] = 0.0
        laws, impact = law_arrays(size)
        limited = size.limited + further_rows(size)
        self._further = None if size.laws is None else Further(size.laws, n)
        self.state = State(clock=np.zeros(1, CLOCK), v=v, **state_arrays(n, size.slots, d) | {"laws": laws})
        self.scratch = Scratch(**scratch_arrays(n, size.slots, limited, d=d) | {"impact": impact})
        self.terms = allocate_terms(n, size.slots, limited, d, size.crowded, skewed=size.skewed)
        self.problem = allocate_problem(n, size.slots, limited, d)
        self.terms.rounding[0] = ROUNDING * size.length
        self.terms.pause[0] = PAUSE * self.step
        self.terms.low[0] = math.inf
        self.crawl = Crawl(self.step, self.time)
        self._record = self.rung.record(self.theta)
        self.clock = self.state.clock.view(np.dtype(self.state.clock.dtype.descr)).view(np.ndarray)[0]
        self._pace, self._fill_pace = np.zeros(n), steady(fill_pace)
        self._keep_near, self._pushes_far = steady(keep_near), steady(pushes_far)
        self._asked, self._ask_speeds = np.zeros(n), steady(ask_speeds)
        self._fall = Fall(self.system, self.rung, self._further is not None and self._further.pulls)
        self._solve, self._take, self._take_slots = steady(solve_step), steady(accept), steady(take_slots)
        self.clock["limited"] = size.limited
        self.clock["surfaces"] = bool((self.terms.surface != APART).any())

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
        asked, landed, self._fall.follows, self._told = False, False, tol < math.inf, math.nan
        self._allowed = tol if tol < math.inf and self.rung.inertia == 0.0 else 0.0
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
                lands = self._fall.lands(self._tried(h))
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
        filled = self._fill(self.q, self.state.v, h, self._reach(h))
        return self._further.until_edge(self._tried(h)) if filled else h

    def _error(self, h: float, v: Reals) -> tuple[float, float]:
        """Estimated error of a step to velocities v, and how far anything moves in it, as lengths."""
        old = np.where(self.state.prescribed == 1, v, self.state.v)
        change = 0.5 * h * self.system.fastest(self.q, np.abs(v - self._fall.fell - old))
        return 0.5 * change, 0.5 * h * self.system.fastest(self.q, np.maximum(np.abs(v), np.abs(old)))

    def _attempt(self, h: float) -> tuple[int, Reals]:
        """The status of a step of length h, and its velocities (n_v,), or how fast things would move if it is
        refused; `_trial` is where they lead."""
        self.attempts += 1
        self.crawl.attempts += 1
        self._cause, self._leaping, size = INSOLUBLE, 0.0, self.system.size
        self._begin(h)
        self.clock["tried"] = h
        before = -math.inf if self.rung.compliant else self.system.least_gap(self.q)
        self._trial, reach, begins = self.q, self._reach(h), True
        led, fastest = self.state.v, np.abs(self.state.v)
        for _ in range(LINEARISATIONS if self.rung.metric else ROUNDED):
            if not self._fill(self._trial, led, h, reach):
                self._cause = FAR
                return UNSOLVED, np.maximum(np.abs(self._pace), fastest)
            status = self._again(h)
            if status != SUPPORTED:
                return status, self.state.v
            way = h * self.system.fastest(self.q, self.scratch.v_new)
            if begins and self._leads_far(way):
                verdict, paced = self._walk(h, way, reach)
                if verdict != SUPPORTED:
                    return verdict, paced
            if way > reach:
                reach, self._pace = SEEN * way, np.abs(self.scratch.v_new)
                continue
            v = self.scratch.v_new.copy()
            fastest = np.maximum(fastest, np.abs(v))
            led = self._fall.leads(self._tried(h), self.q, v)
            if way > size.thin and self.system.passes(self.q, led, h):
                break
            self._trial = self.system.integrate(self.q, led, h)
            if self._fits(v, h, way, before):
                return SUPPORTED, v
            if begins:
                self._deep, begins = float(-self.terms.gap[: self.contacts].min(initial=0.0)), False
        self._cause = OVERLAPPING
        return UNSOLVED, fastest

    def _leads_far(self, way: float) -> bool:
        """Whether a step without momentum goes so far that it may leap."""
        return self.rung.inertia == 0.0 and self.rung.loads and way > NEAR * self.system.size.length

    def _walk(self, h: float, way: float, reach: float) -> tuple[int, Reals]:
        """Whether balance is held along the way of a step without momentum that was just solved, of length h:
        SUPPORTED with its solution as it was, or another status and how fast things would move.

        What nothing holds where the step begins would come to rest against whatever lies in its way, however
        far. So the contacts that are closed, or that driven motion closes in the step, have to balance the
        loads alone. A motion that vanishes with the step is taken in steps no longer than the smallest thing,
        unless drives lead it: their speed bounds it. One that does not leads out of balance: it settles,
        because loads or drives have jumped, or goes on (`snaps_on`).
        """
        size, state, scratch, v = self.system.size, self.state, self.scratch, self.scratch.v_new.copy()
        driven = h * self.system.fastest(self.q, state.speed)
        near = NEAR * size.length
        self._ask_speeds(self._tried(h), self._asked)
        led = h * self.system.fastest(self.q, self._asked)
        lone = bool(self._pushes_far(self._tried(h), near))
        if lone:
            self.contacts = int(self._keep_near(self._tried(h), near))
        if lone and self._again(h) != SUPPORTED:
            return (UNSUPPORTED, state.v) if driven < STUCK * size.length else (UNSOLVED, state.speed)
        if lone:
            self._fill(self.q, state.v, h, reach)
        far = way > max(2.0 * size.length, DRIVEN * driven)
        if far:
            shorter = self._again(SHORTER * h)
            moved = SHORTER * h * self.system.fastest(self.q, scratch.v_new)
            vanishes = shorter == SUPPORTED and moved < 0.5 * way
            if vanishes and way > DRIVEN * led:
                self.outran = self.outran or Leap(self.time, h, 0.5 * way, v)
                self._cause = FAR
                return UNSOLVED, v
            self._leaping = 0.0 if vanishes else 0.5 * way
        if far or lone:
            self._again(h)
        return SUPPORTED, v

    def snaps_on(self, h: float) -> bool:
        """Whether what leapt in the last step would go on so in a small part of a step of length h, under the
        same drives: then momentum decides where it rests, and the run is over."""
        part = SHORTER * h
        self._drive()
        filled = self._fill(self.q, self.state.v, part, self._reach(part))
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

    def _fits(self, v: Reals, h: float, way: float, before: float) -> bool:
        """Whether things overlap no more at the end of a step to v than is allowed or was so `before`."""
        size = self.system.size
        if self.rung.compliant and way <= STUCK * size.length:
            return True
        least = least_allowed(self.rung, size, self._tried(h), v, way, before)
        return self.system.least_gap(self._trial) >= least

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

    def _reach(self, h: float) -> float:
        """How far contacts are looked for in a step of length h, for what is known before it."""
        falls = h if self.rung.inertia > 0.0 else 0.0
        self._fill_pace(self.state.v, self.state.speed, self.terms.fall, falls, self._pace)
        reach = SEEN * h * self.system.fastest(self.q, self._pace) + STUCK * self.system.size.length
        reach = max(reach, self._allowed)  # steps may leave what pushes so far open
        return max(reach, -math.inf if self._further is None else self._further.named.within)

    def _fill(self, trial: Reals, v: Reals, h: float, reach: float) -> bool:
        """Fill in terms at `trial`, as a step from q sees them: gaps less the contribution of v on the way
        there. False where more contacts than there is room for are within reach of a long step."""
        terms, state, rung = self.terms, self.state, self.rung
        moment = Moment(self.time, trial, state.v, h, rung.inertia, rung.metric)
        try:
            slots, fresh = self.system.fill(moment, terms, reach)
        except Crowded:
            if reach > 2.0 * STUCK * self.system.size.length:
                return False
            raise
        count, d = len(slots), self.system.size.directions
        self.contacts = count
        if trial is not self.q:
            terms.gap[:count] -= h * terms.rows[: count * d : d] @ v
            if not (rung.compliant or rung.metric):
                open_added(terms, count, h, self._deep)
        self._take_slots(slots, fresh, rung.compliant, state, terms, self.scratch)
        if self._further is not None:
            self._further.fill(self._tried(h), trial is self.q)
        if rung.inertia == 0.0:
            terms.heft[:, INERTIA] = np.abs(terms.inertia).sum(axis=1)
            terms.heft[:, METRIC] = np.abs(terms.metric).sum(axis=1)
        np.subtract(terms.load, self.system.driving, out=state.passive)
        return True

    def _accept(self, h: float) -> None:
        self.clock["time"] = self.time
        sunk = self._take(self._tried(h))
        self.system.accept()
        self.residual = max(self.residual, float(self.clock["residual"]))
        if self._leaping > 0.0:
            self.leaps.append(Leap(self.time, h, self._leaping, self.state.v.copy()))
        self.leapt = self._leaping
        self.q, self.time = self._trial, self.time + h
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
        if status == UNSUPPORTED or self._leaping > 0.0:  # to ask for solutions takes far longer
            self.certificate = self._unsupported(status != UNSUPPORTED)
        if status != UNSUPPORTED and self.certificate is None:
            problem = trim(self.problem, int(clock["free"]), self.contacts, int(clock["limited"]))
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
            if not self._fill(self.q, self.state.v, h, self._reach(h)):
                return None
            self._again(h)
        self.clock["residual"], near = residual, NEAR * self.system.size.length
        return unsupported(self._tried(h), near, self.deadline)

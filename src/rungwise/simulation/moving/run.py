"""Running a scene on a rung: the core's steps with the scene's inputs, conditions and frames.

The scene's world says what moves (`Prepared`); the plane has a loop of its own.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from rungwise.deadline import Running
from rungwise.kernel import Reals
from rungwise.models.ladder import Rung
from rungwise.outcome import OUTCOMES, Code
from rungwise.scene import InvalidScene
from rungwise.scene.stated import StatedScene
from rungwise.simulation.core.stepper import Stepper
from rungwise.simulation.core.tolerances import ROUNDING
from rungwise.simulation.inputs import condition
from rungwise.simulation.live.observation import Contacts
from rungwise.simulation.moving.begin import Fault, begin_at
from rungwise.simulation.moving.frames import Recorder
from rungwise.simulation.moving.held_since import Times
from rungwise.simulation.moving.kind import Kind
from rungwise.simulation.moving.memory import memory_parts
from rungwise.simulation.moving.prepared import Prepared
from rungwise.simulation.moving.schedule import Clock
from rungwise.simulation.moving.taken_back import Begun, sooner
from rungwise.simulation.moving.values import Values
from rungwise.simulation.options import MANY, ModelError
from rungwise.simulation.reasons.remarks import advice, stillness
from rungwise.simulation.state import Memory, State, StateError
from rungwise.simulation.turns import LONGEST, TURN_S, Turns
from rungwise.simulation.watched.held_since import DATINGS

GAINED = 1e-12
"""Work of contacts in a step, over all of it, that is rounding."""


Prepare = Callable[[dict[str, float]], Prepared]
"""Makes a scene ready at its parameters. Raises InvalidScene where it is impossible there."""


class MovingSimulation(Turns, Kind):
    """A run that is taken in turns, of what `prepare` makes of the scene; no frames are kept where `frames`
    is None."""

    def __init__(self, scene: StatedScene, model: Rung | str, prepare: Prepare, **options: Any) -> None:
        super().__init__(scene, model, options)
        given = self.given
        for name in ("motion", "save_hard"):
            if getattr(given, name) is not None:
                raise ModelError(f"{name}: does not work for {self.kind}")
        self._schedule()
        self._gained = 0.0
        self.stepper: Stepper | None = None
        try:
            made = prepare(self.parameters)
        except InvalidScene as error:
            self.outcome, self.reason = Code.INVALID, str(error)
            return
        bound, self.system = made.bound, made.system
        self.system.forget()
        self._bound: Any = bound
        self.notes: tuple[str, ...] = bound.notes
        self.step = bound.step if given.step is None else given.step
        template = scene.template
        columns = tuple(template.parameters.index(name) for name in template.inputs)
        self._margins = -math.inf, -math.inf
        self._tol = math.inf if given.tol is None else given.tol
        self._next, state = self.step, given.state
        self._clock = Clock(self._segments, 0.0 if state is None else state.time, template.inputs, columns)
        self._scheduled = bool(self.inputs) and given.duration is None
        self.stepper = Stepper(self.system, self.model, self.step, self.theta, self._tell)
        until = [condition(scene, each.until, "until") for each in self.inputs]
        self._values = Values(scene, bound, until)
        self._times = Times(self._values)
        before: list[Fault] | None = []
        if state is not None:
            before = self._go_on(state, self.stepper, given.inputs is None)
        self.end = given.duration or (self._clock.end if self.inputs else bound.duration)
        # A run that goes on where a condition ended a segment takes steps as long as the run before.
        whole = max(self.end, given.duration or sum(each.duration for each in self.inputs))
        self._longest = (given.span or whole) / LONGEST
        if state is not None and not state.time < self.end:
            raise ModelError(f"duration: the run ends at {self.end:g}, and the state is at {state.time:g}")
        most, stride = given.frames or 0, given.stride
        if stride is None:
            stride = max(1, math.ceil(min(self.end / self.step / max(most, 1), MANY)))
        self._recorder = Recorder(most, stride)
        if before is not None:
            field = "start" if state is None else "state"
            self.reason = self.misplaced(self.stepper.q, before, field)
            self.is_misplaced = state is not None and bool(self.reason)
        self.reason = self.reason or self._times.impossible()
        if self.reason:
            self.outcome = Code.INVALID
            return
        self._values.place(self.stepper.time, self.stepper.q, self.stepper.v, self.system)
        self._values.push(self.stepper, self.system, 0.0)  # the state's impulses hold those of its last step
        self._times.enter(self._clock.segment)
        self._times.note(self._clock.segment)
        self._times.end(self._clock.segment, self.stepper.time)
        self._judge()
        self._recorder.take(self.stepper.time, self.frame)
        if self.outcome != Code.RUNNING:
            self._explain(self.stepper)

    @property
    def time(self) -> float:
        """Simulated time so far."""
        return 0.0 if self.stepper is None else self.stepper.time

    def advance(self, *, limit: float | None = None) -> bool:
        """Take steps for about `TURN_S`; returns whether the run goes on. A step, or the search for a proof,
        that takes longer than `limit` seconds is given up, and is made anew by the next turn."""
        if self.outcome != Code.RUNNING or self.stepper is None:
            return False
        self._in_time(limit, partial(self._advanced, self.stepper))
        return self.outcome == Code.RUNNING

    def _advanced(self, stepper: Stepper) -> None:
        """One turn. Raises TimeOver."""
        over = time.perf_counter() + TURN_S
        self._take_while(stepper, lambda: time.perf_counter() < over)
        if self.outcome == Code.RUNNING:
            self.deadline.look()

    def _take_while(self, stepper: Stepper, goes_on: Callable[[], bool]) -> None:
        """Take steps while the run goes on, and this does. Raises TimeOver."""
        began = time.perf_counter()
        try:
            with self.running(stepper):
                while self.outcome == Code.RUNNING and goes_on():
                    self.deadline.look()
                    self.take()
        finally:
            self.wall_s += time.perf_counter() - began

    def running(self, stepper: Stepper) -> Running:
        """Within the context steps raise TimeOver where the deadline has come."""
        stepper.deadline = self.deadline
        return self.deadline.running(stepper.scratch.halt)

    def steps_taken(self, count: int, *, limit: float | None = None) -> int:
        """Take at most so many steps; returns how many, fewer where the run has ended, or `limit` seconds are
        over."""
        if self.stepper is None:
            return 0
        taken = list[int]()
        self._in_time(limit, partial(self._steps_taken, self.stepper, count, taken))
        return len(taken)

    def _steps_taken(self, stepper: Stepper, count: int, taken: list[int]) -> None:
        """Take at most so many steps, and note each. Raises TimeOver."""
        with self.running(stepper):
            while self.outcome == Code.RUNNING and len(taken) < count:
                self.deadline.look()
                self.take()
                taken.append(1)

    def take(self) -> None:
        """Take one step of a run that goes on, and judge where it led."""
        stepper = self.stepper
        assert stepper is not None
        h = min(self._next, self.end - stepper.time, self._clock.left(stepper.time))
        h = min(h, self._times.end(self._clock.segment) - stepper.time)
        before = float(stepper.clock["contact_work"])
        try:
            wish = self._stepped(stepper, h)
        except InvalidScene as error:
            self.outcome, self.reason = Code.INVALID, str(error)
            return
        if self._tol < math.inf:
            self._next = min(max(wish, self._next if h < self._next else 0.0), self._longest)
        if stepper.clock["bounced"]:
            added = float(stepper.clock["contact_work"]) - before
            self._gained += added if added > GAINED * abs(before) else 0.0
        if stepper.outcome != Code.RUNNING:
            self.outcome, self.certificate = stepper.outcome, stepper.certificate
            self._explain(stepper)
        else:
            self._judge()
            self._recorder.take(stepper.time, self.frame)
        if self.outcome == Code.RUNNING and stepper.time >= self.end * (1.0 - ROUNDING):
            self.outcome = Code.TIMEOUT
        if self.outcome != Code.RUNNING:
            self._recorder.take(stepper.time, self.frame, last=True)
            self._explain(stepper)

    def _stepped(self, stepper: Stepper, h: float) -> float:
        """Take a step of length h, or less where a condition begins to hold within it; returns the length for
        the next. Raises InvalidScene."""
        values, segment = self._values, self._clock.segment
        lasting = bool(self._times.parts(segment))
        looks = values.is_guarded(segment) or lasting or (bool(values.verdicts) and h > self.step)
        begun, solved, dated = Begun.of(stepper, values, self.remembered()) if looks else None, 0.0, 0
        if stepper.leapt > 0.0 and stepper.snaps_on(h):
            return h
        while True:
            wish = stepper.advance(h, self._tol)
            if values.is_asked:
                values.read(stepper, self.system)
            if begun is None or (stepper.outcome != Code.RUNNING and not solved):
                if lasting and stepper.outcome == Code.RUNNING:
                    self._times.ended(segment, float(stepper.clock["tried"]), values.all, exact=False)
                return wish
            took = float(stepper.clock["tried"])
            if stepper.outcome != Code.RUNNING:  # what a longer step solves is not given up for its date
                self._take_back(begun)
                begun, h = None, solved
                continue
            h = sooner(begun, values, self._times, segment, took, self.step, self._longest, solved > 0.0)
            if lasting and not h < took:
                end = self._times.ended(segment, took, begun.values, dated < DATINGS)
                h, dated = min(took, end - begun.time), dated + 1
            if not h < took:
                return min(wish, self.step) if solved else wish
            self._take_back(begun)
            solved = took

    def _take_back(self, begun: Begun) -> None:
        assert self.stepper is not None
        self.recall(begun.core)
        begun.restore(self.stepper, self._values)

    def _tell(self, time: float, h: float) -> None:
        """Tell the system the inputs in the middle of a step and at its end. Raises InvalidScene."""
        told = self._values.told
        self._clock.tell(time + 0.5 * h, told)
        middle = told.copy()
        self._clock.tell(time + h, told)
        self.follow(middle, told)

    def memory(self) -> Reals:
        """What the run hands on (w,): its place in the schedule, the length of the next step, margins, values
        that conditions read, and the core's."""
        stepper = self.stepper
        assert stepper is not None
        if not self._values.is_asked:
            self._values.read(stepper, self.system)
        own = np.array([self._next, *self._margins, self._gained])
        return np.concatenate([self._clock.memory(), own, self._values.all, self.remembered()])

    def memory_at(self, memory: Memory, q: Reals) -> Memory:
        """The memory of a state of this scene whose bodies were moved to q (n_q,)."""
        values, first = memory.values.copy(), len(self.scene.template.parameters) + 1
        values[memory_parts(self.scene).values][first : first + len(q)] = q
        return replace(memory, values=values)

    def _go_on(self, state: State, stepper: Stepper, same_inputs: bool) -> list[Fault] | None:
        """Begin at a state; where it is of this scene, with what its run handed on: all of it on the same
        rung at the same parameters, and the contacts on others. Inputs that a new schedule does not name stay
        as they were. Returns what was amiss in the state's own run, None where it is just the same here."""
        rest, memory = begin_at(state, self.scene, stepper), state.memory
        if rest is None or memory is None:
            return []
        parts, columns = memory_parts(self.scene), list(self._clock.columns)
        known = rest[parts.values][: len(self.scene.template.parameters)]
        if memory.inputs:
            self._values.told[columns] = known[columns]
        if same_inputs:
            self._clock.recall(rest[parts.clock])
        same = np.array_equal(known, self._values.told[:-1])
        goes_on = same and memory.model.record(memory.theta) == self.model.record(self.theta)
        try:
            (self.recall if goes_on else self.hand_on)(rest[parts.core])
        except ValueError:
            if same:
                raise StateError("state.memory: is of another scene") from None
        if goes_on:
            if same_inputs:
                self._times.go_on(self._clock.segment)
            self._next, *margins, self._gained = rest[parts.own].tolist()
            self._margins = margins[0], margins[1]
            self._values.hand_on(rest[parts.values])
        if same:
            return None
        parameters = dict(zip(self.scene.template.parameters, known.tolist(), strict=True))
        own = self.scene.file.parameters
        still = {name: own[name].default for name in self.scene.template.inputs if memory.inputs}
        return self.faults_before(parameters | still, stepper.q)

    @property
    def segment(self) -> int:
        return 0 if self.stepper is None else self._clock.segment

    def _now(self) -> tuple[Reals, Reals, Reals]:
        assert self.stepper is not None
        columns = list(self._clock.columns)
        return self.stepper.q.copy(), self.stepper.v.copy(), self._values.told[columns]

    def _contacts(self) -> Contacts:
        return self.contacts(self.model.loads)

    def _open(self) -> None:
        self._clock.enter(len(self._segments) - 1, self.time)

    def _shorten(self, _duration: float) -> None:
        self._clock.enter(len(self._segments), self.time)

    def _through(self) -> None:
        assert self.stepper is not None
        self._take_while(self.stepper, lambda: self.segment < len(self._segments))

    @property
    def steps(self) -> int:
        """Steps taken so far."""
        return 0 if self.stepper is None else int(self.stepper.clock["steps"])

    @property
    def margin(self) -> float:
        """Signed margin of the run, as of `Results`."""
        best, danger = self._margins
        if self.outcome == Code.GOAL:
            return -danger if danger > -math.inf else 1.0 - self.time / self.end
        return min(best, 0.0) if best > -math.inf else math.nan

    def _judge(self) -> None:
        """Set the outcome where a condition decides it, or the schedule is over."""
        if self._values.verdicts:
            best, danger = self._margins
            self.outcome, goal, near = self._values.judge()
            self._margins = max(best, goal), max(danger, near)
        clock, values = self._clock, self._values
        if self.outcome != Code.RUNNING:
            return
        if not clock.go_on(self.time, values.told, self._is_over):
            on = self.inputs[clock.segment]
            self.outcome = Code.TIMEOUT
            self.reason = f"inputs.{clock.segment}.until: {on.until} did not hold within {on.duration:g}"
        elif self._scheduled and clock.is_over:
            self.outcome = Code.MISSED if self.scene.file.goal else Code.TIMEOUT

    def _is_over(self, number: int) -> bool:
        """Whether the condition of segment k, which is on, holds."""
        self._times.enter(number)
        return self._values.is_over(number)

    def _explain(self, stepper: Stepper) -> None:
        """Set the reason of the outcome."""
        outcome = OUTCOMES[self.outcome]
        if self.reason:
            return
        if self.certificate is not None:
            why = f" ({self.certificate.kind} certificate, checked)"
            self.reason = f"{outcome.meaning}{why}. {outcome.advice}"
        elif self.outcome == Code.NOT_CONVERGED:
            self.reason = self.stuck(stepper) if stepper.lack else self.crawled(stepper)
        elif stepper.snaps:
            self.reason = self.snapped(stepper)
        else:
            has_goal, tolerance = self.scene.file.goal is not None, float(self._bound.tolerance)
            rests = stillness({"": (float(np.abs(stepper.v).max(initial=0.0)), False)}, self.time, tolerance)
            self.reason = f"{outcome.meaning}. {advice(outcome, self.model, has_goal, rests)}"

    def _notes(self) -> tuple[str, ...]:
        """Remarks on the model, on the geometry of contacts, and on steps that went far."""
        remarks, stepper = self.remarks(), self.stepper
        if stepper is not None and stepper.leaps:
            first, count = stepper.leaps[0], len(stepper.leaps)
            name = self.fastest(first.v)
            more = f", {count} times in all" if count > 1 else ""
            remarks += (
                f"balance: at t = {first.time:.6g} {name} leapt by {first.far:.3g} in a"
                f" step of {first.h:.3g}{more}, to where drives and loads then balance: without momentum or"
                " damping it is there at once; a dynamic rung follows it",
            )
        if stepper is not None and stepper.outran is not None:
            first = stepper.outran
            name = self.fastest(first.v)
            remarks += (
                f"step: at t = {first.time:.6g} {name} would move by {first.far:.3g} in one"
                f" of {first.h:.3g}, against damping alone: such steps are shortened to the size of"
                " the smallest body, and bodies that come to rest may swing by as much; use tol or a dynamic"
                " rung",
            )
        return remarks

    def result(self) -> Any:
        """The run as far as it has come."""
        stepper = self.stepper
        clock = None if stepper is None else stepper.state.clock[0]
        if stepper is not None and self._recorder.frames and self._recorder.frames[-1].time != stepper.time:
            self._recorder.take(stepper.time, self.frame, last=True)
        return self.run_of(
            **self._record(clock),
            worst_residual=0.0 if stepper is None else stepper.residual,
            frames=tuple(self._recorder.frames) if stepper is not None else (),
            energy_gained=self._gained,
            notes=self.moved_to_begin + (self._notes() if stepper is not None else ()),
        )

"""Running a scene on a rung: the core's loop with the scene's inputs, conditions and frames.

The scene's world says what moves (`Prepared`); the plane has a loop of its own.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from rungwise.deadline import Running, clock, set_at
from rungwise.kernel import Ints, Reals, linking_time
from rungwise.models.ladder import Rung
from rungwise.outcome import OUTCOMES, Code
from rungwise.scene import InvalidScene
from rungwise.scene.language.expression import SLOTS
from rungwise.scene.stated import StatedScene
from rungwise.simulation.core.loop import begin_run
from rungwise.simulation.core.step import SUPPORTED
from rungwise.simulation.inputs import compile_segments, impossible_times
from rungwise.simulation.live.growing import Growing
from rungwise.simulation.live.observation import Contacts
from rungwise.simulation.moving.begin import Fault, begin_at
from rungwise.simulation.moving.frames import Frames, Recorder
from rungwise.simulation.moving.kind import Kind
from rungwise.simulation.moving.memory import PLACES, first_value, memory_parts, values_in, written
from rungwise.simulation.moving.prepared import Prepared
from rungwise.simulation.moving.values import asked_of, blank_values, slots_of
from rungwise.simulation.options import MANY, ModelError
from rungwise.simulation.reasons.remarks import advice, stillness, unmet
from rungwise.simulation.state import Memory, State, StateError
from rungwise.simulation.stepping.advance import NO_ROOM
from rungwise.simulation.stepping.loop import (
    FULL,
    Loop,
    allocate_margins,
    allocate_snapshot,
    take_steps,
)
from rungwise.simulation.stepping.record import HEAD, allocate_recorded, put_memory, record
from rungwise.simulation.stepping.stepper import Stepper, UndefinedNumber
from rungwise.simulation.turns import LONGEST, TURN_S, Turns
from rungwise.simulation.watched.inputs import begin_inputs, set_all
from rungwise.simulation.watched.values import CONTROL

MANY_STEPS = 1 << 30
"""More steps than a turn takes."""


Prepare = Callable[[dict[str, float]], Prepared]
"""Makes a scene ready at its parameters. Raises InvalidScene where it is impossible there."""


def _until(seconds: float | None, signals: Ints) -> AbstractContextManager[None]:
    """Within the context these signals are set after so many seconds."""
    return nullcontext() if seconds is None else set_at(clock() + seconds, [signals])


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
        template, state = scene.template, given.state
        self._growing: Growing | None = None
        inputs, values = compile_segments(scene, self.inputs), blank_values(template, bound)
        self.stepper = stepper = Stepper(
            self.system, self.model, self.step, self.theta, values, slots_of(template), inputs, self.buffer
        )
        conditions = scene.programs
        self._loop = Loop(
            stepper.setting, (conditions.code, conditions.constants, conditions.table), np.zeros(1, CONTROL),
            asked_of(template, (conditions.code, inputs.code), bound.step),
            allocate_snapshot(stepper.setting), allocate_margins(), np.array([int(Code.RUNNING), 0]),
            allocate_recorded(0, 1, 0, 0),
        )  # fmt: skip
        self._steps_in, self._begin_in = stepper.steady(take_steps), stepper.steady(begin_run)
        self._record_in, self._memory_in = stepper.steady(record), stepper.steady(put_memory)
        self._asked = False
        before: list[Fault] | None = []
        goes_on = False
        if state is not None:
            before, goes_on = self._go_on(state, stepper, given.inputs is None)
        self._begin_schedule(stepper, state, goes_on)
        self.end = given.duration or (self._end_of_inputs() if self.inputs else bound.duration)
        # A run that goes on where a condition ended a segment takes steps as long as the run before.
        whole = max(self.end, given.duration or sum(each.duration for each in self.inputs))
        control = self._loop.control
        over = Code.MISSED if scene.file.goal else Code.TIMEOUT
        control["ends"] = over if self.inputs and given.duration is None else 0
        control["step"], control["duration"], control["tolerance"] = self.step, self.end, bound.tolerance
        control["longest"] = self.step if given.tol is None else (given.span or whole) / LONGEST
        control["error"] = 0.0 if given.tol is None else given.tol
        if state is not None and not state.time < self.end:
            raise ModelError(f"duration: the run ends at {self.end:g}, and the state is at {state.time:g}")
        most, stride = given.frames or 0, given.stride
        if stride is None:
            stride = max(1, math.ceil(min(self.end / self.step / max(most, 1), MANY)))
        time = first_value(scene) + stepper.slots.time
        self._recorder = Recorder(most, stride, HEAD + time)
        self._loop = self._loop._replace(recorded=self._recorder.recorded)
        if before is not None:
            field = "start" if state is None else "state"
            self.reason = self.misplaced(stepper.q, before, field)
            self.is_misplaced = state is not None and bool(self.reason)
        self.reason = self.reason or impossible_times(scene, inputs, values)
        if self.reason:
            self.outcome = Code.INVALID
            return
        self.begins(stepper)
        self._begin_in(stepper.inside, self._loop)
        self.outcome = Code(int(self._loop.verdict[0]))
        self._keep_frame(stepper)
        if self.outcome != Code.RUNNING:
            self._explain(stepper)

    def _begin_schedule(self, stepper: Stepper, state: State | None, goes_on: bool) -> None:
        """Begin the schedule, or go on at its place in the state's run."""
        if state is None or not (goes_on and self.given.inputs is None):
            begin_inputs(stepper.inputs, stepper.buffer, stepper.watched)
        else:
            set_all(stepper.inputs, stepper.buffer, stepper.watched)

    def _end_of_inputs(self) -> float:
        """When the schedule is over at the latest."""
        assert self.stepper is not None
        now = self.stepper.clock
        later = sum(segment.duration for segment in self.inputs[int(now["segment"]) + 1 :])
        last = int(now["segment"]) >= len(self.inputs)
        return float(now["time"] if last else now["switch"]) + later

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
        self._take(stepper, None)
        if self.outcome == Code.RUNNING:
            self.deadline.look()

    def _take(self, stepper: Stepper, count: int | None) -> int:
        """Take at most so many steps, or those of a turn; returns how many. Raises TimeOver."""
        signals, taken = np.zeros(1, np.int64), 0
        began, waited = time.perf_counter(), linking_time()
        try:
            with self.running(stepper), _until(None if count else TURN_S, signals):
                while self.outcome == Code.RUNNING and signals[0] == 0 and (count is None or taken < count):
                    taken += self._stretch(stepper, signals, None if count is None else count - taken)
        finally:
            self.wall_s += time.perf_counter() - began - (linking_time() - waited)
        return taken

    def take_some(self, most: int) -> None:
        """Take at most so many steps, fewer where a segment of the schedule ends, or a turn is over. Raises
        TimeOver."""
        signals = np.zeros(1, np.int64)
        assert self.stepper is not None
        with _until(TURN_S, signals):
            self._stretch(self.stepper, signals, most)

    def _stretch(self, stepper: Stepper, signals: Any, count: int | None) -> int:
        """Take steps until a frame is due, a segment ends, something is to be asked, or `count` are taken;
        returns how many. Raises TimeOver."""
        before = int(stepper.clock["steps"])
        try:
            status = int(
                self._steps_in(stepper.inside, self._loop, MANY_STEPS if count is None else count, signals)
            )
            if status == FULL:
                self._keep_frame(stepper)
            settled = stepper.settles(SUPPORTED if status == FULL else status, self._asked)
        except UndefinedNumber as error:
            self.outcome, self.reason = (
                Code.INVALID,
                self.undefined(error.args[0], float(stepper.watched.values[stepper.slots.time])),
            )
            return 0
        except InvalidScene as error:
            self.outcome, self.reason = Code.INVALID, str(error)
            return 0
        taken = int(stepper.clock["steps"]) - before
        self._asked = not settled and (self._asked or status != NO_ROOM)
        if not settled:
            return taken
        if stepper.outcome != Code.RUNNING:
            self.outcome, self.certificate = stepper.outcome, stepper.certificate
            self._keep_frame(stepper)
        else:
            self.outcome = Code(int(self._loop.verdict[0]))
        if self.outcome != Code.RUNNING:
            self._explain(stepper)
        return taken

    def running(self, stepper: Stepper) -> Running:
        """Within the context steps raise TimeOver where the deadline has come."""
        stepper.deadline = self.deadline
        return self.deadline.running(stepper.scratch.halt)

    def steps_taken(self, count: int, *, limit: float | None = None) -> int:
        """Take at most so many steps; returns how many, fewer where the run has ended, or `limit` seconds are
        over."""
        if self.stepper is None:
            return 0
        before, stepper = self.steps, self.stepper

        def turn() -> None:
            self._take(stepper, count)

        self._in_time(limit, turn)
        return self.steps - before

    def _keep_frame(self, stepper: Stepper) -> None:
        """Record the state of the run now."""
        run = self._loop
        while not self._record_in(
            stepper.inside, run.setting, run.asked, run.margins, self._recorder.recorded, True
        ):
            self._recorder.make_room()
            self._loop = run = run._replace(recorded=self._recorder.recorded)

    def memory(self) -> Reals:
        """What the run hands on (w,): see `memory.Parts`."""
        stepper = self.stepper
        assert stepper is not None
        inside, run = stepper.inside, self._loop
        return written(
            lambda out, bits: int(self._memory_in(inside, run.setting, run.asked, run.margins, out, bits, 0))
        )

    def memory_at(self, memory: Memory, q: Reals) -> Memory:
        """The memory of a state of this scene whose bodies were moved to q (n_q,)."""
        values, first = memory.values.copy(), len(self.scene.template.parameters) + 1
        values[memory_parts(self.scene, values).values][first : first + len(q)] = q
        return replace(memory, values=values)

    def _go_on(self, state: State, stepper: Stepper, same_inputs: bool) -> tuple[list[Fault] | None, bool]:
        """Begin at a state; where it is of this scene, with what its run handed on: all of it on the same
        rung at the same parameters, and the contacts on others. Inputs that a new schedule does not name stay
        as they were. Returns what was amiss in the state's own run, None where it is just the same here; and
        whether its place in the schedule is known."""
        rest, memory = begin_at(state, self.scene, stepper), state.memory
        if rest is None or memory is None:
            return [], False
        parts, template, slots = memory_parts(self.scene, rest), self.scene.template, stepper.slots
        columns = [template.parameters.index(name) for name in template.inputs]
        values, kept = stepper.watched.values, values_in(self.scene, rest)
        known = kept[: len(template.parameters)]
        if memory.inputs:
            values[columns] = known[columns]
        same = np.array_equal(known, values[: len(known)])
        goes_on = same and memory.model.record(memory.theta) == self.model.record(self.theta)
        try:
            (self.recall if goes_on else self.hand_on)(rest[parts.core])
        except ValueError:
            if same:
                raise StateError("state.memory: is of another scene") from None
        clock = stepper.clock
        clock["time"] = clock["mark"] = state.time
        clock["crowd"] = clock["votes"] = 0
        clock["worst_residual"] = 0.0
        if goes_on:
            self._loop.margins[:] = rest[parts.margins]
            held = slice(slots.forces + len(template.contacts), slots.dates + SLOTS)
            values[held] = kept[held]
        if same_inputs:
            for name, value in zip(PLACES, rest[parts.place], strict=True):
                clock[name] = value
            stepper.watched.levels[:] = rest[parts.levels]
        if same:
            return None, True
        parameters = dict(zip(template.parameters, known.tolist(), strict=True))
        own = self.scene.file.parameters
        still = {name: own[name].default for name in template.inputs if memory.inputs}
        return self.faults_before(parameters | still, stepper.q), True

    @property
    def segment(self) -> int:
        return 0 if self.stepper is None else int(self.stepper.clock["segment"])

    def _now(self) -> tuple[Reals, Reals, Reals]:
        assert self.stepper is not None
        levels = self.stepper.watched.values[self.stepper.inputs.columns]
        return self.stepper.q.copy(), self.stepper.v.copy(), levels

    def _contacts(self) -> Contacts:
        return self.contacts(self.model.loads)

    def _open(self) -> None:
        stepper = self.stepper
        assert stepper is not None
        if self._growing is None:
            self._growing = Growing(self.scene)
        self._growing.add(self._segments[-1])
        last = self._growing.count - 1
        opened = stepper.time if last == 0 else float(stepper.clock["opened"])
        begin_inputs(self._growing.last, stepper.buffer, stepper.watched)
        stepper.clock["segment"], stepper.clock["opened"] = last, opened
        stepper.inputs = self._growing.whole
        self._loop = self._loop._replace(setting=stepper.setting)

    def _shorten(self, duration: float) -> None:
        assert self.stepper is not None and self._growing is not None
        self._growing.shorten(duration)
        self.stepper.clock["segment"] += 1

    def _through(self) -> None:
        assert self.stepper is not None
        while self.outcome == Code.RUNNING and self.segment < len(self._segments):
            self._take(self.stepper, 1)

    @property
    def steps(self) -> int:
        """Steps taken so far."""
        return 0 if self.stepper is None else int(self.stepper.clock["steps"])

    @property
    def margin(self) -> float:
        """Signed margin of the run, as of `Results`."""
        best, danger = self._loop.margins.tolist()
        if self.outcome == Code.GOAL:
            return -danger if danger > -math.inf else 1.0 - self.time / self.end
        return min(best, 0.0) if best > -math.inf else math.nan

    def _explain(self, stepper: Stepper) -> None:
        """Set the reason of the outcome."""
        outcome = OUTCOMES[self.outcome]
        if self.reason:
            return
        if self._loop.verdict[1]:
            self.reason = unmet(self.segment, self.inputs[self.segment], float(stepper.clock["switched"]))
        elif self.certificate is not None:
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
        if stepper is not None and stepper.first_leap is not None:
            first, count = stepper.first_leap, stepper.leaps
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
        rows = list[Reals]()
        if stepper is not None and (rows := self._recorder.rows()):
            self._keep_frame(stepper)
            rows = self._recorder.rows()
        return self.run_of(
            **self._record(clock),
            worst_residual=0.0 if stepper is None else stepper.residual,
            frames=Frames(rows, self.frame),
            energy_gained=0.0 if stepper is None else float(stepper.clock["gained"]),
            notes=self.moved_to_begin + (self._notes() if stepper is not None else ()),
        )

"""Running a scene on a rung: the compiled loop in turns, and its result."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from dataclasses import replace
from functools import partial, reduce
from operator import add
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rungwise.contact.judge import Balance
from rungwise.contact.step import ContactProblem, trim
from rungwise.deadline import clock, set_at
from rungwise.kernel import Ints, Reals, linking_time, steady
from rungwise.keywords import keywords
from rungwise.models.ladder import Rung
from rungwise.outcome import OUTCOMES, Code
from rungwise.scene import InvalidScene, Scene
from rungwise.scene.read import load_planar
from rungwise.scene.template.records import SPEED
from rungwise.simulation.inputs import compile_segments, impossible_times
from rungwise.simulation.live.growing import Growing
from rungwise.simulation.live.observation import Contacts
from rungwise.simulation.live.planar import contacts_of
from rungwise.simulation.options import MANY, ModelError, count, preferences
from rungwise.simulation.planar import loop
from rungwise.simulation.planar.begin import take_start
from rungwise.simulation.planar.state.allocation import allocate
from rungwise.simulation.planar.state.frames import record
from rungwise.simulation.planar.state.workspace import Workspace, in_memory
from rungwise.simulation.reasons.reasons import JAM as JAM
from rungwise.simulation.reasons.reasons import Reasons
from rungwise.simulation.restart import begin_at, out_of_place
from rungwise.simulation.result import Run
from rungwise.simulation.state import Memory, State, check_state
from rungwise.simulation.turns import LONGEST, TURN_S, Turns
from rungwise.simulation.watched.inputs import begin_inputs
from rungwise.simulation.watched.values import CONTROL

if TYPE_CHECKING:
    from rungwise.simulation.reasons.hard_steps import HardSteps


class Simulation(Turns):
    """A run that is taken in turns. Raises SceneError or ModelError for wrong input.

    Args:
        scene: a scene, or a source that `load` takes.
        model: a rung or its name; the geometric rung does not move.
        options: fields of `RunOptions`, which says what they are.
    """

    scene: Scene

    @keywords
    def __init__(
        self, scene: Scene | str | Path | Mapping[str, Any], model: Rung | str, **options: Any
    ) -> None:
        super().__init__(load_planar(scene), model, options)
        given, state = self.given, self.given.state
        frames = count("frames", given.frames, 3)
        preferred = preferences(self.scene, self.model, given.motion)
        if state is not None:
            check_state(state, self.scene)
        self._schedule()
        self._growing: Growing | None = None
        self._begins_inputs = given.inputs is not None or not self.inputs
        self.motion = {name: float(value) for name, value in (given.motion or {}).items()}
        self.problem: ContactProblem | None = None
        self._sought = -math.inf
        self.workspace: Workspace | None = None
        self._turn = 10
        self._advance = steady(loop.advance)
        self.hard: HardSteps | None = None
        if given.save_hard is not None:
            from rungwise.simulation.reasons.hard_steps import HardSteps

            try:
                self.hard = HardSteps(given.save_hard, f"{self.scene.name}, {self.model.name}")
            except ValueError as error:
                raise ModelError(str(error)) from None
        try:
            self._bound = self.scene.bind_values(self.parameters.values())
        except InvalidScene as error:
            self.outcome, self.reason = Code.INVALID, str(error)
            return
        world = self._bound.records.world[0]
        self._control = np.zeros(1, CONTROL)
        self._control["step"] = world["step"] if given.step is None else given.step
        self.end = self._end_of_inputs() if given.duration is None else given.duration
        self._control["duration"] = self.end
        self._control["ends"] = given.duration is None and len(self.inputs) > 0
        self._control["tolerance"] = world["tolerance"]
        self._control["jam"] = JAM * world["tolerance"]
        self._control["longest"] = (
            self._control["step"] if given.tol is None else (given.span or self.end) / LONGEST
        )
        self._control["error"] = 0.0 if given.tol is None else given.tol
        self._rung = self.model.record(self.theta)
        noted = self.hard is not None
        try:
            self.workspace = allocate(self.scene.template, self._bound.values, frames, noted)
        except MemoryError:
            pairs = len(self._bound.records.pairs)
            raise ModelError(
                f"frames: {frames} states and {pairs} pairs of shapes that may touch do not fit into memory"
            ) from None
        stride = given.stride
        if stride is None:
            steps = self.end / float(self._control[0]["step"])
            frames = len(self.workspace.frames.memory)
            stride = 1 if given.tol is not None else math.ceil(min(steps / frames, MANY))
        self.workspace.state.prefer[:] = preferred
        conditions, records = self.scene.template.conditions, self._bound.records
        self._setting = loop.Setting(
            records, compile_segments(self.scene, self.inputs),
            (conditions.code, conditions.constants, conditions.table), self._bound.buffer, self._rung,
            self._control,
        )  # fmt: skip
        if state is None:
            take_start(records, self._rung, self.workspace.state)
            begin_inputs(self._setting.inputs, self._bound.buffer, self.workspace.watched)
            code = loop.begin(records, self._rung, self._control, self.workspace)
            if code == Code.INVALID:
                self.reason = out_of_place(self.scene, records, self.workspace)
        else:
            if not (state.time < self.end or (self._control[0]["ends"] and state.time == self.end)):
                raise ModelError(
                    f"duration: the run ends at {self.end:g}, and the state is at {state.time:g}"
                )
            self.reason = begin_at(state, self.scene, self._setting, self._begins_inputs, self.workspace)
            self.is_misplaced = bool(self.reason)
        self.workspace.state.clock["stride"] = stride
        self.reason = self.reason or impossible_times(self.scene, self._setting.inputs, self._bound.values)
        if self.reason:
            self.outcome = Code.INVALID

    def memory_at(self, memory: Memory, q: Reals) -> Memory:
        """The memory of a state of this scene whose bodies were moved to q (n,)."""
        assert self.workspace is not None
        values = memory.values.copy()
        in_memory(self.workspace.state, "q", values[None])[0][:] = q
        return replace(memory, values=values)

    def _end_of_inputs(self) -> float:
        """The end of the schedule, or of the scene where there is none."""
        if not self.inputs:
            return float(self._bound.records.world[0]["duration"])
        state = self.given.state
        began = 0.0 if state is None else state.time
        if state is not None and state.memory is not None and not self._begins_inputs:
            began = float(state.memory.clock["opened"])
        return reduce(add, (segment.duration for segment in self.inputs), began)

    @property
    def state(self) -> State:
        """The state that the run has come to; before the first step the start. Raises ValueError for a run
        that cannot begin."""
        if self.workspace is not None and self.outcome == Code.RUNNING:
            self._load(self.workspace)
        return self._result().state

    @property
    def time(self) -> float:
        """Simulated time so far."""
        return 0.0 if self.workspace is None else float(self.workspace.state.clock[0]["time"])

    def advance(self, steps: int | None = None, *, limit: float | None = None) -> bool:
        """Take steps for about `TURN_S`, or as many as given; returns whether the run goes on. A step, or the
        search for a proof, that takes longer than `limit` seconds is given up, and is made anew by the next
        turn."""
        if self.outcome != Code.RUNNING or self.workspace is None:
            return False
        self._in_time(limit, partial(self._advanced, steps, self.workspace))
        return self.outcome == Code.RUNNING

    @property
    def segment(self) -> int:
        return 0 if self.workspace is None else int(self.workspace.state.clock[0]["segment"])

    def _now(self) -> tuple[Reals, Reals, Reals]:
        assert self.workspace is not None
        state, columns = self.workspace.state, self._setting.inputs.columns
        return state.q.copy(), state.v.copy(), state.values[columns]

    def _contacts(self) -> Contacts:
        assert self.workspace is not None
        tolerance = float(self._control[0]["tolerance"])
        return contacts_of(self.scene, self.model, self._bound.records, tolerance, self.workspace)

    def _open(self) -> None:
        assert self.workspace is not None
        if self._growing is None:
            self._growing = Growing(self.scene)
        self._growing.add(self._segments[-1])
        clock, last = self.workspace.state.clock, self._growing.count - 1
        state = self.given.state
        began = float(clock[0]["opened"]) if last else 0.0 if state is None else state.time
        begin_inputs(self._growing.last, self._bound.buffer, self.workspace.watched)
        clock["segment"], clock["opened"] = last, began
        if self._setting.inputs is not self._growing.whole:
            self._setting = self._setting._replace(inputs=self._growing.whole)
        if not clock[0]["steps"]:  # what is driven begins at the speeds that are told, without a jump
            own = self._bound.records.coordinates
            led = own["drive"] == SPEED
            self.workspace.state.v[led] = own["drive_speed"][led]

    def _shorten(self, duration: float) -> None:
        assert self.workspace is not None and self._growing is not None
        self._growing.shorten(duration)
        self.workspace.state.clock["segment"] += 1

    def _through(self) -> None:
        assert self.workspace is not None
        clock, control = self.workspace.state.clock[0], self._control[0]
        while self.outcome == Code.RUNNING and self.segment < len(self._segments):
            whole = int((clock["switch"] - clock["time"]) / control["longest"])
            self._advanced(max(1, whole), self.workspace)

    def _advanced(self, steps: int | None, workspace: Workspace) -> None:
        """One turn. Raises TimeOver."""
        with self.deadline.running(workspace.scratch.halt):
            self._turned(steps, workspace)
        if self.outcome == Code.RUNNING:
            self.deadline.look()

    def _load(self, workspace: Workspace) -> None:
        """Load the loop before the clock starts, and record the start."""
        if workspace.state.clock[0]["frames"] == 0:
            self._take(0, np.zeros(1, np.int64), workspace)

    def _turned(self, steps: int | None, workspace: Workspace) -> None:
        """One turn, and where it ended the run, why."""
        self._load(workspace)
        signals = np.zeros(1, np.int64)
        began, waited = time.perf_counter(), linking_time()
        if steps is None:
            with set_at(clock() + TURN_S, [signals]):
                self.outcome = self._take(self._turn, signals, workspace)
        else:
            self.outcome = self._take(steps, signals, workspace)
        took = time.perf_counter() - began - (linking_time() - waited)
        self.wall_s += took
        self._turn = max(1, min(int(self._turn * TURN_S / max(took, 1e-6)), 10 * self._turn, 10_000_000))
        if self.hard is not None:
            self.hard.take(workspace)
        if self.outcome != Code.RUNNING:
            code, self.outcome = self.outcome, Code.RUNNING  # until it is proved
            ended = self._reasons().explain(code, self.deadline)
            self.outcome, self.reason, self.certificate, self.problem = ended[:4]
            if self.outcome == Code.NOT_CONVERGED and self._goes_on(ended.balance):
                self.outcome, self.reason, self.problem = Code.RUNNING, "", None
        if self.outcome != Code.RUNNING and self.hard is not None:
            self._save_last(self.hard, workspace)

    def _goes_on(self, balance: Balance | None) -> bool:
        """Whether the run goes on from its end: once for each state, from forces that may balance the
        loads."""
        if balance is None or self.time <= self._sought:
            return False
        self._sought = self.time
        self._reasons().goes_on(balance)
        return True

    def _save_last(self, hard: HardSteps, workspace: Workspace) -> None:
        problem = self.problem
        if problem is not None and self.outcome == Code.UNSUPPORTED:
            problem = trim(problem, len(problem.c), len(problem.mu), len(problem.F))
            problem.H[...] = self._reasons().resisting()
        last = hard.end(workspace, OUTCOMES[self.outcome].name, problem)
        if self.outcome == Code.NOT_CONVERGED and last is not None:
            self.reason += f" Here: rungwise solve {last}"

    def _take(self, turns: int, signals: Ints, workspace: Workspace) -> Code:
        return Code(self._advance(self._setting, workspace, turns, signals))

    def result(self) -> Run:
        """The run as far as it has come."""
        workspace = self.workspace
        if workspace is not None and self.outcome == Code.RUNNING and workspace.state.clock[0]["since"]:
            record(self._bound.records, self._rung, workspace, True)
        return self._result()

    def _result(self) -> Run:
        if self.hard is not None and self.workspace is not None:
            self.hard.end(self.workspace)
        clock = None if self.workspace is None else self.workspace.state.clock[0]
        told = self._record(clock)
        if self.workspace is not None:
            told["theta"] = float(self._rung[0]["theta"])
        return Run(
            **told,
            motion=self.motion,
            attempts=0 if clock is None else int(clock["attempts"]),
            worst_residual=0.0 if clock is None else float(clock["worst_residual"]),
            problem=self.problem,
            workspace=self.workspace if clock is not None and clock["frames"] > 0 else None,
            hard=self.hard,
            notes=self.moved_to_begin + (() if self.workspace is None else self._reasons().notes()),
        )

    def _reasons(self) -> Reasons:
        assert self.workspace is not None
        return Reasons(
            self.scene, self.model, self.theta, self.inputs, self._bound, self._control, self.workspace
        )

"""What runs of all worlds that are taken in turns have in common."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from rungwise.contact.judge import Certificate
from rungwise.deadline import Deadline, TimeOver, seconds
from rungwise.kernel import Reals
from rungwise.keywords import keywords
from rungwise.models.ladder import Rung
from rungwise.outcome import OUTCOMES, Code
from rungwise.plain import run_of
from rungwise.scene.contract import AnyScene
from rungwise.simulation.inputs import ScheduleError, Segment, read_schedule
from rungwise.simulation.live.observation import Contacts, Observation
from rungwise.simulation.live.wanted import Wanted, segment_of
from rungwise.simulation.options import RunOptions, moving_rung
from rungwise.simulation.state import State, digest

TURN_S = 0.1
"""Longest time of steps before Python sees progress and Ctrl-C."""


LONGEST = 10
"""Under error control no step is longer than this fraction of the duration, so that conditions are seen."""


class Turns:
    """A run that is taken in turns; `options` are fields of `RunOptions`, which says what they are. Raises
    SceneError or ModelError for wrong input. Its `deadline` may be set: a turn raises TimeOver where that has
    come, with what was done then, and leaves the run as far as it has come."""

    def __init__(self, scene: AnyScene, model: Rung | str, options: dict[str, Any]) -> None:
        self.scene: Any = scene
        self.model = moving_rung(model)
        self.given = keywords(RunOptions)(**options)
        self.theta = self.given.theta
        self.parameters = scene.parameters(self.given.parameters)
        self._segments: list[Segment] = []
        self._schedules = False
        # The time until which the segments tell the inputs, and when the last of them began.
        self._told = self._opened = 0.0
        self.outcome, self.reason, self.wall_s = Code.RUNNING, "", 0.0
        self.certificate: Certificate | None = None
        # Whether it cannot begin at its state; and, where that was moved to where it can, how far, in a note.
        self.is_misplaced, self.moved_to_begin = False, tuple[str, ...]()
        self.deadline = Deadline()
        # Simulated time at which the run ends at the latest, once that is known.
        self.end = math.inf

    @property
    @abstractmethod
    def time(self) -> float:
        """Simulated time so far."""

    def __repr__(self) -> str:
        return run_of(self, f"{OUTCOMES[self.outcome]} at t = {self.time:.6g}")

    @property
    def inputs(self) -> tuple[Segment, ...]:
        """The segments that the run follows, or has been told so far."""
        return tuple(self._segments)

    @property
    @abstractmethod
    def segment(self) -> int:
        """How many segments have ended."""

    @abstractmethod
    def _now(self) -> tuple[Reals, Reals, Reals]:
        """Copies of q (n_q,), v (n_v,), and the values of the inputs (u,)."""

    @abstractmethod
    def _contacts(self) -> Contacts:
        """Contacts of the last step."""

    @abstractmethod
    def _open(self) -> None:
        """Begin the last segment, now."""

    @abstractmethod
    def _shorten(self, duration: float) -> None:
        """The segment that is on has lasted only so long, and ends."""

    @abstractmethod
    def _through(self) -> None:
        """Take steps until the last segment, or the run, has ended. Raises TimeOver."""

    def observe(self) -> Observation:
        """What is seen of the run now. Raises ValueError for a run that cannot begin."""
        template = self.scene.template
        if self.outcome == Code.INVALID and self.time == 0.0:
            raise ValueError(f"the run did not begin: {self.reason}")
        q, v, values = self._now()
        inputs = dict(zip(template.inputs, values.tolist(), strict=True))
        return Observation(
            self.time, template.coordinates, q, template.velocities, v, inputs,
            tuple(template.bodies), self._contacts(),
        )  # fmt: skip

    def hold(
        self, duration: float, inputs: Wanted = None, *, ramp: bool = False, limit: float | None = None
    ) -> None:
        """Hold inputs for a time of the scene, or with `ramp` lead them there linearly, and take steps until
        it is over, or the run has ended; after `limit` seconds it is left on the way, and the next call
        begins there. Steps end exactly where the time does. Raises ScheduleError and ModelError."""
        segment = segment_of(self.scene, inputs, duration, ramp)
        if self._schedules:
            raise ScheduleError(
                "inputs: the run follows the schedule with which it began; begin it with inputs=[] to give"
                " its inputs step by step"
            )
        if self.outcome != Code.RUNNING:
            return
        if not self._segments:
            self._told = 0.0 if self.given.state is None else self.given.state.time
        if self.segment < len(self._segments):
            self._segments[-1] = replace(self._segments[-1], duration=self.time - self._opened)
            self._shorten(self._segments[-1].duration)
        elif self.time > self._told:
            self._segments.append(Segment(duration=self.time - self._told))
            self._open()
            self._shorten(self._segments[-1].duration)
        self._segments.append(segment)
        self._opened = self.time
        self._open()
        self._in_time(limit, self._through)
        self._told = self.time

    @property
    def state(self) -> State:
        """The state that the run has come to. Raises ValueError for a run that cannot begin."""
        state: State = self.result().state
        return state

    @property
    def progress(self) -> float:
        """Simulated time over duration, 0..1."""
        return 1.0 if self.outcome != Code.RUNNING else self.time / self.end

    def _in_time(self, limit: float | None, turn: Callable[[], None]) -> None:
        """Make a turn; after `limit` seconds it ends, and the run is left as far as it has come."""
        if limit is None:
            turn()
            return
        own, self.deadline = self.deadline, Deadline(seconds(limit))
        try:
            turn()
        except TimeOver:
            if not self.deadline.is_over:
                raise  # not by this limit
        finally:
            self.deadline = own

    @abstractmethod
    def result(self) -> Any:
        """The run as far as it has come."""

    def _schedule(self) -> None:
        """Take over the schedule given, or else that which the state's run followed. Raises ScheduleError."""
        self._segments = list(self._segments_given())
        self._schedules = bool(self._segments)

    def _segments_given(self) -> tuple[Segment, ...]:
        if self.given.inputs is not None:
            return read_schedule(self.scene, self.given.inputs)
        memory = self.given.state.memory if isinstance(self.given.state, State) else None
        return memory.inputs if memory is not None and memory.scene == digest(self.scene) else ()

    def _record(self, clock: np.void | None) -> dict[str, Any]:
        """The fields of a record that all worlds fill alike; `clock`: of the run, None where it is
        impossible."""
        return {
            "scene": self.scene,
            "model": self.model,
            "parameters": self.parameters,
            "inputs": self.inputs,
            "theta": self.theta,
            "outcome": OUTCOMES[self.outcome],
            "reason": self.reason or OUTCOMES[self.outcome].meaning,
            "time": self.time,
            "steps": 0 if clock is None else int(clock["steps"]),
            "solves": 0 if clock is None else int(clock["solves"]),
            "wall_s": self.wall_s,
            "certificate": self.certificate,
        }

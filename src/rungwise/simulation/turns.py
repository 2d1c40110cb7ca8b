"""What runs of all worlds that are taken in turns have in common."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Callable
from typing import Any

import numpy as np

from rungwise.contact.judge import Certificate
from rungwise.deadline import Deadline, TimeOver, seconds
from rungwise.keywords import keywords
from rungwise.models.ladder import Rung
from rungwise.outcome import OUTCOMES, Code
from rungwise.plain import run_of
from rungwise.scene.contract import AnyScene
from rungwise.simulation.inputs import Segment, read_schedule
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
        self.inputs: tuple[Segment, ...] = ()
        self.outcome, self.reason, self.wall_s = Code.RUNNING, "", 0.0
        self.certificate: Certificate | None = None
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

    def _schedule(self) -> tuple[Segment, ...]:
        """The schedule given, or else the schedule that the state's run followed. Raises ScheduleError."""
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

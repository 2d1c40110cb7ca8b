"""What rollouts have in the plane and in space."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rungwise.content import ByContent
from rungwise.deadline import Deadline, seconds
from rungwise.errors import InputError
from rungwise.kernel import Ints, Reals
from rungwise.keywords import keywords
from rungwise.models.ladder import Rung
from rungwise.outcome import Code
from rungwise.plain import run_of
from rungwise.scene.contract import AnyScene
from rungwise.simulation.any_run import AnyRun
from rungwise.simulation.inputs import Segment
from rungwise.simulation.result import counted, texts
from rungwise.simulation.state import Memory, State, digest
from rungwise.simulation.stepping.record import WORK

OVER = "limit: the time was over before the run came to its end"
"""Why a run of a rollout ended as `running`."""


@dataclass(frozen=True, repr=False, eq=False)
class Ended:
    """How m runs ended: outcomes (codes, see `rungwise.outcome.Code`), margins (as of `Results`), times,
    steps, attempts at steps, solved problems, segments that ended (all (m,))."""

    outcome: Ints
    margin: Reals
    time: Reals
    steps: Ints
    attempts: Ints
    solves: Ints
    switches: Ints


@dataclass(frozen=True, repr=False, eq=False)
class Rolled(ByContent, Ended):
    """m runs of s segments on a rung, `model`, of a scene of n_q coordinates and n_v velocities.

    outcome (m,) codes (see `rungwise.outcome.Code`), margin (m,) as of `Results`, time (m,) of the end,
    steps, attempts at them, solves (problems solved), switches (m,): how many segments ended, as of `Ended`;
    worst_residual (m,); final (m, n_q), speed (m, n_v) at the end. `faults` maps samples with wrong values to
    a line that names the value; they are `invalid`.

    With `keep`, also the states in which segments ended; the end of a run stands in the column of the segment
    in which it ended, and later columns are nan: see `times`, `q`, `v`, `work`, `state`. `memory` is what
    runs go on from.
    """

    scene: AnyScene
    model: Rung
    worst_residual: Reals
    final: Reals
    speed: Reals
    faults: dict[int, str]
    memory: Reals = field(repr=False)
    _again: Callable[[int, Deadline], Any] = field(repr=False, compare=False)
    _schedules: Callable[[int], tuple[Segment, ...]] = field(repr=False, compare=False)
    _theta: float = field(repr=False)

    @property
    def outcomes(self) -> NDArray[np.str_]:
        """Outcomes (m,) as texts, as of `Run.outcome`."""
        return texts(self.outcome)

    def __repr__(self) -> str:
        return run_of(self, f"{len(self.outcome)} runs: {counted(self.outcome)}")

    @property
    def times(self) -> Reals:
        """Times (m, s) at the ends of segments."""
        return self._kept("time")

    @property
    def q(self) -> Reals:
        """Places (m, s, n_q) at the ends of segments."""
        return self._kept("q")

    @property
    def v(self) -> Reals:
        """Velocities (m, s, n_v) at the ends of segments."""
        return self._kept("v")

    @property
    def work(self) -> Reals:
        """Work (m, s, 5) since the beginning: of drives, loads, contacts, supports and joints."""
        return np.stack([self._kept(name) for name in WORK], axis=-1)

    def _kept(self, name: str) -> NDArray[Any]:
        """What was kept (m, s, ...) at the ends of segments. Raises ValueError where nothing was."""
        if not len(self.memory) and len(self.outcome):
            raise ValueError(f"{name}: was not kept; roll out with keep=True")
        return self._at_ends(name)

    @abstractmethod
    def _at_ends(self, name: str) -> NDArray[Any]:
        """Time, q, v, or one kind of work at the ends of segments (m, s, ...)."""

    @keywords
    def state(self, sample: int, segment: int | None = None) -> State:
        """The state of the run of a `sample` at the end of a `segment`, or at the end of the run if no
        segment is given. Raises ValueError if the run had ended before, or did not begin."""
        last = min(int(self.switches[sample]), self.memory.shape[1] - 1) if len(self.memory) else 0
        k = last if segment is None else segment
        time = float(self.times[sample, k])
        if math.isnan(time):
            raise ValueError(f"sample {sample} has no state at the end of segment {k}")
        names, values = self.scene.template.coordinates, self.memory[sample, k]
        memory = Memory(values, digest(self.scene), self.model, self._theta, self._schedules(sample))
        return State(names, self.q[sample, k], self.v[sample, k], time, memory)

    @keywords
    def run(self, sample: int, *, limit: float | None = None) -> AnyRun:
        """The same run once more by `simulate`, with trajectory, reason and certificate; after `limit`
        seconds as far as it has come, `running`. Raises InputError for a sample with wrong values."""
        again: AnyRun = self._again(sample, Deadline(seconds(limit)))
        return again

    @keywords
    def reason(self, sample: int, *, limit: float | None = None) -> str:
        """Why the run of this sample ended as it did, in one line; for which it is made once more. After
        `limit` seconds the line says how far that has come."""
        if self.outcome[sample] == Code.RUNNING:
            return OVER
        try:
            return self.faults.get(sample) or str(self.run(sample, limit=limit).reason)
        except InputError as error:
            return str(error)

"""Runs of scenes in space, over processes: MuJoCo's data belong to one, and Python's loop takes half the
time."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, wait
from typing import Any, NamedTuple, TypeVar

import numpy as np

from rungwise.errors import InputError
from rungwise.kernel import Reals
from rungwise.models.ladder import Rung
from rungwise.outcome import Code
from rungwise.scene.space import SpaceScene
from rungwise.simulation.core.stepper import Stepper
from rungwise.simulation.inputs import Segment
from rungwise.simulation.spatial.frames import WORK
from rungwise.simulation.spatial.prepared import Prepared
from rungwise.simulation.spatial.run import TURN_S, SpaceSimulation
from rungwise.simulation.state import State, digest

FEW = 4
"""So many runs are not worth the start of other processes; they are made in this one."""
KEPT = 150_000_000
"""Bytes of scenes at parameters that a thread keeps ready: enough for a hundred small ones."""

Job = TypeVar("Job")
Part = TypeVar("Part")
Made = TypeVar("Made")


def spread(
    function: Callable[[Job, Part], Made], job: Job, parts: Sequence[Part], runs: int, processes: int,
    look: Callable[[], None] | None = None,
) -> Iterator[Made]:  # fmt: skip
    """What the function makes of each part, in their order; `runs`: how many there are in all parts. `look`
    is called about ten times a second while other processes work, and after each part that this one makes;
    what it raises ends the wait."""
    if processes == 1 or runs <= FEW:
        return (_seen(function(job, part), look) for part in parts)
    try:
        from loky import get_reusable_executor
    except ImportError:
        raise InputError("threads: more than one process needs loky: pip install 'rungwise[space]'") from None
    pool = get_reusable_executor(max_workers=processes)
    return _gathered([pool.submit(function, job, part) for part in parts], look)


def _seen(made: Made, look: Callable[[], None] | None) -> Made:
    if look is not None:
        look()
    return made


def _gathered(futures: list[Future[Made]], look: Callable[[], None] | None) -> Iterator[Made]:
    """What comes of futures, in their order."""
    try:
        for future in futures:
            while look is not None and not wait([future], timeout=TURN_S).done:
                look()
            yield _seen(future.result(), look)
    finally:
        for future in futures:
            future.cancel()


class Terms(NamedTuple):
    """What all samples share: scene, rung, options of their runs, most steps of one, whether the states at
    the ends of segments are kept, and when by the monotonic clock runs have not converged at the latest."""

    scene: SpaceScene
    model: Rung
    options: dict[str, Any]
    budget: int
    keeps: bool
    ends: float = math.inf


class Sample(NamedTuple):
    """One run: parameters, the state where it begins, None at the scene's start, and its schedule."""

    parameters: dict[str, float]
    state: State | None
    inputs: tuple[Segment, ...]


class Ends(NamedTuple):
    """States at the ends of s segments: times (s,), q (s, n_q), v (s, n_v), work (s, 5), memory (s, w), nan
    after the end of each."""

    time: Reals
    q: Reals
    v: Reals
    work: Reals
    memory: Reals

    def widened(self, size: int) -> Ends:
        """The same with room for memories of this size."""
        room = ((0, 0), (0, size - self.memory.shape[1]))
        return self._replace(memory=np.pad(self.memory, room, constant_values=np.nan))


class Sampled(NamedTuple):
    """How a run ended; q (n_q,), v (n_v,) there, its memory (w,), and the ends of its segments, if kept;
    `fault` says why it did not begin. Steps count from the beginning of the state's run, all else that is
    counted from the state."""

    outcome: int
    time: float
    margin: float
    steps: int
    attempts: int
    solves: int
    switches: int
    residual: float
    q: Reals
    v: Reals
    memory: Reals
    drive_work: float
    ends: Ends | None
    fault: str = ""


_own = threading.local()


def prepared(scene: SpaceScene, parameters: dict[str, float]) -> Prepared:
    """The scene at these parameters, kept ready in this thread. Raises InvalidScene."""
    kept: dict[Any, Prepared] = _own.__dict__.setdefault("kept", {})
    key = digest(scene), tuple(parameters.items())
    made = kept.pop(key, None)
    if made is None:
        made = Prepared.of(scene, parameters)
        while kept and sum(each.bytes for each in (made, *kept.values())) > KEPT:
            del kept[next(iter(kept))]
    kept[key] = made  # behind those that were used less lately
    return made


def run_samples(terms: Terms, samples: Sequence[Sample]) -> list[Sampled]:
    """The runs, one after the other; none depends on earlier ones."""
    return [_told(_ran, terms, sample) for sample in samples]


def begin_samples(terms: Terms, samples: Sequence[Sample]) -> list[Sampled]:
    """The same runs before their first steps."""
    return [_told(_begun, terms, sample) for sample in samples]


def _told(run: Callable[[Terms, Sample], Sampled], terms: Terms, sample: Sample) -> Sampled:
    """What becomes of a sample, also where its input is wrong."""
    try:
        return run(terms, sample)
    except InputError as error:
        return nothing(terms.scene, str(error))


def simulation_of(terms: Terms, sample: Sample) -> SpaceSimulation:
    """The run before its first step. Raises InvalidScene, SceneError, StateError and ModelError."""
    made = prepared(terms.scene, terms.scene.parameters(sample.parameters))
    return SpaceSimulation(
        terms.scene, terms.model, parameters=sample.parameters, state=sample.state, inputs=sample.inputs,
        frames=None, prepared=made, **terms.options,
    )  # fmt: skip


def _begun(terms: Terms, sample: Sample) -> Sampled:
    simulation = simulation_of(terms, sample)
    if simulation.stepper is None or simulation.outcome == Code.INVALID:
        return nothing(terms.scene, simulation.reason)
    return _sampled(simulation, simulation.stepper, 0, 0.0, None)


def _ran(terms: Terms, sample: Sample) -> Sampled:
    simulation = simulation_of(terms, sample)
    stepper = simulation.stepper
    if stepper is None or simulation.outcome == Code.INVALID:
        return nothing(terms.scene, simulation.reason)
    begun, solved = simulation.steps, int(stepper.clock["solves"])
    worked = float(stepper.clock["drive_work"])
    ends = _Ends(simulation, len(sample.inputs)) if terms.keeps else None
    while simulation.outcome == Code.RUNNING:
        simulation.take()
        if ends is not None:
            ends.note()
        spent = simulation.steps - begun >= terms.budget or time.monotonic() > terms.ends
        if simulation.outcome == Code.RUNNING and spent:
            simulation.outcome = Code.NOT_CONVERGED
    return _sampled(simulation, stepper, solved, worked, ends)


def _sampled(
    simulation: SpaceSimulation, stepper: Stepper, solved: int, worked: float, ends: _Ends | None
) -> Sampled:
    """Where a run has come to, whose state had been solved for and worked on before."""
    return Sampled(
        outcome=int(simulation.outcome), time=stepper.time, margin=simulation.margin, steps=simulation.steps,
        attempts=stepper.attempts, solves=int(stepper.clock["solves"]) - solved, switches=simulation.segment,
        residual=stepper.residual, q=stepper.q.copy(), v=stepper.v.copy(), memory=simulation.memory(),
        drive_work=float(stepper.clock["drive_work"]) - worked, ends=None if ends is None else ends.done(),
    )  # fmt: skip


def nothing(scene: SpaceScene, why: str) -> Sampled:
    """A run that did not begin."""
    n_q, n_v = len(scene.template.coordinates), len(scene.template.velocities)
    q, v = np.full(n_q, np.nan), np.full(n_v, np.nan)
    return Sampled(int(Code.INVALID), 0.0, np.nan, 0, 0, 0, 0, 0.0, q, v, np.zeros(0), 0.0, None, why)


class _Ends:
    """Keeps the states of a run at the ends of its segments; without a segment, at the end of the run."""

    def __init__(self, simulation: SpaceSimulation, segments: int) -> None:
        self._simulation, self._noted = simulation, 0
        self._rows: list[tuple[float, Reals, Reals, Reals, Reals] | None] = [None] * max(segments, 1)
        self.note()

    def note(self) -> None:
        """Keep the state for the segments that ended since."""
        ended = min(self._simulation.segment, len(self._rows))
        if ended > self._noted:
            self._rows[self._noted : ended] = [self._row()] * (ended - self._noted)
            self._noted = ended

    def done(self) -> Ends:
        """The states, that at the end of the run in the segment in which it ended."""
        if self._noted < len(self._rows):
            self._rows[self._noted] = self._row()
        rows = [row for row in self._rows if row is not None]
        size = max(len(row[-1]) for row in rows)

        def column(k: int) -> Reals:
            values = np.array([row[k] for row in rows])
            return np.concatenate([values, np.full((len(self._rows) - len(rows), *values.shape[1:]), np.nan)])

        memory = np.full((len(self._rows), size), np.nan)
        for row, kept in zip(memory, rows, strict=False):
            row[: len(kept[-1])] = kept[-1]
        return Ends(column(0), column(1), column(2), column(3), memory)

    def _row(self) -> tuple[float, Reals, Reals, Reals, Reals]:
        simulation, stepper = self._simulation, self._simulation.stepper
        assert stepper is not None
        work = np.array([float(stepper.clock[name]) for name in WORK])
        return stepper.time, stepper.q.copy(), stepper.v.copy(), work, simulation.memory()

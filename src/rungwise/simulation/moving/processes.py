"""Many runs of whatever moves, one after another or over processes."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, wait
from typing import Any, NamedTuple, TypeVar

import numpy as np

from rungwise.deadline import NEVER, Deadline, TimeOver
from rungwise.errors import InputError
from rungwise.kernel import Reals
from rungwise.models.ladder import Rung
from rungwise.outcome import Code
from rungwise.scene.stated import StatedScene
from rungwise.simulation.inputs import Segment
from rungwise.simulation.moving.frames import worked
from rungwise.simulation.moving.run import MovingSimulation
from rungwise.simulation.state import State
from rungwise.simulation.stepping.stepper import Stepper
from rungwise.simulation.turns import TURN_S

FEW = 4
"""So many runs are not worth the start of other processes; they are made in this one."""
IDLE_S = 300.0
"""How long other processes wait for work before they end. By default that is so short that they leave between
two stages of a plan; where work comes just then, loky warns of it."""
GROWTH = 4e9
"""Bytes by which another process may grow: what it compiles stays in its memory, and loky takes more than
0.3 GB for a leak."""
LATE_S = 0.5
"""How long other processes, which see themselves when the time is over, are waited for then."""
_GROWTH = "LOKY_MAX_MEMORY_LEAK_SIZE"
Make = Callable[..., MovingSimulation]
"""Makes a run of a scene on a rung, with these options; what other processes are told has a name."""
Look = Callable[[], None]
"""What is called again and again while runs go on."""
Job = TypeVar("Job")
Part = TypeVar("Part")
Made = TypeVar("Made")


def spread(
    function: Callable[..., Made], job: Job, parts: Sequence[Part], runs: int, processes: int, look: Look,
    deadline: Deadline,
) -> Iterator[Made]:  # fmt: skip
    """What the function makes of each part, in their order; `runs`: how many there are in all parts. `look`
    is called about ten times a second: in this process by the function, which it is given; what it raises
    ends the work. Other processes are given up shortly after the deadline, by TimeOver."""
    if processes == 1 or runs <= FEW or deadline.is_over:
        return (_seen(function(job, part, look), look) for part in parts)
    try:
        from loky import get_reusable_executor
    except ImportError:
        raise InputError("threads: more than one process needs loky: pip install 'rungwise[space]'") from None
    growth = os.environ.get(_GROWTH, str(GROWTH))
    pool = get_reusable_executor(max_workers=processes, timeout=IDLE_S, env={_GROWTH: growth})
    return _gathered([pool.submit(function, job, part) for part in parts], look, deadline)


def _seen(made: Made, look: Look) -> Made:
    look()
    return made


def _gathered(futures: list[Future[Made]], look: Look, deadline: Deadline) -> Iterator[Made]:
    """What comes of futures, in their order."""
    try:
        for future in futures:
            while not wait([future], timeout=TURN_S).done:
                look()
                if deadline.is_over_for(LATE_S):
                    raise TimeOver("in other processes")
            yield _seen(future.result(), look)
    finally:
        for future in futures:
            future.cancel()


class Terms(NamedTuple):
    """What all samples share: scene, rung, what makes their runs, options of these, most steps of one,
    whether the states at the ends of segments are kept, and when runs that still go on are left so."""

    scene: StatedScene
    model: Rung
    make: Make
    options: dict[str, Any]
    budget: int
    keeps: bool
    deadline: Deadline = NEVER

    def made(self, sample: Sample) -> MovingSimulation:
        """The run of a sample before its first step. Raises InvalidScene, SceneError, StateError and
        ModelError."""
        return self.make(
            self.scene, self.model, parameters=sample.parameters, state=sample.state, inputs=sample.inputs,
            frames=None, **self.options,
        )  # fmt: skip


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


def run_samples(terms: Terms, samples: Sequence[Sample], look: Look | None = None) -> list[Sampled]:
    """The runs, one after the other; none depends on earlier ones. `look` is called about ten times a second,
    between steps."""
    watch = None if look is None else _Watch(look)

    def run(terms: Terms, sample: Sample) -> Sampled:
        return (
            nothing(terms.scene, "", Code.RUNNING) if terms.deadline.is_over else _ran(terms, sample, watch)
        )

    return [_told(run, terms, sample) for sample in samples]


def begin_samples(terms: Terms, samples: Sequence[Sample]) -> list[Sampled]:
    """The same runs before their first steps."""
    return [_told(_begun, terms, sample) for sample in samples]


def _told(run: Callable[[Terms, Sample], Sampled], terms: Terms, sample: Sample) -> Sampled:
    """What becomes of a sample, also where its input is wrong."""
    try:
        return run(terms, sample)
    except InputError as error:
        return nothing(terms.scene, str(error))


def _begun(terms: Terms, sample: Sample) -> Sampled:
    simulation = terms.made(sample)
    if simulation.stepper is None or simulation.outcome == Code.INVALID:
        return nothing(terms.scene, simulation.reason)
    return _sampled(simulation, simulation.stepper, 0, 0.0, None)


class _Watch:
    """Looks again when some time has passed."""

    def __init__(self, look: Look) -> None:
        self._look, self._next = look, time.monotonic() + TURN_S

    def look(self) -> None:
        if time.monotonic() >= self._next:
            self._look()
            self._next = time.monotonic() + TURN_S


def _ran(terms: Terms, sample: Sample, watch: _Watch | None) -> Sampled:
    simulation = terms.made(sample)
    stepper = simulation.stepper
    if stepper is None or simulation.outcome == Code.INVALID:
        return nothing(terms.scene, simulation.reason)
    begun, solved = simulation.steps, int(stepper.clock["solves"])
    worked = float(stepper.clock["drive_work"])
    ends = _Ends(simulation, len(sample.inputs)) if terms.keeps else None
    simulation.deadline = terms.deadline
    try:
        with simulation.running(stepper):
            while simulation.outcome == Code.RUNNING and simulation.steps - begun < terms.budget:
                simulation.deadline.look()
                if watch is not None:
                    watch.look()
                simulation.take_some(terms.budget - (simulation.steps - begun))
                if ends is not None:
                    ends.note()
        if simulation.outcome == Code.RUNNING:
            simulation.outcome = Code.NOT_CONVERGED
    except TimeOver:
        if not terms.deadline.is_over:
            raise  # by what looks
    return _sampled(simulation, stepper, solved, worked, ends)


def _sampled(
    simulation: MovingSimulation, stepper: Stepper, solved: int, worked: float, ends: _Ends | None
) -> Sampled:
    """Where a run has come to, whose state had been solved for and worked on before."""
    return Sampled(
        outcome=int(simulation.outcome), time=stepper.time, margin=simulation.margin, steps=simulation.steps,
        attempts=stepper.attempts, solves=int(stepper.clock["solves"]) - solved, switches=simulation.segment,
        residual=stepper.residual, q=stepper.q.copy(), v=stepper.v.copy(), memory=simulation.memory(),
        drive_work=float(stepper.clock["drive_work"]) - worked, ends=None if ends is None else ends.done(),
    )  # fmt: skip


def nothing(scene: StatedScene, why: str, outcome: Code = Code.INVALID) -> Sampled:
    """A run that did not begin."""
    n_q, n_v = len(scene.template.coordinates), len(scene.template.velocities)
    q, v = np.full(n_q, np.nan), np.full(n_v, np.nan)
    return Sampled(int(outcome), 0.0, np.nan, 0, 0, 0, 0, 0.0, q, v, np.zeros(0), 0.0, None, why)


class _Ends:
    """Keeps the states of a run at the ends of its segments; without a segment, at the end of the run."""

    def __init__(self, simulation: MovingSimulation, segments: int) -> None:
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
        return stepper.time, stepper.q.copy(), stepper.v.copy(), worked(stepper.clock), simulation.memory()

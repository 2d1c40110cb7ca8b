"""Many runs of whatever moves, one after another or over threads."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from rungwise.deadline import NEVER, Deadline, TimeOver
from rungwise.errors import InputError
from rungwise.kernel import Ints, Reals
from rungwise.models.ladder import Rung
from rungwise.outcome import Code
from rungwise.scene.stated import StatedScene
from rungwise.simulation.inputs import Segment
from rungwise.simulation.moving.frames import worked
from rungwise.simulation.moving.run import MovingSimulation
from rungwise.simulation.state import State
from rungwise.simulation.stepping.stepper import Stepper
from rungwise.simulation.turns import TURN_S

Make = Callable[..., MovingSimulation]
"""Makes a run of a scene on a rung, with these options."""
Look = Callable[[], None]
"""What is called again and again while runs go on."""


@dataclass
class Stop:
    """Ends runs in other threads: once it is set, no other begins, and those that go on are left where they
    are."""

    is_set: bool = False
    cells: dict[int, Ints] = field(default_factory=dict)

    @contextmanager
    def watching(self, halt: Ints) -> Iterator[None]:
        """Within the context, the cell (1,) is set with it."""
        self.cells[id(halt)] = halt
        halt[0] |= self.is_set
        try:
            yield
        finally:
            del self.cells[id(halt)]

    def set(self) -> None:
        """End the runs."""
        self.is_set = True
        for halt in tuple(self.cells.values()):
            halt[0] = 1


class Terms(NamedTuple):
    """What all samples share: scene, rung, what makes their runs, options of these, most steps of one,
    whether the states at the ends of segments are kept, what stops them, and when runs that still go on are
    left so."""

    scene: StatedScene
    model: Rung
    make: Make
    options: dict[str, Any]
    budget: int
    keeps: bool
    stop: Stop
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


def spread(
    terms: Terms, parts: Sequence[Sequence[Sample]], threads: int, look: Look
) -> Iterator[list[Sampled]]:  # fmt: skip
    """How the runs of each part ended, in their order, in so many threads. `look` is called in this thread,
    about ten times a second; what it raises ends the work."""
    with ThreadPoolExecutor(threads) as pool:
        futures = [pool.submit(run_samples, terms, part) for part in parts]
        try:
            for future in futures:
                while not wait([future], timeout=TURN_S).done:
                    look()
                look()
                yield future.result()
        except BaseException:
            terms.stop.set()
            raise
        finally:
            for future in futures:
                future.cancel()


def run_samples(terms: Terms, samples: Sequence[Sample]) -> list[Sampled]:
    """The runs, one after the other; none depends on earlier ones."""

    def run(terms: Terms, sample: Sample) -> Sampled:
        left = terms.deadline.is_over or terms.stop.is_set
        return nothing(terms.scene, "", Code.RUNNING) if left else _ran(terms, sample)

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
        simulation.give_back()
        return nothing(terms.scene, simulation.reason)
    found = _sampled(simulation, simulation.stepper, 0, 0.0, None)
    simulation.give_back()
    return found


def _ran(terms: Terms, sample: Sample) -> Sampled:
    simulation = terms.made(sample)
    stepper = simulation.stepper
    if stepper is None or simulation.outcome == Code.INVALID:
        simulation.give_back()
        return nothing(terms.scene, simulation.reason)
    begun, solved = simulation.steps, int(stepper.clock["solves"])
    worked = float(stepper.clock["drive_work"])
    ends = _Ends(simulation, len(sample.inputs)) if terms.keeps else None
    simulation.deadline = terms.deadline
    try:
        with simulation.running(stepper), terms.stop.watching(stepper.scratch.halt):
            while simulation.outcome == Code.RUNNING and simulation.steps - begun < terms.budget:
                simulation.deadline.look()
                simulation.take_some(terms.budget - (simulation.steps - begun))
                if ends is not None:
                    ends.note()
        if simulation.outcome == Code.RUNNING:
            simulation.outcome = Code.NOT_CONVERGED
    except TimeOver:
        if not (terms.deadline.is_over or terms.stop.is_set):
            raise
    found = _sampled(simulation, stepper, solved, worked, ends)
    simulation.give_back()
    return found


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

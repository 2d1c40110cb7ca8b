"""What a model predicts, at an accuracy: many moves from many states, and the steps that they take."""

from __future__ import annotations

import math
import os
import time as clock
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from rungwise.kernel import Ints, Reals
from rungwise.models.ladder import Rung
from rungwise.outcome import Code
from rungwise.scene import Scene
from rungwise.scene.space import SpaceScene
from rungwise.simulation.crew import Crew, threads_of
from rungwise.simulation.inputs import Segment
from rungwise.simulation.planar.workspace import in_memory
from rungwise.simulation.questions import Question
from rungwise.simulation.run import JAM, TURN_S, Simulation
from rungwise.simulation.spatial.batch import BUDGET
from rungwise.simulation.spatial.crew import Sample, Sampled, Terms, run_samples, spread
from rungwise.simulation.spatial.memory import memory_parts
from rungwise.simulation.state import Memory, State, digest

GOES_ON = (Code.MISSED, Code.TIMEOUT)
"""Outcomes after which a plan may go on with its next move."""

LONGEST, SHORT, LONGEST_IN_SPACE = 1000, 1e-1, 300
"""Most steps of one move, and the part of the accuracy by which something must be able to move: a search does
not wait for what goes on more slowly. In space a step takes a hundred times as long."""
PATIENCE = 10
"""How many times as many steps patient runs may take, such as those of plans that are laid out."""
UNBOUNDED = 1_250_000
"""Steps of which stages take their parts where a search has no bounds."""
FOLLOWED = (Segment({}, 0.0),)
"""Stands for the schedule of a run that was followed, whichever it was."""


@dataclass(frozen=True)
class Stage:
    """A rung and an accuracy: `tol` is the error allowed per step, as a part of the scene's size."""

    model: Rung
    tol: float

    def __str__(self) -> str:
        return f"{self.model.name} @ {self.tol:g}"


class Places(NamedTuple):
    """Where m plans have come to: q (m, n_q), v (m, n_v), time (m,), and memories (m, w) to go on from, or no
    row where bodies were placed by hand since; in space (m, 1), each an array of its own length."""

    q: Reals
    v: Reals
    time: Reals
    memory: NDArray[Any]

    def take(self, rows: Ints) -> Places:
        return Places(*(a[rows] if len(a) else a for a in self))


class Ends(NamedTuple):
    """How m runs ended: outcomes (m,), where, the segments that ended (m,), the work of drives (m,); `at`
    gives the places of some rows at the end of a segment, where the stage keeps them."""

    outcome: Ints
    places: Places
    switches: Ints
    work: Reals
    at: Callable[[int, Ints], Places]


class TimeOver(Exception):
    """The time that a search has is over; what was found before counts."""


class Budget:
    """Simulated steps by stage, refused ones included, and outcomes of moves; `left`: whether there are
    more, and time is left of `limit` seconds. `tell` is called about ten times a second while runs go on."""

    def __init__(self, steps: int | None = None, limit: float | None = None) -> None:
        self.most, self.spent, self.outcomes = steps, Counter[str](), Counter[str]()
        self.ends = math.inf if limit is None else clock.monotonic() + limit
        self.tell: Callable[[], None] = _nothing
        self._told = clock.monotonic()

    def look(self, _done: object = None) -> None:
        """Called again and again while runs go on. Raises TimeOver."""
        if not self.is_in_time():
            raise TimeOver
        self.announce()

    def announce(self, _done: object = None) -> None:
        """Tell how far it is, about ten times a second."""
        if clock.monotonic() - self._told >= TURN_S:
            self.tell()
            self._told = clock.monotonic()

    def take(self, stage: Stage, steps: int, outcomes: Ints) -> None:
        self.spent[str(stage)] += steps
        for code, count in enumerate(np.bincount(outcomes)):
            if count:
                self.outcomes[Code(code).name.lower()] += int(count)

    @contextmanager
    def part(self, share: float) -> Iterator[None]:
        """Allow only this part of the steps and of the time that are left, until the end of the context; of
        `UNBOUNDED` steps where neither is bounded, so that all stages have their turns."""
        most, ends, spent = self.most, self.ends, self.spent.total()
        if most is not None or ends == math.inf:
            self.most = spent + int(share * (UNBOUNDED if most is None else most - spent))
        if ends < math.inf:
            self.ends = ends - (1.0 - share) * max(0.0, ends - clock.monotonic())
        try:
            yield
        finally:
            self.most, self.ends = most, ends

    def within(self, steps: int | None) -> Budget:
        """Another budget, of so many steps, that ends when this one does."""
        other = Budget(steps)
        other.ends = self.ends
        return other

    @property
    def seconds(self) -> float | None:
        """The time that is left; None without a limit."""
        return None if self.ends == math.inf else max(0.0, self.ends - clock.monotonic())

    def extend(self, steps: int) -> None:
        """Allow so many steps from now on."""
        self.most = self.spent.total() + steps

    @property
    def ended(self) -> str:
        """Why nothing more may be tried, in words; empty if more may."""
        if self.most is not None and self.spent.total() >= self.most:
            return "the budget is spent"
        return "" if self.is_in_time() else "the time is over"

    def is_in_time(self) -> bool:
        """Whether time is left, whatever the steps."""
        return clock.monotonic() < self.ends

    @property
    def left(self) -> bool:
        return not self.ended


def _not_kept(segment: int, rows: Ints) -> Places:
    raise NotImplementedError(f"the ends of segment {segment} are not kept, of runs {rows}")


def _nothing() -> None:
    """Tell nobody."""


class Predictor(Protocol):
    """Runs of a scene at fixed parameters on one stage."""

    scene: Any
    stage: Stage
    budget: Budget

    def run(
        self, places: Places, levels: Reals, durations: Reals, *, ramps: tuple[bool, ...] | None = None,
        until: tuple[str | None, ...] | None = None, patient: bool = False,
    ) -> Ends:  # fmt: skip
        """Segments with inputs `levels` (m, s, u) and `durations` (m, s), from the places; `patient` runs may
        take more steps than quick ones."""

    def taken_over(self, now: Places, scene: Any, levels: Reals, /) -> Places:
        """One place to which a run of `scene` at other parameters has come, on this stage's rung, as these
        runs go on from it, after inputs `levels` (u,)."""


def predictor_of(
    scene: Scene | SpaceScene, stage: Stage, tol: float, parameters: dict[str, float], budget: Budget,
    threads: int | None = None, *, quick: bool = True, span: float | None = None,
) -> Predictor:  # fmt: skip
    """Runs with an error `tol` allowed per step, as parts of one that lasts for `span`, if that is given;
    quick ones end where they take long (see `LONGEST`)."""
    if isinstance(scene, SpaceScene):
        return SpacePredictor(scene, stage, tol, parameters, budget, threads, quick=quick)
    return PlanarPredictor(scene, stage, tol, parameters, budget, threads, quick=quick, span=span)


class PlanarPredictor:
    """Runs of a planar scene, in compiled threads that are kept."""

    def __init__(
        self, scene: Scene, stage: Stage, tol: float, parameters: dict[str, float], budget: Budget,
        threads: int | None = None, *, quick: bool = True, span: float | None = None,
    ) -> None:  # fmt: skip
        self.scene, self.stage, self.budget = scene, stage, budget
        self._tol, self._parameters, self._threads = tol, parameters, threads
        self._quick, self._span = quick, span
        self._crews: dict[tuple[tuple[bool, ...], tuple[str | None, ...], bool], Crew] = {}

    def run(
        self, places: Places, levels: Reals, durations: Reals, *, ramps: tuple[bool, ...] | None = None,
        until: tuple[str | None, ...] | None = None, patient: bool = False,
    ) -> Ends:  # fmt: skip
        """Segments with inputs `levels` (m, s, u) and `durations` (m, s), from the places; `patient` runs may
        take more steps than quick ones."""
        m, s = durations.shape
        crew = self._crew(ramps or (False,) * s, until or (None,) * s, patient)
        goes_on = len(places.memory) > 0
        before = in_memory(crew.workspace.state, "drive_work", places.memory) if goes_on else np.zeros(m)
        samples = crew.run(
            np.zeros((m, 0)),
            bodies=np.hstack([places.q, places.v, places.time[:, None]]),
            memories=places.memory if goes_on else None,
            memory=np.arange(m) if goes_on else None,
            durations=np.ascontiguousarray(durations), levels=np.ascontiguousarray(levels), keeps=True,
            chunk=max(1, min(64, math.ceil(m / crew.threads / 2))), on_progress=self.budget.look,
        )  # fmt: skip
        found, n = samples.results, samples.final.shape[1] // 2
        self.budget.take(self.stage, int(found["attempts"].sum()), found["outcome"].astype(np.int64))
        column = np.minimum(found["switches"], max(s, 1) - 1)
        memory = samples.kept[np.arange(m), column]
        places = Places(samples.final[:, :n], samples.final[:, n:], found["time"].copy(), memory)
        state, kept = crew.workspace.state, samples.kept
        work = in_memory(state, "drive_work", memory) - before

        def at(segment: int, rows: Ints) -> Places:
            there = kept[rows, segment]
            q, v, time = (in_memory(state, name, there) for name in ("q", "v", "time"))
            return Places(q, v, time, there)

        switches = found["switches"].astype(np.int64)
        return Ends(found["outcome"].astype(np.int64), places, switches, work, at)

    def taken_over(self, now: Places, scene: Scene, _levels: Reals, /) -> Places:
        """See `Predictor`; inputs begin as at these parameters."""
        placed = Places(now.q.copy(), now.v.copy(), np.zeros(1), np.zeros((0, 1)))
        if not Question(self.scene, None, self._parameters).geometry(now.q).collides[0]:
            return placed
        memory = Memory(now.memory[0], digest(scene), self.stage.model, 1.0, ())
        state = State(scene.template.coordinates, now.q[0], now.v[0], float(now.time[0]), memory)
        begun = Simulation(
            self.scene, self.stage.model, parameters=self._parameters, state=state, frames=3,
            duration=state.time + float(self.scene.bind(self._parameters).records.world[0]["duration"]),
        )  # fmt: skip
        if begun.workspace is None or begun.reason:
            return placed
        return placed._replace(time=now.time, memory=begun.workspace.state.memory[None].copy())

    def _crew(self, ramps: tuple[bool, ...], until: tuple[str | None, ...], patient: bool) -> Crew:
        if (ramps, until, patient) not in self._crews:
            options: dict[str, Any] = {"tol": self._tol, "threads": self._threads, "span": self._span}
            if self._quick:
                tolerance = float(self.scene.bind(self._parameters).records.world[0]["tolerance"])
                longest = PATIENCE * LONGEST if patient else LONGEST
                options |= {"budget": longest, "jam": max(JAM, SHORT * self._tol / tolerance)}
            self._crews[ramps, until, patient] = Crew(
                self.scene, self.stage.model, (), self._parameters, until=until, ramps=ramps, **options
            )
        return self._crews[ramps, until, patient]


class SpacePredictor:
    """Runs of a scene in space, over processes that are kept; few are made in this one."""

    def __init__(
        self, scene: SpaceScene, stage: Stage, tol: float, parameters: dict[str, float], budget: Budget,
        threads: int | None = None, *, quick: bool = True,
    ) -> None:  # fmt: skip
        self.scene, self.stage, self.budget = scene, stage, budget
        self._parameters, self._digest, self._quick = parameters, digest(scene), quick
        self._processes = min(threads_of(threads), os.cpu_count() or 1)
        options = {"tol": tol, "step": None, "theta": 1.0}
        self._terms = Terms(scene, stage.model, options, LONGEST_IN_SPACE if quick else BUDGET, False)

    def run(
        self, places: Places, levels: Reals, durations: Reals, *, ramps: tuple[bool, ...] | None = None,
        until: tuple[str | None, ...] | None = None, patient: bool = False,
    ) -> Ends:  # fmt: skip
        """Segments with inputs `levels` (m, s, u) and `durations` (m, s), from the places; `patient` runs may
        take more steps than quick ones."""
        m, s = durations.shape
        names, ramps, until = self.scene.template.inputs, ramps or (False,) * s, until or (None,) * s
        samples = [
            Sample(
                self._parameters, self._state(places, i),
                tuple(
                    Segment(dict(zip(names, level, strict=True)), duration, until[k], ramps[k])
                    for k, (level, duration) in enumerate(
                        zip(levels[i].tolist(), durations[i].tolist(), strict=True)
                    )
                ),
            )
            for i in range(m)
        ]  # fmt: skip
        size = max(1, min(16, math.ceil(m / self._processes / 2)))
        parts = [samples[at : at + size] for at in range(0, m, size)]
        most = self._terms.budget * (PATIENCE if patient and self._quick else 1)
        terms, found = self._terms._replace(ends=self.budget.ends, budget=most), list[Sampled]()
        for part in spread(run_samples, terms, parts, m, self._processes, self.budget.look):
            found += part
        self.budget.look()
        return self._ends(found)

    def taken_over(self, now: Places, scene: SpaceScene, levels: Reals, /) -> Places:
        """See `Predictor`: forces and deformations of contacts are kept."""
        template, own = self.scene.template, now.memory[0, 0].copy()
        values = own[memory_parts(scene).values]
        values[[template.parameters.index(name) for name in template.inputs]] = levels
        memory = np.empty((1, 1), object)
        memory[0, 0] = own
        return Places(now.q.copy(), now.v.copy(), now.time.copy(), memory)

    def _state(self, places: Places, i: int) -> State:
        memory = None
        if len(places.memory):
            memory = Memory(places.memory[i, 0], self._digest, self.stage.model, 1.0, FOLLOWED)
        q, v, time = places.q[i], places.v[i], float(places.time[i])
        return State(self.scene.template.coordinates, q, v, time, memory)

    def _ends(self, found: list[Sampled]) -> Ends:
        outcome = np.array([each.outcome for each in found], np.int64)
        self.budget.take(self.stage, sum(each.attempts for each in found), outcome)
        memory = np.empty((len(found), 1), object)
        for i, each in enumerate(found):
            memory[i, 0] = each.memory
        ends = Places(
            np.array([each.q for each in found]), np.array([each.v for each in found]),
            np.array([each.time for each in found]), memory,
        )  # fmt: skip
        switches = np.array([each.switches for each in found], np.int64)
        return Ends(outcome, ends, switches, np.array([each.drive_work for each in found]), _not_kept)

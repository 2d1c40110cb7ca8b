"""What sets of states ask of a scene, in the plane and in space: names of its state, travel, and runs."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

from rungwise.kernel import Ints, Reals
from rungwise.models.ladder import Rung
from rungwise.outcome import Code
from rungwise.scene import Scene
from rungwise.scene import records as rec
from rungwise.scene.space import SpaceScene
from rungwise.sets.request import THETA
from rungwise.sets.store import SetError
from rungwise.simulation.crew import Crew, threads_of
from rungwise.simulation.spatial.batch import BUDGET
from rungwise.simulation.spatial.crew import Sample, Terms, run_samples, spread
from rungwise.simulation.state import State

SPEED_OF = "speed("
CHUNK = 64
"""Most runs in space that one task takes; chosen by trial."""


@dataclass(frozen=True)
class Macro:
    """What runs of macro-steps share: rung, inputs by name, all parameters, the error allowed, threads."""

    model: Rung
    inputs: tuple[str, ...]
    parameters: dict[str, float]
    accuracy: float
    threads: int | None


class Stated(Protocol):
    """A scene as sets of states see it; `known`: its coordinates by name, and then speeds."""

    known: tuple[str, ...]

    def needed(self, model: Rung) -> tuple[str, ...]:
        """Names without which a state is not known."""

    def allowed(self, model: Rung) -> tuple[str, ...]:
        """Names of which a state may consist."""

    @property
    def follows_time(self) -> bool:
        """Whether something depends on t."""

    @property
    def is_forced(self) -> bool:
        """Whether servos or forces drive something."""

    def undriven(self, names: Sequence[str]) -> list[int]:
        """Places in `names` of coordinates that nothing drives."""

    def travel(self, values: Mapping[str, float]) -> dict[str, tuple[float, float]]:
        """Ends of the travel of coordinates that have any."""

    def duration(self, values: Mapping[str, float]) -> float:
        """How long a run of the scene takes at most."""

    def run(
        self, macro: Macro, points: Reals, columns: Ints, states: Reals, duration: float,
        on_progress: Callable[[int], None] | None,
    ) -> tuple[Ints, Reals]:  # fmt: skip
        """Outcomes (m,) and ends (m, d) of runs from states (m, d), columns of all that is known, under
        inputs (m, k). Raises SetError where something else moves as well."""


def stated(scene: Scene | SpaceScene) -> Stated:
    """The side of the scene."""
    return StatesInSpace(scene) if isinstance(scene, SpaceScene) else PlanarStates(scene)


@dataclass
class PlanarStates:
    """A planar scene."""

    scene: Scene
    known: tuple[str, ...] = field(init=False)

    def __post_init__(self) -> None:
        own = self.scene.template.coordinates
        self.known = (*own, *(f"{SPEED_OF}{name})" for name in own))

    @property
    def _drives(self) -> Any:
        """How each coordinate is driven, from the scene's literal numbers."""
        template = self.scene.template
        return rec.views(template.buffer, template.counts).coordinates["drive"]

    def needed(self, model: Rung) -> tuple[str, ...]:
        own = self.scene.template.coordinates
        drives = zip(own, self._drives, strict=True) if model.inertia > 0.0 else ()
        return (*own, *(f"{SPEED_OF}{name})" for name, drive in drives if drive != rec.SPEED))

    allowed = needed

    @property
    def follows_time(self) -> bool:
        return self.scene.template.reads_time or self.scene.template.awaits_time

    @property
    def is_forced(self) -> bool:
        return bool(np.isin(self._drives, (rec.SERVO, rec.FORCE)).any())

    def undriven(self, names: Sequence[str]) -> list[int]:
        drives = dict(zip(self.scene.template.coordinates, self._drives, strict=True))
        return [k for k, name in enumerate(names) if drives.get(name) == rec.NO_DRIVE]

    def travel(self, values: Mapping[str, float]) -> dict[str, tuple[float, float]]:
        own = self.scene.bind(values).records.coordinates
        ends = zip(own["lower"].tolist(), own["upper"].tolist(), strict=True)
        return dict(zip(self.scene.template.coordinates, ends, strict=True))

    def duration(self, values: Mapping[str, float]) -> float:
        return float(self.scene.bind(values).records.world[0]["duration"])

    def run(
        self, macro: Macro, points: Reals, columns: Ints, states: Reals, duration: float,
        on_progress: Callable[[int], None] | None,
    ) -> tuple[Ints, Reals]:  # fmt: skip
        crew = Crew(
            self.scene, macro.model, macro.inputs, macro.parameters, tol=macro.accuracy, theta=THETA,
            duration=duration, threads=macro.threads,
        )  # fmt: skip
        bodies = np.zeros((len(states), len(self.known) + 1))
        bodies[:, columns] = states
        found = crew.run(points, bodies=bodies, on_progress=on_progress)
        return found.results["outcome"].astype(np.int64), found.final[:, columns]


@dataclass
class StatesInSpace:
    """A scene in space, of whose state a set spans a part: all else must stay where the scene starts."""

    scene: SpaceScene
    known: tuple[str, ...] = field(init=False)

    def __post_init__(self) -> None:
        template = self.scene.template
        self.known = (*template.coordinates, *(f"{SPEED_OF}{name})" for name in template.velocities))

    def needed(self, _model: Rung) -> tuple[str, ...]:
        return ()

    def allowed(self, model: Rung) -> tuple[str, ...]:
        template = self.scene.template
        speeds = [n for n in template.velocities if n not in self.scene.file.speeds]
        moving = speeds if model.inertia > 0.0 else []
        return (*template.coordinates, *(f"{SPEED_OF}{name})" for name in moving))

    @property
    def follows_time(self) -> bool:
        names, file = self.scene.template.names(), self.scene.file
        told = [*file.controls.values(), *file.speeds.values()]
        codes = [names.number(str(text), "", timed=True) for text in told]
        t = len(self.scene.template.parameters)
        return any(t in code.reads for code in (*codes, *self.scene.conditions.values()))

    @property
    def is_forced(self) -> bool:
        return bool(self.scene.labels.actuators)

    def undriven(self, _names: Sequence[str]) -> list[int]:
        return []

    def travel(self, values: Mapping[str, float]) -> dict[str, tuple[float, float]]:
        model = self.scene.bind(values).model
        return {
            self.scene.template.coordinates[model.jnt_qposadr[j]]: tuple(model.jnt_range[j].tolist())
            for j in np.flatnonzero(model.jnt_limited & (model.jnt_type >= 2))
        }

    def duration(self, values: Mapping[str, float]) -> float:
        return self.scene.bind(values).duration

    def run(
        self, macro: Macro, points: Reals, columns: Ints, states: Reals, duration: float,
        on_progress: Callable[[int], None] | None,
    ) -> tuple[Ints, Reals]:  # fmt: skip
        bound, names = self.scene.bind(macro.parameters), self.scene.template.coordinates
        start, n = np.concatenate([bound.place, bound.motion]), len(names)
        full = np.repeat(start[None], len(states), axis=0)
        full[:, columns] = states
        options = {"tol": macro.accuracy, "step": None, "theta": THETA, "duration": duration}
        terms = Terms(self.scene, macro.model, options, BUDGET, False)
        samples = [
            Sample(
                macro.parameters | dict(zip(macro.inputs, point, strict=True)),
                State(names, row[:n], row[n:], 0.0), (),
            )
            for point, row in zip(points.tolist(), full, strict=True)
        ]  # fmt: skip
        processes = min(threads_of(macro.threads), os.cpu_count() or 1)
        size = max(1, min(CHUNK, math.ceil(len(samples) / processes / 4)))
        parts = [samples[at : at + size] for at in range(0, len(samples), size)]
        outcome, ends = np.zeros(len(samples), np.int64), np.full((len(samples), len(columns)), np.nan)
        others, done = self._others(macro.model, columns), 0
        for part in spread(run_samples, terms, parts, len(samples), processes):
            for each in part:
                end = np.concatenate([each.q, each.v])
                outcome[done] = each.outcome
                ends[done] = end[columns]
                strays = others[np.abs(end - full[done])[others] > macro.accuracy]
                if len(strays) and each.outcome == Code.TIMEOUT:
                    raise SetError(f"over: {self.known[strays[0]]} moves as well, and is no state of the set")
                done += 1
            if on_progress is not None:
                on_progress(done)
        return outcome, ends

    def _others(self, model: Rung, columns: Ints) -> Ints:
        """Columns of all other coordinates of a state, and of speeds where they are a state."""
        named = {self.known[k] for k in columns}
        return np.array(
            [k for k, name in enumerate(self.known) if name in self.allowed(model) and name not in named],
            np.int64,
        )

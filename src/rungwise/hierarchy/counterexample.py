"""Two runs that show that a model does not approximate another, as data that `simulate` takes."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from rungwise.hierarchy.motions import THETA, Bench
from rungwise.kernel import Reals
from rungwise.models.ladder import Rung, rung
from rungwise.plain import brief
from rungwise.scene import Scene
from rungwise.simulation.inputs import Segment
from rungwise.simulation.result import Run
from rungwise.simulation.run import simulate


@dataclass(frozen=True)
class Side:
    """A run: the rung's name and its inertia, parameters of the matched scene, schedule, end, and accuracy
    (the error allowed per step)."""

    model: str
    inertia: float
    parameters: dict[str, float]
    inputs: tuple[Segment, ...]
    duration: float
    tol: float
    theta: float = THETA

    def replay(self, scene: Scene) -> Run:
        chosen = rung(self.model)
        return simulate(
            scene, chosen if chosen.inertia == self.inertia else chosen.with_inertia(self.inertia),
            parameters=self.parameters, inputs=self.inputs or None, duration=self.duration, tol=self.tol,
            theta=self.theta,
        )  # fmt: skip


@dataclass(frozen=True)
class Counterexample:
    """The richer run and the simpler one, how far they are apart (over the extent), and what fails."""

    words: str
    richer: Side
    simpler: Side
    distance: float
    scene: Scene = field(repr=False)

    __repr__ = brief

    def replay(self) -> tuple[Run, Run]:
        """Both runs, anew."""
        return self.richer.replay(self.scene), self.simpler.replay(self.scene)

    def summary(self) -> dict[str, Any]:
        """Plain values, with the scene as `load` takes it."""
        return {
            "words": self.words, "distance": self.distance, "richer": asdict(self.richer),
            "simpler": asdict(self.simpler),
            "scene_file": self.scene.file.model_dump(mode="json", exclude_unset=True),
        }  # fmt: skip


def side(
    bench: Bench, model: Rung, inputs: Reals, until: float, tol: float, parameters: dict[str, float]
) -> Side:
    """The run under inputs (k,) until a time, as data."""
    values, segments = bench.matched.values(model) | parameters, tuple[Segment, ...]()
    if bench.inputs.scheduled:
        given = bench.inputs.options(inputs[None], np.array([[until]]), bench.duration)
        segments = (Segment(bench.inputs.named(given["inputs"][0, 0]), until, ramp=bench.inputs.ramp),)
    else:
        values |= bench.inputs.named(inputs)
    return Side(model.name, model.inertia, values, segments, until, tol * bench.extent)

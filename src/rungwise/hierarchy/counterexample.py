"""Two runs that show that a model does not approximate another, as data that `simulate` takes."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from rungwise.content import ByContent
from rungwise.deadline import Deadline, seconds
from rungwise.errors import InputError
from rungwise.hierarchy.distance import farthest
from rungwise.hierarchy.motions import MOMENTS, Bench
from rungwise.kernel import Reals
from rungwise.keywords import keywords
from rungwise.models.ladder import Rung, rung
from rungwise.plain import brief, json_text
from rungwise.scene.contract import AnyScene
from rungwise.scene.read import load
from rungwise.simulation.any_run import AnyRun
from rungwise.simulation.inputs import Segment
from rungwise.world.contract import Marks
from rungwise.world.find import world_of
from rungwise.world.run import finished, simulation_of

FORMAT = "rungwise counterexample 1"


@dataclass(frozen=True, eq=False)
class Side(ByContent):
    """A run: the rung's name and its inertia, parameters of the matched scene, schedule, end, and the error
    allowed per step, or the step."""

    model: str
    inertia: float
    parameters: dict[str, float]
    inputs: tuple[Segment, ...]
    duration: float
    tol: float | None
    step: float | None = None

    def replay(self, scene: AnyScene, deadline: Deadline) -> AnyRun:
        chosen = rung(self.model)
        simulation = simulation_of(
            scene, chosen if chosen.inertia == self.inertia else chosen.with_inertia(self.inertia),
            parameters=self.parameters, inputs=self.inputs or None, duration=self.duration, tol=self.tol,
            step=self.step,
        )  # fmt: skip
        run: AnyRun = finished(simulation, None, deadline)
        return run


@dataclass(frozen=True, eq=False)
class Counterexample(ByContent):
    """Two runs of a scene, on a richer and on a simpler rung, whose distance contradicts a definition;
    `words` say which, and how.

    levers: factors that turn differences of coordinates into parts of the extent; `late`: the distance is
    measured in the second half of the runs.
    """

    words: str
    richer: Side
    simpler: Side
    distance: float
    late: bool
    levers: dict[str, float]
    scene: AnyScene = field(repr=False)

    __repr__ = brief

    @keywords
    def replay(self, *, limit: float | None = None) -> tuple[AnyRun, AnyRun]:
        """Both runs, anew; after `limit` seconds each as far as it has come, `running`."""
        deadline = Deadline(seconds(limit))
        return self.richer.replay(self.scene, deadline), self.simpler.replay(self.scene, deadline)

    def apart(self, richer: AnyRun, simpler: AnyRun) -> float:
        """The distance between a run of the `richer` model and a run of the `simpler` one, measured as in the
        comparison."""
        times = self.richer.duration * np.arange(1, MOMENTS + 1)[MOMENTS // 2 if self.late else 0 :] / MOMENTS
        places = world_of(self.scene).marks(self.richer.parameters)
        lever = np.array([self.levers.get(name, 0.0) for name in places.names])[:, None]
        away = _along(richer, places, times) - _along(simpler, places, times)
        return float(farthest((away * lever)[None])[0])

    def summary(self) -> dict[str, Any]:
        """Plain values, with the scene as `load` takes it."""
        return {
            "format": FORMAT, "words": self.words, "distance": self.distance, "late": self.late,
            "levers": self.levers, "richer": asdict(self.richer), "simpler": asdict(self.simpler),
            "scene_file": _stored(self.scene),
        }  # fmt: skip

    def save(self, file: str | Path) -> Path:
        """Write it with its scene into a file (JSON), which `load_counterexample` reads. Raises OSError."""
        target = Path(file)
        target.write_text(json_text(self.summary(), indent=1) + "\n", "utf-8")
        return target


def _stored(scene: AnyScene) -> Any:
    """The scene as `load` takes it."""
    return json.loads(scene.stored)


def saved(file: str | Path) -> bool:
    """Whether a file says of itself that it holds a counterexample."""
    try:
        with Path(file).open("rb") as stream:
            return FORMAT.encode() in stream.read(100)
    except (OSError, ValueError):
        return False


@keywords
def load_counterexample(file: str | Path) -> Counterexample:
    """A counterexample that was saved. Raises FileNotFoundError, and InputError for a file that holds
    none."""
    text = Path(file).read_bytes()
    try:
        data = json.loads(text)
        if data["format"] != FORMAT:
            raise ValueError
        return Counterexample(
            str(data["words"]), _side(data["richer"]), _side(data["simpler"]), float(data["distance"]),
            bool(data["late"]), {str(k): float(x) for k, x in data["levers"].items()},
            load(data["scene_file"]),
        )  # fmt: skip
    except InputError as error:
        raise InputError(f"counterexample: {Path(file).name[:60]!r}: {error}") from None
    except (ValueError, KeyError, TypeError, AttributeError):
        raise InputError(f"counterexample: {Path(file).name[:60]!r} holds no saved counterexample") from None


def _side(data: Mapping[str, Any]) -> Side:
    segments = tuple(Segment(**each) for each in data["inputs"])
    return Side(**{**data, "inputs": segments})


def _along(run: AnyRun, places: Marks, times: Reals) -> Reals:
    """Places (s, p, d) at times (s,)."""
    known = places(np.asarray(run.trajectory.position.values, float))
    at, columns = run.trajectory.time.values, known.reshape(len(known), -1).T
    return np.array([np.interp(times, at, column) for column in columns]).T.reshape(-1, *known.shape[1:])


def levers(bench: Bench) -> dict[str, float]:
    """What differences of places are multiplied with, by the places' names."""
    found = zip(bench.places.names, (bench.levers / bench.extent).tolist(), strict=True)
    return {name: lever for name, lever in found if lever > 0.0}


def side(
    bench: Bench, model: Rung, inputs: Reals, until: float, parameters: dict[str, float], tol: float,
    step: float | None = None,
) -> Side:  # fmt: skip
    """The run under inputs (k,) until a time, as data."""
    values, segments = bench.matched.values(model) | parameters, tuple[Segment, ...]()
    if bench.inputs.scheduled:
        given = bench.inputs.options(inputs[None], np.array([[until]]), bench.duration)
        segments = (Segment(bench.inputs.named(given["inputs"][0, 0]), until, ramp=bench.inputs.ramp),)
    else:
        values |= bench.inputs.named(inputs)
    return Side(
        model.name, model.inertia, values, segments, until, None if step else tol * bench.extent, step
    )

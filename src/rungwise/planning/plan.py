"""Plans: schedules of inputs with where they come from; saved, loaded, replayed, printed."""

from __future__ import annotations

import csv
import json
import math
import os
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field
from functools import cached_property
from io import StringIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rungwise.content import ByContent
from rungwise.deadline import LimitError
from rungwise.errors import InputError
from rungwise.kernel import Reals
from rungwise.keywords import keywords
from rungwise.models.ladder import Rung
from rungwise.outcome import Code
from rungwise.plain import cut, json_text
from rungwise.planning.diagnosis.deferred import Deferred
from rungwise.planning.diagnosis.diagnose import Diagnosis, table
from rungwise.planning.motion.budget import Stage
from rungwise.scene import SceneError
from rungwise.scene.contract import AnyScene
from rungwise.scene.fields.values import shown
from rungwise.scene.read import load
from rungwise.simulation.any_run import AnyRun
from rungwise.simulation.inputs import Segment
from rungwise.simulation.state import State, digest
from rungwise.stored import installed, whole
from rungwise.world.find import world_of
from rungwise.world.margins import geometry
from rungwise.world.run import simulate

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    import rungwise

FORMAT = "rungwise plan 1"
OPEN_LOOP, GUARDED, RE_PLANNING = "open loop", "guarded moves", "re-planning"
FEEDBACK = "feedback"
"""How a plan is executed: as it is; with moves that end at a contact; planned anew after each move; or with
its policy, from measured places."""
HELD, NOTHING = "held", "nothing found"
"""What comes of a stage on which a plan goes on to hold, and of one on which none is found."""


SHOWN_S = 20.0
"""Seconds after which a console that shows a plan shows its replay as far as it has come."""
PLACES_ONLY = "it is of the geometric rung: it has places, but no inputs; lift it to a richer rung"


class PlanError(InputError):
    """A plan cannot be read, or does not belong to the scene; one line that names the field."""


@dataclass(frozen=True)
class Record:
    """What came of one stage: how its plan was found, if it was (`held`, `repaired ...`, `planned`, `nothing
    found`), steps that it took, seconds (which do not count in `==`), and the number of moves."""

    stage: str
    how: str
    steps: int
    seconds: float = field(compare=False)
    moves: int = 0


@dataclass(frozen=True)
class Check:
    """How often a plan succeeded, executed in a mode, in samples of what its task calls uncertain; lower:
    bound of the rate of success."""

    mode: str
    samples: int
    successes: int
    lower: float

    def __str__(self) -> str:
        return (
            f"{self.mode}: {self.successes} of {self.samples} samples succeed, at least {self.lower:.3f}"
            " with a confidence of 95%"
        )


@dataclass(frozen=True, eq=False)
class Plan(ByContent):
    """A plan, or the reason why there is none.

    scene, parameters: what was planned for; segments: the schedule; labels: the purpose of each segment
    ("transit", "push", "back", "hold"); moves (k, d): the vectors of numbers that define the moves;
    waypoints: positions (n,) at the ends of moves; stage: rung and accuracy of the last stage on which the
    plan holds; tol: error allowed per step there, in the scene's unit; cost: by the task; records: results
    stage by stage; told: the diagnoses of stages on which the plan failed or drifted, made when `diagnosis`
    is asked for; checks: results of the modes of execution, if a rate of success was asked for; reason: why
    there is no plan, else empty; seed: of the search; version: of rungwise, by which the plan was found.
    """

    scene: AnyScene
    parameters: dict[str, float]
    segments: tuple[Segment, ...] = ()
    labels: tuple[str, ...] = ()
    moves: Reals = field(default_factory=lambda: np.zeros((0, 0)))
    waypoints: tuple[tuple[float, ...], ...] = ()
    stage: Stage | None = None
    tol: float = 0.0
    cost: float = math.nan
    seed: int = 0
    records: tuple[Record, ...] = ()
    told: tuple[Diagnosis | Deferred, ...] = field(default=(), compare=False)
    checks: tuple[Check, ...] = ()
    reason: str = ""
    version: str = ""

    @cached_property
    def diagnosis(self) -> tuple[Diagnosis, ...]:
        """For each stage on which the plan before failed or drifted, why. Where there is a plan it is made
        when it is first asked for, in as many seconds as the limit of `plan` had left, one at least."""
        found = (each.found if isinstance(each, Deferred) else each for each in self.told)
        return tuple(each for each in found if each is not None)

    @property
    def found(self) -> bool:
        """Whether there is a plan."""
        return not self.reason

    @property
    def ok(self) -> bool:
        """Whether the answer is positive: there is a plan."""
        return self.found

    @property
    def mode(self) -> str:
        """How the plan is executed: "open loop", "guarded moves" or "re-planning"."""
        if self.checks and self.found:
            return self.checks[-1].mode
        return GUARDED if any(segment.until for segment in self.segments) else OPEN_LOOP

    def how(self, stage: Stage) -> str:
        """The last result of a stage; empty if it was not tried."""
        return next((record.how for record in self.records if record.stage == str(stage)), "")

    @property
    def duration(self) -> float:
        """Time that the plan takes, at most: a guarded move may end before its time-out."""
        return math.fsum(segment.duration for segment in self.segments)

    @keywords
    def replay(
        self,
        model: Rung | str | None = None,
        *,
        tol: float | None = None,
        duration: float | None = None,
        theta: float = 1.0,
        frames: int = 2000,
        stride: int | None = None,
        save_hard: str | Path | None = None,
        limit: float | None = None,
        on_progress: Callable[[Any], None] | None = None,
    ) -> AnyRun:
        """The run of the plan, on the rung `model` with the error `tol` per step, by default the plan's own.
        duration, theta, frames, stride, save_hard, limit, on_progress: as for `simulate`. Raises PlanError if
        there is no plan, or one of places only, and what `simulate` raises."""
        if self.stage is None:
            raise PlanError(f"plan: there is none. {self.reason}")
        if not self.stage.model.moves:
            raise PlanError(f"plan: {PLACES_ONLY}")
        run: AnyRun = simulate(
            self.scene, self.stage.model if model is None else model, parameters=self.parameters,
            inputs=self.segments, tol=self.tol if tol is None else tol, duration=duration, theta=theta,
            frames=frames, stride=stride, save_hard=save_hard, limit=limit, on_progress=on_progress,
        )  # fmt: skip
        return run

    @keywords
    def policy(
        self,
        *,
        model: Rung | str | None = None,
        budget: int | None = None,
        limit: float | None = None,
        average: int = 1,
    ) -> rungwise.Policy:
        """A controller that follows the plan from measured states; model, budget, limit, average: as for
        `Policy`. Raises TaskError if there is no plan, or one of places only."""
        import rungwise

        return rungwise.Policy(self, model=model, budget=budget, limit=limit, average=average)

    @keywords
    def joint_trajectory(
        self, names: Sequence[str] | None = None, *, rate: float | None = None, limit: float | None = None
    ) -> rungwise.JointTrajectory:
        """Joints over time in the plan's run; `names` and `rate` as for `Run.joint_trajectory`. Raises
        LimitError if the run takes more than `limit` seconds."""
        return self._whole_run(limit).joint_trajectory(names, rate=rate)

    @keywords
    def mjcf(
        self, at: float | Sequence[float] | None = None, *, whole: bool = True, limit: float | None = None
    ) -> str:
        """The scene as MJCF with keyframes of the plan's run; `at` and `whole` as for `Run.mjcf`. Raises
        LimitError if the run takes more than `limit` seconds."""
        return self._whole_run(limit).mjcf(at, whole=whole)

    def _whole_run(self, limit: float | None) -> AnyRun:
        run = self.replay(limit=limit)
        if run.outcome.code == Code.RUNNING:
            raise LimitError(run.reason)
        return run

    def __repr__(self) -> str:
        if not self.found:
            return f"<Plan of {cut(self.scene.name)}: none. {cut(self.reason, 200)}>"
        if self.stage is not None and not self.stage.model.moves:
            return f"<Plan of {cut(self.scene.name)}: {len(self.waypoints)} legs on {self.stage}>"
        return (
            f"<Plan of {cut(self.scene.name)}: {len(self.waypoints)} moves, {self.duration:.4g} long,"
            f" on {self.stage}, at a cost of {self.cost:.4g}>"
        )

    def _repr_html_(self) -> str:
        import rungwise

        return rungwise.to_html(self, limit=SHOWN_S)

    @keywords
    def plot(self, frames: int = 6, *, limit: float | None = None) -> Figure:
        """Picture of the plan's run with so many `frames`; after `limit` seconds, of the run so far (see
        `rungwise.plot`)."""
        import rungwise

        return rungwise.plot(self, frames=frames, limit=limit)

    def __str__(self) -> str:
        lines = [self._head()]
        if self.records:
            lines.append(f"  {'stage':29} {'how':36} {'steps':>9} {'seconds':>9}")
        lines += [
            f"  {record.stage:29} {record.how:36} {record.steps:9} {record.seconds:9.2f}"
            for record in self.records
        ]
        lines += [f"  {check}" for check in self.checks]
        if self.diagnosis:
            lines += [f"  {line}" for line in table(self.diagnosis)]
        return "\n".join(lines)

    def _head(self) -> str:
        count, name = len(self.waypoints), self.scene.name
        if not self.found or self.stage is None:
            return f"{name}: no plan. {self.reason}"
        if not self.stage.model.moves:
            ways = ", ".join(f"{body} travels {length:.3g}" for body, length in self._ways().items())
            return f"{name}: a path of {count} leg{'s' * (count != 1)} on {self.stage}; {ways}"
        return (
            f"{name}: a plan of {count} move{'s' * (count != 1)}, {self.duration:.4g} long, on {self.stage},"
            f" at a cost of {self.cost:.4g}"
        )

    def _ways(self) -> dict[str, float]:
        """How long the path of each object's centre is, from place to place."""
        start = State.of(self.scene, parameters=self.parameters).q
        found = geometry(self.scene, np.array([start, *self.waypoints]), self.parameters)
        lengths = np.linalg.norm(np.diff(found.poses[..., :-1], axis=0), axis=-1).sum(axis=0)
        roles = world_of(self.scene).roles()
        return {
            name: float(length)
            for name, length in zip(found.bodies, lengths, strict=True) if roles[name] == "object"
        }  # fmt: skip

    def levels(self) -> tuple[Reals, Reals]:
        """Inputs (s, u) and durations (s,) of the segments."""
        now, rows = {name: self.parameters[name] for name in self.scene.template.inputs}, list[list[float]]()
        for segment in self.segments:
            now = now | dict(segment.inputs)
            rows.append(list(now.values()))
        return np.array(rows, float), np.array([segment.duration for segment in self.segments], float)

    def timetable(self) -> str:
        """The inputs over time as CSV: a row for the beginning and for the end of each segment, with the
        condition that ends a guarded move; times are the latest."""
        names, text = self.scene.template.inputs, StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(["time", "label", "until", *names])
        now, before = 0.0, {name: self.parameters[name] for name in names}
        for segment, label in zip(self.segments, self.labels, strict=True):
            levels = before | dict(segment.inputs)
            begins = before if segment.ramp else levels
            until = segment.until or ""
            writer.writerow([repr(now), label, until, *(repr(begins[name]) for name in names)])
            now += segment.duration
            writer.writerow([repr(now), label, until, *(repr(levels[name]) for name in names)])
            before = levels
        return text.getvalue()

    def summary(self) -> dict[str, Any]:
        """Plain values, as `rungwise plan --json` prints them and as plans are saved."""
        return {
            "format": FORMAT,
            "version": self.version or installed(),
            "scene": self.scene.name,
            "digest": digest(self.scene),
            "found": self.found,
            "reason": self.reason,
            "model": None if self.stage is None else self.stage.model.name,
            "inertia": None if self.stage is None else self.stage.model.inertia,
            "accuracy": None if self.stage is None else self.stage.tol,
            "tol": self.tol,
            "seed": self.seed,
            "duration": self.duration,
            "cost": self.cost,
            "parameters": self.parameters,
            "segments": [asdict(segment) for segment in self.segments],
            "labels": list(self.labels),
            "moves": np.asarray(self.moves).tolist(),
            "waypoints": [list(place) for place in self.waypoints],
            "records": [asdict(record) for record in self.records],
            "diagnosis": [part.summary() for part in self.diagnosis],
            "mode": self.mode,
            "checks": [asdict(check) for check in self.checks],
        }

    def text(self) -> str:
        """The plan with its scene as JSON, as it is saved."""
        content = self.summary() | {"scene_file": json.loads(self._scene_file())}
        return json_text(content, indent=1)

    def _scene_file(self) -> str:
        return str(self.scene.stored)

    @keywords
    def save(self, file: str | Path) -> Path:
        """Write the plan with its scene into a file (JSON), whole or not at all. Raises OSError."""
        target = Path(file)
        with whole(target) as draft:
            draft.write_text(self.text(), "utf-8")
        return target


@keywords
def load_plan(file: str | Path, scene: AnyScene | None = None) -> Plan:
    """A saved plan, of the scene that was saved with it or of one that is given. Raises FileNotFoundError,
    and PlanError for a file that holds none or for another scene."""
    if not isinstance(file, str | os.PathLike):
        raise PlanError(f"plan: must be a path, not {shown(file)}")
    name = repr(Path(file).name[:60])
    try:
        return plan_of(Path(file).read_text("utf-8"), scene, name)
    except (FileNotFoundError, PlanError):
        raise
    except (OSError, UnicodeError):
        raise PlanError(f"plan: {name} holds no saved plan") from None


def plan_of(text: str, scene: AnyScene | None = None, name: str = "the text") -> Plan:
    """The plan in a text that `Plan.text` made. Raises PlanError, which names what it was read from."""
    try:
        data = json.loads(text)
        if data["format"] != FORMAT:
            raise ValueError
        own = load(data["scene_file"]) if scene is None else scene
        if (scene is not None or not own.self_contained) and digest(own) != data["digest"]:
            raise PlanError(f"plan: {name} belongs to another version of {data['scene']}")
        return _from_values(own, data)
    except PlanError:
        raise
    except SceneError as error:
        raise PlanError(f"plan: the scene in {name}: {error}") from None
    except (ValueError, KeyError, TypeError, AttributeError):
        raise PlanError(f"plan: {name} holds no saved plan") from None


def _from_values(scene: AnyScene, data: dict[str, Any]) -> Plan:
    from rungwise.models.ladder import rung

    stage = None
    if data["model"] is not None:
        model = rung(data["model"])
        if data["inertia"] != model.inertia:
            model = model.with_inertia(data["inertia"])
        stage = Stage(model, float(data["accuracy"]))
    return Plan(
        scene=scene, parameters=scene.parameters(data["parameters"]),
        segments=tuple(Segment(**segment) for segment in data["segments"]), labels=tuple(data["labels"]),
        moves=np.array(data["moves"], float), waypoints=tuple(tuple(place) for place in data["waypoints"]),
        stage=stage, tol=float(data["tol"]), seed=int(data["seed"]),
        cost=math.nan if data["cost"] is None else float(data["cost"]),
        records=tuple(Record(**record) for record in data["records"]),
        told=tuple(Diagnosis.of(values) for values in data["diagnosis"]),
        checks=tuple(Check(**values) for values in data["checks"]),
        reason=data["reason"], version=data["version"],
    )  # fmt: skip

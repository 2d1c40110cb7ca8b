"""A scene of whatever moves, as everything above sees it (see `world.contract`)."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from rungwise.deadline import NEVER, Deadline
from rungwise.kernel import Reals
from rungwise.models.ladder import KINEMATIC, Rung
from rungwise.scene import SceneError
from rungwise.simulation.moving.prepared import Prepared
from rungwise.simulation.moving.result import MovingRun
from rungwise.simulation.moving.run import MovingSimulation
from rungwise.simulation.options import ModelError
from rungwise.simulation.saved import Saved, moving_run
from rungwise.world.arguments import Asked
from rungwise.world.carriers import Surroundings
from rungwise.world.contract import OBJECT, OBSTACLE, OTHER_SHAPES, ROBOT, Told
from rungwise.world.ingredients import Parting, evidence_of
from rungwise.world.matching import Matched
from rungwise.world.moving.configurations import MovingConfigurations
from rungwise.world.moving.description import common, heading, stated
from rungwise.world.moving.instance import MovingInstance, body_of
from rungwise.world.moving.marks import Coordinates
from rungwise.world.moving.place import MovingPlace
from rungwise.world.moving.rollouts import MovingRollouts, rollout
from rungwise.world.moving.runs import MovingRuns
from rungwise.world.moving.variant import MovingVariant
from rungwise.world.parts import coordinates_as_joints, no_model, of_scene

if TYPE_CHECKING:
    from rungwise.simulation.derivatives.slopes import Slopes


@dataclass(frozen=True)
class MovingWorld(ABC):
    """See `World`. A world of one's own derives from this class and says `prepare`; it replaces what is said
    here where it knows more: which bodies are robots (`robots`), where bodies may travel (`at`), which
    dimensions coordinates have (`place`), what is matched from rung to rung (`matched`)."""

    scene: Any
    shapes: ClassVar[str] = OTHER_SHAPES
    comparison_steps: ClassVar[int] = 4000
    replanning_steps: ClassVar[int] = 10_000

    @abstractmethod
    def prepare(self, parameters: dict[str, float]) -> Prepared:
        """The scene's numbers at all parameters, and its system (see `simulation.moving.prepared.Led`).
        Raises InvalidScene where the scene is impossible there."""

    robots: ClassVar[tuple[str, ...]] = ()
    """Bodies that drives lead; those without coordinates are obstacles, all others objects."""

    def simulation(self, model: Rung | str, **options: Any) -> MovingSimulation:
        return MovingSimulation(self.scene, model, self.prepare, **options)

    def saved(self, saved: Saved) -> MovingRun:
        return moving_run(MovingRun, self.scene, saved)

    def runs(
        self, model: Rung, over: Sequence[str], parameters: Mapping[str, float] | None, **options: Any
    ) -> MovingRuns:
        return MovingRuns(self.scene, model, over, parameters, **options)

    def rollout(
        self, model: Rung, wanted: Asked, options: dict[str, Any], *, keep: bool, budget: int | None,
        threads: int | None, chunk: int | None, deadline: Deadline, on_progress: Told | None,
    ) -> MovingRollouts:  # fmt: skip
        return rollout(
            MovingRollouts, MovingRuns, self.scene, model, wanted, options, keep=keep, budget=budget,
            threads=threads, chunk=chunk, deadline=deadline, on_progress=on_progress,
        )  # fmt: skip

    def _prepared(self, parameters: Mapping[str, float] | None) -> Prepared:
        return self.prepare(self.scene.parameters(parameters))

    def place(self, parameters: Mapping[str, float] | None) -> MovingPlace:
        return MovingPlace(self.scene, *self._prepared(parameters))

    def at(self, parameters: Mapping[str, float] | None = None) -> MovingInstance:
        return MovingInstance(self.scene, self._prepared(parameters), self.roles(parameters))

    def configurations(
        self, parameters: Mapping[str, float], size: float, without: str = ""
    ) -> MovingConfigurations:
        return MovingConfigurations(self.place(parameters), self.at(parameters), size, without)

    def surroundings(self, _parameters: Mapping[str, float]) -> Surroundings | None:
        """Not known of moving scenes."""
        return None

    def slopes(self, _parameters: Mapping[str, float], _h: float, _near: float) -> Slopes:
        raise ModelError(f"scene: derivatives of steps do not work for {self.scene.name}")

    def variant(self, parameters: dict[str, float], model: Rung, tol: float) -> MovingVariant:
        return MovingVariant(self.scene, parameters, model, tol)

    def evidence(self, parting: Parting, causes: Sequence[str]) -> dict[str, dict[str, Any]]:
        return evidence_of({}, parting, causes)

    def end(self, run: MovingRun) -> dict[str, Any]:
        """Outcome and time."""
        return {"outcome": str(run.outcome), "time": run.time}

    def matched(self, parameters: dict[str, float], _duration: float, _deadline: Deadline = NEVER) -> Matched:
        """The scene as it is: nothing is matched."""
        bare = self.scene.changed(goal=None, unsafe=None, doomed=None, task=None)
        return Matched(self.scene.changed(task=None), bare, parameters, {}, ("nothing is matched",), ())

    def marks(self, _parameters: Mapping[str, float]) -> Coordinates:
        return Coordinates(self.scene.template.coordinates)

    def measures(
        self, parameters: dict[str, float], duration: float, _deadline: Deadline = NEVER
    ) -> tuple[float, Reals]:
        """How far coordinates get from the origin or from each other in the slowest motion, at least the size
        of the smallest thing; and 1 for coordinates of objects, 0 for those of robots."""
        simulation = self.simulation(KINEMATIC, parameters=parameters, duration=1e-3 * duration, frames=3)
        run = simulation.result()
        if not run.began:
            raise SceneError(run.reason)
        here = self.at(parameters)
        levers = here.moved.weights
        return max(here.smallest, float(np.ptp(here.q))), levers if levers.any() else np.ones(len(levers))

    def describe(self, parameters: Mapping[str, float]) -> dict[str, Any]:
        """Bodies with roles and coordinates, contacts, parameters, conditions. Plain values."""
        template, here = self.scene.template, self.at(parameters)
        bodies: dict[str, Any] = {
            name: {"role": role, "coordinates": {}} for name, role in self.roles(parameters).items()
        }
        for name, start in zip(template.coordinates, here.q.tolist(), strict=True):
            bodies[body_of(name)]["coordinates"][name.partition(".")[2]] = {"start": start}
        contacts = [{"between": list(pair)} for pair in template.contacts]
        return (
            heading(self.scene)
            | {"bodies": bodies, "contacts": contacts}
            | common(self.scene, parameters, here)
        )

    def described(self, report: Mapping[str, Any]) -> str:
        lines = [f"{report['scene']}: {report['about']}", "bodies"]
        for name, body in report["bodies"].items():
            lines.append(f"  {name:12s} {body['role']}")
            lines += [
                f"    {name}.{coordinate}: starts at {own['start']:.6g}"
                for coordinate, own in body["coordinates"].items()
            ]
        lines += ["contacts", *(f"  {' | '.join(each['between'])}" for each in report["contacts"])]
        return "\n".join([*lines, *stated(report, 12)])

    joints = of_scene(coordinates_as_joints)
    mjcf = of_scene(no_model)

    def roles(self, _parameters: Mapping[str, float] | None = None) -> dict[str, str]:
        moving = {body_of(name) for name in self.scene.template.coordinates}
        return {
            name: ROBOT if name in self.robots else OBJECT if name in moving else OBSTACLE
            for name in self.scene.template.bodies
        }

    @property
    def velocities(self) -> tuple[str, ...]:
        names: tuple[str, ...] = self.scene.template.velocities
        return names

    @property
    def prescribed(self) -> tuple[str, ...]:
        return ()

    undriven = at_liberty = prescribed

    @property
    def follows_time(self) -> bool:
        """Whether a condition reads t."""
        t = len(self.scene.template.parameters)
        return any(t in code.reads for code in self.scene.conditions.values())

    @property
    def leading(self) -> tuple[str, ...]:
        inputs: tuple[str, ...] = self.scene.template.inputs
        return inputs

    is_forced = True
    whole_states = many_motions = on_clusters = False

"""A scene in space, as everything above sees it (see `world.contract`)."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

from rungwise.kernel import Reals
from rungwise.models.ladder import Rung
from rungwise.scene.space import SpaceScene
from rungwise.simulation.spatial.result import SpaceRun
from rungwise.simulation.spatial.run import SpaceSimulation
from rungwise.world.arguments import Asked
from rungwise.world.contract import SOLIDS, Told
from rungwise.world.ingredients import Parting
from rungwise.world.matching import Matched
from rungwise.world.moving.rollouts import rollout
from rungwise.world.spatial import description, evidence, matching
from rungwise.world.spatial.configurations import SpatialConfigurations
from rungwise.world.spatial.instance import SpatialInstance, roles_in_space
from rungwise.world.spatial.marks import Bodies, marks_of, measures
from rungwise.world.spatial.place import SpatialPlace
from rungwise.world.spatial.rollouts import SpaceRollouts
from rungwise.world.spatial.runs import SpatialRuns
from rungwise.world.spatial.variant import SpatialVariant


@dataclass(frozen=True)
class SpatialWorld:
    """See `World`."""

    scene: SpaceScene
    shapes: ClassVar[str] = SOLIDS
    comparison_steps: ClassVar[int] = 4000
    replanning_steps: ClassVar[int] = 10_000

    def simulation(self, model: Rung | str, **options: Any) -> SpaceSimulation:
        return SpaceSimulation(self.scene, model, **options)

    def runs(
        self, model: Rung, over: Sequence[str], parameters: Mapping[str, float] | None, **options: Any
    ) -> SpatialRuns:
        return SpatialRuns(self.scene, model, over, parameters, **options)

    def rollout(
        self, model: Rung, wanted: Asked, options: dict[str, Any], *, keep: bool, budget: int | None,
        threads: int | None, chunk: int | None, on_progress: Told | None,
    ) -> SpaceRollouts:  # fmt: skip
        return rollout(
            SpaceRollouts, SpatialRuns, self.scene, model, wanted, options, keep=keep, budget=budget,
            threads=threads, chunk=chunk, on_progress=on_progress,
        )  # fmt: skip

    def place(self, parameters: Mapping[str, float] | None) -> SpatialPlace:
        return SpatialPlace(self.scene, parameters)

    def at(self, parameters: Mapping[str, float] | None = None) -> SpatialInstance:
        return SpatialInstance(self.scene, parameters)

    def configurations(
        self, parameters: Mapping[str, float], size: float, without: str = ""
    ) -> SpatialConfigurations:
        return SpatialConfigurations(self.scene, parameters, size, without)

    def variant(self, parameters: dict[str, float], model: Rung, tol: float) -> SpatialVariant:
        return SpatialVariant(self.scene, parameters, model, tol)

    def evidence(self, parting: Parting, causes: Sequence[str]) -> dict[str, dict[str, Any]]:
        return evidence.evidence(parting, causes)

    def end(self, run: SpaceRun) -> dict[str, Any]:
        return evidence.end(run)

    def matched(self, parameters: dict[str, float], duration: float) -> Matched:
        return matching.matched(self.scene, parameters, duration)

    def marks(self, parameters: Mapping[str, float]) -> Bodies:
        return marks_of(self.scene, parameters)

    def measures(self, parameters: dict[str, float], duration: float) -> tuple[float, Reals]:
        return measures(self.scene, parameters, duration)

    def describe(self, parameters: Mapping[str, float]) -> dict[str, Any]:
        return description.describe(self.scene, parameters)

    def described(self, report: Mapping[str, Any]) -> str:
        return description.described(report)

    def roles(self, parameters: Mapping[str, float] | None = None) -> dict[str, str]:
        roles = roles_in_space(self.scene.bind(parameters))
        return dict(zip(self.scene.template.bodies, roles, strict=True))

    @property
    def velocities(self) -> tuple[str, ...]:
        return self.scene.template.velocities

    @property
    def prescribed(self) -> tuple[str, ...]:
        return tuple(self.scene.file.speeds)

    @property
    def undriven(self) -> tuple[str, ...]:
        return ()

    at_liberty = undriven

    @property
    def is_forced(self) -> bool:
        return bool(self.scene.labels.actuators)

    @property
    def follows_time(self) -> bool:
        names, file = self.scene.template.names(), self.scene.file
        told = [*file.controls.values(), *file.speeds.values()]
        codes = [names.number(str(text), "", timed=True) for text in told]
        t = len(self.scene.template.parameters)
        return any(t in code.reads for code in (*codes, *self.scene.conditions.values()))

    @property
    def leading(self) -> tuple[str, ...]:
        file = self.scene.file
        told = " ".join(str(text) for text in (*file.controls.values(), *file.speeds.values()))
        return tuple(word for word in re.findall(r"\w+", told) if word in file.parameters)

    whole_states = many_motions = on_clusters = False

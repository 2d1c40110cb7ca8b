"""A planar scene, as everything above sees it (see `world.contract`)."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

from rungwise.kernel import Reals
from rungwise.models.ladder import Rung
from rungwise.scene import Scene
from rungwise.scene.template import records as rec
from rungwise.simulation.result import Run
from rungwise.simulation.run import Simulation
from rungwise.world.arguments import Asked
from rungwise.world.contract import OUTLINES, Told
from rungwise.world.ingredients import Parting
from rungwise.world.matching import Matched
from rungwise.world.moving.marks import Coordinates
from rungwise.world.planar import description, evidence, matching
from rungwise.world.planar.configurations import PlanarConfigurations
from rungwise.world.planar.instance import PlanarInstance, roles_in_plane
from rungwise.world.planar.marks import measures
from rungwise.world.planar.place import PlanarPlace
from rungwise.world.planar.rollouts import Rollouts, rollout
from rungwise.world.planar.runs import PlanarRuns
from rungwise.world.planar.variant import PlanarVariant

LEADS = ("speed", "force", "target", "target_speed")
"""Fields of a drive that say what it does; the others say how strongly."""


@dataclass(frozen=True)
class PlanarWorld:
    """See `World`."""

    scene: Scene
    shapes: ClassVar[str] = OUTLINES
    comparison_steps: ClassVar[int] = 8000
    replanning_steps: ClassVar[int] = 300_000

    def simulation(self, model: Rung | str, **options: Any) -> Simulation:
        return Simulation(self.scene, model, **options)

    def runs(
        self, model: Rung, over: Sequence[str], parameters: Mapping[str, float] | None, **options: Any
    ) -> PlanarRuns:
        return PlanarRuns(self.scene, model, over, parameters, **options)

    def rollout(
        self, model: Rung, wanted: Asked, options: dict[str, Any], *, keep: bool, budget: int | None,
        threads: int | None, chunk: int | None, on_progress: Told | None,
    ) -> Rollouts:  # fmt: skip
        return rollout(
            self.scene, model, wanted, options, keep=keep, budget=budget, threads=threads, chunk=chunk,
            on_progress=on_progress,
        )  # fmt: skip

    def place(self, parameters: Mapping[str, float] | None) -> PlanarPlace:
        return PlanarPlace(self.scene, parameters)

    def at(self, parameters: Mapping[str, float] | None = None) -> PlanarInstance:
        return PlanarInstance(self.scene, parameters)

    def configurations(
        self, parameters: Mapping[str, float], size: float, without: str = ""
    ) -> PlanarConfigurations:
        return PlanarConfigurations(self.scene, parameters, size, without)

    def variant(self, parameters: dict[str, float], model: Rung, tol: float) -> PlanarVariant:
        return PlanarVariant(self.scene, parameters, model, tol)

    def evidence(self, parting: Parting, causes: Sequence[str]) -> dict[str, dict[str, Any]]:
        return evidence.evidence(parting, causes)

    def end(self, run: Run) -> dict[str, Any]:
        return evidence.end(run)

    def matched(self, parameters: dict[str, float], duration: float) -> Matched:
        return matching.matched(self.scene, parameters, duration)

    def marks(self, _parameters: Mapping[str, float]) -> Coordinates:
        return Coordinates(self.scene.template.coordinates)

    def measures(self, parameters: dict[str, float], duration: float) -> tuple[float, Reals]:
        return measures(self.scene, parameters, duration)

    def describe(self, parameters: Mapping[str, float]) -> dict[str, Any]:
        return description.describe(self.scene, parameters)

    def described(self, report: Mapping[str, Any]) -> str:
        return description.described(report)

    def roles(self, _parameters: Mapping[str, float] | None = None) -> dict[str, str]:
        return roles_in_plane(self.scene)

    @property
    def velocities(self) -> tuple[str, ...]:
        return self.scene.template.coordinates

    @property
    def _drives(self) -> list[tuple[str, int]]:
        """How each coordinate is driven, from the scene's literal numbers."""
        template = self.scene.template
        kinds = rec.views(template.buffer, template.counts).coordinates["drive"].tolist()
        return list(zip(template.coordinates, kinds, strict=True))

    @property
    def prescribed(self) -> tuple[str, ...]:
        return tuple(name for name, drive in self._drives if drive == rec.SPEED)

    @property
    def undriven(self) -> tuple[str, ...]:
        return tuple(name for name, drive in self._drives if drive == rec.NO_DRIVE)

    @property
    def at_liberty(self) -> tuple[str, ...]:
        template = self.scene.template
        records = rec.views(template.buffer, template.counts)
        driven = records.joints[records.measures["joint"][records.measures["drive"] != rec.NO_DRIVE]]
        bodies = {*driven["body_a"].tolist(), *driven["body_b"].tolist()}
        owners = dict(zip(template.coordinates, records.coordinates["body"].tolist(), strict=True))
        return tuple(name for name in self.undriven if owners[name] not in bodies)

    @property
    def is_forced(self) -> bool:
        return any(drive in (rec.SERVO, rec.FORCE) for _, drive in self._drives)

    @property
    def follows_time(self) -> bool:
        return self.scene.template.reads_time or self.scene.template.awaits_time

    @property
    def leading(self) -> tuple[str, ...]:
        file = self.scene.file.model_dump(mode="json", exclude_unset=True)
        coordinates = [c for body in file["bodies"].values() for c in body.get("coordinates", {}).values()]
        coordinates += [joint.get("coordinate") or {} for joint in file.get("joints", {}).values()]
        drives = [coordinate.get("drive") or {} for coordinate in coordinates]
        told = " ".join(str(drive[field]) for drive in drives for field in LEADS if field in drive)
        return tuple(word for word in re.findall(r"\w+", told) if word in self.scene.file.parameters)

    whole_states = many_motions = on_clusters = True

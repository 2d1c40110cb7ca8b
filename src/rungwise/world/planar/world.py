"""A planar scene, as everything above sees it (see `world.contract`)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from rungwise.models.ladder import Rung
from rungwise.scene import Scene
from rungwise.scene import records as rec
from rungwise.simulation.run import Simulation
from rungwise.world.arguments import Asked
from rungwise.world.contract import Told
from rungwise.world.planar.instance import PlanarInstance, roles_in_plane
from rungwise.world.planar.place import PlanarPlace
from rungwise.world.planar.rollouts import Rollouts, rollout
from rungwise.world.planar.runs import PlanarRuns


@dataclass(frozen=True)
class PlanarWorld:
    """See `World`."""

    scene: Scene

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

    whole_states = many_motions = on_clusters = True

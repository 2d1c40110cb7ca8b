"""A planar scene, as everything above sees it (see `world.contract`)."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from rungwise.models.ladder import QUASISTATIC_COMPLIANT
from rungwise.scene import Scene
from rungwise.scene.template import records as rec
from rungwise.simulation.run import Simulation
from rungwise.simulation.saved import planar_run
from rungwise.world.contract import OUTLINES
from rungwise.world.moving.marks import coordinates_of
from rungwise.world.parts import coordinates_as_joints, no_model, of_scene
from rungwise.world.planar.configurations import PlanarConfigurations
from rungwise.world.planar.description import describe, described
from rungwise.world.planar.evidence import end, evidence
from rungwise.world.planar.instance import PlanarInstance, roles_in_plane
from rungwise.world.planar.marks import measures
from rungwise.world.planar.matching import matched
from rungwise.world.planar.place import PlanarPlace
from rungwise.world.planar.rollouts import rollout
from rungwise.world.planar.runs import PlanarRuns
from rungwise.world.planar.surroundings import PlanarSurroundings
from rungwise.world.planar.variant import PlanarVariant

if TYPE_CHECKING:
    from rungwise.simulation.derivatives.slopes import Slopes

LEADS = ("speed", "force", "target", "target_speed")
"""Fields of a drive that say what it does; the others say how strongly."""


@dataclass(frozen=True)
class PlanarWorld:
    """See `World`."""

    scene: Scene
    shapes: ClassVar[str] = OUTLINES
    comparison_steps: ClassVar[int] = 8000
    replanning_steps: ClassVar[int] = 300_000

    simulation = of_scene(Simulation)
    saved = of_scene(planar_run)
    runs = of_scene(PlanarRuns)
    rollout = of_scene(rollout)
    place = of_scene(PlanarPlace)
    at = of_scene(PlanarInstance)
    configurations = of_scene(PlanarConfigurations)
    surroundings = of_scene(PlanarSurroundings)
    variant = of_scene(PlanarVariant)
    evidence = staticmethod(evidence)
    end = staticmethod(end)
    matched = of_scene(matched)
    marks = of_scene(coordinates_of)
    measures = of_scene(measures)
    describe = of_scene(describe)
    described = staticmethod(described)
    joints = of_scene(coordinates_as_joints)
    mjcf = of_scene(no_model)
    roles = of_scene(roles_in_plane)

    def slopes(self, parameters: Mapping[str, float], h: float, near: float) -> Slopes:
        from rungwise.simulation.derivatives.assembly import Assembly
        from rungwise.simulation.derivatives.slopes import Slopes

        return Slopes(Assembly(self.scene, QUASISTATIC_COMPLIANT, dict(parameters), h, 1.0), near)

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

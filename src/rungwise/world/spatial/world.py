"""A scene in space, as everything above sees it (see `world.contract`)."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, ClassVar

from rungwise.models.ladder import QUASISTATIC_COMPLIANT
from rungwise.scene.space import SpaceScene
from rungwise.simulation.saved import moving_run
from rungwise.simulation.spatial.result import SpaceRun
from rungwise.simulation.spatial.run import SpaceSimulation
from rungwise.world.contract import SOLIDS
from rungwise.world.parts import of_scene
from rungwise.world.spatial.around.surroundings import SpatialSurroundings
from rungwise.world.spatial.configurations import SpatialConfigurations
from rungwise.world.spatial.description import describe, described
from rungwise.world.spatial.evidence import end, evidence
from rungwise.world.spatial.export import joints, mjcf
from rungwise.world.spatial.instance import SpatialInstance, roles_in_space
from rungwise.world.spatial.marks import marks_of, measures
from rungwise.world.spatial.matching import matched
from rungwise.world.spatial.place import SpatialPlace
from rungwise.world.spatial.rollouts import rollout
from rungwise.world.spatial.runs import SpatialRuns
from rungwise.world.spatial.variant import SpatialVariant

if TYPE_CHECKING:
    from rungwise.simulation.derivatives.slopes import Slopes


@dataclass(frozen=True)
class SpatialWorld:
    """See `World`."""

    scene: SpaceScene
    shapes: ClassVar[str] = SOLIDS
    comparison_steps: ClassVar[int] = 4000
    replanning_steps: ClassVar[int] = 10_000

    simulation = of_scene(SpaceSimulation)
    saved = of_scene(partial(moving_run, SpaceRun))
    runs = of_scene(SpatialRuns)
    rollout = of_scene(rollout)
    place = of_scene(SpatialPlace)
    at = of_scene(SpatialInstance)
    configurations = of_scene(SpatialConfigurations)
    surroundings = of_scene(SpatialSurroundings)
    variant = of_scene(SpatialVariant)
    evidence = staticmethod(evidence)
    end = staticmethod(end)
    matched = of_scene(matched)
    marks = of_scene(marks_of)
    measures = of_scene(measures)
    describe = of_scene(describe)
    described = staticmethod(described)
    joints = of_scene(joints)
    mjcf = of_scene(mjcf)

    def slopes(self, parameters: Mapping[str, float], h: float, near: float) -> Slopes:
        from rungwise.simulation.derivatives.slopes import Slopes
        from rungwise.simulation.derivatives.space_assembly import SpaceAssembly

        return Slopes(SpaceAssembly(self.scene, QUASISTATIC_COMPLIANT, dict(parameters), h, 1.0), near)

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

"""Many runs of a scene in space, over threads (see `world.contract.Runs`)."""

from __future__ import annotations

import os
from typing import ClassVar

from rungwise.kernel import Reals
from rungwise.scene.space import SpaceScene
from rungwise.simulation.moving.samples import Make
from rungwise.simulation.spatial.kept import give_back, kept_simulation, prepared
from rungwise.world.moving.runs import MovingRuns
from rungwise.world.spatial.place import forces_in


class SpatialRuns(MovingRuns):
    """Runs of a scene in space on one rung."""

    scene: SpaceScene
    make: ClassVar[Make] = kept_simulation
    kind: ClassVar[str] = "scenes in space"
    most: ClassVar[int] = os.cpu_count() or 1

    def forces_in(self, memory: Reals, parameters: dict[str, float]) -> Reals:
        key, made = prepared(self.scene, parameters)
        found = forces_in(memory, self.scene, made)
        give_back(key, made)
        return found

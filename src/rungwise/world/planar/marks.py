"""How far motions in the plane reach that are compared."""

from __future__ import annotations

import numpy as np

from rungwise.deadline import NEVER, Deadline
from rungwise.kernel import Reals
from rungwise.models.ladder import KINEMATIC
from rungwise.scene import Scene, SceneError
from rungwise.simulation.run import Simulation
from rungwise.world.run import completed


def measures(
    scene: Scene, parameters: dict[str, float], duration: float, deadline: Deadline = NEVER
) -> tuple[float, Reals]:
    """The extent of a scene, and levers (n,) of its coordinates: of objects 1, and for angles the longest
    reach; 0 for robots, unless there are no objects. Raises SceneError where no run can begin."""
    begun = Simulation(scene, KINEMATIC, parameters=parameters, duration=1e-3 * duration, frames=3)
    run = completed(begun, deadline)
    if run.workspace is None:
        raise SceneError(run.reason)
    clock, names = run.workspace.state.clock[0], scene.template.coordinates
    objects = np.array([scene.file.bodies[name.split(".")[0]].role == "object" for name in names], bool)
    levers = np.array([float(clock["reach"]) if name.endswith("angle") else 1.0 for name in names])
    return float(clock["extent"]), levers * objects if objects.any() else levers

"""Places by which motions in space are compared: centres and axes of bodies."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from rungwise.deadline import NEVER, Deadline
from rungwise.kernel import Reals
from rungwise.scene import SceneError
from rungwise.scene.space import SpaceScene
from rungwise.simulation.spatial.run import SpaceSimulation
from rungwise.world.contract import OBJECT
from rungwise.world.run import completed
from rungwise.world.spatial.instance import reaches_of, roles_in_space

if TYPE_CHECKING:
    import mujoco

AXES = ("x axis", "y axis", "z axis")


@dataclass(frozen=True)
class Bodies:
    """Of each body that moves: its centre of mass, and the unit vectors of its axes, which know no sign of a
    quaternion."""

    names: tuple[str, ...]
    model: mujoco.MjModel

    def __call__(self, q: Reals) -> Reals:
        """Places (..., 4 b, 3) of states q (..., n_q)."""
        import mujoco

        data, moving = mujoco.MjData(self.model), self.model.body_weldid != 0
        rows = q.reshape(-1, q.shape[-1])
        found = np.full((len(rows), int(moving.sum()), 4, 3), np.nan)
        for own, row in zip(found, rows, strict=True):
            if not np.isnan(row).any():
                data.qpos[:] = row
                mujoco.mj_kinematics(self.model, data)
                own[:, 0] = data.xipos[moving]
                own[:, 1:] = data.xmat[moving].reshape(-1, 3, 3).transpose(0, 2, 1)
        return found.reshape(*q.shape[:-1], -1, 3)


def marks_of(scene: SpaceScene, parameters: Mapping[str, float]) -> Bodies:
    """Centres and axes of the bodies that move."""
    model = scene.bind(parameters).model
    moving = [name for name, weld in zip(scene.labels.bodies, model.body_weldid, strict=True) if weld]
    return Bodies(tuple(f"{name} {part}" for name in moving for part in ("centre", *AXES)), model)


def measures(
    scene: SpaceScene, parameters: Mapping[str, float], duration: float, deadline: Deadline = NEVER
) -> tuple[float, Reals]:
    """The extent of a scene, the longest edge of the box around all geoms of finite size at the start, and
    levers (4 b,) of the places of `Bodies`: of objects 1, and for axes how far the body reaches; 0 for
    robots, unless there are no objects. Raises SceneError where no run can begin."""
    begun = SpaceSimulation(scene, "kinematic", parameters=parameters, duration=1e-6 * duration, frames=3)
    run = completed(begun, deadline)
    if run.space is None or not run.frames:
        raise SceneError(run.reason)
    space = run.space
    space.least_gap(run.frames[0].q)
    model, data = space.model, space.data
    moving = model.body_weldid != 0
    roles = np.array(roles_in_space(scene.bind(parameters)))
    chosen = moving & (roles == OBJECT)
    chosen = chosen if chosen.any() else moving
    sized = model.geom_rbound > 0.0
    size, centre = model.geom_rbound[sized, None], data.geom_xpos[sized]
    box = (centre + size).max(axis=0, initial=-np.inf) - (centre - size).min(axis=0, initial=np.inf)
    extent = float(box.max()) if sized.any() else float(model.stat.extent)
    weights = np.ones((model.nbody, 4))
    weights[:, 1:] = reaches_of(model)[:, None]
    return extent, (weights * chosen[:, None])[moving].ravel()

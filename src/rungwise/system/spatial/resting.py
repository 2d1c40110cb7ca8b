"""How fast bodies of a model move, as conditions of rest count it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rungwise.kernel import Reals

if TYPE_CHECKING:
    import mujoco


class Resting:
    """Speeds of the bodies of a model, and what that takes: the farthest that points of a body's geoms may be
    from its centre of mass (b,)."""

    def __init__(self, model: mujoco.MjModel) -> None:
        import mujoco

        self._mujoco, self._model, self._data = mujoco, model, mujoco.MjData(model)
        self._reach = np.zeros(model.nbody)
        for g in range(model.ngeom):
            b = int(model.geom_bodyid[g])
            away = float(np.linalg.norm(model.geom_pos[g] - model.body_ipos[b]))
            self._reach[b] = max(self._reach[b], away + float(model.geom_rbound[g]))

    def paces(self, q: Reals, v: Reals) -> Reals:
        """Speeds (b,) at q (n_q,), v (n_v,): of the centre of mass, and of turns about it."""
        mujoco, m, d = self._mujoco, self._model, self._data
        d.qpos[:], d.qvel[:] = q, v
        mujoco.mj_kinematics(m, d)
        mujoco.mj_comPos(m, d)
        mujoco.mj_comVel(m, d)
        found, velocity = np.zeros(m.nbody), np.zeros(6)
        for b in range(1, m.nbody):
            mujoco.mj_objectVelocity(m, d, mujoco.mjtObj.mjOBJ_BODY, b, velocity, 0)
            turn, way = np.linalg.norm(velocity[:3]), np.linalg.norm(velocity[3:])
            found[b] = way + self._reach[b] * turn
        return found

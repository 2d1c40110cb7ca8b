"""Robots in space that a task leads through free space, by their joints."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from rungwise.kernel import Reals
from rungwise.scene.space import SpaceBound, SpaceScene
from rungwise.system.spatial.drives import joints_of, targets
from rungwise.world.carriers import Carrier, TaskError, pushes_of


def carrier(scene: SpaceScene, name: str, bound: SpaceBound, numbers: Mapping[str, float]) -> Carrier:
    """A body to lead through free space by its joints. Raises TaskError where inputs do not drive these."""
    joints = joints_of(bound.model, scene.template.bodies.index(name))
    matrix, zero, by_place = _followed_in_space(scene, joints, bound)
    columns = np.flatnonzero(np.abs(matrix).any(axis=0)).tolist()
    matrix = matrix[:, columns]
    k = len(joints)
    if not k or len(columns) != k or np.linalg.matrix_rank(matrix) < k or not (by_place or not zero.any()):
        own = [scene.template.velocities[v] for v in bound.model.jnt_dofadr[joints].tolist()]
        raise TaskError(
            f"task.transit.{name}: needs inputs, one for each of {', '.join(own) or 'its joints'}, that drive"
            " their speeds, or the targets of their servos, linearly and whatever the time"
        )
    places = tuple(bound.model.jnt_qposadr[joints].tolist())
    return Carrier(
        body=name, places=places, columns=tuple(columns), matrix=matrix, zero=zero, by_place=by_place,
        **pushes_of(name, numbers),
    )  # fmt: skip


def _followed_in_space(scene: SpaceScene, joints: list[int], bound: SpaceBound) -> tuple[Reals, Reals, bool]:
    """The matrix (k, u) and zero (k,) by which targets or speeds of joints follow the inputs, nan where they
    do not, or not linearly; and whether they are targets."""
    columns = [scene.template.parameters.index(name) for name in scene.template.inputs]

    def followed(levels: Reals, time: float) -> Reals:
        values = bound.values.copy()
        values[columns], values[-1] = levels, time
        bound.tell(values)
        pace = bound.pace[bound.model.jnt_dofadr[joints]]
        return targets(bound, joints) if np.isnan(pace).all() else pace

    size = len(columns)
    zero = followed(np.zeros(size), 0.0)
    matrix = np.array([followed(one, 0.0) - zero for one in np.eye(size)]).T.reshape(len(joints), size)
    trial = np.random.default_rng(0).uniform(-1.0, 1.0, size)
    same = all(
        np.allclose(followed(trial, time), matrix @ trial + zero, rtol=1e-9, atol=1e-12)
        for time in (0.0, 1.0)
    )
    bound.tell(bound.values)
    by_place = bool(np.isnan(bound.pace[bound.model.jnt_dofadr[joints]]).all())
    return (matrix if same else np.zeros_like(matrix)), zero, by_place

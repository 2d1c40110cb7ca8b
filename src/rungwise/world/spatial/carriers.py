"""Robots in space that a task leads through free space, by their joints."""

from __future__ import annotations

import numpy as np

from rungwise.kernel import Reals
from rungwise.scene.space import SpaceBound, SpaceScene
from rungwise.system.spatial.drives import SLIDE, drives, joints_of, targets
from rungwise.world.carriers import Driven, Linear, Servos, TaskError


def driven(scene: SpaceScene, name: str, bound: SpaceBound, path: str, reach: float) -> Driven:
    """How inputs place a body by its joints. Raises TaskError, at the path, where they do not drive these."""
    joints = joints_of(bound.model, scene.template.bodies.index(name))
    matrix, zero, by_place = _followed_in_space(scene, joints, bound)
    led = np.abs(matrix).any(axis=1) | ~np.isfinite(zero)
    if by_place and led.any():
        joints = [joint for joint, own in zip(joints, led.tolist(), strict=True) if own]
        matrix, zero = matrix[led], zero[led]
    columns = np.flatnonzero(np.abs(matrix).any(axis=0)).tolist()
    matrix = matrix[:, columns]
    k = len(joints)
    if not k or len(columns) != k or np.linalg.matrix_rank(matrix) < k or not (by_place or not zero.any()):
        own = [scene.template.velocities[v] for v in bound.model.jnt_dofadr[joints].tolist()]
        raise TaskError(
            f"{path}: needs inputs, one for each of {', '.join(own) or 'its joints'}, that drive"
            " their speeds, or the targets of their servos, linearly and whatever the time"
        )
    servos = _servos(bound, joints) if by_place else Servos(np.full(k, np.inf), np.full(k, np.inf))
    return Driven(
        body=name, places=tuple(bound.model.jnt_qposadr[joints].tolist()), columns=tuple(columns),
        led=Linear(matrix, zero), by_place=by_place, servos=servos, reach=reach, links=(),
        home=np.zeros(0), rates=tuple(bound.model.jnt_dofadr[joints].tolist()),
        slides=tuple((bound.model.jnt_type[joints] == SLIDE).tolist()), travel=_travel(bound, joints),
        levers=_levers(bound, joints, scene.template.bodies.index(name), reach),
    )  # fmt: skip


def _levers(bound: SpaceBound, joints: list[int], body: int, reach: float) -> tuple[float, ...]:
    """How far a body, which reaches so far from its centre of mass, is at most from the axes of hinges (k,)
    as it begins; 1 for slides."""
    import mujoco

    model, data = bound.model, mujoco.MjData(bound.model)
    data.qpos[:] = bound.place
    mujoco.mj_kinematics(model, data)
    found = list[float]()
    for joint in joints:
        arm = np.cross(data.xaxis[joint], data.xipos[body] - data.xanchor[joint])
        found.append(1.0 if model.jnt_type[joint] == SLIDE else float(np.linalg.norm(arm)) + reach)
    return tuple(found)


def _travel(bound: SpaceBound, joints: list[int]) -> Reals:
    """Least and greatest places (2, k) of joints, infinite where nothing bounds them."""
    model = bound.model
    limited = model.jnt_limited[joints].astype(bool)
    return np.where(limited, model.jnt_range[joints].T, [[-np.inf], [np.inf]])


def _servos(bound: SpaceBound, joints: list[int]) -> Servos:
    """The servos that lead joints (see `drives.targets`)."""
    model, own = bound.model, drives(bound.model)
    actuators = {int(model.actuator_trnid[a, 0]): (s, a) for s, a in enumerate(own.servos.tolist())}
    rows = [(s, a, float(model.actuator_gear[a, 0])) for s, a in (actuators[joint] for joint in joints)]
    stiffness = np.array([own.gains[s, 0] * gear**2 for s, _, gear in rows])
    damping = np.array([own.gains[s, 1] * gear**2 for s, _, gear in rows])
    damping += bound.model.dof_damping[bound.model.jnt_dofadr[joints]]
    limit = np.array([own.limit[a] * abs(gear) for _, a, gear in rows])
    return Servos(stiffness, limit, float((damping / stiffness).max()))


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

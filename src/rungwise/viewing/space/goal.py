"""The poses that a goal wants of bodies in space."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from rungwise.kernel import Reals
from rungwise.scene.space.labels import PLACES
from rungwise.scene.space.mujoco_model import library
from rungwise.viewing.goal import NEAR_GOAL, Wanted, goal_places

if TYPE_CHECKING:
    import mujoco

    from rungwise.scene.space import SpaceScene

FREE = 2
"""Places of a free body, of three, that a goal must hold to want a pose of it."""


def goal_poses(scene: SpaceScene, model: mujoco.MjModel, parameters: Mapping[str, float], q: Reals) -> Reals:
    """Poses (b, 7), places and quaternions w x y z, that the goal wants of bodies, with what it leaves open
    as in q (n_q,); NaN where it wants none. It wants a pose of a free body where it holds two of its places,
    of another where it holds all of its joints."""
    poses, there = np.full((model.nbody, 7), np.nan), q.copy()
    found = goal_places(scene, parameters)
    names, wanted = scene.labels.coordinates, np.zeros(model.nbody, bool)
    for body in range(1, model.nbody):
        wanted[body] = _wants(scene, model, body, found)
        if model.body_jntnum[body] == 0:  # what is fixed to a body goes with it
            wanted[body] = wanted[model.body_parentid[body]]
    if not wanted.any():
        return poses
    for name, each in found.items():
        if name in names:
            there[names.index(name)] = each.value
    for name, each in found.items():
        if name not in names:
            label, axis = name.removeprefix("angle_about(").removesuffix(")").split(", ")
            first = names.index(f"{label}.qw")
            there[first : first + 4] = _turned(there[first : first + 4], "xyz".index(axis), each.value)
    mujoco = library()
    data = mujoco.MjData(model)
    data.qpos[:] = there
    mujoco.mj_kinematics(model, data)
    poses[wanted] = np.column_stack([data.xpos, data.xquat])[wanted]
    return poses


def _wants(scene: SpaceScene, model: mujoco.MjModel, body: int, found: Mapping[str, Wanted]) -> bool:
    """Whether the goal holds what the joints of a body leave free, within a part of its reach."""
    label = scene.labels.bodies[body]
    own = [name for name in scene.labels.coordinates if name.rpartition(".")[0] == label]
    geoms = np.flatnonzero(model.geom_bodyid == body)
    near = NEAR_GOAL * float(
        (model.geom_rbound + np.linalg.norm(model.geom_pos, axis=1))[geoms].max(initial=0.0)
    )
    held = [name for name in own if name in found and found[name].within <= near]
    if f"{label}.qw" in own:
        return sum(name in held for name in (f"{label}.{place}" for place in PLACES)) >= FREE
    return bool(own) and held == own


def _turned(turn: Reals, axis: int, angle: float) -> Reals:
    """A quaternion turned about an axis of the world until its twist about it is the angle."""
    by = 0.5 * angle - math.atan2(turn[1 + axis], turn[0])
    about = np.zeros(3)
    about[axis] = math.sin(by)
    real, vector = math.cos(by), turn[1:]
    whole: Reals = np.concatenate(
        [
            [real * turn[0] - about @ vector],
            real * vector + turn[0] * about + np.cross(about, vector),
        ]
    )
    return whole

"""What a planner moves, and with what: roles of bodies, weights of their coordinates, their size."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rungwise.kernel import Ints, Reals
from rungwise.scene import Scene
from rungwise.scene.records import Records
from rungwise.scene.space import SpaceBound, SpaceScene
from rungwise.system.spatial.drives import moments

if TYPE_CHECKING:
    import mujoco

OBJECT, ROBOT, OBSTACLE = "object", "robot", "obstacle"
FREE, BALL, SLIDE = 0, 1, 2
"""Numbers of MuJoCo's joints, as far as they are told apart here."""
TURNED = 2.0
"""Angle of a turn over the distance of its quaternion from the one before, for small angles."""


class Moved(NamedTuple):
    """Weights (n_q,) of coordinates in distances between states: 1 for places of objects, how far they reach
    for angles, 0 for robots; size: how far the largest object reaches; turns (r, 4): columns of
    quaternions; rates (n_v,): weights of velocities in speeds, in the same manner."""

    weights: Reals
    size: float
    turns: Ints
    rates: Reals


def roles_of(scene: Scene | SpaceScene, parameters: Mapping[str, float] | None = None) -> dict[str, str]:
    """What each body is to a planner: as it is written; in space an obstacle where it cannot move, a robot
    where an actuator or a given speed drives it or what it is joined to, and otherwise an object."""
    if isinstance(scene, Scene):
        return {name: body.role for name, body in scene.file.bodies.items()}
    return dict(zip(scene.template.bodies, _roles(scene.bind(parameters)), strict=True))


def _roles(bound: SpaceBound) -> list[str]:
    model = bound.model
    driven = ~np.isnan(bound.pace) | (moments(model, bound.place) != 0.0).any(axis=0)
    trees = set(model.dof_treeid[driven].tolist())
    return [
        OBSTACLE if tree < 0 else ROBOT if tree in trees else OBJECT for tree in model.body_treeid.tolist()
    ]


def reaches_of(model: mujoco.MjModel) -> Reals:
    """How far the geoms of each body (b,) reach from its centre of mass."""
    reach = np.zeros(model.nbody)
    for g in range(model.ngeom):
        body, own = int(model.geom_bodyid[g]), float(model.geom_rbound[g])
        reach[body] = max(reach[body], own + float(np.linalg.norm(model.geom_pos[g] - model.body_ipos[body])))
    return reach


def moved_in_space(bound: SpaceBound) -> Moved:
    """Weights and size of what is moved in a bound scene in space."""
    model, roles = bound.model, np.array(_roles(bound))
    reach = reaches_of(model)
    weights, turns, rates = np.zeros(model.nq), list[range](), np.zeros(model.nv)
    for j in range(model.njnt):
        kind, first, body = int(model.jnt_type[j]), int(model.jnt_qposadr[j]), int(model.jnt_bodyid[j])
        places = 3 if kind == FREE else 0
        if kind in (FREE, BALL):
            turns.append(range(first + places, first + places + 4))
        if roles[body] == OBJECT:
            weights[first : first + places] = 1.0
            lever = TURNED * reach[body] if kind in (FREE, BALL) else 1.0 if kind == SLIDE else reach[body]
            weights[first + places : first + places + (4 if kind in (FREE, BALL) else 1)] = lever
            moving = int(model.jnt_dofadr[j])
            rates[moving : moving + places] = 1.0
            rates[moving + places : moving + places + (3 if kind in (FREE, BALL) else 1)] = (
                1.0 if kind == SLIDE else reach[body]
            )
    sizes = reach[roles == OBJECT]
    if not sizes.max(initial=0.0) > 0.0:
        sizes = reach[roles == ROBOT]
    size = float(sizes.max(initial=0.0))
    return Moved(weights, size or 1.0, np.array(turns, np.int64).reshape(-1, 4), rates)


def moved_in_plane(scene: Scene, records: Records) -> Moved:
    """The same of a planar scene; angles count by the radius of gyration, and without a finite object the
    size is 1."""
    roles, names = roles_of(scene), scene.template.coordinates
    of_object = [roles[name.split(".")[0]] == OBJECT for name in names]
    reaches = [
        float(s["reach"]) for s in records.shapes if roles[scene.template.bodies[int(s["body"])]] == OBJECT
    ]
    size = max((reach for reach in reaches if math.isfinite(reach)), default=1.0)
    levers = np.where(of_object, records.coordinates["lever"], 0.0)
    return Moved(levers, size, np.zeros((0, 4), np.int64), levers)


def moved(scene: Scene | SpaceScene, parameters: Mapping[str, float]) -> Moved:
    """Weights and size of what is moved in a scene of either kind."""
    if isinstance(scene, Scene):
        return moved_in_plane(scene, scene.bind(parameters).records)
    return moved_in_space(scene.bind(parameters))

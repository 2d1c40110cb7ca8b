"""A scene in space at one set of parameters (see `world.contract.Instance`)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rungwise.kernel import Reals
from rungwise.scene.language.lasting import names_in
from rungwise.scene.space import SpaceBound, SpaceScene
from rungwise.system.spatial.drives import BALL, FREE, SLIDE, moments
from rungwise.world.carriers import Driven
from rungwise.world.contract import OBJECT, OBSTACLE, ROBOT, Load, Moved
from rungwise.world.parts import SceneInstance
from rungwise.world.spatial.carriers import driven

if TYPE_CHECKING:
    import mujoco

TURNED = 2.0
"""Angle of a turn over the distance of its quaternion from the one before, for small angles."""


@dataclass(frozen=True)
class SpatialInstance(SceneInstance[SpaceBound]):
    """See `Instance`."""

    scene: SpaceScene

    @property
    def _start(self) -> tuple[Reals, Reals]:
        return self.bound.place, self.bound.motion

    @property
    def travel(self) -> Reals:
        model = self.bound.model
        travel = np.full((2, model.nq), [[-math.inf], [math.inf]])
        for j in np.flatnonzero(model.jnt_limited & (model.jnt_type >= SLIDE)):
            travel[:, model.jnt_qposadr[j]] = model.jnt_range[j]
        return travel

    @property
    def smallest(self) -> float:
        return self.scene.size if math.isfinite(self.scene.size) else 1.0

    @cached_property
    def moved(self) -> Moved:
        said = names_in(self.scene.file.goal) if self.scene.file.goal else set[str]()
        named = [k for k, name in enumerate(self.scene.template.bodies) if name in said]
        return moved_in_space(self.bound, named)

    def driven(self, name: str, path: str) -> Driven:
        body = self.scene.template.bodies.index(name)
        return driven(self.scene, name, self.bound, path, float(reaches_of(self.bound.model)[body]))

    @property
    def loads(self) -> Mapping[str, Load]:
        model, names = self.bound.model, self.scene.template.bodies
        roles = dict(zip(names, roles_in_space(self.bound), strict=True))
        gravity, found = float(np.linalg.norm(model.opt.gravity)), {}
        for name, mass in zip(names, model.body_mass.tolist(), strict=True):
            if roles[name] == OBJECT:
                pairs = [pair for pair in self.scene.template.contacts if name in pair]
                on = tuple(other for pair in pairs for other in pair if roles[other] == OBSTACLE)
                found[name] = Load(mass * gravity, on, 0.0)
        return found


def roles_in_space(bound: SpaceBound) -> list[str]:
    """The role of each body: an obstacle where it cannot move, a robot where an actuator or a given speed
    drives it or what it is joined to, and otherwise an object."""
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


def moved_in_space(bound: SpaceBound, named: list[int]) -> Moved:
    """Weights and size of what is moved in a bound scene in space: of objects; where there are none, of the
    robots' bodies among those that a goal has `named`."""
    model, roles = bound.model, np.array(roles_in_space(bound))
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
        sizes = _asked(bound, roles, reach, named)
    size = float(sizes.max(initial=0.0))
    return Moved(weights, size or 1.0, np.array(turns, np.int64).reshape(-1, 4), rates)


def _asked(bound: SpaceBound, roles: NDArray[np.str_], reach: Reals, named: list[int]) -> Reals:
    """How far the robots' bodies of which a goal speaks reach (k,), or what they are built on where they
    have no geoms; all robots where it speaks of none."""
    found = list[float]()
    for body in named:
        while roles[body] == ROBOT and not reach[body] > 0.0:
            body = int(bound.model.body_parentid[body])
        if roles[body] == ROBOT:
            found.append(float(reach[body]))
    return np.array(found) if found else np.asarray(reach[roles == ROBOT])

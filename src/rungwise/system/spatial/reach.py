"""How far velocities of a model carry its points: bounds that hold at every state."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from rungwise.kernel import Ints, Reals, kernel

if TYPE_CHECKING:
    import mujoco


def reaches(model: mujoco.MjModel) -> Reals:
    """(b, n): a bound on the speed of any point of each body's geoms per unit of each velocity: 1 for
    translation; for a turn the farthest that a point of the body can be from the axis, link by link."""
    import mujoco

    found = np.zeros((model.nbody, model.nv))
    extent = np.zeros(model.nbody)
    for g in range(model.ngeom):
        b = int(model.geom_bodyid[g])
        size = float(model.geom_rbound[g])
        if size > 0.0:
            extent[b] = max(extent[b], float(np.linalg.norm(model.geom_pos[g])) + size)
    link = np.linalg.norm(model.body_pos, axis=1) + _travel(model)
    for b in range(1, model.nbody):
        away, at = float(extent[b]), b
        while at > 0:
            first, count = int(model.body_jntadr[at]), int(model.body_jntnum[at])
            for j in range(first, first + count):
                address, kind = int(model.jnt_dofadr[j]), int(model.jnt_type[j])
                arm = away + float(np.linalg.norm(model.jnt_pos[j]))
                if kind == mujoco.mjtJoint.mjJNT_SLIDE:
                    found[b, address] = 1.0
                elif kind == mujoco.mjtJoint.mjJNT_HINGE:
                    found[b, address] = arm
                elif kind == mujoco.mjtJoint.mjJNT_BALL:
                    found[b, address : address + 3] = arm
                else:
                    found[b, address : address + 3] = 1.0
                    found[b, address + 3 : address + 6] = arm
            away += float(link[at])
            at = int(model.body_parentid[at])
    return found


def vectors(model: mujoco.MjModel) -> Ints:
    """Where each vector of velocities begins, and the end of the last (g + 1,): the translation of a free
    body, its turn, the turn of a ball joint, and each other velocity for itself."""
    import mujoco

    first = []
    for kind, address in zip(model.jnt_type, model.jnt_dofadr, strict=True):
        first.append(int(address))
        if kind == mujoco.mjtJoint.mjJNT_FREE:
            first.append(int(address) + 3)
    return np.array([*first, model.nv], np.int64)


@kernel
def fastest_point(reaches: Reals, vectors: Ints, v: Reals, lengths: Reals) -> float:
    """The greatest speed of any point at velocities v (n,), by these bounds, in any frame; `lengths` (g,) is
    scratch."""
    greatest, count = 0.0, len(vectors) - 1
    for g in range(count):
        lengths[g] = abs(v[vectors[g]])
        for i in range(vectors[g] + 1, vectors[g + 1]):
            lengths[g] = math.hypot(lengths[g], v[i])
    for b in range(len(reaches)):
        speed = 0.0
        for g in range(count):
            speed += reaches[b, vectors[g]] * lengths[g]
        greatest = max(greatest, speed)
    return greatest


def _travel(model: mujoco.MjModel) -> Reals:
    """How far slides carry each body from its place in its parent (b,)."""
    import mujoco

    travel = np.zeros(model.nbody)
    for j in range(model.njnt):
        if model.jnt_type[j] == mujoco.mjtJoint.mjJNT_SLIDE and model.jnt_limited[j]:
            travel[model.jnt_bodyid[j]] += float(np.abs(model.jnt_range[j]).max())
    return travel


def moved_by(model: mujoco.MjModel) -> Ints:
    """The stretch (b, 2) of the velocities that may move each body: from the first of its mechanism to the
    last of its own."""
    found = np.zeros((model.nbody, 2), np.int64)
    for body in range(1, model.nbody):
        parent, count = model.body_parentid[body], model.body_dofnum[body]
        first, end = found[parent]
        if count:
            end = model.body_dofadr[body] + count
            first = first if found[parent, 1] else model.body_dofadr[body]
        found[body] = first, end
    return found

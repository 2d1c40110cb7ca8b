"""How far velocities of a model carry its points: bounds that hold at every state."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from rungwise.contact.step import whole_matrix
from rungwise.kernel import Ints, Reals, kernel

if TYPE_CHECKING:
    import mujoco


def reaches(model: mujoco.MjModel) -> Reals:
    """(b, n): a bound on the speed of any point of each body's geoms per unit of each velocity: 1 for
    translation; for a turn the farthest that a point of the body can be from the axis, link by link."""
    moved = moved_by(model)
    return whole_matrix(kept_reaches(model, moved), moved, model.nv)


def kept_reaches(model: mujoco.MjModel, moved: Ints) -> Reals:
    """What is kept of these (b, w) in the stretches moved (b, 2), see `moved_by` and `contact.step.spans`."""
    import mujoco

    found = np.zeros((model.nbody, int((moved[:, 1] - moved[:, 0]).max(initial=0))))
    extent = np.zeros(model.nbody)
    for g in range(model.ngeom):
        b = int(model.geom_bodyid[g])
        size = float(model.geom_rbound[g])
        if size > 0.0:
            extent[b] = max(extent[b], float(np.linalg.norm(model.geom_pos[g])) + size)
    link = np.linalg.norm(model.body_pos, axis=1) + _travel(model)
    for b in range(1, model.nbody):
        away, at, shift = float(extent[b]), b, int(moved[b, 0])
        while at > 0:
            first, count = int(model.body_jntadr[at]), int(model.body_jntnum[at])
            for j in range(first, first + count):
                address, kind = int(model.jnt_dofadr[j]) - shift, int(model.jnt_type[j])
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
def fastest_point(reaches: Reals, moved: Ints, vectors: Ints, v: Reals, lengths: Reals) -> float:
    """The greatest speed of any point at velocities v (n,), by these bounds, which are kept in the stretches
    moved (b, 2), in any frame; `lengths` (n,) is scratch."""
    greatest = 0.0
    for g in range(len(vectors) - 1):
        first = vectors[g]
        lengths[first] = abs(v[first])
        for i in range(first + 1, vectors[g + 1]):
            lengths[first], lengths[i] = math.hypot(lengths[first], v[i]), 0.0
    for b in range(len(reaches)):
        speed = 0.0
        for i in range(moved[b, 0], moved[b, 1]):
            speed += reaches[b, i - moved[b, 0]] * lengths[i]
        greatest = max(greatest, speed)
    return greatest


@kernel
def rate_of(bounds: Reals, moved: Ints, b: int, v: Reals) -> float:
    """A bound of what velocities v (n,) do to body b, by bounds per unit of each, which are kept in the
    stretches moved (b, 2)."""
    total = 0.0
    for i in range(moved[b, 0], moved[b, 1]):
        total += bounds[b, i - moved[b, 0]] * abs(v[i])
    return total


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

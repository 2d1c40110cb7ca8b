"""How fast bodies of a model move, as conditions of rest count it."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from rungwise.block import Block
from rungwise.kernel import Ints, Reals, kernel

if TYPE_CHECKING:
    import mujoco


class Resting(Block):
    """reach (b,): the farthest that points of a body's geoms may be from its centre of mass; root (b,): the
    root of each body's tree; centre, velocity (b, 3; b, 6) of bodies, and the centres (b, 3) of their trees,
    at which velocities are given, in MuJoCo's memory."""

    reach: Reals
    root: Ints
    centre: Reals
    velocity: Reals
    tree: Reals


def resting(model: mujoco.MjModel, data: mujoco.MjData) -> Resting:
    reach = np.zeros(model.nbody)
    for g in range(model.ngeom):
        b = int(model.geom_bodyid[g])
        away = float(np.linalg.norm(model.geom_pos[g] - model.body_ipos[b]))
        reach[b] = max(reach[b], away + float(model.geom_rbound[g]))
    return Resting(
        reach=reach, root=model.body_rootid.astype(np.int64), centre=data.xipos, velocity=data.cvel,
        tree=data.subtree_com,
    )  # fmt: skip


@kernel
def pace(of: Resting, b: int) -> float:
    """How fast a body moves: the speed of its centre of mass, and of turns about it."""
    w, u, centre, tree = of.velocity[b, :3], of.velocity[b, 3:], of.centre[b], of.tree[of.root[b]]
    way, turn = 0.0, 0.0
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        own = u[i] + w[j] * (centre[k] - tree[k]) - w[k] * (centre[j] - tree[j])
        way += own * own
        turn += w[i] * w[i]
    return float(math.sqrt(way) + of.reach[b] * math.sqrt(turn))

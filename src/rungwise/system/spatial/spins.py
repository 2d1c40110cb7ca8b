"""Free bodies that turn: inertial forces with which a step without other forces keeps momentum.

Explicit ones, -w x I w about the centre r and -m w x (w x r) at it, add energy in each step, without bound
where a body turns by a good part of a radian. Here the turning speed w' after the step is such that the
momentum I w, as the body turns by E = exp(h w'), stays where it is in space: E I w' = I w (J. Moser, A. P.
Veselov, Comm. Math. Phys. 139, 1991, 217-243), so |I w| never grows; and the centre goes on as fast, with the
force m (1 - E) (w' x r) / h.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from rungwise.block import Block
from rungwise.kernel import Ints, Reals, inner_kernel, kernel

if TYPE_CHECKING:
    import mujoco

_MOST, _SETTLED = 40, 1e-15
"""Most turns of the momentum that are tried, and the change of the speed, over the speed, that ends them."""
_AT_ORIGIN = 1e-14
"""Distance of a centre from its frame's origin that is rounding, over the model's extent."""


class Spins(Block):
    """Free bodies that nothing else hangs on: body (b,), first (b,) of their six velocities, mass (b,),
    centre (b, 3), and inertia about it and its inverse (b, 3, 3), in the body's frame."""

    body: Ints
    first: Ints
    mass: Reals
    centre: Reals
    inertia: Reals
    inverse: Reals


def spins(model: mujoco.MjModel) -> Spins:
    """The free bodies of a model, with what is welded to them."""
    import mujoco

    m, data = model, mujoco.MjData(model)
    mujoco.mj_kinematics(m, data)
    bodies, first, masses, centres, inertia = [], [], [], [], []
    for joint in np.flatnonzero(m.jnt_type == mujoco.mjtJoint.mjJNT_FREE):
        body, dof = int(m.jnt_bodyid[joint]), int(m.jnt_dofadr[joint])
        parts = np.flatnonzero(m.body_weldid == body)
        hangs = (m.body_dofnum > 0) & np.isin(m.body_weldid[m.body_parentid], body)
        if hangs.any() or m.dof_armature[dof : dof + 6].any():
            continue
        mass, centre = m.body_mass[parts], data.xipos[parts]
        middle = mass @ centre / mass.sum()
        total = np.zeros((3, 3))
        for i, arm in zip(parts, centre - middle, strict=True):
            axes = data.ximat[i].reshape(3, 3)
            total += (axes * m.body_inertia[i]) @ axes.T
            total += m.body_mass[i] * (arm @ arm * np.eye(3) - np.outer(arm, arm))
        axes = data.xmat[body].reshape(3, 3)
        bodies.append(body)
        first.append(dof)
        masses.append(mass.sum())
        centres.append(axes.T @ (middle - data.xpos[body]))
        inertia.append(axes.T @ total @ axes)
    found, own = np.array(inertia).reshape(-1, 3, 3), np.array(centres).reshape(-1, 3)
    own[np.abs(own) < _AT_ORIGIN * model.stat.extent] = 0.0
    return Spins(
        body=np.array(bodies, np.int64), first=np.array(first, np.int64), mass=np.array(masses, float),
        centre=own, inertia=found, inverse=np.linalg.inv(found),
    )  # fmt: skip


@kernel
def turn_freely(bodies: Spins, turn: Reals, v: Reals, h: float, eps: float, load: Reals) -> None:
    """Put these forces, times eps, into `load` (n,) in the place of those at the start of a step of length h
    from speeds v (n,); turn (all bodies, 9): axes of the bodies' frames, row by row."""
    for b in range(len(bodies.first)):
        at, I, inverse = bodies.first[b] + 3, bodies.inertia[b], bodies.inverse[b]
        w0, w1, w2 = v[at], v[at + 1], v[at + 2]
        if w0 == 0.0 and w1 == 0.0 and w2 == 0.0:
            continue
        L0 = I[0, 0] * w0 + I[0, 1] * w1 + I[0, 2] * w2
        L1 = I[1, 0] * w0 + I[1, 1] * w1 + I[1, 2] * w2
        L2 = I[2, 0] * w0 + I[2, 1] * w1 + I[2, 2] * w2
        x, y, z, a0, a1, a2 = w0, w1, w2, L0, L1, L2
        for _ in range(_MOST):
            a0, a1, a2 = _turned(-h * x, -h * y, -h * z, L0, L1, L2)
            newer0 = inverse[0, 0] * a0 + inverse[0, 1] * a1 + inverse[0, 2] * a2
            newer1 = inverse[1, 0] * a0 + inverse[1, 1] * a1 + inverse[1, 2] * a2
            newer2 = inverse[2, 0] * a0 + inverse[2, 1] * a1 + inverse[2, 2] * a2
            change = max(abs(newer0 - x), abs(newer1 - y), abs(newer2 - z))
            x, y, z = newer0, newer1, newer2
            if change <= _SETTLED * max(abs(x), abs(y), abs(z)):
                break
        c0, c1, c2 = _cross(w0, w1, w2, L0, L1, L2)
        load[at] += eps * ((a0 - L0) / h + c0)
        load[at + 1] += eps * ((a1 - L1) / h + c1)
        load[at + 2] += eps * ((a2 - L2) / h + c2)
        r, m = bodies.centre[b], eps * bodies.mass[b]
        if r[0] == 0.0 and r[1] == 0.0 and r[2] == 0.0:
            continue
        u0, u1, u2 = _cross(x, y, z, r[0], r[1], r[2])
        e0, e1, e2 = _turned(h * x, h * y, h * z, u0, u1, u2)
        d0, d1, d2 = _cross(w0, w1, w2, r[0], r[1], r[2])
        d0, d1, d2 = _cross(w0, w1, w2, d0, d1, d2)
        f0, f1, f2 = m * ((u0 - e0) / h + d0), m * ((u1 - e1) / h + d1), m * ((u2 - e2) / h + d2)
        axes = turn[bodies.body[b]]
        for i in range(3):
            load[at - 3 + i] += axes[3 * i] * f0 + axes[3 * i + 1] * f1 + axes[3 * i + 2] * f2
        d0, d1, d2 = _cross(r[0], r[1], r[2], f0, f1, f2)
        load[at] += d0
        load[at + 1] += d1
        load[at + 2] += d2


@inner_kernel
def _cross(a: float, b: float, c: float, x: float, y: float, z: float) -> tuple[float, float, float]:
    return b * z - c * y, c * x - a * z, a * y - b * x


@kernel
def _turned(x: float, y: float, z: float, a: float, b: float, c: float) -> tuple[float, float, float]:
    """The vector (a, b, c) turned by (x, y, z), by Rodrigues' formula."""
    angle = math.sqrt(x * x + y * y + z * z)
    sine = math.sin(angle) / angle if angle > 0.0 else 1.0
    half = math.sin(0.5 * angle) / angle if angle > 0.0 else 0.5
    d, e, f = _cross(x, y, z, a, b, c)
    p, q, r = _cross(x, y, z, d, e, f)
    bend = 2.0 * half * half
    return a + sine * d + bend * p, b + sine * e + bend * q, c + sine * f + bend * r

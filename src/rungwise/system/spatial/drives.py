"""Actuators as what a step knows: loads, and rows of servos with limited force.

The force of an actuator is gain * control + bias_0 + bias_1 * length + bias_2 * rate. With bias_1 or bias_2
below zero it is a servo with K_p = -bias_1 and K_d = -bias_2, taken implicitly; otherwise it is a load. A
range of force that is not symmetric is a load in its middle and a symmetric range about it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from rungwise.kernel import Ints, Reals
from rungwise.scene.space.ranges import force_ranges
from rungwise.scene.space.refused import AFFINE

if TYPE_CHECKING:
    import mujoco

    from rungwise.scene.space import SpaceBound

INTEGRATOR = 1
"""MuJoCo's number of actuators that act by the integral of their control."""
FREE, BALL, SLIDE, HINGE = range(4)
"""MuJoCo's numbers of joints: free bodies, balls, along an axis, about one."""


@dataclass(frozen=True, eq=False)
class Drives:
    """Actuators of a model: `servos` (s,) and `forces` (f,) are their numbers; bias (a,) the constant part of
    their forces; gains (s, 2) K_p and K_d; middle, limit (a,) of the ranges of force (see `force_ranges`), in
    the units of the actuator's force."""

    model: mujoco.MjModel
    servos: Ints
    forces: Ints
    bias: Reals
    gains: Reals
    middle: Reals
    limit: Reals

    def control_ranges(self) -> tuple[Reals, Reals]:
        """The least and the greatest control of each actuator (a,)."""
        m = self.model
        low = np.where(m.actuator_ctrllimited, m.actuator_ctrlrange[:, 0], -np.inf)
        return low, np.where(m.actuator_ctrllimited, m.actuator_ctrlrange[:, 1], np.inf)

    def activation_ranges(self) -> tuple[Reals, Reals]:
        """The least and the greatest activation of each actuator (a,)."""
        m = self.model
        low = np.where(m.actuator_actlimited, m.actuator_actrange[:, 0], -np.inf)
        return low, np.where(m.actuator_actlimited, m.actuator_actrange[:, 1], np.inf)

    def constant(self, acting: Reals) -> Reals:
        """Forces (a,) without length and rate, of what actuators act by (see `acting`)."""
        return np.asarray(self.model.actuator_gainprm[:, 0] * acting + self.bias)

    def load(self, acting: Reals, moment: Reals) -> Reals:
        """The load (n,) of forces, within their ranges, and of the middles of servos; moment (a, n)."""
        force = np.clip(self.constant(acting) - self.middle, -self.limit, self.limit) + self.middle
        force[self.servos] = self.middle[self.servos]
        return np.asarray(force @ moment)

    def errors(self, acting: Reals, length: Reals, loads: bool) -> Reals:
        """K_p times the error of place, plus K_d times the speed wished for, of each servo (s,); `loads`:
        whether the middles of servos act beside it."""
        wish = self.constant(acting)[self.servos]
        if loads:
            wish -= self.middle[self.servos]
        return np.asarray(wish - self.gains[:, 0] * length[self.servos])


def drives(model: mujoco.MjModel) -> Drives:
    """The actuators of a model that has been read (see `scene.space.read`)."""
    bias = np.where((model.actuator_biastype == AFFINE)[:, None], model.actuator_biasprm[:, :3], 0.0)
    is_servo = (bias[:, 1] < 0.0) | (bias[:, 2] < 0.0)
    servos = np.flatnonzero(is_servo)
    ranges = force_ranges(model)
    limited = np.isfinite(ranges[:, 0])
    low, high = np.where(limited[:, None], ranges, 0.0).T
    return Drives(
        model=model,
        servos=servos,
        forces=np.flatnonzero(~is_servo),
        bias=bias[:, 0],
        gains=0.0 - bias[servos, 1:],
        middle=0.5 * (low + high),
        limit=np.where(limited, 0.5 * (high - low), np.inf),
    )


def moments(model: mujoco.MjModel, q: Reals) -> Reals:
    """What each actuator does to each velocity (a, n_v) at q."""
    import mujoco

    data, found = mujoco.MjData(model), np.zeros((model.nu, model.nv))
    data.qpos[:] = q
    mujoco.mj_fwdPosition(model, data)
    if model.nu:
        fill_moments(data, found)
    return found


def fill_moments(data: mujoco.MjData, found: Reals) -> None:
    """Write what each actuator does to each velocity, at the data's places, into found (a, n)."""
    import mujoco

    mujoco.mju_sparse2dense(
        found, data.actuator_moment, data.moment_rownnz, data.moment_rowadr, data.moment_colind
    )


def joints_of(model: mujoco.MjModel, body: int) -> list[int]:
    """The joints that place a body, from the world on; none where a free body or a ball joint is among
    them."""
    joints = list[int]()
    while body > 0:
        first = int(model.body_jntadr[body])
        joints += reversed(range(first, first + int(model.body_jntnum[body])))
        body = int(model.body_parentid[body])
    return [] if (model.jnt_type[joints] < SLIDE).any() else joints[::-1]


def targets(bound: SpaceBound, joints: list[int]) -> Reals:
    """Where the servos of joints lead them (k,) at the controls told now, in the end, as if no range bounded
    these; nan for a joint that not one servo of its own leads, or one whose control is a speed."""
    m, own = bound.model, drives(bound.model)
    wish = own.constant(bound.control)[own.servos]
    wish[m.actuator_dyntype[own.servos] == INTEGRATOR] = np.nan
    found = np.full(len(joints), np.nan)
    for k, joint in enumerate(joints):
        servos = [
            s
            for s, a in enumerate(own.servos.tolist())
            if m.actuator_trntype[a] == 0 and m.actuator_trnid[a, 0] == joint and own.gains[s, 0] > 0.0
        ]
        if len(servos) == 1:
            s = servos[0]
            found[k] = wish[s] / (own.gains[s, 0] * m.actuator_gear[own.servos[s], 0])
    return found

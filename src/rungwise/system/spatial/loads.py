"""Inertia and loads of a model: what acts besides contacts, limits and servos."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rungwise.kernel import Ints, Reals, steady
from rungwise.scene.space.mujoco_model import of_unit_mass
from rungwise.system.moving import Moment, fall_freely
from rungwise.system.spatial.drives import Drives, fill_moments
from rungwise.system.spatial.spins import spins, turn_freely
from rungwise.system.terms import Terms

if TYPE_CHECKING:
    import mujoco


class Loads:
    """What fills M, metric, loads, springs and dampers of a model with these drives; moment (a, n) holds the
    rows of actuators afterwards, driving (n,) their part of the load, and taken (n,) the inertial forces and
    the weight that were taken off it. `joined` (n,): the velocities of bodies that do not turn freely;
    `weighs` (b,): the masses of these bodies; `falls` (n,): accelerations of free bodies by weight, 0 where
    more than weight and contacts may act."""

    def __init__(self, model: mujoco.MjModel, drives: Drives) -> None:
        import mujoco

        self._mujoco = mujoco
        m = self.model = model
        self.drives = drives
        self.moment = np.zeros((m.nu, m.nv))
        self.driving = np.zeros(m.nv)
        self._unit: tuple[mujoco.MjModel, mujoco.MjData] | None = None
        self._row = np.zeros(m.nv)
        self._filled: Terms | None = None
        self._damping, self._stiffness = np.diag(m.dof_damping), np.diag(m.jnt_stiffness[m.dof_jntid])
        # Earlier versions of MuJoCo know no damping of actuators.
        self._drag = np.array(getattr(m, "actuator_damping", np.zeros(m.nu)))
        self._spins, self._turn_freely = spins(m), steady(turn_freely)
        self.joined, self.taken = np.ones(m.nv, np.int64), np.zeros(m.nv)
        self.joined[(self._spins.first[:, None] + np.arange(6)).ravel()] = 0
        self.any_joined = bool(self.joined.any())
        self.weighs = np.where(np.isin(m.body_rootid, self._spins.body), 0.0, m.body_mass)
        parts = (m.jnt_stiffness, m.body_gravcomp, m.tendon_stiffness, m.tendon_damping, self._drag)
        self._stretches = _stretches(m, bool(self._drag.any()))
        self._springs = any(bool(part.any()) for part in parts)
        self.falls = np.zeros(m.nv) if self._springs or m.nu else self._weights()

    def _weights(self) -> Reals:
        """See `falls`."""
        m, found = self.model, np.zeros(self.model.nv)
        weightless = m.opt.disableflags & self._mujoco.mjtDisableBit.mjDSBL_GRAVITY
        for first in [] if weightless else self._spins.first.tolist():
            if not m.dof_damping[first : first + 3].any():
                found[first : first + 3] = m.opt.gravity
        return found

    def fill(
        self, data: mujoco.MjData, moment: Moment, acting: Reals, pace: Reals, free: bool, terms: Terms
    ) -> None:
        """Fill terms at the data's places, for what actuators act by (a,) and speeds (n,), nan where free;
        `free`: everywhere."""
        self._mujoco.mj_fullM(self.model, data, terms.inertia)
        if moment.inertia == 0.0:
            self._fill_metric(data.qpos, terms)
        self._fill_loads(data, moment, acting, terms)
        self.fall(data, pace, free, terms)

    def fall(self, data: mujoco.MjData, pace: Reals, free: bool, terms: Terms) -> None:
        """Fill in the accelerations without contacts, for speeds (n,), nan where free; `free`: everywhere."""
        if free:
            self._mujoco.mj_solveM(self.model, data, terms.fall[None], terms.load[None])
        else:
            fall_freely(terms, pace)

    def _fill_metric(self, q: Reals, terms: Terms) -> None:
        """M of the same bodies with mass 1 each."""
        if self._unit is None:
            model = of_unit_mass(self.model)
            self._unit = model, self._mujoco.MjData(model)
            self._mujoco.mj_setConst(*self._unit)  # it keeps M of bodies whose M is constant
        model, data = self._unit
        data.qpos[:] = q
        self._mujoco.mj_kinematics(model, data)
        self._mujoco.mj_comPos(model, data)
        self._mujoco.mj_makeM(model, data)
        self._mujoco.mj_fullM(model, data, terms.metric)

    def _fill_loads(self, d: mujoco.MjData, moment: Moment, acting: Reals, terms: Terms) -> None:
        m, eps, load = self.model, float(moment.inertia), terms.load
        d.qvel[:] = moment.v if eps > 0.0 else 0.0
        self._mujoco.mj_comVel(m, d)
        self._mujoco.mj_rne(m, d, 0, self.taken)
        if 0.0 < eps < 1.0:
            d.qvel[:] = 0.0
            self._mujoco.mj_comVel(m, d)
            self._mujoco.mj_rne(m, d, 0, self._row)
            self.taken *= eps
            self.taken += (1.0 - eps) * self._row
        np.subtract(0.0, self.taken, out=load)
        if eps > 0.0 and len(self._spins.first):
            self._turn_freely(self._spins, d.xmat, moment.v, moment.h, eps, load)
        if self._springs:
            self._mujoco.mj_passive(m, d)
            load += d.qfrc_spring + d.qfrc_gravcomp
        if m.nu:
            fill_moments(d, self.moment)
            self.driving = self.drives.load(acting, self.moment)
            load += self.driving
        if terms is not self._filled or self._springs:
            self._fill_yielding(d, terms)
            terms.entries.matrices[:] = self._stretches[: len(terms.entries.matrices)]
            self._filled = terms

    def _fill_yielding(self, d: mujoco.MjData, terms: Terms) -> None:
        """Springs and dampers of joints, tendons and actuators, which a step takes at its end."""
        m = self.model
        terms.damping[:] = self._damping
        if self._drag.any():
            terms.damping[:] += (self.moment.T * self._drag) @ self.moment
        terms.stiffness[:] = self._stiffness
        if m.ntendon and (m.tendon_damping.any() or m.tendon_stiffness.any()):
            rows = tendon_rows(m, d)
            low, high = m.tendon_lengthspring.T
            pulls = (d.ten_length < low) | (d.ten_length > high)
            terms.damping[:] += (rows.T * m.tendon_damping) @ rows
            terms.stiffness[:] += (rows.T * (m.tendon_stiffness * pulls)) @ rows


def _stretches(m: mujoco.MjModel, drags: bool) -> Ints:
    """The stretch (n, 2) of the velocities that inertia, springs and dampers couple with each: those of its
    mechanism, or all where tendons, or dampers of actuators, may couple mechanisms."""
    ties = m.tendon_stiffness, m.tendon_damping, getattr(m, "tendon_armature", m.tendon_damping)
    if drags or any(tie.any() for tie in ties):
        return np.tile(np.array([0, m.nv]), (m.nv, 1))
    first = m.tree_dofadr[m.dof_treeid]
    return np.stack([first, first + m.tree_dofnum[m.dof_treeid]], axis=1).astype(np.int64)


def tendon_rows(model: mujoco.MjModel, data: mujoco.MjData) -> Reals:
    """What each velocity does to the length of each tendon (t, n_v)."""
    import mujoco

    rows = np.zeros((model.ntendon, model.nv))
    if data.ten_J.shape == rows.shape:
        return np.array(data.ten_J)
    mujoco.mju_sparse2dense(
        rows, data.ten_J.ravel(), model.ten_J_rownnz, model.ten_J_rowadr, model.ten_J_colind
    )
    return rows

"""Ranges of force: of actuators, and of joints and tendons, which hold for all that actuators do to them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rungwise.kernel import Reals

if TYPE_CHECKING:
    import mujoco

JOINTS, TENDON = (0, 1), 3
"""Numbers of MuJoCo's transmissions to a joint, in the joint's frame or its parent's, and to a tendon."""


def force_ranges(model: mujoco.MjModel) -> Reals:
    """Least and greatest force of each actuator (a, 2), inf where nothing bounds it: its own range, cut to
    its joint's or tendon's, where it acts alone (see `shared_ranges`). A joint's range is of the force that
    the gear has multiplied, a tendon's of the force before."""
    m = model
    found = np.where(m.actuator_forcelimited[:, None] != 0, m.actuator_forcerange, (-np.inf, np.inf))
    for a in range(m.nu):
        kind, target, gear = m.actuator_trntype[a], m.actuator_trnid[a, 0], m.actuator_gear[a, 0]
        if kind in JOINTS and m.jnt_actfrclimited[target] and gear != 0.0:
            found[a] = np.clip(found[a], *np.sort(m.jnt_actfrcrange[target] / gear))
        elif kind == TENDON and m.tendon_actfrclimited[target]:
            found[a] = np.clip(found[a], *m.tendon_actfrcrange[target])
    return np.asarray(found)


def shared_ranges(model: mujoco.MjModel) -> list[str]:
    """Joints and tendons whose range of force holds for more than one actuator of their own: for several, for
    one that acts through a tendon or a site, or for gravity compensation that counts as an actuator."""
    m, found = model, []
    if m.jnt_actfrclimited.any():
        acts = _acts(m)
        for j in np.flatnonzero(m.jnt_actfrclimited):
            own = np.isin(m.actuator_trntype, JOINTS) & (m.actuator_trnid[:, 0] == j)
            others = acts[:, m.jnt_dofadr[j]] & ~own
            compensated = bool(m.jnt_actgravcomp[j]) and bool(m.body_gravcomp.any())
            if own.sum() > 1 or others.any() or compensated:
                found.append(m.jnt(j).name or f"joint {j}")
    for t in np.flatnonzero(m.tendon_actfrclimited):
        if ((m.actuator_trntype == TENDON) & (m.actuator_trnid[:, 0] == t)).sum() > 1:
            found.append(m.tendon(t).name or f"tendon {t}")
    return found


def _acts(model: mujoco.MjModel) -> NDArray[np.bool_]:
    """Whether each actuator acts on each velocity (a, n_v), at a place where nothing vanishes by chance."""
    import mujoco

    data, found = mujoco.MjData(model), np.zeros((model.nu, model.nv))
    mujoco.mj_integratePos(model, data.qpos, np.sqrt(np.arange(2.0, 2.0 + model.nv)) % 1.0, 1.0)
    mujoco.mj_fwdPosition(model, data)
    if model.nu:
        mujoco.mju_sparse2dense(
            found, data.actuator_moment, data.moment_rownnz, data.moment_rowadr, data.moment_colind
        )
    return np.asarray(found != 0.0)

"""Cylinders that stand on planes keep their contacts, however little they are tilted."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from rungwise.system.spatial.rims import Rims


@pytest.mark.few(1)
@pytest.mark.parametrize("power", range(-17, -2))
def test_a_cylinder_that_stands_has_the_depth_of_its_rim(power: int) -> None:
    """Thin and thick ones, overlapping a plane that leans: MuJoCo alone loses all contacts of every fifth
    that is tilted by 1e-15."""
    random = np.random.default_rng(power + 20)
    for _ in range(100):
        radius, depth = 10.0 ** random.uniform(-2, 0), 10.0 ** random.uniform(-4, -2)
        half, lean = radius * 10.0 ** random.uniform(-3, 0.5), random.normal(size=4)
        lean /= np.linalg.norm(lean)
        turn = " ".join(map(str, lean))
        model = mujoco.MjModel.from_xml_string(
            f'<mujoco><worldbody><geom type="plane" size="1 1 1" quat="{turn}"/>'
            + f'<body><freejoint/><geom type="cylinder" size="{radius} {half}"/></body></worldbody></mujoco>'
        )
        data, rims = mujoco.MjData(model), Rims(model)
        model.geom_margin[:] = 1e-3 * radius
        turned, tilt = np.zeros(4), np.append(1.0, random.normal(size=3) * 10.0**power)
        mujoco.mju_mulQuat(turned, lean, tilt / np.linalg.norm(tilt))
        mujoco.mj_kinematics(model, data)
        normal = data.geom_xmat[0].reshape(3, 3)[:, 2]
        data.qpos[:3], data.qpos[3:] = (half - depth * half) * normal, turned
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        cosine = abs(data.geom_xmat[1].reshape(3, 3)[:, 2] @ normal)
        rim = half - depth * half - half * cosine - radius * np.sqrt(max(0.0, 1.0 - cosine**2))
        rims.straighten(data)
        mujoco.mj_collision(model, data)
        rims.mend(data)
        assert data.ncon >= 1
        assert data.contact.dist.min() == pytest.approx(rim, abs=5e-8 * radius + 1e-3 * abs(rim))

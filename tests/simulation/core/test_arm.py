"""An arm with a full inertia M(q), on the core that planar scenes run on."""

from __future__ import annotations

import numpy as np
import pytest

import rungwise as rw
from rungwise.models.ladder import Rung
from rungwise.outcome import Code
from rungwise.simulation.core.march import March

from .two_link_arm import TwoLinkArm

MOVING = [rung for rung in rw.LADDER if rung.moves]
BENT = (0.6, 0.9)
AT_TIP = float(TwoLinkArm(BENT).tip(np.array(BENT))[0])


def named(rung: Rung) -> str:
    return rung.name


def test_a_swinging_arm_keeps_its_energy_to_first_order() -> None:
    errors = []
    for h in (2e-3, 1e-3):
        system = TwoLinkArm((0.3, 0.5), (1.0, -2.0), gravity=9.81)
        march = March(system, rw.DYNAMIC_RIGID, h)
        energy = system.energy(march.q, march.v)
        march.run(0.5)
        errors.append(system.energy(march.q, march.v) / energy - 1.0)
    assert errors[0] / errors[1] == pytest.approx(2.0, rel=0.1)


@pytest.mark.parametrize("rung", [rung for rung in MOVING if rung.loads], ids=named)
def test_torques_become_the_force_that_the_jacobian_says(rung: Rung) -> None:
    system = TwoLinkArm(BENT, torques=(-8.0, -3.0), friction=2.0, wall=AT_TIP)
    march = March(system, rung, 1e-3)
    assert march.run(0.1) == Code.RUNNING
    fx, fy = np.linalg.solve(system.jacobian(np.array(BENT)).T, -np.array(system.torques))
    np.testing.assert_allclose(march.state.force[0], [-fx, fy], rtol=2e-5)
    assert np.abs(march.v).max() < 1e-6 and march.residual < 1e-8


@pytest.mark.parametrize("rung", [rw.QUASISTATIC_RIGID, rw.DYNAMIC_RIGID], ids=named)
def test_a_tip_outside_its_friction_cone_slips(rung: Rung) -> None:
    system = TwoLinkArm(BENT, torques=(-8.0, -3.0), friction=0.3, wall=AT_TIP, damping=1.0)
    march = March(system, rung, 1e-3)
    march.run(0.02)
    normal, tangential = march.state.force[0]
    assert abs(tangential) == pytest.approx(0.3 * normal, rel=1e-9)
    assert abs(march.v).max() > 1e-3 and abs(system.least_gap(march.q)) < 1e-5


@pytest.mark.parametrize("e", [0.0, 0.5, 1.0])
def test_a_tip_bounces_with_its_restitution_and_loses_the_energy_that_the_full_inertia_says(e: float) -> None:
    system = TwoLinkArm(BENT, (-1.0, 0.3), restitution=e, wall=AT_TIP + 0.02)
    march = March(system, rw.DYNAMIC_RIGID, 1e-4)
    while not march.state.impulse[0, 0] > 0.0:
        before = march.v.copy()
        march.advance(1e-4)
        assert march.time < 0.2
    march.advance(1e-4)  # without restitution the first step ends at the wall, and the next one stops there
    row = -system.jacobian(march.q)[0]
    assert row @ march.v == pytest.approx(-e * (row @ before), abs=2e-3)
    M = system.inertia(march.q)
    kick = np.linalg.solve(M, row) * march.state.impulse[0, 0]
    np.testing.assert_allclose(march.v - before, kick, atol=2e-3)


@pytest.mark.parametrize("rung", MOVING, ids=named)
def test_a_driven_first_joint_makes_the_second_give_way_at_the_wall(rung: Rung) -> None:
    system = TwoLinkArm(BENT, wall=AT_TIP, damping=0.1, driven=lambda _: (-0.5, np.nan))
    march = March(system, rung, 1e-3)
    assert march.run(0.3) == Code.RUNNING
    assert march.q[0] == pytest.approx(BENT[0] - 0.15)
    assert march.q[1] > BENT[1] + 0.02
    assert system.least_gap(march.q) > (-1e-3 if rung.compliant else -1e-5)
    assert march.residual < 1e-8


def test_where_the_second_joint_is_driven_too_the_wall_is_a_jam() -> None:
    system = TwoLinkArm(BENT, wall=AT_TIP + 0.1, driven=lambda _: (-0.5, -0.5))
    march = March(system, rw.KINEMATIC, 1e-3)
    assert march.run(0.3) == Code.JAMMED

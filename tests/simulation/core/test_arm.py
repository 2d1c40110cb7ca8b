"""An arm with a full inertia M(q), on the core that planar scenes run on."""

from __future__ import annotations

import numpy as np
import pytest

import rungwise as rw
from rungwise.models.ladder import Rung
from rungwise.outcome import Code
from rungwise.simulation.stepping.stepper import Stepper

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
        stepper = Stepper(system, rw.DYNAMIC_RIGID, h)
        energy = system.energy(stepper.q, stepper.v)
        stepper.run(0.5)
        errors.append(system.energy(stepper.q, stepper.v) / energy - 1.0)
    assert errors[0] / errors[1] == pytest.approx(2.0, rel=0.1)


@pytest.mark.parametrize("rung", [rung for rung in MOVING if rung.loads], ids=named)
def test_torques_become_the_force_that_the_jacobian_says(rung: Rung) -> None:
    system = TwoLinkArm(BENT, torques=(-8.0, -3.0), friction=2.0, wall=AT_TIP)
    stepper = Stepper(system, rung, 1e-3)
    assert stepper.run(0.1) == Code.RUNNING
    fx, fy = np.linalg.solve(system.jacobian(np.array(BENT)).T, -np.array(system.torques))
    np.testing.assert_allclose(stepper.state.force[0], [-fx, fy], rtol=2e-5)
    assert np.abs(stepper.v).max() < 1e-6 and stepper.residual < 1e-8


@pytest.mark.parametrize("rung", [rw.QUASISTATIC_RIGID, rw.DYNAMIC_RIGID], ids=named)
def test_a_tip_outside_its_friction_cone_slips(rung: Rung) -> None:
    system = TwoLinkArm(BENT, torques=(-8.0, -3.0), friction=0.3, wall=AT_TIP, damping=1.0)
    stepper = Stepper(system, rung, 1e-3)
    stepper.run(0.02)
    normal, tangential = stepper.state.force[0]
    assert abs(tangential) == pytest.approx(0.3 * normal, rel=1e-9)
    assert abs(stepper.v).max() > 1e-3 and abs(system.least_gap(stepper.q)) < 1e-5


@pytest.mark.parametrize("e", [0.0, 0.5, 1.0])
def test_a_tip_bounces_with_its_restitution_and_loses_the_energy_that_the_full_inertia_says(e: float) -> None:
    system = TwoLinkArm(BENT, (-1.0, 0.3), restitution=e, wall=AT_TIP + 0.02)
    stepper = Stepper(system, rw.DYNAMIC_RIGID, 1e-4)
    while not stepper.state.impulse[0, 0] > 0.0:
        before = stepper.v.copy()
        stepper.advance(1e-4)
        assert stepper.time < 0.2
    stepper.advance(1e-4)  # without restitution the first step ends at the wall, and the next one stops there
    row = -system.jacobian(stepper.q)[0]
    assert row @ stepper.v == pytest.approx(-e * (row @ before), abs=2e-3)
    M = system.inertia(stepper.q)
    kick = np.linalg.solve(M, row) * stepper.state.impulse[0, 0]
    np.testing.assert_allclose(stepper.v - before, kick, atol=2e-3)


@pytest.mark.parametrize("rung", MOVING, ids=named)
def test_a_driven_first_joint_makes_the_second_give_way_at_the_wall(rung: Rung) -> None:
    system = TwoLinkArm(BENT, wall=AT_TIP, damping=0.1, driven=lambda _: (-0.5, np.nan))
    stepper = Stepper(system, rung, 1e-3)
    assert stepper.run(0.3) == Code.RUNNING
    assert stepper.q[0] == pytest.approx(BENT[0] - 0.15)
    assert stepper.q[1] > BENT[1] + 0.02
    assert system.least_gap(stepper.q) > (-1e-3 if rung.compliant else -1e-5)
    assert stepper.residual < 1e-8


def test_a_joint_that_is_jerked_kicks_the_next_one_by_the_inertia_between_them() -> None:
    """Nothing turns the second joint: M_21 v_1 + M_22 v_2 stays as it was."""
    jerked, h = TwoLinkArm(BENT, driven=lambda _: (-0.5, np.nan)), 1e-6
    stepper, M = Stepper(jerked, rw.DYNAMIC_RIGID, h), jerked.inertia(np.array(BENT))
    stepper.advance(h)
    assert stepper.v == pytest.approx([-0.5, 0.5 * M[1, 0] / M[1, 1]], rel=1e-5)


def test_where_the_second_joint_is_driven_too_the_wall_is_a_jam() -> None:
    system = TwoLinkArm(BENT, wall=AT_TIP + 0.1, driven=lambda _: (-0.5, -0.5))
    stepper = Stepper(system, rw.KINEMATIC, 1e-3)
    assert stepper.run(0.3) == Code.JAMMED

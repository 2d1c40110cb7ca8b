"""Hinges, slides, servos, limits, dry friction, equalities and tendons, against closed forms."""

from __future__ import annotations

from math import cos, exp, sin, sqrt

import mujoco
import numpy as np
import pytest

import rungwise as rw
from rungwise.models.ladder import Rung

from .conftest import Make
from .measure import FLOOR, NO_GRAVITY, SLIDER, G, forces, free, q, run, v, world
from .rungs import DYNAMIC, MOVING, QUASISTATIC, WITH_LOADS, named

LINK = '<geom type="capsule" fromto="0 0 0 0 0 -.5" size=".02" mass="1" contype="0" conaffinity="0"/>'
DOUBLE = (
    f'<body name="p" pos="0 0 1"><joint name="j" axis="0 1 0"/>{LINK}'
    f'<body name="o" pos="0 0 -.5"><joint name="k" axis="0 1 0"/>{LINK}</body></body>'
)
RADIAN = '<compiler angle="radian"/>'


@pytest.mark.few(1)
@pytest.mark.parametrize("rung", DYNAMIC, ids=named)
def test_a_pendulum_swings_at_its_frequency(make: Make, rung: Rung) -> None:
    body = (
        '<body name="p" pos="0 0 1"><joint name="j" axis="0 1 0"/>'
        '<inertial pos="0 0 -0.5" mass="2" diaginertia="0.1 0.1 0.1"/></body>'
    )
    scene = make(world(body), start={"places": {"p.j": 0.01}}, duration=2.0)
    frequency = sqrt(2.0 * G * 0.5 / (0.1 + 2.0 * 0.25))
    errors = [q(run(scene, rung, step=h))[0] - 0.01 * cos(2.0 * frequency) for h in (4e-3, 2e-3)]
    assert abs(errors[0]) < 1e-4
    assert errors[0] / errors[1] == pytest.approx(2.0, rel=0.05)


def test_a_double_pendulum_comes_to_where_a_scheme_of_fourth_order_puts_it(make: Make) -> None:
    start = (1.0, 0.5)
    scene = make(world(DOUBLE), start={"places": {"p.j": start[0], "o.k": start[1]}}, duration=0.5)
    model = mujoco.MjModel.from_xml_string(f"<mujoco>{world(DOUBLE)}</mujoco>")
    model.opt.timestep, model.opt.integrator = 1e-3, mujoco.mjtIntegrator.mjINT_RK4
    data = mujoco.MjData(model)
    data.qpos[:] = start
    for _ in range(500):
        mujoco.mj_step(model, data)
    errors = [q(run(scene, rw.DYNAMIC_RIGID, step=h)) - data.qpos for h in (2e-3, 1e-3)]
    assert np.abs(errors[0]).max() < 1e-2
    np.testing.assert_allclose(errors[0] / errors[1], 2.0, rtol=0.1)


def sprung(t: float) -> float:
    """Where a slider of 2 kg, at 0 at first, is on a spring of 100 N/m about 0.1 with a damper of 3 N s/m."""
    decay, pull = 3.0 / 4.0, 100.0 / 2.0
    frequency = sqrt(pull - decay * decay)
    return 0.1 - 0.1 * exp(-decay * t) * (cos(frequency * t) + decay / frequency * sin(frequency * t))


@pytest.mark.parametrize(("theta", "order"), [(1.0, 1), (0.5, 2)])
def test_a_slider_on_a_spring_and_a_damper(make: Make, theta: float, order: int) -> None:
    body = SLIDER.replace("/>", ' stiffness="100" damping="3" springref="0.1"/>', 1)
    scene = make(world(body, before=NO_GRAVITY), duration=0.5)
    steps = (5e-3, 2.5e-3)
    errors = [q(run(scene, rw.DYNAMIC_COMPLIANT, step=h, theta=theta))[0] - sprung(0.5) for h in steps]
    assert abs(errors[0]) < 5e-3
    assert errors[0] / errors[1] == pytest.approx(2.0**order, rel=0.1)


@pytest.mark.parametrize("rung", QUASISTATIC, ids=named)
def test_a_slider_without_inertia_creeps_to_where_its_spring_rests(make: Make, rung: Rung) -> None:
    body = SLIDER.replace("/>", ' stiffness="100" damping="30" springref="0.1"/>', 1)
    found = run(make(world(body, before=NO_GRAVITY), duration=0.3), rung, step=1e-2)
    assert q(found)[0] == pytest.approx(0.1 * (1.0 - (1.0 + 1e-2 * 100.0 / 30.0) ** -30), abs=1e-7)


@pytest.mark.parametrize("rung", DYNAMIC, ids=named)
def test_a_limit_stops_a_fall_without_bounce_and_bears_the_weight(make: Make, rung: Rung) -> None:
    body = SLIDER.replace("/>", ' range="-0.2 1" limited="true"/>', 1)
    found, simulation = forces(make(world(body), duration=0.4), rung, step=1e-3)
    fallen = found.trajectory.position.values[:, 0] + 0.2
    assert fallen.min() > -1e-12 and abs(fallen[-1]) < 1e-12 and v(found)[0] == 0.0
    assert found.trajectory.velocity.values.max() < 1e-9
    reaction = simulation.stepper.state.force[simulation.space.most :, 0]  # type: ignore[union-attr]
    np.testing.assert_allclose(reaction, [0.0, 2.0 * G], atol=1e-9)


def test_a_limit_of_a_hinge_stops_it(make: Make) -> None:
    body = (
        '<body name="p"><joint name="j" axis="0 1 0" range="-.5 .5" limited="true"/>'
        '<geom pos="1 0 0" size=".1" mass="2"/></body>'
    )
    found = run(make(world(body, before=RADIAN), duration=0.6), rw.DYNAMIC_RIGID, step=2e-3)
    assert q(found)[0] == pytest.approx(0.5, abs=1e-12) and abs(v(found)[0]) < 1e-12


@pytest.mark.parametrize("rung", WITH_LOADS, ids=named)
@pytest.mark.parametrize("pull", [0.44, 0.46])
def test_dry_friction_in_a_joint_holds_up_to_its_limit(make: Make, rung: Rung, pull: float) -> None:
    body = SLIDER.replace("/>", ' frictionloss="0.45"/>', 1)
    scene = make(world(body, before=f'<option gravity="0 0 {0.5 * pull}"/>'), duration=0.2)
    found, simulation = forces(scene, rung, step=1e-2)
    friction = simulation.stepper.scratch.limited_force[0]  # type: ignore[union-attr]
    assert friction == pytest.approx(-min(pull, 0.45), rel=1e-8)
    if pull < 0.45:
        assert abs(q(found)[0]) < 1e-12
    elif rung in QUASISTATIC:
        assert found.outcome.name == "unsupported"
    else:
        assert v(found)[0] == pytest.approx((pull - 0.45) / 2.0 * 0.2, rel=1e-9)


SERVO = '<actuator><position name="a" joint="j" kp="500" kv="60" {more}/></actuator>'


@pytest.mark.few(2)
@pytest.mark.parametrize("rung", MOVING, ids=named)
@pytest.mark.parametrize("more", ["", 'forcelimited="true" forcerange="-5 30"'])
def test_a_servo_stands_off_its_aim_by_load_over_gain(make: Make, rung: Rung, more: str) -> None:
    """Also where its range of force is not symmetric. On the kinematic rung there is no load."""
    scene = make(world(SLIDER, after=SERVO.format(more=more)), duration=4.0, controls={"a": 0.3})
    load = 2.0 * G if rung.loads else 0.0
    assert q(run(scene, rung, step=1e-2))[0] == pytest.approx(0.3 - load / 500.0, abs=1e-6)


@pytest.mark.parametrize("rung", DYNAMIC, ids=named)
@pytest.mark.parametrize(("aim", "force"), [(5.0, 30.0), (-5.0, -5.0)])
def test_a_servo_pushes_with_no_more_than_its_range(make: Make, rung: Rung, aim: float, force: float) -> None:
    more = 'forcelimited="true" forcerange="-5 30"'
    scene = make(world(SLIDER, after=SERVO.format(more=more)), duration=0.1, controls={"a": aim})
    assert v(run(scene, rung, step=1e-3))[0] == pytest.approx((force / 2.0 - G) * 0.1, rel=1e-9)


@pytest.mark.parametrize("rung", DYNAMIC, ids=named)
def test_a_motor_pushes_with_its_gain_within_its_range_of_control(make: Make, rung: Rung) -> None:
    motor = '<actuator><motor name="a" joint="j" gear="3" ctrlrange="-2 2" ctrllimited="true"/></actuator>'
    for control, force in ((1.0, 3.0), (5.0, 6.0)):
        scene = make(world(SLIDER, after=motor), duration=0.1, controls={"a": control})
        assert v(run(scene, rung, step=1e-2))[0] == pytest.approx((force / 2.0 - G) * 0.1, rel=1e-9)


HUNG = '<body name="p" pos="0 0 1"><freejoint/><geom size=".1" mass="2" pos="0.3 0 0"/></body>'


@pytest.mark.few(1)
@pytest.mark.parametrize("rung", DYNAMIC, ids=named)
def test_a_connection_holds_while_its_body_swings(make: Make, rung: Rung) -> None:
    """A body on a connection swings as a pendulum on a hinge does."""
    connect = '<equality><connect body1="p" anchor="0 0 0"/></equality>'
    swung = run(make(world(HUNG, after=connect), duration=0.3), rung, step=1e-3)
    hinged = HUNG.replace("<freejoint/>", '<joint name="j" axis="0 1 0"/>')
    turned = q(run(make(world(hinged), duration=0.3), rung, step=1e-3))[0]
    apart = max(float(np.linalg.norm(each.q[:3] - [0.0, 0.0, 1.0])) for each in swung.frames)
    assert apart < 1e-9
    assert 2.0 * np.arctan2(q(swung)[5], q(swung)[3]) == pytest.approx(turned, abs=5e-3)


@pytest.mark.parametrize("rung", WITH_LOADS, ids=named)
def test_a_weld_bears_weight_and_moment(make: Make, rung: Rung) -> None:
    scene = make(world(HUNG, after='<equality><weld body1="p"/></equality>'), duration=0.1)
    found, simulation = forces(scene, rung, step=2e-3)
    assert max(float(np.abs(each.q - found.frames[0].q).max()) for each in found.frames) < 1e-9
    assert simulation.stepper is not None
    terms, force = simulation.stepper.terms, simulation.stepper.scratch.limited_force
    bent = -0.3 * 2.0 * G
    np.testing.assert_allclose(terms.limited.T @ force, [0.0, 0.0, 2.0 * G, 0.0, bent, 0.0], atol=1e-6)


@pytest.mark.few(3)
@pytest.mark.parametrize("rung", DYNAMIC, ids=named)
@pytest.mark.parametrize("seed", range(6))
def test_welded_bodies_fall_as_one_and_stay_where_they_land(make: Make, rung: Rung, seed: int) -> None:
    """Balls, capsules and boxes of one height land side by side: openings of the weld that are rounding ask
    nothing of the friction that holds them all."""
    draw = np.random.default_rng(seed)
    high, mu = draw.uniform(0.05, 0.1), draw.uniform(0.2, 1.0)
    size = {"box": f"{high} .05 {high}", "sphere": f"{high}", "capsule": f"{high} .06"}
    geoms = [f'type="{kind}" size="{size[kind]}"' for kind in draw.permutation(list(size))]
    first, second = (f'{geom} mass="{mass}"' for geom, mass in zip(geoms, (1.0, 3.0), strict=False))
    if "capsule" in first + second:
        lying = 'quat="0.7071067811865476 0.7071067811865476 0 0"'
        first, second = (f"{each} {lying}" if "capsule" in each else each for each in (first, second))
    place = high + draw.uniform(0.001, 0.1)
    pair = free("u", f"0 0 {place}", first), free("v", f"{4.0 * high} 0 {place}", second)
    weld = '<equality><weld body1="u" body2="v"/></equality>'
    law = {"friction": mu, "stiffness": 1e6, "damping": 1e3}
    scene = make(world(FLOOR, *pair, after=weld), contacts=[law], duration=0.3, step=1e-3)
    found = run(scene, rung)
    assert found.outcome.name == "timeout" and found.time == pytest.approx(0.3)
    end = found.final
    assert end["u"]["z"] == pytest.approx(high, abs=1e-4) and end["v"]["z"] == pytest.approx(high, abs=1e-4)
    assert abs(end["v"]["x"] - end["u"]["x"] - 4.0 * high) < 1e-7


PAIR = (
    SLIDER + '<body name="o" pos="1 0 0"><joint name="k" type="slide" axis="0 0 1"/>'
    '<geom size=".1" mass="1"/></body>'
)


@pytest.mark.parametrize("rung", DYNAMIC, ids=named)
def test_coupled_joints_move_together(make: Make, rung: Rung) -> None:
    """Of 2 kg and 1 kg on a lever of two arms, j = -0.25 k, the first rises or falls by d'Alembert."""
    couple = '<equality><joint joint1="j" joint2="k" polycoef="0 -0.25 0 0 0"/></equality>'
    found, simulation = forces(make(world(PAIR, after=couple), duration=0.2), rung, step=1e-3)
    assert max(abs(each.q[0] + 0.25 * each.q[1]) for each in found.frames) < 1e-9
    fall = (-G + 0.25 * 2.0 * G) / (1.0 + 2.0 * 0.25**2)
    assert v(found)[1] == pytest.approx(fall * 0.2, rel=1e-8)
    reaction = simulation.stepper.scratch.limited_force[0]  # type: ignore[union-attr]
    assert abs(reaction) == pytest.approx(2.0 * abs(-0.25 * fall + G), rel=1e-6)


@pytest.mark.few(2)
@pytest.mark.parametrize("rung", WITH_LOADS, ids=named)
def test_a_fixed_tendon_carries_a_servo_and_a_spring(make: Make, rung: Rung) -> None:
    """Both pull at j + 2 k; the two slides have springs of their own that say which of them gives way."""
    springs = PAIR.replace('axis="0 0 1"/>', 'axis="0 0 1" stiffness="300" damping="50"/>')
    tendon = (
        '<tendon><fixed name="t" stiffness="40" damping="5" springlength="0">'
        '<joint joint="j" coef="1"/><joint joint="k" coef="2"/></fixed></tendon>'
        '<actuator><position name="a" tendon="t" kp="60" kv="10"/></actuator>'
    )
    scene = make(world(springs, before=NO_GRAVITY, after=tendon), duration=8.0, controls={"a": 1.0})
    found = run(scene, rung, step=2e-2)
    pull = 60.0 / (1.0 + 100.0 * 5.0 / 300.0)
    np.testing.assert_allclose(q(found), [pull / 300.0, 2.0 * pull / 300.0], atol=1e-6)


@pytest.mark.parametrize("rung", DYNAMIC, ids=named)
def test_a_tendon_with_a_range_holds_a_fall(make: Make, rung: Rung) -> None:
    sites = '<site name="top" pos="0 0 1"/>'
    body = (
        '<body name="p"><joint name="j" type="slide" axis="0 0 1"/>'
        '<geom size=".1" mass="2"/><site name="s"/></body>'
    )
    tendon = (
        '<tendon><spatial name="t" limited="true" range="0 1.2"><site site="top"/><site site="s"/>'
        "</spatial></tendon>"
    )
    found, simulation = forces(make(world(sites, body, after=tendon), duration=0.4), rung, step=1e-3)
    assert q(found)[0] == pytest.approx(-0.2, abs=1e-9)
    reaction = simulation.stepper.state.force[simulation.space.most :, 0]  # type: ignore[union-attr]
    assert reaction.max() == pytest.approx(2.0 * G, rel=1e-8)


@pytest.mark.parametrize("rung", MOVING, ids=named)
def test_a_prescribed_slide_moves_at_its_speed(make: Make, rung: Rung) -> None:
    scene = make(world(SLIDER), speeds={"p.j": "0.5 + t"}, duration=0.2)
    assert q(run(scene, rung, step=1e-2))[0] == pytest.approx(0.1 + 0.02, abs=1e-12)


@pytest.mark.parametrize("rung", WITH_LOADS, ids=named)
def test_a_trajectory_has_the_forces_of_drives_limits_and_dry_friction(make: Make, rung: Rung) -> None:
    held = SLIDER.replace('type="slide"', 'type="slide" frictionloss="3"')
    stopped = SLIDER.replace('"p"', '"q"').replace('"j"', '"k" limited="true" range="0 1"')
    motor = '<actuator><motor name="m" joint="j"/></actuator>'
    scene = make(
        world(held, stopped.replace("<body", '<body pos="1 0 0"'), after=motor), controls={"m": 18.0}
    )
    acting = run(scene, rung, duration=0.1).trajectory.isel(time=-1)
    np.testing.assert_allclose(acting.drive_force, [18.0, 0.0], atol=1e-9)
    np.testing.assert_allclose(acting.dry_friction, [2.0 * G - 18.0, 0.0], atol=1e-6)
    np.testing.assert_allclose(acting.limit_force, [0.0, 2.0 * G], atol=1e-6)
    assert abs(float(acting.drive_work)) < 1e-9

"""Bodies in space, seven coordinates for six velocities, on the core that planar scenes run on."""

from __future__ import annotations

from math import cos, sin

import numpy as np
import pytest

import rungwise as rw
from rungwise.models.ladder import Rung
from rungwise.outcome import Code
from rungwise.simulation.stepping.stepper import Stepper

from .bodies_in_space import Array, BodiesInSpace, Body, rotation, turn_by

UPRIGHT = (1.0, 0.0, 0.0, 0.0)
BRICK = (0.1, 0.2, 0.3)
MOVING = [rung for rung in rw.LADDER if rung.moves]
WITH_MASS = [rw.DYNAMIC_RIGID, rw.DYNAMIC_COMPLIANT]
G = 9.81


def named(rung: Rung) -> str:
    return rung.name


def sphere(*place: float, **more: object) -> Body:
    return Body(1.0, 0.1, (*place, *UPRIGHT), **more)  # type: ignore[arg-type]


def still(_time: float) -> tuple[float, ...]:
    return (0.0,) * 6


@pytest.mark.few(4)
@pytest.mark.parametrize("rung", WITH_MASS, ids=named)
@pytest.mark.parametrize("heading", [0.0, 0.9, 4.0])
def test_a_sliding_sphere_comes_to_roll_at_five_sevenths_of_its_speed(rung: Rung, heading: float) -> None:
    speed, mu, h = 1.0, 0.2, 1e-3
    ahead = np.array([cos(heading), sin(heading), 0.0])
    stepper = Stepper(
        BodiesInSpace([sphere(0.0, 0.0, 0.1, v=(*speed * ahead, 0, 0, 0))], friction=mu), rung, h
    )
    until = 2.0 * speed / (7.0 * mu * G)
    stepper.run(0.8 * until)
    np.testing.assert_allclose(stepper.v[:3], (speed - mu * G * stepper.time) * ahead, atol=2e-3)
    stepper.run(0.4 * until)
    np.testing.assert_allclose(stepper.v[:3], 5.0 / 7.0 * speed * ahead, atol=1e-4)
    np.testing.assert_allclose(stepper.v[3:], np.cross([0, 0, 1], stepper.v[:3]) / 0.1, atol=1e-2)
    assert stepper.residual < 1e-8


def test_a_tumbling_body_keeps_energy_and_momentum_to_first_order() -> None:
    errors = []
    for h in (2e-3, 1e-3):
        body = Body(1.0, BRICK, (0, 0, 5.0, *UPRIGHT), (0.1, 0, 0, 1.0, 2.0, 3.0), turned=(1.0, 2.0, 4.0))
        system = BodiesInSpace([body], gravity=np.zeros(3))
        stepper = Stepper(system, rw.DYNAMIC_RIGID, h)

        def angular(q: Array, v: Array) -> Array:
            R = rotation(q[3:7])
            return np.asarray(R @ np.diag([1.0, 2.0, 4.0]) @ R.T @ v[3:])

        energy, momentum = system.energy(stepper.q, stepper.v), angular(stepper.q, stepper.v)
        stepper.run(1.0)
        assert np.linalg.norm(stepper.q[3:7]) == pytest.approx(1.0, abs=1e-14)
        lost = float(np.linalg.norm(angular(stepper.q, stepper.v) - momentum) / np.linalg.norm(momentum))
        errors.append((system.energy(stepper.q, stepper.v) / energy - 1.0, lost))
    (energy, momentum), (finer_energy, finer_momentum) = errors
    assert energy / finer_energy == pytest.approx(2.0, rel=0.1)
    assert momentum / finer_momentum == pytest.approx(2.0, rel=0.1)


@pytest.mark.few(1)
@pytest.mark.parametrize("rung", MOVING, ids=named)
def test_a_brick_rests_on_its_four_corners_on_every_rung(rung: Rung) -> None:
    system = BodiesInSpace([Body(1.0, BRICK, (0, 0, 0.3, *UPRIGHT))], friction=0.5, damping=2e3)
    stepper = Stepper(system, rung, 1e-3)
    assert stepper.run(0.3) == Code.RUNNING
    assert np.abs(stepper.v).max() < 1e-6
    weight = stepper.state.force[:, 0].sum()
    assert weight == pytest.approx(0.0 if rung.metric else G, rel=1e-5)
    assert stepper.q[2] == pytest.approx(0.3 - (G / 4e5 if rung.compliant else 0.0), abs=1e-8)
    assert stepper.residual < 1e-8


@pytest.mark.parametrize("rung", MOVING, ids=named)
def test_what_nothing_holds_falls_rests_or_is_unsupported(rung: Rung) -> None:
    stepper = Stepper(BodiesInSpace([Body(1.0, BRICK, (0, 0, 0.9, *UPRIGHT))]), rung, 1e-3)
    outcome = stepper.run(0.1)
    if rung.inertia > 0.0:
        assert stepper.q[2] == pytest.approx(0.9 - 0.5 * G * 0.01, abs=1e-3)
    elif rung.metric:
        assert (outcome, stepper.q[2]) == (Code.RUNNING, 0.9)
    else:
        assert outcome == Code.UNSUPPORTED
        assert stepper.certificate is not None and stepper.certificate.kind == "unsupported"


@pytest.mark.few(1)
@pytest.mark.parametrize("rung", MOVING, ids=named)
def test_a_sphere_pushed_against_a_fixed_one_jams_or_sinks_in(rung: Rung) -> None:
    pusher = sphere(-0.5, 0.0, 0.1, driven=lambda _: (1.0, 0, 0, 0, 0, 0))
    stop = sphere(0.5, 0.0, 0.1, driven=still)
    system = BodiesInSpace([pusher, sphere(0.0, 0.0, 0.1), stop], friction=0.3, drag=1.0)
    stepper = Stepper(system, rung, 1e-3)
    outcome = stepper.run(0.7)
    assert stepper.time == pytest.approx(0.62 if rung.compliant else 0.6, abs=0.012)
    if rung.compliant:
        assert outcome == Code.MODEL_INVALID
    else:
        assert outcome == Code.JAMMED
        assert stepper.certificate is not None and stepper.certificate.kind == "kinematic"
        np.testing.assert_allclose(stepper.q[7:10], [0.3, 0.0, 0.1], atol=2e-4)


@pytest.mark.parametrize("rung", [rw.QUASISTATIC_RIGID, rw.DYNAMIC_RIGID], ids=named)
@pytest.mark.parametrize("slope", [0.4, 0.7])
def test_a_brick_sticks_on_a_slope_up_to_the_angle_of_friction(rung: Rung, slope: float) -> None:
    mu, heading = 0.6, 0.7
    pull = G * np.array([sin(slope) * cos(heading), sin(slope) * sin(heading), -cos(slope)])
    system = BodiesInSpace([Body(1.0, (0.2, 0.2, 0.05), (0, 0, 0.05, *UPRIGHT))], pull, friction=mu)
    stepper = Stepper(system, rung, 1e-3)
    outcome = stepper.run(0.1)
    acceleration = G * (sin(slope) - mu * cos(slope))
    if acceleration < 0.0:
        assert np.abs(stepper.q[:3] - [0, 0, 0.05]).max() < 1e-12
    elif rung.inertia > 0.0:
        assert np.linalg.norm(stepper.v[:2]) == pytest.approx(acceleration * 0.1, rel=1e-6)
        assert stepper.q[2] == pytest.approx(0.05, abs=1e-9)
    else:
        assert outcome == Code.UNSUPPORTED


def test_a_bounce_without_friction_keeps_the_energy_of_a_turning_brick() -> None:
    turned = tuple(turn_by(np.array([0.4, 0.7, 0.2])))
    body = Body(1.0, BRICK, (0, 0, 0.45, *turned), (0.3, 0.1, -1.0, 0.5, -0.4, 0.2))
    errors = []
    for h in (4e-4, 2e-4):
        system = BodiesInSpace([body], gravity=np.zeros(3), restitution=1.0)
        stepper = Stepper(system, rw.DYNAMIC_RIGID, h)
        energy = system.energy(stepper.q, stepper.v)
        stepper.run(0.3)
        assert stepper.v[2] > 0.0
        errors.append(abs(system.energy(stepper.q, stepper.v) / energy - 1.0))
    assert errors[1] < 2e-3 and errors[1] < 0.7 * errors[0]


def test_a_turned_scene_turns_the_motion() -> None:
    ends = []
    for angle in (0.0, 2.0):
        turn = np.array([[cos(angle), -sin(angle), 0], [sin(angle), cos(angle), 0], [0, 0, 1.0]])
        spin = (cos(angle / 2), 0.0, 0.0, sin(angle / 2))
        v = (*(turn @ [0.5, 0.2, 0.0]), *(turn @ [0.1, 0.2, 2.0]))
        body = Body(1.0, (0.2, 0.1, 0.05), (*(turn @ [0.1, 0, 0.05]), *spin), v)
        stepper = Stepper(BodiesInSpace([body], friction=0.3), rw.DYNAMIC_COMPLIANT, 1e-3)
        stepper.run(0.1)
        ends.append(turn.T @ stepper.q[:3])
    np.testing.assert_allclose(ends[0], ends[1], atol=1e-7)

"""Rolling, spinning and sliding in space, against closed forms."""

from __future__ import annotations

from math import atan2, cos, hypot, radians, sin, tan

import numpy as np
import pytest

import rungwise as rw
from rungwise.models.ladder import Rung

from .conftest import Make
from .measure import FLOOR, G, free, q, run, v, world
from .rungs import COMPLIANT, DYNAMIC, QUASISTATIC, RIGID, WITH_LOADS, named

LAW = {"stiffness": 1e6, "damping": 2e3}
STEEP = radians(20.0)


@pytest.mark.few(3)
@pytest.mark.parametrize("rung", DYNAMIC, ids=named)
@pytest.mark.parametrize("heading", [0.0, 0.9, -2.2])
def test_a_sliding_ball_comes_to_roll_at_five_sevenths_of_its_speed(
    make: Make, rung: Rung, heading: float
) -> None:
    speed, mu = 1.0, 0.2
    ahead = np.array([cos(heading), sin(heading), 0.0])
    scene = make(
        world(FLOOR, free("b", "0 0 .1", 'size=".1"')),
        contacts=[{"friction": mu, **LAW}],
        start={"velocities": {"b.x": ahead[0], "b.y": ahead[1]}},
        duration=0.2,
        step=1e-3,
    )
    found = run(scene, rung, stride=1)
    near = 1e-12 if not rung.compliant else 5e-5
    np.testing.assert_allclose(v(found)[:2], 5.0 / 7.0 * speed * ahead[:2], atol=near)
    assert rung.compliant or abs(q(found)[2] - 0.1) < 1e-9
    velocity = found.trajectory.velocity.values
    rolls = np.hypot(velocity[:, 0], velocity[:, 1]) < 5.0 / 7.0 * speed + 10.0 * near
    stopped = float(found.trajectory.time[int(np.argmax(rolls))])
    assert stopped == pytest.approx(2.0 * speed / (7.0 * mu * G), abs=1e-3)


@pytest.mark.few(1)
@pytest.mark.parametrize("rung", DYNAMIC, ids=named)
def test_torsional_friction_slows_a_spin_at_its_rate(make: Make, rung: Rung) -> None:
    ball = free("b", "0 0 .1", 'size=".1" condim="4" friction="0.5 0.01 0"')
    scene = make(world(FLOOR, ball), start={"velocities": {"b.rz": 10.0}}, duration=0.1, step=1e-3)
    inertia, moment = 0.4 * 0.1**2, 0.01 * G
    assert v(run(scene, rung))[5] == pytest.approx(10.0 - 0.1 * moment / inertia, rel=1e-9)
    assert abs(v(run(scene, rung, duration=0.6))[5]) < (1e-2 if rung.compliant else 1e-9)


@pytest.mark.parametrize("rung", RIGID, ids=named)
def test_a_block_does_not_creep_on_a_slope(rung: Rung) -> None:
    found = run(rw.load("slope"), rung, duration=0.5, step=1e-2)
    longer = rw.simulate(rw.load("slope"), rung, step=1e-2, state=found.state, duration=9.0, inputs=[])
    assert np.abs(q(longer)[:3] - [0.0, 0.0, 0.05]).max() <= 1e-11


@pytest.mark.parametrize("rung", COMPLIANT, ids=named)
def test_a_block_on_compliant_contacts_is_off_by_their_yield_and_does_not_creep(rung: Rung) -> None:
    stiffness = 4.0 * 1e6
    found = run(rw.load("slope"), rung, step=1e-2)
    yielded = G * sin(STEEP) / stiffness
    tilt = 0.05 * G * sin(STEEP) / (stiffness * 0.1**2)
    assert q(found)[0] == pytest.approx(yielded + 0.05 * tilt, rel=1e-3)
    assert q(found)[2] == pytest.approx(0.05 - G * cos(STEEP) / stiffness, abs=1e-10)
    assert np.abs(v(found)).max() < 1e-13


def test_a_block_slides_on_a_slope_at_its_acceleration_and_stays_on_it() -> None:
    mu, heading = 0.3, 0.7
    found = run(
        rw.load("slope"),
        rw.DYNAMIC_RIGID,
        parameters={"mu": mu, "heading": heading},
        duration=0.02,
        step=1e-3,
    )
    acceleration = G * (sin(STEEP) - mu * cos(STEEP))
    assert hypot(*v(found)[:2]) / found.time == pytest.approx(acceleration, abs=1e-9)
    assert atan2(v(found)[1], v(found)[0]) == pytest.approx(heading, abs=1e-9)
    assert np.abs(found.trajectory.position.values[:, 2] - 0.05).max() <= 1e-9


@pytest.mark.parametrize("rung", WITH_LOADS, ids=named)
def test_the_angle_of_friction_is_met_to_a_thousandth(rung: Rung) -> None:
    """Below it a block slides: with inertia it speeds up at its rate, without there is no balance."""
    scene = rw.load("slope")
    holds = run(scene, rung, parameters={"mu": 1.001 * tan(STEEP)}, duration=0.1)
    assert np.abs(v(holds)).max() < 1e-9 and hypot(*q(holds)[:2]) < 2e-6
    slides = run(scene, rung, parameters={"mu": 0.999 * tan(STEEP)}, duration=0.2, stride=1)
    if rung in QUASISTATIC:
        assert slides.time == 0.0
        assert slides.outcome.name == "unsupported" and slides.certificate is not None
        return
    speed = slides.trajectory.velocity.values[:, 0]
    gained = (speed[-1] - speed[50]) / (slides.time - float(slides.trajectory.time[50]))
    assert gained == pytest.approx(1e-3 * G * sin(STEEP), rel=1e-3)


@pytest.mark.parametrize("rung", DYNAMIC, ids=named)
def test_contacts_without_tangents_stay_without_friction(make: Make, rung: Rung) -> None:
    """Friction of an entry stands for the file's, and contacts of condim 1 have none."""
    block = free("b", "0 0 .1", 'type="box" size=".1 .1 .1" condim="1"')
    floor = FLOOR.replace("/>", ' condim="1"/>')
    start = {"velocities": {"b.x": 1.0}}
    found = run(make(world(floor, block), contacts=[{"friction": 0.5}], start=start, duration=0.1), rung)
    assert found.final["b"]["x"] == pytest.approx(0.1, abs=1e-9)
    assert not found.frames[-1].touch.friction.any()

"""Inputs over time, and restarts from states, in space."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import rungwise as rw
from rungwise.models.ladder import Rung
from rungwise.scene.space import SpaceScene
from rungwise.simulation.spatial.result import SpaceRun

from .conftest import Make
from .measure import FLOOR, NO_GRAVITY, SLIDER, free, q, run, v, world
from .rungs import DYNAMIC, MOVING, WITH_LOADS, named

SCHEDULE = [
    {"inputs": {"u": 2.0}, "duration": 0.5},
    {"inputs": {"u": 0.0}, "duration": 0.5, "ramp": True},
    {"inputs": {"u": 1.0}, "duration": 5.0, "until": "p.j >= 2"},
    {"inputs": {"u": -1.0}, "duration": 0.25},
]


def driven(make: Make, **fields: Any) -> SpaceScene:
    parameters = {"u": {"default": 1.0, "range": [-5.0, 5.0]}}
    return make(world(SLIDER), speeds={"p.j": "u"}, inputs=["u"], parameters=parameters, step=1e-2, **fields)


def same(one: SpaceRun, other: SpaceRun) -> bool:
    return bool(
        (one.outcome, one.time, one.steps) == (other.outcome, other.time, other.steps)
        and np.array_equal(q(one), q(other))
        and np.array_equal(v(one), v(other))
    )


@pytest.mark.few(4)
@pytest.mark.parametrize("rung", MOVING, ids=named)
def test_segments_hold_ramp_and_end_when_a_condition_holds(make: Make, rung: Rung) -> None:
    """Ways are exact, also of ramps; the third segment ends with the step in which p.j comes to 2."""
    found = run(driven(make, goal="p.j > 5"), rung, inputs=SCHEDULE)
    at = dict(zip(found.trajectory.time.values.round(9), found.trajectory.position.values[:, 0], strict=True))
    assert at[0.5] == pytest.approx(1.0, abs=1e-12)
    assert at[1.0] == pytest.approx(1.5, abs=1e-12)
    assert found.outcome.name == "missed"
    assert found.time == pytest.approx(1.75, abs=0.011)
    assert q(found)[0] == pytest.approx(1.75, abs=0.011)


@pytest.mark.few(1)
@pytest.mark.parametrize("rung", [rw.KINEMATIC, rw.DYNAMIC_RIGID], ids=named)
def test_a_state_in_the_middle_of_a_schedule_goes_on_with_it_bit_for_bit(make: Make, rung: Rung) -> None:
    scene = driven(make, goal="p.j > 5")
    whole = run(scene, rung, inputs=SCHEDULE, stride=1)
    for k in (3, 49, 50, 51, 80, 100, 120, 149, 160):
        assert same(run(scene, rung, state=whole.states[k]), whole), k
    other = run(scene, rung, state=whole.states[80], inputs=[{"inputs": {"u": 0.0}, "duration": 0.3}])
    assert other.time == pytest.approx(1.1) and q(other)[0] == whole.states[80].q[0]


def test_segments_of_no_length_and_conditions_that_hold_already_end_at_once(make: Make) -> None:
    schedule = [
        {"inputs": {"u": 3.0}, "duration": 0.0},
        {"inputs": {"u": 5.0}, "duration": 1.0, "until": "t >= 0"},
        {"duration": 0.1},
    ]
    found = run(driven(make), rw.KINEMATIC, inputs=schedule)
    assert (found.outcome.name, found.steps) == ("timeout", 10)
    assert q(found)[0] == pytest.approx(0.5, abs=1e-12)
    unmet = run(driven(make), rw.KINEMATIC, inputs=[{"duration": 0.0, "until": "p.j > 1"}])
    assert (unmet.steps, unmet.reason) == (0, "inputs.0.until: p.j > 1 did not hold within 0 (from t = 0 on)")


@pytest.mark.parametrize("rung", WITH_LOADS, ids=named)
def test_a_pile_in_contact_goes_on_bit_for_bit(rung: Rung) -> None:
    scene = rw.load("stack")
    whole = run(scene, rung, stride=1, duration=0.06)
    assert same(run(scene, rung, state=whole.states[15], duration=0.06), whole)


@pytest.mark.few(1)
@pytest.mark.parametrize("rung", DYNAMIC, ids=named)
def test_a_box_that_bounces_and_slides_goes_on_bit_for_bit(make: Make, rung: Rung) -> None:
    box = free("b", "0 0 .3", 'type="box" size=".1 .15 .05"', 'euler="20 30 40"')
    scene = make(
        world(FLOOR, box),
        start={"velocities": {"b.x": 1.0, "b.ry": 3.0}},
        contacts=[{"friction": 0.4, "restitution": 0.3}],
        duration=0.5,
        step=2e-3,
    )
    whole = run(scene, rung, stride=1)
    for k in (40, 105, 170, 240):
        assert same(run(scene, rung, state=whole.states[k]), whole), k


def test_controls_follow_time_and_parameters(make: Make) -> None:
    motor = '<actuator><motor name="a" joint="j"/></actuator>'
    scene = make(
        world(SLIDER, before=NO_GRAVITY, after=motor),
        controls={"a": "2 * strength * t"},
        parameters={"strength": {"default": 3.0}},
        duration=0.2,
    )
    assert v(run(scene, rw.DYNAMIC_RIGID, step=1e-2))[0] == pytest.approx(3.0 * 0.021, rel=1e-9)
    stronger = run(scene, rw.DYNAMIC_RIGID, step=1e-2, parameters={"strength": 5.0})
    assert v(stronger)[0] == pytest.approx(5.0 * 0.021, rel=1e-9)


def test_a_model_alone_has_its_actuators_as_inputs(tmp_path: Any) -> None:
    path = tmp_path / "lift.xml"
    actuator = '<actuator><position name="lift" joint="j" kp="500" kv="60" ctrlrange="-1 1"/></actuator>'
    path.write_text(f"<mujoco>{world(SLIDER, after=actuator)}</mujoco>")
    scene = rw.load(path)
    assert scene.template.inputs == ("lift",)
    found = run(scene, rw.DYNAMIC_RIGID, step=1e-2, inputs=[{"inputs": {"lift": 0.5}, "duration": 3.0}])
    assert q(found)[0] == pytest.approx(0.5 - 2.0 * 9.81 / 500.0, abs=1e-6)


SLED = (
    '<body name="b" pos="0 0 0.1"><joint name="x" type="slide" axis="1 0 0"/>'
    '<geom type="box" size=".1 .1 .1" mass="2"/></body>'
)


@pytest.mark.few(3)
@pytest.mark.parametrize("onset", [0.7, 1.3, 2.1])
@pytest.mark.parametrize("tol", [1e-5, 1e-7])
@pytest.mark.parametrize("slope", [3.0, 30.0])
def test_what_dry_friction_holds_slides_when_a_growing_force_exceeds_it(
    make: Make, onset: float, tol: float, slope: float
) -> None:
    """Nothing moves before, so steps are long there; then m x'' = s t, x = s t^3 / 6 m from the onset on.
    Steps whose estimated errors are tol, h^2 x'' / 4, are wrong by twice that; their sum is
    2/3 t^(3/2) (s tol / m)^(1/2).
    """
    sled = SLED.replace('axis="1 0 0"', f'axis="1 0 0" frictionloss="{slope * onset}"')
    motor = '<actuator><motor name="m" joint="x"/></actuator>'
    scene = make(world(sled, after=motor), controls={"m": f"{slope} * t"}, goal="b.x >= 1e-3", duration=4)
    found = run(scene, rw.DYNAMIC_RIGID, step=1e-3, tol=tol)
    slid = (12e-3 / slope) ** (1 / 3)
    error = 2.0 / 3.0 * slid**1.5 * (slope * tol / 2.0) ** 0.5
    assert found.time == pytest.approx(onset + slid, abs=2.0 * error / (slope * slid**2 / 4.0))

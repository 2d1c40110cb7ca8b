"""Actuators that act after a filter, or by an integral: their activation is a state of the run."""

from __future__ import annotations

from math import exp

import mujoco
import numpy as np
import pytest

import rungwise as rw
from tests.simulation.conftest import MOVING

from .conftest import Make

LOADED = [rung for rung in MOVING if rung.loads]
MASS = """<worldbody><body name="b"><joint name="x" type="slide" axis="1 0 0" {}/>
<geom size=".1" mass="2"/></body>{}</worldbody>"""
"""A mass on a slide."""


def slide(make: Make, actuator: str, joint: str = "", more: str = "", **fields: object) -> rw.SpaceScene:
    return make(
        f'<option gravity="0 0 0"/>{MASS.format(joint, more)}<actuator>{actuator}</actuator>',
        **{"duration": 0.5, "step": 1e-3, **fields},
    )


@pytest.mark.few(1)
@pytest.mark.parametrize("dyntype", ["filter", "filterexact"])
@pytest.mark.parametrize("rung", [rw.DYNAMIC_RIGID, rw.DYNAMIC_COMPLIANT], ids=lambda rung: rung.name)
def test_a_filtered_force_comes_by_and_by(make: Make, dyntype: str, rung: rw.Rung) -> None:
    """m v' = g (1 - exp(-t / T)) u."""
    motor = f'<general name="m" joint="x" dyntype="{dyntype}" dynprm="0.1" gainprm="4"/>'
    scene = slide(make, motor, controls={"m": "0.5"})
    for step in (1e-3, 5e-4):
        run = rw.simulate(scene, rung, step=step)
        speed = 0.5 * 4.0 / 2.0 * (0.5 - 0.1 * (1.0 - exp(-5.0)))
        assert float(run.state.v[0]) == pytest.approx(speed, abs=2.0 * step)


def test_an_integral_stays_in_its_range(make: Make) -> None:
    """A velocity servo of MuJoCo is a position servo whose aim is the integral of the control."""
    servo = '<intvelocity name="m" joint="x" kp="1000" actrange="-0.1 0.1"/>'
    scene = slide(make, servo, 'damping="5"', controls={"m": "0.3"})
    for rung in LOADED:
        run = rw.simulate(scene, rung, frames=1000)
        places = run.trajectory.position.values[:, 0]
        times = run.trajectory.time.values
        aim = np.minimum(0.3 * times, 0.1)
        assert np.abs(places - aim).max() < (0.05 if rung.inertia else 0.006)
        assert places[-1] == pytest.approx(0.1, abs=5e-3)


@pytest.mark.few(1)
@pytest.mark.parametrize("rung", MOVING, ids=lambda rung: rung.name)
def test_a_run_goes_on_with_its_activations(make: Make, rung: rw.Rung) -> None:
    actuators = (
        '<general name="m" joint="x" dyntype="filterexact" dynprm="0.2" gainprm="30" biastype="affine"'
        ' biasprm="0 -30 -3"/>'
    )
    scene = slide(make, actuators, controls={"m": "0.2 * sin(9 * t)"})
    whole = rw.simulate(scene, rung, stride=1)
    middle = next(state for state in whole.states if state.time >= 0.2)
    rest = rw.simulate(scene, rung, state=middle, stride=1)
    assert np.array_equal(rest.state.q, whole.state.q) and np.array_equal(rest.state.v, whole.state.v)
    by_hand = rw.simulate(scene, rung, state=rw.State.of(scene, {"b.x": middle["b.x"]}, time=middle.time))
    assert not np.array_equal(by_hand.state.q, whole.state.q)
    again = rw.simulate(scene, rung, stride=1)
    assert np.array_equal(again.state.q, whole.state.q)


def test_mujoco_beside_it_and_keyframes_have_the_activations(make: Make) -> None:
    key = '<keyframe><key name="k" act="0.4 0"/></keyframe>'
    more = '<body name="c" pos="0 1 0"><joint name="y" type="slide"/><geom size=".1" mass="1"/></body>'
    actuators = (
        '<general name="m" joint="x" dyntype="filter" dynprm="0.1" gainprm="2"/>'
        '<general name="n" joint="y" dyntype="integrator" gainprm="2"/>'
    )
    scene = make(
        f'<option gravity="0 0 0" timestep="0.001"/>{MASS.format("", more)}'
        f"<actuator>{actuators}</actuator>{key}",
        duration=0.3, controls={"m": "1", "n": "0.5"}, start={"keyframe": "k"},
    )  # fmt: skip
    run = rw.simulate(scene, rw.DYNAMIC_RIGID)
    found = rw.replay(run)
    assert found.end is not None and found.end.time == pytest.approx(run.frames[-1].time)
    assert np.isnan(found.parts), found
    model = mujoco.MjModel.from_xml_string(run.mjcf([0.0, 0.3]))
    assert model.key_act[0].tolist() == [0.4, 0.0]
    assert model.key_act[1] == pytest.approx([1.0 - 0.6 * exp(-3.0), 0.15], rel=1e-9)
    later = rw.simulate(scene, rw.DYNAMIC_RIGID, state=run.states[len(run.states) // 2])
    assert np.isnan(rw.replay(later).parts)

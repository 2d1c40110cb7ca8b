"""Boxes that two fingers tilt as they lift them: what pushes is left a little open by steps that take faces
as flat, and still carries."""

from __future__ import annotations

import numpy as np
import pytest

import rungwise as rw

from .conftest import Make
from .rungs import QUASISTATIC, named


def lifted(make: Make, seed: int) -> rw.SpaceScene:
    """Two servo fingers with limits close on a box beside its middle and below its top, and lift."""
    rng = np.random.default_rng(seed)
    side = 10.0 ** rng.uniform(-2.0, -0.5)
    mass = 1e3 * (2.0 * side) ** 3 * rng.uniform(0.3, 2.0)
    tip, height = side * rng.uniform(0.2, 0.4), side * rng.uniform(0.6, 0.95)
    left, right = side * rng.uniform(-0.4, 0.4, 2)
    press = mass * 9.81 * rng.uniform(0.8, 1.5)
    friction, condim, gain = float(rng.uniform(0.3, 0.7)), int(rng.choice([3, 4])), press / (0.1 * side)
    fingers = "".join(
        f'<body name="{name}" pos="{-sign * (side + 1.5 * tip)} {y} {height}">'
        f'<joint name="{name}" type="slide" axis="{sign} 0 0" damping="{mass}"/>'
        f'<joint name="{name}z" type="slide" axis="0 0 1" damping="{mass}"/>'
        f'<geom type="sphere" size="{tip}" mass="{0.1 * mass}" condim="{condim}"'
        f' friction="1 {0.1 * side} 0"/></body>'
        for name, sign, y in (("l", 1, left), ("r", -1, right))
    )
    servos = "".join(
        f'<position name="{name}" joint="{name}" kp="{gain}" forcerange="{-press} {press}"/>'
        f'<position name="{name}z" joint="{name}z" kp="{gain}"/>'
        for name in "lr"
    )
    model = (
        f'<option gravity="0 0 -9.81"/><worldbody><geom name="floor" type="plane" size="9 9 .1"/>'
        f'<body name="box" pos="0 0 {side}"><freejoint/><geom type="box" size="{side} {side} {side}"'
        f' mass="{mass}"/></body>{fingers}</worldbody><actuator>{servos}</actuator>'
    )
    soft = {"stiffness": 1e4 * mass * 9.81 / side, "damping": 10.0 * mass * 9.81 / side}
    return make(
        model, duration=1.6, step=1e-2,
        controls={"l": f"{side} * min(t, 1)", "r": f"{side} * min(t, 1)"}
        | dict.fromkeys(("lz", "rz"), f"{side} * max(0, t - 1)"),
        contacts=[{"between": ["floor", "*"], "friction": 0.2}, {"friction": friction, **soft}],
    )  # fmt: skip


@pytest.mark.few(4)
@pytest.mark.parametrize("rung", QUASISTATIC, ids=named)
@pytest.mark.parametrize("seed", [0, 1, 6, 7, 11, 15, 16, 18, 20, 26])
def test_a_box_that_fingers_tilt_is_lifted_in_coarse_steps(make: Make, seed: int, rung: rw.Rung) -> None:
    run = rw.simulate(lifted(make, seed), rung)
    assert run.outcome == rw.Outcome.TIMEOUT, run.reason
    assert run.worst_residual <= 1e-8
    began = float(run.trajectory.position.values[0, 2])
    with_momentum = rw.simulate(lifted(make, seed), rw.DYNAMIC_RIGID, step=2e-3).final["box"]["z"]
    assert (run.final["box"]["z"] > 1.05 * began) == (with_momentum > 1.05 * began)


@pytest.mark.parametrize("seed", [0, 1, 6, 15, 20])
def test_steps_within_an_error_carry_as_well(make: Make, seed: int) -> None:
    run = rw.simulate(lifted(make, seed), rw.QUASISTATIC_RIGID, tol=1e-3)
    assert run.outcome == rw.Outcome.TIMEOUT, run.reason

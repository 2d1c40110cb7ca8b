"""Torsional and rolling friction that a scene gives apart from sliding friction."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import rungwise as rw
from rungwise.models.ladder import Rung

from .conftest import Make
from .measure import FLOOR, G, free, run, world
from .rungs import DYNAMIC, QUASISTATIC, named

R, I = 0.1, 0.4 * 0.1**2
"""Radius of a ball, and its inertia over its mass."""


def _speed(make: Make, rung: Rung, condim: int, motion: dict[str, float], axis: str, **law: Any) -> float:
    """The rate about an axis that a ball has after 0.1 s on a floor."""
    own = f'size=".1" condim="{condim}" friction="1 0.02 0.003"'
    ball = free("b", "0 0 .1", own)
    law |= {"stiffness": 1e7}
    scene = make(world(FLOOR, ball), contacts=[law], start={"velocities": motion}, step=5e-4, duration=0.1)
    found = run(scene, rung)
    return float(found.trajectory.velocity.sel(rate=f"b.{axis}").values[-1])


@pytest.mark.few(4)
@pytest.mark.parametrize("rung", DYNAMIC, ids=named)
@pytest.mark.parametrize("slides", [0.0, 0.05, 1.5, None])
@pytest.mark.parametrize("twist", [0.0, 0.001, 0.004])
def test_a_ball_that_spins_slows_down_by_torsional_friction_alone(
    make: Make, rung: Rung, slides: float | None, twist: float
) -> None:
    law = {"torsional_friction": twist} | ({} if slides is None else {"friction": slides})
    after = _speed(make, rung, 4, {"b.rz": 5.0}, "rz", **law)
    assert after == pytest.approx(max(5.0 - 0.1 * twist * G / I, 0.0), abs=2e-3)


@pytest.mark.few(4)
@pytest.mark.parametrize("rung", DYNAMIC, ids=named)
@pytest.mark.parametrize("slides", [0.3, 1.5, None])
@pytest.mark.parametrize("rolls", [0.0, 5e-4, 1e-3])
def test_a_ball_that_rolls_slows_down_by_rolling_friction(
    make: Make, rung: Rung, slides: float | None, rolls: float
) -> None:
    """What slows the ball down is a friction force, in the same cone as the moment. Creep, of the order of
    (rolls / (mu R))^2, is left out."""
    law = {"rolling_friction": rolls} | ({} if slides is None else {"friction": slides})
    after = _speed(make, rung, 6, {"b.x": 0.5, "b.ry": 5.0}, "ry", **law)
    grip = slides or 1.0
    moment = rolls / math.hypot(1.0, rolls / (grip * R * (1.0 + I / R**2)))
    slowing = moment * G / (I + R**2)
    assert after == pytest.approx(5.0 - 0.1 * slowing, abs=4e-3)


@pytest.mark.parametrize("rung", DYNAMIC, ids=named)
def test_torsional_friction_that_is_not_given_changes_with_sliding_friction(make: Make, rung: Rung) -> None:
    for slides in (0.35, 1.4):
        after = _speed(make, rung, 4, {"b.rz": 30.0}, "rz", friction=slides)
        assert after == pytest.approx(30.0 - 0.1 * 0.02 * slides * G / I, abs=1e-2)


@pytest.mark.parametrize("name", ["torsional_friction", "rolling_friction"])
def test_friction_below_zero_is_refused_by_name(make: Make, name: str) -> None:
    model = world(FLOOR, free("b", "0 0 .1", 'size=".1" condim="6"'))
    found = rw.simulate(make(model, contacts=[{name: -0.1}]), rw.DYNAMIC_RIGID)
    assert found.outcome.name == "invalid"
    assert found.reason == f"contacts.0.{name}: -0.1 must be >= 0"


@pytest.mark.few(4)
@pytest.mark.parametrize("rung", QUASISTATIC, ids=named)
@pytest.mark.parametrize("condim", [3, 4, 6])
@pytest.mark.parametrize("seed", range(4))
def test_what_slides_without_momentum_is_proved_whatever_resists_its_turns(
    make: Make, rung: Rung, condim: int, seed: int
) -> None:
    """A box on a floor that leans to some side, a thousandth below its angle of friction and beyond it, and
    far below it beside a ball in the air."""
    draw = np.random.default_rng(seed)
    mu, heading = draw.uniform(0.1, 1.2), draw.uniform(0.0, 2.0 * math.pi)
    outcomes = []
    for part, beside in ((0.999, False), (1.001, False), (0.5, True)):
        lean = math.atan(part * mu)
        level = math.sin(lean)
        pull = G * np.array([level * math.cos(heading), level * math.sin(heading), -math.cos(lean)])
        box = f'type="box" size=".1 .1 .03" condim="{condim}" friction="{mu} 0.05 0.01"'
        ball = free("a", "1 0 1", f'size=".1" condim="{condim}"') if beside else ""
        before = f'<option gravity="{pull[0]:.17g} {pull[1]:.17g} {pull[2]:.17g}"/>'
        floor = FLOOR.replace("/>", f' friction="{mu} 0.05 0.01"/>')
        scene = make(world(floor, free("b", "0 0 .03", box), ball, before=before), duration=0.01, step=2e-3)
        found = run(scene, rung)
        assert (found.certificate is None) == (found.outcome.name == "timeout")
        outcomes.append(found.outcome.name)
    assert outcomes == ["timeout", "unsupported", "unsupported"]

"""Runs in space whose steps lead nowhere end, and say what keeps their steps short."""

from __future__ import annotations

import pytest

import rungwise as rw
from rungwise.models.ladder import Rung
from rungwise.simulation.core.crawl import OVERLAPPING
from rungwise.simulation.core.step import UNSOLVED
from rungwise.simulation.spatial.run import SpaceSimulation
from rungwise.simulation.stepping import advance
from rungwise.simulation.stepping.attempt import Setting, attempt
from rungwise.simulation.stepping.stepper import Stepper

from .conftest import Make
from .measure import FLOOR, NO_GRAVITY, free, world
from .rungs import DYNAMIC, named

BALL = (
    '<body name="ball"><joint name="x" type="slide" axis="1 0 0"/><geom name="b" size=".1" mass="1"/></body>'
)


def _end(simulation: SpaceSimulation) -> tuple[str, int]:
    """The reason of a run that is `not_converged`, and how many attempts it took."""
    while simulation.advance():
        pass
    found, stepper = simulation.result(), simulation.stepper
    assert stepper is not None and found.outcome == "not_converged"
    return found.reason, stepper.attempts


def test_steps_that_overlap_unless_they_are_tiny_name_the_contact(
    make: Make, monkeypatch: pytest.MonkeyPatch
) -> None:
    law = [{"friction": 0.0}]
    ball = free("ball", "0 0 .1", 'name="b" size=".1"')
    scene = make(world(FLOOR, ball), contacts=law, start={"velocities": {"ball.x": 1e6}})

    def overlapping(system: object, setting: Setting, h: float) -> int:
        status = int(attempt(system, setting, h))
        if h < 1e-7:
            return status
        setting.attempt.note["cause"] = OVERLAPPING
        return UNSOLVED

    monkeypatch.setattr(Stepper, "is_compiled", False)
    monkeypatch.setattr(advance, "attempt", overlapping)
    simulation = SpaceSimulation(scene, rw.DYNAMIC_RIGID, step=1e-2, duration=1.0)
    assert simulation.stepper is not None
    simulation.stepper.clock["crowd"] = 9_000  # as if so many had been made
    reason, attempts = _end(simulation)
    assert 1_000 <= attempts < 11_000
    assert "overlap bodies between floor and b." in reason and "dynamic-compliant" in reason


@pytest.mark.few(1)
@pytest.mark.parametrize("rung", DYNAMIC, ids=named)
def test_a_body_that_is_shaken_a_hundred_thousand_times_within_a_step_ends(make: Make, rung: Rung) -> None:
    motor = '<actuator><motor name="m" joint="x"/></actuator>'
    scene = make(world(BALL, before=NO_GRAVITY, after=motor), controls={"m": "1e9 * sin(1e6 * t)"})
    simulation = SpaceSimulation(scene, rung, step=1.0, duration=1e3, tol=1e-6)
    assert simulation.stepper is not None
    simulation.stepper.clock["crowd"] = 9_000  # as if so many had been made
    reason, attempts = _end(simulation)
    assert 1_000 < attempts < 101_000
    assert "the error of longer ones" in reason and "ball" in reason

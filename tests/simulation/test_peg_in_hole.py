"""A peg on springs in a hole: where it is jammed, where it is wedged, and what its task asks."""

from __future__ import annotations

import math

import pytest

import rungwise as rw

FORCES = ("quasistatic-rigid", "quasistatic-compliant", "dynamic-rigid", "dynamic-compliant")


@pytest.mark.parametrize("model", FORCES)
def test_springs_lead_the_peg_into_a_hole_that_is_elsewhere(model: str) -> None:
    for x, angle in ((1e-3, math.radians(1.0)), (1e-3, -math.radians(1.0)), (-1e-3, math.radians(1.0))):
        run = rw.simulate("peg_in_hole", model, parameters={"x": x, "angle": angle})
        assert str(run.outcome) == "goal", run.reason
        peg = run.final["peg"]
        # In two points at the most, at this depth: no more of an angle than the clearance over it.
        depth = 0.02 - 0.002
        assert abs(peg["angle"] - angle) <= 1.01 * 2e-4 / depth


def test_without_give_the_peg_stands_on_the_chamfer() -> None:
    """The kinematic rung follows springs exactly, and no motion does both."""
    run = rw.simulate("peg_in_hole", "kinematic", parameters={"x": 1e-3})
    assert str(run.outcome) == "jammed" and run.certificate is not None
    assert run.final["peg"]["y"] == pytest.approx(-(2e-3 - 9e-4), abs=1e-5)


@pytest.mark.parametrize("mu", [0.1, 0.3, 0.6])
def test_a_chamfer_holds_a_peg_that_its_springs_press_too_little(mu: float) -> None:
    """On a slope of 45 degrees the spring gives way iff push (1 - mu) > spring d (1 + mu), d to the side."""
    d, spring, deep = 1e-3, 5e3, 0.028
    least = spring * (d - 1e-4) * (1.0 + mu) / (1.0 - mu)
    for part, reaches in ((0.97, False), (1.03, True)):
        over = {"x": d, "mu": mu, "push_spring": part * least / deep, "ty": -deep - 2e-3, "turn_spring": 1e9}
        run = rw.simulate("peg_in_hole", "quasistatic-rigid", parameters=over)
        assert (run.final["peg"]["y"] < -2e-3) == reaches, (part, run.final)


def test_a_plan_holds_wherever_the_hole_is() -> None:
    plan = rw.plan("peg_in_hole", seed=0)
    assert plan.found
    found = rw.verify(plan, samples=200, mode="open loop")
    assert found.lower >= 0.9


def test_a_servo_without_gains_has_no_force() -> None:
    """Whatever its limit: a limit alone would be dry friction."""
    drive = {"kind": "servo", "stiffness": 0.0, "limit": 100.0}
    disc = {
        "role": "object",
        "shape": {"kind": "disc", "radius": 1.0},
        "mass": 1.0,
        "force": [1.0, 0.0],
        "motion": {"kind": "slide", "axis": [1, 0], "name": "x"},
        "coordinates": {"x": {"damping": 10.0, "drive": drive}},
    }
    for model in FORCES[:2]:
        run = rw.simulate({"name": "free", "bodies": {"disc": disc}}, model, duration=0.5)
        assert run.final["disc"]["x"] == pytest.approx(0.05, rel=1e-6)

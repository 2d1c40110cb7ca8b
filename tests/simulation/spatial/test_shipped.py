"""Scenes in space that ship come to their goals."""

from __future__ import annotations

from importlib.util import find_spec

import numpy as np
import pytest

import rungwise as rw
from rungwise.models.ladder import Rung
from rungwise.scene import SceneError
from rungwise.scene.space import SpaceScene

from .measure import run
from .rungs import DYNAMIC, WITH_LOADS, named


@pytest.mark.few(2)
@pytest.mark.parametrize("rung", WITH_LOADS, ids=named)
def test_three_fingers_lift_a_ball(rung: Rung) -> None:
    """By the palm's rise, less what servos stand off under their loads."""
    found = run(rw.load("three_fingers"), rung, step=4e-3)
    assert found.outcome.name == "goal"
    final = found.final
    risen = final["palm"]["lift"]
    assert final["ball"]["z"] - 0.05 == pytest.approx(risen, abs=0.015)
    assert abs(final["ball"]["x"]) < 1e-6 and abs(final["ball"]["y"]) < 1e-6


def test_three_fingers_that_slip_leave_the_ball() -> None:
    found = run(rw.load("three_fingers"), rw.DYNAMIC_RIGID, step=4e-3, parameters={"mu": 0.05})
    assert found.outcome.name == "unsafe"
    assert found.final["ball"]["z"] == pytest.approx(0.05, abs=1e-6)


@pytest.mark.few(2)
@pytest.mark.parametrize("rung", DYNAMIC, ids=named)
@pytest.mark.parametrize("offset", [0.0025, -0.0015])
def test_a_peg_finds_its_hole(rung: Rung, offset: float) -> None:
    found = run(rw.load("peg"), rung, step=2e-3, parameters={"offset": offset})
    assert found.outcome.name == "goal"
    assert found.final["hand"]["down"] >= 0.04


def test_a_peg_that_lands_beside_the_chamfer_stays_outside() -> None:
    found = run(rw.load("peg"), rw.DYNAMIC_RIGID, step=2e-3, parameters={"offset": 0.008})
    assert found.outcome.name == "timeout"
    assert found.final["hand"]["down"] < 0.02


@pytest.mark.few(2)
@pytest.mark.parametrize("rung", [rw.QUASISTATIC_RIGID, *DYNAMIC], ids=named)
def test_an_arm_pushes_a_box_ahead(rung: Rung) -> None:
    found = run(rw.load("arm_push"), rung, step=4e-3)
    assert found.outcome.name == "goal"
    assert found.final["box"]["z"] == pytest.approx(0.04, abs=2e-5)


def test_a_pile_comes_to_rest_in_its_bin() -> None:
    found = run(rw.load("pile"), rw.DYNAMIC_COMPLIANT, step=4e-3, duration=1.0)
    scene = rw.load("pile")
    assert isinstance(scene, SpaceScene)
    for name in scene.template.bodies[1:]:
        place = found.final[name]
        assert max(abs(place["x"]), abs(place["y"])) < 0.25 and place["z"] > 0.035
    speeds = found.trajectory.velocity.values
    assert np.abs(speeds[-1]).mean() < 0.1 * np.abs(speeds).mean(axis=1).max()


def test_the_hand_of_another_package_is_asked_for_by_name() -> None:
    """Where gymnasium-robotics is not installed, its model is what is missing; otherwise its block stays."""
    if find_spec("gymnasium_robotics") is None:
        with pytest.raises(SceneError, match="package gymnasium_robotics, which is not installed"):
            rw.load("shadow_hand")
        return
    found = run(rw.load("shadow_hand"), rw.DYNAMIC_RIGID, duration=0.2)
    places = found.trajectory.position.sel(coordinate=["object.x", "object.y", "object.z"]).values
    assert np.abs(places - places[0]).max() < 2e-5

"""Derivatives of runs in space against closed forms of the scheme."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import rungwise as rw
from rungwise.models.ladder import Rung
from rungwise.simulation.derivatives.in_space import SpaceSensitivity

from .conftest import Make
from .measure import FLOOR, NO_GRAVITY, G, free, world
from .rungs import DYNAMIC, named

MU, SPEED, STEPS, H = 0.3, 2.0, 50, 2e-3


def sensitivity(*arguments: Any, **options: Any) -> SpaceSensitivity:
    found = rw.run_sensitivity(*arguments, **options)
    assert isinstance(found, SpaceSensitivity)
    return found


@pytest.mark.parametrize("rung", DYNAMIC, ids=named)
def test_a_block_that_slides(make: Make, rung: Rung) -> None:
    """x = v t - mu g h^2 n (n + 1) / 2 after n steps; turned by the friction where contacts yield."""
    scene = make(
        world(FLOOR, free("b", "0 0 .02", 'type="box" size=".2 .2 .02"')),
        parameters={"mu": {"default": MU, "range": [0, 1]}, "pace": {"default": SPEED, "range": [0, 9]}},
        contacts=[{"friction": "mu", "stiffness": 1e7, "damping": 1e4}],
        start={"velocities": {"b.x": "pace"}},
    )
    found = sensitivity(scene, rung, steps=STEPS, h=H)
    assert found.names == ("mu", "pace") and found.time == pytest.approx(STEPS * H)
    exact = np.array([-G * H * H * STEPS * (STEPS + 1) / 2, STEPS * H])
    accuracy = 1e-6 if not rung.compliant else 0.02
    np.testing.assert_allclose(found.dq["parameters"][0], exact, rtol=accuracy)
    np.testing.assert_allclose(found.dv["parameters"][0], [-G * STEPS * H, 1.0], rtol=accuracy)
    if not rung.compliant:
        assert not found.weak["parameters"].any()
        assert (np.abs(found.dq["parameters"][0] - exact) <= found.dq_error["parameters"][0] + 1e-7).all()


def test_a_ball_comes_to_roll_at_5_7_of_its_speed(make: Make) -> None:
    scene = make(
        world(FLOOR, free("b", "0 0 .1", 'size=".1"')),
        parameters={"pace": {"default": 1.0, "range": [0, 9]}},
        contacts=[{"friction": 0.5}],
        start={"velocities": {"b.x": "pace"}},
    )
    found = sensitivity(scene, rw.DYNAMIC_RIGID, steps=100, h=2e-3)
    assert found.dv["parameters"][0, 0] == pytest.approx(5.0 / 7.0, rel=1e-6)
    assert found.dv["parameters"][4, 0] == pytest.approx(50.0 / 7.0, rel=1e-6)


def test_differences_are_exact_where_the_third_derivative_is_all_there_is(make: Make) -> None:
    """A flight at pace cubed: two differences err by delta^2 and a quarter of it, and by nothing together."""
    scene = make(
        world(free("b", "0 0 1", 'size=".1"'), before=NO_GRAVITY),
        parameters={"pace": {"default": 1.5, "range": [0, 9]}},
        start={"velocities": {"b.x": "pace**3"}},
    )
    found = sensitivity(scene, rw.DYNAMIC_RIGID, steps=10, h=1e-2)
    assert found.dv["parameters"][0, 0] == pytest.approx(3.0 * 1.5**2, rel=1e-9)
    assert found.dq["parameters"][0, 0] == pytest.approx(0.3 * 1.5**2, rel=1e-9)
    assert found.dv_error["parameters"][0, 0] == pytest.approx(0.25e-6 * 1.5**2, rel=1e-2)


def test_flight_by_its_start(make: Make) -> None:
    """q' = I + h n I by v, and the identity by q, turns included, without loads."""
    scene = make(world(free("b", "0 0 1", 'size=".1"'), before=NO_GRAVITY))
    q, v = np.array([0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0]), np.array([1.0, 0.0, 2.0, 0.0, 0.0, 3.0])
    found = sensitivity(scene, rw.DYNAMIC_RIGID, steps=5, h=1e-2, q=q, v=v, wrt=("q", "v"))
    np.testing.assert_allclose(found.dq["q"][:3, :3], np.eye(3), atol=1e-9)
    np.testing.assert_allclose(found.dq["v"][:3, :3], 0.05 * np.eye(3), atol=1e-9)
    angle = 5 * 1e-2 * 3.0  # a turn at the start is seen from the frame that has turned since
    turn = [[np.cos(angle), np.sin(angle), 0.0], [-np.sin(angle), np.cos(angle), 0.0], [0.0, 0.0, 1.0]]
    np.testing.assert_allclose(found.dq["q"][3:, 3:], turn, atol=1e-6)


def test_an_impact_within_the_differences_is_weak(make: Make) -> None:
    """Ball and floor meet at the end of the last step or a step later."""
    scene = make(
        world(FLOOR, free("b", "0 0 .2", 'size=".1"'), before=NO_GRAVITY),
        parameters={"pace": {"default": 1.0, "range": [0, 9]}},
        start={"velocities": {"b.z": "-pace"}},
    )
    assert sensitivity(scene, rw.DYNAMIC_RIGID, steps=10, h=1e-2).weak["parameters"].all()
    before = sensitivity(scene, rw.DYNAMIC_RIGID, steps=5, h=1e-2)
    assert before.dq["parameters"][2, 0] == pytest.approx(-0.05) and not before.weak["parameters"].any()


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"steps": 0}, "steps: must be a whole number"),
        ({"wrt": ("w",)}, "wrt: unknown kind 'w'"),
        ({"names": ("w",)}, "names: unknown parameter 'w'"),
        ({"q": np.zeros(7)}, "q and v: give both"),
        ({"parameters": {"pace": 0.0}}, "names: pace is at an end of its range"),
        ({"time": 1.0}, "deformation and time"),
    ],
)
def test_wrong_input(make: Make, change: dict[str, Any], words: str) -> None:
    scene = make(
        world(free("b", "0 0 1", 'size=".1"')),
        parameters={"pace": {"default": 1.0, "range": [0, 9]}},
        start={"velocities": {"b.x": "pace"}},
    )
    with pytest.raises(rw.ModelError, match=words):
        rw.run_sensitivity(**{"scene": scene, "model": rw.DYNAMIC_RIGID, "steps": 2} | change)

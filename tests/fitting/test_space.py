"""Motions in space: quaternions, and the same fit."""

from __future__ import annotations

import numpy as np
import pytest

import rungwise as rw
from rungwise.fitting.measured.layout import laid_out, rates_at

GRAVITY, MU = 9.81, 0.3
LABELS = ("block.x", "block.y", "block.z", "block.qw", "block.qx", "block.qy", "block.qz")
RATES = ("block.x", "block.y", "block.z", "block.rx", "block.ry", "block.rz")
TIMES = np.arange(16) * 0.01


def sliding(mu: float = MU, trials: int = 3, noise: float = 2e-5) -> rw.Motions:
    """Blocks that slide on the floor of the scene `slope` laid flat, each along a way of its own."""
    rng = np.random.default_rng(0)
    places = np.zeros((trials, len(TIMES), 7))
    for i in range(trials):
        angle, speed = rng.uniform(-3.0, 3.0), rng.uniform(0.6, 1.0)
        way = speed * TIMES - 0.5 * mu * GRAVITY * TIMES**2
        places[i, :, :2] = way[:, None] * [np.cos(angle), np.sin(angle)]
        places[i, :, 2], places[i, :, 3] = 0.05, 1.0
    places[..., :3] += noise * rng.normal(size=(trials, len(TIMES), 3))
    return rw.Motions(LABELS, TIMES, places, rates=RATES)


@pytest.mark.long
def test_friction_in_space_is_that_of_the_way_it_stops() -> None:
    found = rw.fit("slope", "dynamic-rigid", sliding(), "mu", box={"mu": (0.05, 1.0)},
                   parameters={"angle": 0.0}, span=np.inf, moments=3, tol=1e-6, threads=1)  # fmt: skip
    assert found.values["mu"] == pytest.approx(MU, abs=0.01)
    assert [each.name for each in found.residuals][-3:] == ["block.turn_x", "block.turn_y", "block.turn_z"]
    assert [each.name for each in found.phases] == ["sliding"]


def test_rates_of_a_spin_are_about_the_axes_of_the_body() -> None:
    """A block tilted about x that spins about its own z: quaternions are multiplied from the right."""
    tilt, spin = 0.4, 3.0
    half = 0.5 * spin * TIMES
    a, b = np.cos(0.5 * tilt), np.sin(0.5 * tilt)
    turned = np.column_stack([a * np.cos(half), b * np.cos(half), -b * np.sin(half), a * np.sin(half)])
    turned[8:] *= -1.0  # the same turns
    places = np.column_stack([np.zeros((len(TIMES), 2)), np.full(len(TIMES), 0.5), turned])
    scene = rw.load("slope")
    layout = laid_out(scene, rw.Motions(LABELS, TIMES, places, rates=RATES))
    v = rates_at(layout, scene, layout.trials[0], np.arange(2, 14))[0]
    assert v[:, 3:] == pytest.approx(np.tile([0.0, 0.0, spin], (12, 1)), abs=1e-3)


def test_three_numbers_of_a_quaternion_are_refused() -> None:
    motions = rw.Motions(LABELS[:6], TIMES, np.ones((1, len(TIMES), 6)))
    with pytest.raises(rw.MotionError, match=r"coordinates: of block.qw all four numbers are needed"):
        rw.fit("slope", "dynamic-rigid", motions, "mu")

"""A box tipped over the edge of its foot: the force at its onset, the balance, and what each rung says."""

from __future__ import annotations

import math

import numpy as np
import pytest

import rungwise as rw

FORCES = ("quasistatic-rigid", "quasistatic-compliant", "dynamic-rigid", "dynamic-compliant")


@pytest.mark.parametrize("model", FORCES[:2])
def test_the_force_at_the_onset(model: str) -> None:
    """F = m g w / (2 (h - mu w)), a finger at the height h that slides up the face; m g w / (2 h) without
    friction."""
    rng = np.random.default_rng(12)
    for mu in (0.0, 0.2, *rng.uniform(0.0, 0.4, 3)):
        w, m, g = (float(x) for x in rng.uniform((0.05, 0.2, 1.0), (0.2, 5.0, 20.0)))
        h = float(rng.uniform(1.2, 1.9)) * w
        over = {"mu": mu, "width": w, "height": 2 * w, "push_height": h, "mass": m, "gravity": g}
        over |= {"mu_floor": 1.0, "stiffness": 1e9, "damping": 0.0}
        run = rw.simulate("pivot", model, parameters=over, duration=1e-4, step=1e-4)
        force = run.trajectory["contact_force"].sel(point="finger|box/0", direction="normal")
        assert float(force[-1]) == pytest.approx(m * g * w / (2 * (h - mu * w)), rel=1e-3)


def test_the_box_slides_where_the_floor_does_not_hold_its_edge() -> None:
    """F <= mu_floor (m g + mu F) tips it; below, it slides and stands."""
    least = 0.1 / (2 * 0.15)
    for mu_floor, tips in ((0.98 * least, False), (1.02 * least, True)):
        over = {"mu": 0.0, "mu_floor": mu_floor, "turn": 0.02}
        run = rw.simulate("pivot", "quasistatic-rigid", parameters=over)
        assert str(run.outcome) == ("goal" if tips else "timeout"), (mu_floor, run.reason)
        assert tips or abs(run.final["box"]["angle"]) < 1e-9


@pytest.mark.parametrize("model", FORCES)
def test_every_rung_with_forces_comes_to_the_balance(model: str) -> None:
    run = rw.simulate("pivot", model)
    assert str(run.outcome) == "goal"
    assert run.final["box"]["angle"] == pytest.approx(-0.98 * math.atan(0.5), rel=3e-3)


@pytest.mark.parametrize("model", FORCES)
def test_beyond_the_balance_the_box_falls_if_it_has_inertia(model: str) -> None:
    run = rw.simulate("pivot", model, parameters={"turn": 3.38})
    if model.startswith("dynamic"):
        assert str(run.outcome) == "goal"
        return
    assert str(run.outcome) == "unsupported"
    # A step of the finger leads past the balance by less than 0.3 percent.
    assert -1.003 < run.final["box"]["angle"] / math.atan(0.5) <= -1.0
    assert run.certificate is not None


def test_the_finger_pushes_less_and_less() -> None:
    """The force falls to nothing at the balance, like the torque of the weight about the edge."""
    run = rw.simulate("pivot", "quasistatic-rigid", parameters={"mu": 0.0, "turn": 0.99})
    points = run.trajectory["contact_force"].sel(direction="normal")
    force = sum(points.sel(point=f"finger|box/{k}").to_numpy() for k in range(2))[1:]
    angle = -run.trajectory["position"].sel(coordinate="box.angle").to_numpy()[1:]
    d, balance = math.hypot(0.1, 0.2) / 2, math.atan(0.5)
    # The finger touches the face at s from the edge, with its centre at the height 0.15.
    s = (0.15 - (0.1 + 0.005) * np.sin(angle)) / np.cos(angle)
    assert np.ptp(angle) > 0.4 and force[-1] < 0.2
    np.testing.assert_allclose(force * s, 9.81 * d * np.sin(balance - angle), atol=1e-3)

"""The paper's two-finger grasp against its closed forms, on every rung."""

from __future__ import annotations

import numpy as np
import pytest

import rungwise as rw

from .conftest import GEOMETRIES, MOVING, RIGID, captured, lowest_ratio, threshold

SPEEDS = np.exp(np.random.default_rng(7).uniform(-2.0, 2.0, 10))
STEPS = np.random.default_rng(8).uniform(2e-4, 4e-3, 10)


def both_sides(lowest: float, width: float) -> list[tuple[float, bool]]:
    """Ratios just outside and just inside both ends of a band, with the verdict they should get."""
    highest = 1.0 / lowest
    return [
        (lowest - width, False),
        (lowest + width, True),
        (highest - width, True),
        (highest + width, False),
    ]


@pytest.mark.few(4)
@pytest.mark.parametrize("geometry", GEOMETRIES, ids=("paper", "flat", "steep", "wide"))
@pytest.mark.parametrize("model", RIGID, ids=str)
def test_band_off_the_step_grid(two_finger: rw.Scene, model: rw.Rung, geometry: dict[str, float]) -> None:
    slope = geometry.get("height", 1.0) / geometry.get("half_base", 1.0)
    frictions = np.random.default_rng(9).uniform(0.0, 0.95 * min(slope, 1.0), 10)
    for v1, h, mu in zip(SPEEDS, STEPS, frictions, strict=True):
        h = h / v1
        for r, expected in both_sides(lowest_ratio(geometry), 2.0 * h * v1):
            parameters = {**geometry, "mu": mu}
            assert captured(two_finger, model, r, v1, step=h, parameters=parameters) == expected, (
                r,
                v1,
                h,
                mu,
            )


@pytest.mark.few(4)
@pytest.mark.parametrize("geometry", GEOMETRIES, ids=("paper", "flat", "steep", "wide"))
@pytest.mark.parametrize("restitution", [0.2, 0.5, 0.8, 1.0])
def test_band_with_restitution(two_finger: rw.Scene, geometry: dict[str, float], restitution: float) -> None:
    for v1, h in zip(SPEEDS, STEPS, strict=True):
        h = h / v1
        for r, expected in both_sides(lowest_ratio(geometry, restitution), 2.0 * h * v1):
            parameters = {**geometry, "restitution": restitution, "mu": 0.3}
            assert captured(two_finger, rw.DYNAMIC_RIGID, r, v1, step=h, parameters=parameters) == expected


def test_restitution_band_of_the_paper_is_what_the_design_says() -> None:
    for e in (0.0, 0.3, 1.0):
        assert lowest_ratio({}, e) == pytest.approx(1.0 / (1.5 + 0.5 / (1.0 + e)))
    assert lowest_ratio({}) == 0.5 and lowest_ratio({}, 1.0) == pytest.approx(4.0 / 7.0)


@pytest.mark.few(1)
@pytest.mark.parametrize(
    ("mu", "coarse", "exact"), [(0.0, 0.5021, 0.50218), (0.5, 0.5039, 0.50399), (0.9, 0.5127, 0.51337)]
)
def test_damped_compliant_threshold(two_finger: rw.Scene, mu: float, coarse: float, exact: float) -> None:
    at = [
        threshold(two_finger, rw.DYNAMIC_COMPLIANT, 0.49, 0.53, step=h, parameters={"mu": mu})
        for h in (1e-4, 2.5e-5)
    ]
    assert at[0] == pytest.approx(coarse, abs=1e-4)
    assert at[1] == pytest.approx(exact, rel=1e-3)
    controlled = threshold(two_finger, rw.DYNAMIC_COMPLIANT, 0.49, 0.53, tol=1e-6, parameters={"mu": mu})
    assert controlled == pytest.approx(exact, rel=1e-3)


@pytest.mark.few(1)
@pytest.mark.parametrize("mu", [0.0, 0.5])
def test_undamped_compliant_threshold(two_finger: rw.Scene, mu: float) -> None:
    parameters = {"mu": mu, "damping": 0.0}
    coarse, fine = (
        threshold(two_finger, rw.DYNAMIC_COMPLIANT, 0.55, 0.59, step=h, parameters=parameters)
        for h in (1e-4, 2.5e-5)
    )
    assert 0.567 <= coarse <= 0.570
    assert 0.5703 <= fine <= 0.5715
    elastic = 4.0 / 7.0
    assert abs(fine - elastic) < 0.002


@pytest.mark.few(1)
@pytest.mark.parametrize("mu", [0.0, 0.5])
def test_quasistatic_compliant_band_is_that_of_the_rigid_rung(two_finger: rw.Scene, mu: float) -> None:
    found = threshold(two_finger, rw.QUASISTATIC_COMPLIANT, 0.45, 0.65, step=1e-4, parameters={"mu": mu})
    assert found == pytest.approx(0.5, abs=2e-4)


@pytest.mark.parametrize("model", MOVING, ids=str)
@pytest.mark.parametrize("tol", [1e-3, 1e-5])
def test_controlled_steps_give_the_same_verdicts(two_finger: rw.Scene, model: rw.Rung, tol: float) -> None:
    plastic = {"mu": 0.4, "stiffness": 1e8, "damping": 1e6}
    for v1 in SPEEDS[:4]:
        for r, expected in both_sides(0.5, 0.004):
            assert captured(two_finger, model, r, v1, tol=tol, parameters=plastic) == expected, (r, v1)


@pytest.mark.long
@pytest.mark.parametrize("damping", [0.0, 1e4])
def test_controlled_compliant_threshold(two_finger: rw.Scene, damping: float) -> None:
    parameters = {"mu": 0.5, "damping": damping}
    fine = threshold(
        two_finger, rw.DYNAMIC_COMPLIANT, 0.49, 0.59, step=2e-5, theta=0.5, parameters=parameters
    )
    assert threshold(
        two_finger, rw.DYNAMIC_COMPLIANT, 0.49, 0.59, tol=1e-5, theta=0.5, parameters=parameters
    ) == pytest.approx(fine, rel=1e-3)


@pytest.mark.parametrize("model", [rw.QUASISTATIC_RIGID, rw.DYNAMIC_RIGID], ids=str)
@pytest.mark.parametrize("mu", [1.0, 1.3, 5.0])
def test_sticking_fingers_jam_with_a_frictional_certificate(
    two_finger: rw.Scene, model: rw.Rung, mu: float
) -> None:
    for step in (None, 1.7e-3):
        run = rw.simulate(two_finger, model, parameters={"mu": mu, "v2": 0.8}, step=step)
        assert (
            run.outcome.name == "jammed"
            and run.certificate is not None
            and run.certificate.kind == "frictional"
        )
        assert run.final["finger1"]["x1"] == pytest.approx(1.5, abs=1e-5)
        assert run.final["part"]["x3"] == pytest.approx(0.0, abs=1e-5)


def test_below_one_nothing_sticks(two_finger: rw.Scene) -> None:
    for mu in (0.9, 0.99, 0.999):
        assert (
            rw.simulate(two_finger, rw.QUASISTATIC_RIGID, parameters={"mu": mu, "v2": 0.8}).outcome.name
            == "goal"
        )


@pytest.mark.parametrize("model", [rw.QUASISTATIC_COMPLIANT, rw.DYNAMIC_COMPLIANT], ids=str)
def test_sticking_compliant_finger_moves_the_part_by_the_difference_of_stiffnesses(model: rw.Rung) -> None:
    data = rw.load("two_finger").file.model_dump(mode="json")
    data["contacts"][0] |= {"tangential_stiffness": "0.5 * stiffness", "tangential_damping": "0.5 * damping"}
    scene = rw.load(data)
    run = rw.simulate(
        scene, model, parameters={"mu": 3.0, "v2": 0.01, "damping": 0.0}, duration=1.52, step=1e-4
    )
    pressed = 0.02
    expected = pressed * (1.0 - 0.5) / (1.0 + 0.5)
    oscillation = 0.0 if model.inertia == 0.0 else 2e-3
    assert run.final["part"]["x3"] == pytest.approx(expected, rel=1e-3, abs=oscillation + 1e-6)


def test_equal_stiffness_sticks_in_place(two_finger: rw.Scene) -> None:
    run = rw.simulate(two_finger, rw.QUASISTATIC_COMPLIANT, parameters={"mu": 3.0, "v2": 0.01}, duration=1.52)
    assert run.final["part"]["x3"] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("model", [rw.DYNAMIC_RIGID, rw.DYNAMIC_COMPLIANT], ids=str)
@pytest.mark.parametrize("options", [{}, {"tol": 1e-5}])
def test_travel_limit_stops_a_sliding_body(model: rw.Rung, options: dict[str, float]) -> None:
    slider = {
        "role": "object", "mass": 1, "shape": {"kind": "disc", "radius": 0.1},
        "motion": {"kind": "slide", "axis": [1, 0]},
        "coordinates": {"s": {"speed": 1, "upper": 0.3}},
    }  # fmt: skip
    run = rw.simulate(
        {"name": "stop", "duration": 1, "step": 1e-3, "bodies": {"b": slider}}, model, **options
    )
    assert run.outcome.name == "timeout"
    assert run.final["b"]["s"] == pytest.approx(0.3, abs=1e-9)


@pytest.mark.few(1)
@pytest.mark.parametrize("model", MOVING[1:], ids=str)
def test_fingers_of_limited_force_capture_every_ratio_where_they_stick(model: rw.Rung) -> None:
    """Prescribed speeds jam there; a finger that sticks and stalls waits for the other one."""
    scene = rw.load("two_finger_servo")
    for r in np.exp(np.random.default_rng(11).uniform(-3.0, 3.0, 6)):
        assert captured(scene, model, float(r), step=1e-3, parameters={"mu": 1.05})
    for r, expected in both_sides(0.5, 2e-2):
        assert captured(scene, model, r, step=1e-3, parameters={"mu": 0.5}) == expected

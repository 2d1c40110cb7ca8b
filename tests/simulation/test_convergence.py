"""Order of convergence in the step, accounts of energy, and what --tol controls."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import rungwise as rw

from .test_run import slider

STEPS = [4e-3, 2e-3, 1e-3, 5e-4]
DYNAMIC = (rw.DYNAMIC_RIGID, rw.DYNAMIC_COMPLIANT)


def order(errors: list[float]) -> float:
    """Exponent p of errors ~ h^p over STEPS, by regression."""
    return float(np.polyfit(np.log(STEPS), np.log(errors), 1)[0])


def exact(rhs: Any, start: list[float], time: float) -> float:
    """The first unknown at `time`."""
    return float(solve_ivp(rhs, (0.0, time), start, rtol=1e-12, atol=1e-13).y[0, -1])


def pressed(stiffness: float, damping: float) -> rw.Scene:
    """A disc set down unloaded on a floor that yields: it sinks and swings, and never separates."""
    disc = {
        "role": "object",
        "mass": 1.0,
        "shape": {"kind": "disc", "radius": 1.0},
        "pose": {"y": 1.0},
        "motion": {"kind": "free"},
    }
    contact = {"between": ["disc", "floor"], "stiffness": stiffness, "damping": damping}
    return rw.load(
        {
            "name": "pressed",
            "gravity": [0, -10],
            "bodies": {"disc": disc, "floor": {"role": "obstacle", "shape": {"kind": "halfplane"}}},
            "contacts": [contact],
        }
    )


def height(stiffness: float, damping: float, time: float) -> float:
    return 1.0 + exact(lambda _, y: [y[1], -10.0 - stiffness * y[0] - damping * y[1]], [0.0, 0.0], time)


@pytest.mark.parametrize(
    ("theta", "expected", "band"), [(1.0, 1.0, 0.15), (0.75, 1.0, 0.1), (0.5, 2.0, 0.05)]
)
def test_order_on_a_smooth_contact(theta: float, expected: float, band: float) -> None:
    scene, reference = pressed(1e3, 20.0), height(1e3, 20.0, 0.3)
    errors = []
    for h in STEPS:
        run = rw.simulate(scene, rw.DYNAMIC_COMPLIANT, step=h, theta=theta, duration=0.3, frames=3)
        assert run.outcome.name == "timeout", run.reason
        errors.append(abs(run.final["disc"]["y"] - reference))
    assert order(errors) == pytest.approx(expected, abs=band)


def test_tolerance_controls_the_error_of_a_contact() -> None:
    scene, reference = pressed(1e5, 5.0), height(1e5, 5.0, 0.3)
    errors, steps = [], []
    for tol in (1e-5, 1e-7, 1e-9):
        run = rw.simulate(scene, rw.DYNAMIC_COMPLIANT, tol=tol, theta=0.5, duration=0.3, frames=3)
        errors.append(abs(run.final["disc"]["y"] - reference))
        steps.append(run.steps)
    assert errors[0] > 5.0 * errors[1] > 25.0 * errors[2]
    assert steps[0] < steps[1] < steps[2]


def pendulum(speed: float = 0.7) -> rw.Scene:
    rod = {
        "role": "object",
        "mass": 2.0,
        "inertia": 0.3,
        "shape": {"kind": "box", "width": 1.0, "height": 0.1},
        "pose": {"x": 0.5},
        "motion": {"kind": "hinge", "pivot": [0, 0]},
        "coordinates": {"angle": {"speed": speed}},
    }
    return rw.load({"name": "pendulum", "gravity": [0, -9.81], "bodies": {"rod": rod}, "duration": 1.3})


def swung(time: float) -> float:
    """Angle of the pendulum."""
    about_pivot = 0.3 + 2.0 * 0.5**2
    return exact(lambda _, y: [y[1], -2.0 * 9.81 * 0.5 * math.cos(y[0]) / about_pivot], [0.0, 0.7], time)


@pytest.mark.parametrize(
    ("model", "theta", "expected"),
    [(rw.DYNAMIC_RIGID, 1.0, 1.0), (rw.DYNAMIC_COMPLIANT, 1.0, 1.0), (rw.DYNAMIC_COMPLIANT, 0.5, 2.0)],
    ids=str,
)
def test_order_on_a_pendulum(model: rw.Rung, theta: float, expected: float) -> None:
    scene, reference = pendulum(), swung(1.3)
    errors = [
        abs(rw.simulate(scene, model, step=h, theta=theta, frames=3).final["rod"]["angle"] - reference)
        for h in STEPS
    ]
    assert order(errors) == pytest.approx(expected, abs=0.02)


@pytest.mark.few(1)
@pytest.mark.parametrize("model", DYNAMIC, ids=str)
def test_tolerance_controls_the_error_of_a_pendulum(model: rw.Rung) -> None:
    """Free flight is of second order under error control: a hundredth of the tolerance, of the error."""
    runs = [rw.simulate(pendulum(), model, tol=tol, duration=20.0, frames=3) for tol in (1e-4, 1e-6, 1e-8)]
    errors = [abs(run.final["rod"]["angle"] - swung(20.0)) for run in runs]
    assert errors[0] > 50.0 * errors[1] > 2500.0 * errors[2] and errors[2] < 1e-5
    fixed = rw.simulate(pendulum(), model, step=20.0 / runs[1].attempts, duration=20.0, frames=3)
    assert errors[1] < abs(fixed.final["rod"]["angle"] - swung(20.0))


@pytest.mark.parametrize(("model", "theta"), [(rw.DYNAMIC_RIGID, 1.0), (rw.DYNAMIC_COMPLIANT, 0.5)], ids=str)
def test_a_pendulum_keeps_its_energy(model: rw.Rung, theta: float) -> None:
    data = rw.simulate(pendulum(), model, theta=theta, step=1e-3, duration=40.0).trajectory
    energy = (data.kinetic_energy + data.potential_energy).values
    late, early = energy[len(energy) // 2 :], energy[: len(energy) // 2]
    assert np.ptp(energy) < 0.02 * float(data.kinetic_energy.max())
    assert late.mean() == pytest.approx(early.mean(), abs=1e-3 * float(data.kinetic_energy.max()))


@pytest.mark.parametrize("time", [0.1, 0.5])
def test_order_of_a_disc_that_slides_and_rolls(time: float) -> None:
    scene = rw.load(rw.load("slide_roll").file.model_dump(mode="json") | {"goal": None})
    rolls, drag = 1.0 / (3.0 * 0.2 * 9.81), 0.2 * 9.81
    sliding = min(time, rolls)
    reference = sliding - 0.5 * drag * sliding**2 + 2.0 / 3.0 * (time - sliding)
    errors = []
    for h in STEPS:
        run = rw.simulate(scene, rw.DYNAMIC_RIGID, step=0.2593 * h, duration=time, frames=3)
        errors.append(abs(run.final["disc"]["x"] - reference))
    assert order(errors) == pytest.approx(1.0, abs=0.05)


@pytest.mark.parametrize(("theta", "expected"), [(1.0, 1.0), (0.5, 2.0)])
@pytest.mark.parametrize("limit", ["inf", 1000.0])
def test_order_on_springs_and_damping(theta: float, expected: float, limit: float | str) -> None:
    """A servo with a constant target, on a support with drag; a limit that is not met changes nothing."""
    servo = {"kind": "servo", "stiffness": 50.0, "damping": 2.0, "target": 0.4, "limit": limit}
    scene = slider({"damping": 3.0, "speed": 1.0, "drive": servo})
    reference = exact(lambda _, y: [y[1], (50.0 * (0.4 - y[0]) - 5.0 * y[1]) / 2.0], [0.0, 1.0], 1.0)
    errors = [
        abs(
            rw.simulate(scene, rw.DYNAMIC_COMPLIANT, step=h, theta=theta, frames=3).final["block"]["s"]
            - reference
        )
        for h in STEPS
    ]
    assert order(errors) == pytest.approx(expected, abs=0.05)


def imbalance(run: rw.Run) -> float:
    """Kinetic energy less its start and the four works, relative to the greatest of them."""
    data = run.trajectory
    works = [data[name].values for name in ("drive_work", "load_work", "contact_work", "support_work")]
    kinetic = data.kinetic_energy.values
    largest = max(float(np.abs(values).max()) for values in [kinetic, *works])
    return float(np.abs(kinetic - kinetic[0] - sum(works)).max()) / largest


@pytest.mark.few(6)
@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("model", DYNAMIC, ids=str)
@pytest.mark.parametrize("options", [{"theta": 1.0}, {"theta": 0.5}, {"tol": 1e-5}], ids=str)
def test_energy_accounts(model: rw.Rung, options: dict[str, float], seed: int) -> None:
    """Blocks and a stack that are thrown on a slope: all that moves them is in the accounts."""
    rng = np.random.default_rng(seed)
    data = rw.load("blocks").file.model_dump(mode="json") | {"goal": None, "unsafe": None}
    servo = {"kind": "servo", "stiffness": 30.0, "damping": 1.0, "target": "0.3 * cos(2 * t)", "limit": 9.0}
    data["bodies"]["lone"]["coordinates"] |= {
        "x": {"speed": float(rng.normal()), "damping": 0.5, "dry_friction": 0.3, "drive": servo}
    }
    parameters = {
        "slope": rng.uniform(0.1, 0.6),
        "mu": rng.uniform(0.0, 0.8),
        "mu_stack": rng.uniform(0.0, 0.8),
        "spin": rng.normal(),
        "damping": float(10.0 ** rng.uniform(0.0, 3.0)),
    }
    run = rw.simulate(rw.load(data), model, parameters=parameters, duration=0.5, **options)
    assert run.outcome.name == "timeout", run.reason
    works = ("drive_work", "load_work", "contact_work", "support_work")
    assert all(float(np.abs(run.trajectory[name]).max()) > 1e-4 for name in works)
    assert imbalance(run) < 1e-11


@pytest.mark.parametrize("theta", [1.0, 0.5])
@pytest.mark.parametrize("model", DYNAMIC, ids=str)
def test_energy_accounts_of_prescribed_speeds(model: rw.Rung, theta: float) -> None:
    data = rw.load("two_finger").file.model_dump(mode="json") | {"goal": None, "doomed": None}
    data["bodies"]["finger1"] |= {"mass": 0.7}
    data["bodies"]["finger1"]["coordinates"]["x1"]["drive"]["speed"] = "v1 * (1 + 0.5 * sin(3 * t))"
    run = rw.simulate(rw.load(data), model, parameters={"v2": 0.3, "mu": 0.4}, theta=theta, duration=1.6)
    assert run.outcome.name == "timeout", run.reason
    assert float(run.trajectory.contact_work[-1]) != 0.0
    assert imbalance(run) < 1e-11

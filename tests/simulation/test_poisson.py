"""Poisson's restitution: where it equals Newton's, the two phases of an oblique impact in closed form, and
energy, which Newton's law can add and Poisson's cannot."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import rungwise as rw
from rungwise.kernel import Reals

FLOOR = {"role": "obstacle", "shape": {"kind": "halfplane"}}
POISSON = {"impact": "poisson"}


def rod(
    speeds: tuple[float, float, float], angle: float, mu: float, e: float, inertia: float, **law: Any
) -> dict[str, Any]:
    """A rod of mass 1 with its lower end on a floor, at the speeds (x, y, angle), without gravity."""
    points = [{"kind": "point", "at": [-0.5, 0]}, {"kind": "point", "at": [0.5, 0]}]
    body = {
        "role": "object", "shape": points, "mass": 1.0, "centre": [0, 0], "inertia": inertia,
        "pose": {"y": 0.5 * abs(math.sin(angle)) + 1e-9, "angle": angle}, "motion": {"kind": "free"},
        "coordinates": dict(
            zip(("x", "y", "angle"), ({"speed": speed} for speed in speeds), strict=True)
        ),
    }  # fmt: skip
    contact = {"between": ["rod", "floor"], "friction": mu, "restitution": e} | law
    return {
        "name": "rod", "bodies": {"rod": body, "floor": FLOOR}, "contacts": [contact], "gravity": [0, 0],
        "duration": 1e-6, "step": 1e-6,
    }  # fmt: skip


def rows(angle: float) -> Reals:
    """Rates (2, 3) of the gap of the lower end and of its way along the floor."""
    side = -1.0 if angle > 0.0 else 1.0
    x, y = 0.5 * side * math.cos(angle), 0.5 * side * math.sin(angle)
    return np.array([[0.0, 1.0, x], [1.0, 0.0, -y]])


def phase(A: Reals, u: Reals, mu: float, least: float) -> Reals:
    """Impulses (normal, tangential) of a phase that begins with the rates u and gives `least` at least along
    the normal: the contact sticks, or slides to one side, and opens or not."""
    given = u + A[:, 0] * least
    tried = [np.linalg.solve(A, -given), np.array([0.0, -given[1] / A[1, 1]])]
    for side in (1.0, -1.0):  # of the slip
        tilt = np.array([1.0, -side * mu])
        push = -(given[0] - side * mu * least * A[0, 1]) / (A[0] @ tilt)
        tried += [tilt * push + [0.0, -side * mu * least], np.array([0.0, -side * mu * least])]
    found = []
    for extra in tried:
        normal, slide = given + A @ extra
        total = least + extra[0]
        admissible = extra[0] >= -1e-12 and normal >= -1e-12 and abs(extra[0] * normal) < 1e-9
        within = abs(extra[1]) <= mu * total + 1e-12
        against = abs(slide) < 1e-12 or extra[1] * slide <= -mu * total * abs(slide) + 1e-12
        if admissible and within and against:
            found.append(extra + np.array([least, 0.0]))
    assert found
    return np.asarray(found[0])


def after(speeds: Any, angle: float, mu: float, e: float, inertia: float) -> Reals:
    """Speeds after the two phases."""
    W, M = rows(angle), np.array([1.0, 1.0, inertia])
    A, v = W / M @ W.T, np.array(speeds)
    first = phase(A, W @ v, mu, 0.0)
    v = v + W.T @ first / M
    return np.asarray(v + W.T @ phase(A, W @ v, mu, e * first[0]) / M)


def drawn(rng: np.random.Generator) -> tuple[tuple[float, float, float], float, float, float, float]:
    """Speeds that bring the lower end down on the floor, angle, friction, restitution and inertia."""
    angle = rng.uniform(0.1, 1.4) * rng.choice([-1.0, 1.0])
    while True:
        speeds = (rng.uniform(-2, 2), rng.uniform(-3, 0), rng.uniform(-3, 3))
        if rows(angle)[0] @ speeds < -0.1:
            inertia = 10.0 ** rng.uniform(-2.0, 0.0)
            return speeds, angle, rng.uniform(0.0, 1.2), rng.uniform(0.05, 1.0), inertia


def run(case: Any, **law: Any) -> rw.Run:
    return rw.simulate(rod(*case, **law), rw.DYNAMIC_RIGID)


def energy(v: Reals, inertia: float) -> float:
    return float(0.5 * (v[:2] @ v[:2] + inertia * v[2] ** 2))


@pytest.mark.long
def test_an_oblique_impact_has_two_phases() -> None:
    """Against both phases solved one after the other by trying every mode; Newton's law differs wherever slip
    stops or turns, and only there adds energy."""
    rng, apart, gained = np.random.default_rng(7), 0, 0
    for _ in range(120):
        case = drawn(rng)
        inertia = case[-1]
        v = run(case, **POISSON).trajectory.velocity.values[-1]
        np.testing.assert_allclose(v, after(*case), atol=1e-9)
        before = energy(np.array(case[0]), inertia)
        assert energy(v, inertia) <= before * (1.0 + 1e-9)
        newton = run(case).trajectory.velocity.values[-1]
        apart += np.abs(newton - v).max() > 1e-6
        gained += energy(newton, inertia) > before * (1.0 + 1e-9)
    assert apart > 20 and gained > 0


def test_newton_adds_energy_where_slip_turns_and_poisson_does_not() -> None:
    """Kane and Levinson (1985): restitution near 1, and friction that turns the slip of a slanting rod."""
    case = ((-0.3, -1.0, 0.0), -0.9, 0.6, 0.9, 1.0 / 12.0)
    newton, poisson = run(case), run(case, **POISSON)
    assert newton.energy_gained > 1e-3 and poisson.energy_gained == 0.0


@pytest.mark.few(1)
@pytest.mark.parametrize("mu", [0.0, 0.4])
def test_central_impacts_are_newtons(mu: float) -> None:
    """And so are all impacts of one contact without friction."""
    ball = {
        "role": "object", "shape": {"kind": "disc", "radius": 0.1}, "mass": 2.0,
        "pose": {"y": 0.1}, "motion": {"kind": "free"}, "coordinates": {"y": {"speed": -3.0}},
    }  # fmt: skip
    contact = {"between": ["ball", "floor"], "restitution": 0.7, "friction": mu} | POISSON
    data = {"name": "b", "bodies": {"ball": ball, "floor": FLOOR}, "contacts": [contact], "duration": 0.01}
    v = rw.simulate(data, rw.DYNAMIC_RIGID).trajectory.velocity.values[-1]
    np.testing.assert_allclose(v, [0.0, 2.1, 0.0], atol=1e-12)
    rng = np.random.default_rng(1)
    for _ in range(20):
        speeds, angle, _, e, inertia = drawn(rng)
        case = (speeds, angle, 0.0, e, inertia)
        both = [run(case, **law).trajectory.velocity.values[-1] for law in ({}, POISSON)]
        np.testing.assert_allclose(*both, atol=1e-9)


def test_a_mirrored_impact_is_mirrored() -> None:
    rng = np.random.default_rng(3)
    for _ in range(20):
        (x, y, turn), angle, mu, e, inertia = drawn(rng)
        v = run(((x, y, turn), angle, mu, e, inertia), **POISSON).trajectory.velocity.values[-1]
        u = run(((-x, y, -turn), -angle, mu, e, inertia), **POISSON).trajectory.velocity.values[-1]
        np.testing.assert_allclose(u, v * [-1.0, 1.0, -1.0], atol=1e-9)


def test_without_restitution_there_is_no_second_phase() -> None:
    rng = np.random.default_rng(4)
    for _ in range(10):
        speeds, angle, mu, _, inertia = drawn(rng)
        case = (speeds, angle, mu, 0.0, inertia)
        both = [run(case, **law).trajectory.velocity.values[-1] for law in ({}, POISSON)]
        assert np.array_equal(*both)


def test_a_cradle_passes_the_impulse_on() -> None:
    """Three balls that touch, hit from the left: (-1/3, 2/3, 2/3) for restitution 1, in both laws."""
    ball = {"role": "object", "shape": {"kind": "disc", "radius": 0.1}, "mass": 1.0}
    bodies = {
        name: ball
        | {
            "pose": {"x": 0.2 * k},
            "motion": {"kind": "slide", "axis": [1, 0]},
            "coordinates": {"s": {"speed": 1.0 if k == 0 else 0.0}},
        }
        for k, name in enumerate("abc")
    }
    contact = {"between": ["*", "*"], "restitution": 1.0} | POISSON
    data = {"name": "cradle", "bodies": bodies, "contacts": [contact], "duration": 1e-3}
    found = rw.simulate(data, rw.DYNAMIC_RIGID)
    np.testing.assert_allclose(found.trajectory.velocity.values[-1], [-1 / 3, 2 / 3, 2 / 3], atol=1e-9)


def test_a_box_that_bounces_comes_to_rest_without_adding_energy() -> None:
    box = {
        "role": "object", "shape": {"kind": "box", "width": 0.3, "height": 0.2}, "mass": 1.0,
        "pose": {"y": 0.6, "angle": 0.3}, "motion": {"kind": "free"},
        "coordinates": {"x": {"speed": 1.0}, "angle": {"speed": 2.0}},
    }  # fmt: skip
    contact = {"between": ["box", "floor"], "restitution": 0.4, "friction": 0.3} | POISSON
    data = {
        "name": "box", "bodies": {"box": box, "floor": FLOOR}, "contacts": [contact], "gravity": [0, -10],
        "duration": 2.0, "step": 1e-3, "tolerance": 1e-6,
    }  # fmt: skip
    found = rw.simulate(data, rw.DYNAMIC_RIGID)
    assert found.energy_gained <= 1e-9 and found.outcome == "timeout"
    assert np.abs(found.trajectory.velocity.values[-1]).max() < 1e-6
    assert found.trajectory.position.values[-1][1] == pytest.approx(0.1, abs=1e-5)

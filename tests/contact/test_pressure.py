"""The limit surface of a pressure as a kind of group: what it dissipates, and projections on it."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rungwise.contact.kinds import pressure as law
from rungwise.kernel import Reals
from rungwise.system.planar import pressed

RINGS, DISCS, BOXES, THIN = "ring", "disc", "box", "thin"


def table_of(edges: list[tuple[float, float, float, float]], line: float = 0.0) -> Reals:
    """Numbers of a pressure along edges, or within them, over the mean distance of the load."""
    table = np.zeros(law.HEAD + (law.EDGE + law.SPOT * pressed.MOST) * len(edges))
    table[law.LINE] = line
    for edge in edges:
        pressed._add_edge(*edge, table)
    pressed._measure(1.0, table)
    mean, _, _ = law.dissipation(table, (0.0, 0.0, 1.0))
    again = np.zeros_like(table)
    again[law.LINE] = line
    for edge in edges:
        pressed._add_edge(*edge, again)
    pressed._measure(mean, again)
    pressed._spread(again)
    return again


def polygon(corners: list[tuple[float, float]]) -> list[tuple[float, float, float, float]]:
    return [(*a, *b) for a, b in zip(corners, corners[1:] + corners[:1], strict=True)]


def around(count: int) -> list[tuple[float, float]]:
    angles = 2.0 * np.pi * np.arange(count) / count
    return [(math.cos(a), math.sin(a)) for a in angles]


LOADS = {
    RINGS: table_of(polygon(around(64)), 1.0),
    DISCS: table_of(polygon(around(64))),
    BOXES: table_of(polygon([(-1.0, -0.5), (1.0, -0.5), (1.0, 0.5), (-1.0, 0.5)])),
    THIN: table_of(polygon([(-1.0, -0.02), (1.0, -0.02), (1.0, 0.02), (-1.0, 0.02)])),
}
"""Numbers by name."""
EVERY = pytest.mark.parametrize("load", LOADS)


def power(load: str, u: Reals) -> float:
    return float(law.dissipation(LOADS[load], tuple(u))[0])


def gradient_at(load: str, u: Reals) -> tuple[float, ...]:
    return law.dissipation(LOADS[load], tuple(u))[1]  # type: ignore[arg-type]


def dense(h: tuple[float, ...]) -> Reals:
    return np.array([[h[0], h[1], h[2]], [h[1], h[3], h[4]], [h[2], h[4], h[5]]])


def motions(count: int, seed: int = 0) -> Reals:
    """Slides, turns, and both, of all sizes."""
    rng = np.random.default_rng(seed)
    u = rng.normal(size=(count, 3))
    u[:, 2] *= 10.0 ** rng.uniform(-4, 2, count)
    u[::7, 2] = 0.0
    return np.asarray(u * 10.0 ** rng.uniform(-3, 3, (count, 1)))


@EVERY
def test_power_is_the_sum_over_the_load_and_its_slopes_are_slopes(load: str) -> None:
    """Gradient and Hessian against differences; both are those of a function of degree one."""
    for u in motions(200):
        value, gradient, h = law.dissipation(LOADS[load], tuple(u))
        hessian, e = dense(h), 1e-5 * np.linalg.norm(u)
        assert np.dot(gradient, u) == pytest.approx(value, rel=1e-12)
        np.testing.assert_allclose(hessian @ u, 0.0, atol=1e-12 * np.abs(hessian).max() * np.linalg.norm(u))
        assert np.linalg.eigvalsh(hessian).min() > -1e-12 * np.abs(hessian).max()
        steps = np.eye(3) * e
        slope = [(power(load, u + s) - power(load, u - s)) / (2.0 * e) for s in steps]
        np.testing.assert_allclose(gradient, slope, atol=1e-7)
        bend = [np.subtract(gradient_at(load, u + s), gradient_at(load, u - s)) / (2.0 * e) for s in steps]
        np.testing.assert_allclose(hessian, bend, rtol=1e-3, atol=1e-4 * np.abs(hessian).max())


@EVERY
def test_spots_stand_for_the_load_where_it_turns_about_a_far_place(load: str) -> None:
    """On both sides of the distance from which on they do, numbers are the same."""
    table = LOADS[load]
    for angle in np.linspace(0.0, 2.0 * np.pi, 13):
        for side in (1.0, -1.0):
            turn = side / (law.FAR * table[law.REACH])
            u = (math.cos(angle), math.sin(angle), turn)
            one, other = law._by_edges(table, u), law._by_spots(table, u)
            assert one[0] == pytest.approx(other[0], abs=1e-12)
            np.testing.assert_allclose(one[1], other[1], atol=1e-11)
            np.testing.assert_allclose(one[2], other[2], atol=1e-9)


@pytest.mark.parametrize("away", [0.3, 1e-6, 5e-12])
def test_a_loaded_edge_next_to_the_centre_of_a_turn_has_its_distance(away: float) -> None:
    """The load over the speed is asinh(1 / away) of the mean distance 1 / 2, however near the edge is."""
    table = table_of([(-1.0, 0.0, 1.0, 0.0)], 1.0)
    _, _, h = law.dissipation(table, (2.0 * away, 0.0, 1.0))
    assert h[0] + h[3] == pytest.approx(0.5 * math.asinh(1.0 / away), rel=1e-9)
    assert np.isfinite(law.dissipation(table, (0.0, 0.0, 1.0))[2]).all()


def projected(load: str, radius: float, angle: float, z: Reals) -> tuple[int, Reals, Reals]:
    """Mode, projection of a force, and its slope."""
    F, S = np.zeros(3), np.zeros((3, 3))
    numbers = np.array([radius, math.cos(angle), math.sin(angle), 0.0])
    mode = law.natural_map(numbers, LOADS[load], z, np.zeros(3), F, S)
    return mode, z - F, S


def turned(angle: float) -> Reals:
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


@EVERY
def test_projections_are_the_nearest_forces_of_the_limit_surface(load: str) -> None:
    """No motion exceeds what the pressure dissipates; what is left of a force beyond is a motion that drives
    it, for that the pressure does; forces within are kept."""
    rng, beyond = np.random.default_rng(1), 0
    tries = motions(300, 2)
    for _ in range(300):
        radius, angle = 10.0 ** rng.uniform(-2, 2), rng.uniform(-4.0, 4.0)
        z = rng.normal(size=3) * radius * 10.0 ** rng.uniform(-0.5, 2.0)
        mode, force, _ = projected(load, radius, angle, z)
        own, left = turned(angle).T @ force, turned(angle).T @ (z - force)
        assert all(own @ u <= radius * power(load, u) * (1.0 + 1e-12) for u in tries)
        if mode == law.STICK:
            np.testing.assert_array_equal(force, z)
        else:
            beyond += 1
            assert own @ left == pytest.approx(radius * power(load, left), rel=1e-12)
    assert 100 < beyond < 290


@EVERY
def test_projections_are_the_same_wherever_the_search_begins(load: str) -> None:
    """Rates of all directions and sizes, with forces so that what is projected stays."""
    rng = np.random.default_rng(7)
    for _ in range(300):
        z, angle = rng.normal(size=3) * 10.0 ** rng.uniform(-0.5, 1.0), rng.uniform(-4.0, 4.0)
        mode, force, slope = projected(load, 1.0, angle, z)
        u, F, S = rng.normal(size=3) * 10.0 ** rng.uniform(-9, 1), np.zeros(3), np.zeros((3, 3))
        u = -u if rng.random() < 0.3 else force - z if rng.random() < 0.5 else u
        numbers = np.array([1.0, math.cos(angle), math.sin(angle), 0.0])
        assert law.natural_map(numbers, LOADS[load], z + u, u, F, S) == mode
        np.testing.assert_allclose(z + u - F, force, atol=1e-12)
        np.testing.assert_allclose(S, slope, atol=1e-7)


@EVERY
def test_forces_on_the_limit_surface_are_at_its_edge(load: str) -> None:
    """A ten-billionth within they are kept, as much beyond they are not."""
    for u in motions(100, 3):
        force = np.array(law.dissipation(LOADS[load], tuple(u))[1])
        assert projected(load, 1.0, 0.0, (1.0 - 1e-10) * force)[0] == law.STICK
        mode, kept, _ = projected(load, 1.0, 0.0, (1.0 + 1e-10) * force)
        assert mode == law.FORWARD
        np.testing.assert_allclose(kept, force, atol=3e-10)


@EVERY
def test_the_slope_of_the_projection_is_that_of_differences(load: str) -> None:
    rng = np.random.default_rng(4)
    for _ in range(100):
        z, angle = rng.normal(size=3) * 10.0 ** rng.uniform(-0.3, 1.5), rng.uniform(-4.0, 4.0)
        mode, force, S = projected(load, 1.0, angle, z)
        if mode == law.STICK:
            np.testing.assert_array_equal(S, np.eye(3))
            continue
        e = 1e-5 * float(np.linalg.norm(z - force))
        both = [[projected(load, 1.0, angle, z + side * s)[1] for side in (1, -1)] for s in np.eye(3) * e]
        slope = np.array([(there - back) / (2.0 * e) for there, back in both]).T
        np.testing.assert_allclose(S, slope, atol=1e-5)
        np.testing.assert_allclose(S, S.T, atol=1e-13)


@EVERY
def test_violation_is_the_distance_from_the_projection(load: str) -> None:
    rng = np.random.default_rng(5)
    for _ in range(50):
        x, y, angle, radius = (
            rng.normal(size=3),
            rng.normal(size=3),
            rng.uniform(-4.0, 4.0),
            rng.uniform(0.5, 2),
        )
        numbers = np.array([radius / 3.0, math.cos(angle), math.sin(angle), 0.0])
        _, force, _ = projected(load, radius, angle, x - y)
        found = law.violation(numbers, LOADS[load], 3.0, x, y)
        assert found == pytest.approx(float(np.linalg.norm(x - force)), rel=1e-9, abs=1e-13)


def test_the_ball_that_counts_as_within_is_within() -> None:
    """Nowhere is less dissipated than by a ball of this radius."""
    for load in LOADS:
        assert min(power(load, u) / np.linalg.norm(u) for u in motions(2000, 6)) > law.INNER

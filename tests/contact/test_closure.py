"""Form and force closure against closed forms, and the checker against wrong certificates."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import rungwise as rw
from rungwise.contact.analysis.closure import check

SQUARE = np.array([[-0.3, -1.0], [1.0, -0.3], [0.3, 1.0], [-1.0, 0.3]])
"""One contact on each side of a square, each off the middle in the same sense of rotation."""
INWARD = np.array([[0.0, 1.0], [-1.0, 0.0], [0.0, -1.0], [1.0, 0.0]])


def moved(points: NDArray[Any], normals: NDArray[Any], rng: np.random.Generator) -> tuple[Any, Any]:
    angle, scale = rng.uniform(-4, 4), 10.0 ** rng.uniform(-4, 4)
    turn = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
    return scale * (points @ turn.T + rng.normal(size=2)), rng.uniform(0.1, 9.0) * normals @ turn.T


def test_four_contacts_on_a_square() -> None:
    """All turning one way: the square can turn the other way. One pair each way: closed."""
    turning = rw.form_closure(SQUARE, INWARD)
    assert not turning and check(turning) and turning.certificate[2] != 0.0
    closed = rw.form_closure(SQUARE * [[-1, 1], [1, 1], [-1, 1], [1, 1]], INWARD)
    assert closed and check(closed) and closed.margin == pytest.approx(1.0)


@pytest.mark.parametrize("seed", range(20))
def test_fewer_than_four_frictionless_contacts_never_close(seed: int) -> None:
    rng = np.random.default_rng(seed)
    for k in range(4):
        angles = rng.uniform(0, 2 * math.pi, k)
        closure = rw.form_closure(rng.normal(size=(k, 2)), np.column_stack([np.cos(angles), np.sin(angles)]))
        assert not closure and check(closure)


@pytest.mark.parametrize("seed", range(30))
def test_triangle_between_four_fingers_closes_in_any_frame_and_unit(seed: int) -> None:
    """Closed while the upper contacts are on either side of the peak (the paper's goal edge), else not."""
    rng = np.random.default_rng(seed)
    for x3, holds in ((rng.uniform(-0.49, 0.49), True), (rng.uniform(0.51, 1.4), False)):
        left = np.array([-0.5 - x3, 0.5 - x3])
        right = np.array([0.5 - x3, 0.5 + x3])
        faces = [[1.0, -1.0], [-1.0, -1.0]] if holds else [[1.0, -1.0], [1.0, -1.0]]
        base = [[-0.5 - x3, 0.0], [0.5 - x3, 0.0]]
        points, normals = np.array([left, right, *base]), np.array([*faces, [0.0, 1.0], [0.0, 1.0]])
        closure = rw.form_closure(*moved(points, normals, rng))
        assert closure.holds == holds and check(closure)


@pytest.mark.parametrize("seed", range(40))
def test_two_contacts_with_friction_close_iff_the_line_lies_in_both_cones(seed: int) -> None:
    rng = np.random.default_rng(seed)
    mu = rng.uniform(0.1, 1.5, 2)
    tilts = np.arctan(mu) * rng.choice([0.7, 1.3], 2) * rng.choice([-1, 1], 2)
    points = np.array([[0.0, 0.0], [1.0, 0.0]])
    normals = np.array([[math.cos(tilts[0]), math.sin(tilts[0])], [-math.cos(tilts[1]), math.sin(tilts[1])]])
    closure = rw.force_closure(*moved(points, normals, rng), mu)
    assert closure.holds == bool(np.all(np.abs(np.tan(tilts)) < mu)) and check(closure)


def test_friction_only_helps() -> None:
    rng = np.random.default_rng(3)
    closed = 0
    for _ in range(50):
        angles = rng.uniform(0, 2 * math.pi, 3)
        points, normals = rng.normal(size=(3, 2)), np.column_stack([np.cos(angles), np.sin(angles)])
        verdicts = [rw.force_closure(points, normals, mu).holds for mu in (0.0, 0.2, 0.5, 1.0, 2.0)]
        assert verdicts == sorted(verdicts) and not verdicts[0]
        closed += verdicts[-1]
    assert closed > 10


def test_perturbed_certificates_fail() -> None:
    closed = rw.force_closure([[0, 0], [1, 0]], [[1, 0], [-1, 0]], 0.5)
    for i in range(len(closed.certificate)):
        wrong = closed.certificate.copy()
        wrong[i] += -2.0 * np.abs(wrong).max() - 1.0
        assert not check(replace(closed, certificate=wrong))
    free = rw.form_closure(SQUARE, INWARD)
    assert not check(replace(free, certificate=-free.certificate))
    for closure in (closed, free):
        assert not check(replace(closure, holds=not closure.holds))
        assert not check(replace(closure, certificate=np.full_like(closure.certificate, np.nan)))


@pytest.mark.parametrize(
    ("points", "normals", "friction", "named"),
    [
        ([[0, 0, 0]], [[1, 0]], 0, "points"),
        ([[0, 0]], [[1, 0, 0]], 0, "normals"),
        ([[0, math.nan]], [[1, 0]], 0, "points"),
        ([[0, 0]], [[0, 0]], 0, "normals"),
        ([[0, 0]], [[1, 0], [0, 1]], 0, "normals"),
        ([[0, 0]], [[1, 0]], -1, "friction"),
        ([[0, 0]], [[1, 0]], "a", "friction"),
        ([[0, 0]], [[1, 0]], [1, 2], "friction"),
        ("x", "y", 0, "points"),
        ([[0, 0], [1]], [[1, 0], [0, 1]], 0, "points"),
        ([[0, 0]], [["a", 0]], 0, "normals"),
        ([[1j, 0]], [[1, 0]], 0, "points"),
    ],
)
def test_wrong_contacts(points: Any, normals: Any, friction: float, named: str) -> None:
    with pytest.raises(ValueError, match=f"^{named}: "):
        rw.force_closure(points, normals, friction)

"""Cones of the interior point method: the scaling, and what products have beyond what is linear."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import sqrtm

from rungwise.contact.solvers.cones import Layout, Scaling, beyond, nesterov_todd


def inside(rng: np.random.Generator, d: int) -> np.ndarray:
    x = rng.normal(size=d)
    x[0] = np.linalg.norm(x[1:]) + rng.uniform(0.05, 2.0)
    return x


def arrow(x: np.ndarray) -> np.ndarray:
    """The matrix that multiplies by x in the algebra of the cone."""
    made = x[0] * np.eye(len(x))
    made[0], made[:, 0] = x, x
    return made


@pytest.mark.parametrize("d", [1, 2, 3])
def test_the_scaling_and_the_bend_of_products(d: int) -> None:
    rng, layout = np.random.default_rng(d), Layout(np.array([0]), np.array([d]), np.zeros(0, np.int64))
    for _ in range(20):
        z, w, dz, dw = inside(rng, d), inside(rng, d), rng.normal(size=d), rng.normal(size=d)
        S, inverse, turn, slip, bend = np.zeros((d, 3)), np.zeros(d), np.zeros(d), np.zeros(d), np.zeros(d)
        nesterov_todd(z, w, 1.0, layout, Scaling(S, inverse, turn, slip))
        np.testing.assert_allclose(S[:, :d] @ z, w, rtol=1e-9)
        np.testing.assert_allclose(arrow(z) @ inverse, np.eye(d)[0], atol=1e-9)
        np.testing.assert_allclose(slip[0], np.linalg.norm(w[1:]))
        W = np.real(sqrtm(S[:, :d]))
        together = W @ z
        np.testing.assert_allclose(np.linalg.solve(W, w), together, rtol=1e-8)
        beyond(z, w, dz, dw, layout, np.empty((4, 3)), bend)
        expected = W @ np.linalg.solve(arrow(together), arrow(W @ dz) @ np.linalg.solve(W, dw))
        np.testing.assert_allclose(bend, expected, rtol=1e-6, atol=1e-9)

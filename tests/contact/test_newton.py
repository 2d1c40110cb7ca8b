"""Newton steps of small problems, against the whole system that they are a part of."""

from __future__ import annotations

import numpy as np
import pytest

from rungwise.contact.prepare.units import Sparse
from rungwise.contact.solvers.newton.reduced import (
    INTS,
    REALS,
    directions,
    factorise_reduced,
    solve_reduced,
)
from rungwise.contact.solvers.polish.refine import jacobian

RHO, KEPT, DAMPING = 0.8, 0.7, 1e-3


def derivative(rng: np.random.Generator, mu: np.ndarray, d: int, others: int) -> np.ndarray:
    """Rows of the projections' derivative where contacts open, stick or slide at random."""
    D = np.zeros((d * len(mu) + others, 3))
    for n, friction in zip(range(0, d * len(mu), d), mu, strict=True):
        mode = rng.choice(["open", "stick", "slide"])
        if mode == "open":
            continue
        D[n, 0] = 1.0
        if mode == "stick":
            D[n + 1 : n + d, 1:d] = np.eye(d - 1)
        elif d == 2:
            D[n + 1, 0] = rng.choice([-friction, friction])
        elif d == 3:
            slip = rng.normal(size=2)
            slip /= np.linalg.norm(slip)
            shrink = rng.uniform(0.01, 0.99) if friction > 0.0 else 0.0
            D[n + 1 : n + 3, 0] = friction * slip
            D[n + 1 : n + 3, 1:] = shrink * (np.eye(2) - np.outer(slip, slip))
    D[d * len(mu) :, 0] = rng.integers(0, 2, others)
    return D


@pytest.mark.long
def test_the_reduced_system_gives_the_step_of_the_whole() -> None:
    rng = np.random.default_rng(0)
    for case in range(400):
        d, mu, others = 1 + case % 3, rng.choice([0.0, 0.5, 2.0], rng.integers(1, 5)), int(rng.integers(0, 4))
        n = d * len(mu) + others
        A, F, D = rng.normal(size=(n, n)), rng.normal(size=n), derivative(rng, mu, d, others)
        whole = np.empty((n, n))
        jacobian(A, D, d * len(mu), d, RHO, KEPT, DAMPING, whole)
        place, u, order = np.empty((n, INTS), np.int64), np.empty((n, REALS)), np.empty(n, np.int64)
        K, scratch, step = np.empty((n, n)), np.empty(n), np.empty(n)
        left = directions(D, mu, d, place, u)
        assert left <= np.count_nonzero(D.any(axis=1))
        place, u = place[:left], u[:left]
        assert factorise_reduced(A, d, place, u, RHO, KEPT, DAMPING, scratch, K, order)
        entries = Sparse(np.arange(0, n * n + 1, n), np.tile(np.arange(n), n), A.ravel())
        solve_reduced(entries, F, d, place, u, RHO, DAMPING, K, order, scratch, step)
        np.testing.assert_allclose(whole @ step, F, atol=1e-10 * max(1.0, np.abs(step).max()))

"""Intervals by weights of trials hold the true values also where few trials say most of them."""

from __future__ import annotations

import numpy as np
import pytest

from rungwise.fitting.certainty import Minimum, _bootstrap, _unpulled
from rungwise.kernel import Reals

TRIALS, ERRORS = 20, 5


def straight(unequal: float, k: int, rng: np.random.Generator) -> Minimum:
    """Least squares of straight lines at true values of 0.5: some trials say far more than others."""
    size = np.exp(unequal * rng.normal(size=(TRIALS, 1, k)))
    rows, noise = size * rng.normal(size=(TRIALS, ERRORS, k)), rng.normal(size=(TRIALS, ERRORS))
    second = np.einsum("mri,mrj->mij", rows, rows)
    pull: Reals = np.einsum("mri,mr->mi", rows, noise)
    found = np.linalg.solve(second.sum(axis=0), pull.sum(axis=0))
    return Minimum(0.5 + found, np.zeros(TRIALS), np.einsum("mij,j->mi", second, found) - pull, second)


@pytest.mark.few(1)
@pytest.mark.parametrize("k", [1, 2])
@pytest.mark.parametrize("unequal", [0.0, 1.2])
def test_intervals_hold_the_true_values_where_few_trials_say_most(unequal: float, k: int) -> None:
    rng = np.random.default_rng(0)
    ends = [_bootstrap([straight(unequal, k, rng)], seed)[0] for seed in range(200)]
    held = np.array([(low <= 0.5) & (high >= 0.5) for low, high in ends])
    assert 0.92 <= held.mean() <= 0.995


def test_degrees_of_freedom_are_those_of_the_trials_that_say_something() -> None:
    second = np.zeros((TRIALS, 1, 1))
    second[:4] = 1.0
    slopes, free = _unpulled(Minimum(np.full(1, 0.5), np.zeros(TRIALS), second[:, 0], second))
    assert free == pytest.approx([3.0], rel=1e-3) and slopes.shape == (TRIALS, 1)
    assert np.ptp(slopes[:4]) == pytest.approx(0.0)
    mean = second[:, 0].mean()
    assert slopes[0, 0] == pytest.approx((1.0 - mean) / np.sqrt(1.0 - 0.25), rel=1e-3)

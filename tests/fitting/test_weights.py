"""What errors weigh, and how sure values are, beside closed forms."""

from __future__ import annotations

import numpy as np
import pytest

import rungwise as rw
from rungwise.deadline import NEVER
from rungwise.fitting.certainty import _bootstrap
from rungwise.fitting.prepare import Options, prepare
from rungwise.fitting.search import EXPECTED, losses
from rungwise.fitting.weights import by_sensitivity, free_flight, unexplained

from .drops import NAMES, PLACE, RATE, SCENE, SPEED, TURN, drops


def test_in_flight_the_error_of_a_start_grows_with_time() -> None:
    """S = R + P + t^2 P_v, and errors of one coordinate at two times share those of the start."""
    motions = drops(2, 6)
    for trial in motions.trials:
        trial.q[:, 1] += 1.0
    one = prepare(SCENE, rw.DYNAMIC_RIGID, motions, ("mu",), None, None, Options(np.inf, 3, None, None, 1, 0))
    runs, none = one.predictor(one.spans(), NEVER), np.zeros(3)
    seen = by_sensitivity(one.layout, runs, np.array([0.3]), none)
    times = runs.spans.since[0]
    own, rate = np.array([PLACE, PLACE, TURN]), np.array([SPEED, SPEED, RATE])
    assert seen.spread[0] == pytest.approx(np.sqrt(2.0 * own**2 + (rate * times[:, None]) ** 2), rel=1e-3)
    assert free_flight(one.layout, runs, none).spread == pytest.approx(seen.spread, rel=1e-3)
    covariance = np.linalg.inv(seen.inverse[0].T @ seen.inverse[0])
    shared = PLACE**2 + SPEED**2 * times[0] * times[2]
    assert covariance[0, 6] == pytest.approx(shared, rel=1e-3)
    assert abs(covariance[0, 1]) < 1e-6 * shared


def test_whitened_errors_of_normal_ones_are_standard() -> None:
    motions = drops(1, 6)
    motions.trials[0].q[:, 1] += 1.0
    one = prepare(SCENE, rw.DYNAMIC_RIGID, motions, ("mu",), None, None, Options(np.inf, 3, None, None, 1, 0))
    runs = one.predictor(one.spans(), NEVER)
    weights = by_sensitivity(one.layout, runs, np.array([0.3]), np.zeros(3))
    factor = np.linalg.inv(weights.inverse[0])
    rng = np.random.default_rng(0)
    errors = (factor @ rng.normal(size=(9, 4000))).T.reshape(4000, 1, 3, 3)
    found = weights.whitened(errors)[:, 0]
    assert np.cov(found.T) == pytest.approx(np.eye(9), abs=0.08)
    assert losses(found[None]) / found.size == pytest.approx(EXPECTED, rel=0.02)


def test_what_a_model_does_not_explain_is_added_by_medians() -> None:
    one = prepare(
        SCENE, rw.DYNAMIC_RIGID, drops(2, 6), ("mu",), None, None, Options(np.inf, 3, None, None, 1, 0)
    )
    runs = one.predictor(one.spans(), NEVER)
    weights = free_flight(one.layout, runs, np.zeros(3))
    errors = 0.6745 * weights.spread * [1.0, 3.0, 1.1]
    extra = unexplained(weights, runs, errors, np.zeros(3))
    typical = np.median(weights.spread[..., 1])
    assert extra == pytest.approx([0.0, np.sqrt(8.0) * typical, 0.0])
    assert one.layout.compared.names == NAMES


@pytest.mark.parametrize("trials", [5, 40])
def test_intervals_of_a_straight_line_are_those_of_students_t(trials: int) -> None:
    """A mean of normal numbers: half the width is t s / sqrt(m)."""
    from scipy.stats import t

    rng, unit = np.random.default_rng(2), np.array([0.5])
    widths, expected = [], []
    for _ in range(40):
        values = rng.normal(size=trials) * 0.05
        whitened, slopes = values[:, None], np.ones((1, trials, 1))
        curvature = np.ones((trials, 1, 1))
        low, high = _bootstrap(slopes, whitened, curvature, np.arange(trials), unit, 0)
        widths.append((high - low)[0])
        expected.append(2.0 * t.ppf(0.975, trials - 1) * values.std(ddof=1) / np.sqrt(trials))
    assert np.mean(widths) == pytest.approx(np.mean(expected), rel=0.12)

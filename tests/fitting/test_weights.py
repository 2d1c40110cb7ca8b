"""What errors weigh, and how sure values are, beside closed forms."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import pytest

import rungwise as rw
from rungwise.deadline import NEVER
from rungwise.fitting.box import Box
from rungwise.fitting.certainty import RARE, Minimum, _bootstrap, minimum
from rungwise.fitting.least_squares import Best, best_of, merged, spread_apart, worse
from rungwise.fitting.loss import EXPECTED, bend, losses, typical_losses
from rungwise.fitting.prepare import Options, prepare
from rungwise.fitting.telling import telling
from rungwise.fitting.weights import Weights, by_sensitivity, free_flight, unexplained

from .drops import NAMES, PLACE, RATE, SCENE, SPEED, TURN, drops


def test_in_flight_the_error_of_a_start_grows_with_time() -> None:
    """S = R + P + t^2 P_v, and errors of one coordinate at two times share those of the start."""
    motions = drops(2, 6)
    for trial in motions.trials:
        trial.q[:, 1] += 1.0
    one = prepare(SCENE, rw.DYNAMIC_RIGID, motions, ("mu",), None, None, Options(np.inf, 3, None, None, 1, 0))
    runs, none = one.predictor(one.spans(), NEVER), np.zeros(3)
    seen = by_sensitivity(one.layout, runs, np.array([0.3]))
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
    weights = by_sensitivity(one.layout, runs, np.array([0.3]))
    factor = np.linalg.inv(weights.inverse[0])
    rng = np.random.default_rng(0)
    errors = (factor @ rng.normal(size=(9, 4000))).T.reshape(4000, 1, 3, 3)
    found = weights.whitened(errors)[:, 0]
    assert np.cov(found.T) == pytest.approx(np.eye(9), abs=0.08)
    assert typical_losses(found).mean() / 9 == pytest.approx(EXPECTED, rel=0.02)


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
        values = rng.normal(size=(trials, 1)) * 0.05
        only = Minimum(unit, 0.5 * values[:, 0] ** 2, values, np.ones((trials, 1, 1)))
        (low, high), shares = _bootstrap([only], 0)
        widths.append((high - low)[0])
        expected.append(2.0 * t.ppf(0.975, trials - 1) * values.std(ddof=1) / np.sqrt(trials))
        assert shares.tolist() == [1.0]
    assert np.mean(widths) == pytest.approx(np.mean(expected), rel=0.12)


@pytest.mark.few(1)
@pytest.mark.parametrize("spread", [0.0, 1.0])
def test_intervals_hold_the_true_value_where_few_trials_say_most(spread: float) -> None:
    """Straight lines, whose trials say equally much, or some of them ten times as much as others."""
    rng, true, within = np.random.default_rng(3), np.array([0.4, 0.6]), []
    for _ in range(150):
        slopes = 30.0 * rng.normal(size=(12, 4, 2)) * np.exp(spread * rng.normal(size=(12, 1, 2)))
        second = np.einsum("mri,mrj->mij", slopes, slopes)
        pull = np.einsum("mri,mr->mi", slopes, rng.normal(size=(12, 4)))
        unit = true + np.linalg.solve(second.sum(axis=0), pull.sum(axis=0))
        first = np.einsum("mij,j->mi", second, unit - true) - pull
        (low, high), _ = _bootstrap([Minimum(unit, np.zeros(12), first, second)], 0)
        within.append((low <= true) & (true <= high))
    assert 0.9 <= np.mean(within) <= 0.99


@pytest.mark.parametrize(("better", "joined"), [(0.0, True), (20.0, False)])
def test_intervals_join_minima_that_trials_do_not_tell_apart(better: float, joined: bool) -> None:
    """Each trial prefers one of two minima by chance, or all prefer the first one by as much."""
    rng, trials = np.random.default_rng(1), 40
    prefers = rng.normal(size=trials)
    prefers += better - prefers.mean()
    first = rng.normal(size=(trials, 1))
    second = np.full((trials, 1, 1), 1e3)
    minima = [
        Minimum(np.array([0.2]), np.zeros(trials), first, second),
        Minimum(np.array([0.7]), prefers, first, second),
    ]
    (low, high), shares = _bootstrap(minima, 0)
    assert low[0] == pytest.approx(0.2, abs=0.01)
    assert high[0] == pytest.approx(0.7 if joined else 0.2, abs=0.01)
    assert shares[1] == pytest.approx(0.5 if joined else 0.0, abs=0.1)


@pytest.mark.parametrize("clear", [1, 2])
def test_a_minimum_that_few_trials_exclude_is_excluded(clear: int) -> None:
    """One or two trials of twenty say clearly that a plain is wrong, and the others nothing: a draw that left
    these out would find it as good, and its interval would be the whole box."""
    rng = np.random.default_rng(0)
    depth = np.zeros(20)
    depth[:clear] = 150.0
    first, second = rng.normal(size=(20, 1)), np.full((20, 1, 1), 1e3)
    minima = [
        Minimum(np.array([0.3]), np.zeros(20), first, second),
        Minimum(np.array([1.0]), depth, 0.1 * first, np.full((20, 1, 1), 1e-4)),
    ]
    (low, high), shares = _bootstrap(minima, 0)
    assert shares[1] < RARE
    assert low[0] > 0.28 and high[0] < 0.32


class _Rough:
    """Runs whose errors are (unit - 0.5) / 0.3 + noise of trials, and waves of a part of the noise."""

    def __init__(self, seed: int, wave: float) -> None:
        rng = np.random.default_rng(seed)
        self.noise, self.phase = rng.normal(size=60), rng.uniform(0.0, 2.0 * np.pi, 60)
        self.wave, self.spans = wave, drops_of(60)

    def __call__(self, points: np.ndarray) -> _Errors:
        waves = self.wave * np.sin(points * 2.0 * np.pi / 0.006 + self.phase)
        return _Errors(((points - 0.5) / 0.3 + self.noise + waves)[:, :, None, None])


class _Errors(NamedTuple):
    errors: np.ndarray


class _Spans(NamedTuple):
    trial: np.ndarray


def drops_of(trials: int) -> _Spans:
    return _Spans(np.arange(trials))


@pytest.mark.few(1)
@pytest.mark.parametrize("wave", [0.0, 0.3])
def test_rough_runs_do_not_make_values_seem_sure(wave: float) -> None:
    """Waves finer than the value is known give slopes without meaning; intervals hold the truth as often."""
    box = Box(("a",), np.zeros(1), np.ones(1), np.zeros(1, bool))
    weights = Weights(np.ones((60, 1, 1)), np.ones((60, 1, 1)), np.zeros(1), np.ones(60))
    within = []
    for seed in range(60):
        runs: Any = _Rough(seed, wave)
        best = best_of(runs, box, weights, np.linspace(0.3, 0.7, 801)[:, None])
        (low, high), _ = _bootstrap([minimum(runs, box, weights, best)], 0)
        within.append(low[0] <= 0.5 <= high[0])
    assert np.mean(within) >= 0.9


def test_derivatives_of_the_loss_are_its_differences() -> None:
    """The first ones exactly; and spans whose errors are far greater than expected hardly count."""
    rng, step = np.random.default_rng(3), 1e-6
    errors, slope, free = rng.normal(size=(6, 4)), rng.normal(size=(2, 6, 4)), np.full(6, 4.0)
    errors[0] *= 1e3
    first, second = bend(slope, errors, free)
    for k in range(2):
        sides = [losses((errors + sign * step * slope[k])[None], free)[0] for sign in (1.0, -1.0)]
        assert first[:, k].sum() == pytest.approx((sides[0] - sides[1]) / (4.0 * step), rel=1e-5)
    assert np.abs(second[0]).max() < 1e-3 * np.abs(second[1:]).max()


def test_minima_of_one_valley_are_one_and_beginnings_are_apart() -> None:
    curvature, none = np.diag([1e4, 0.0]), np.zeros((3, 2))
    places = [(0.5, 0.5), (0.51, 0.9), (0.6, 0.5), (0.5, 0.1)]
    found = [Best(np.array(place), float(i), none) for i, place in enumerate(places)]
    assert [each.loss for each in merged(found[::-1], curvature)] == [0.0, 2.0]
    assert spread_apart(np.array(places), np.array([3.0, 2.0, 0.0, 1.0]), 3, 0.2).tolist() == [2, 3, 1]


def test_a_minimum_is_worse_where_all_spans_say_so() -> None:
    free, here = np.full(50, 2.0), np.zeros((50, 2))
    by_chance = here.copy()
    by_chance[:3] = 9.0
    everywhere = here + 0.3
    best = Best(np.zeros(1), 0.0, here)
    assert not worse(Best(np.zeros(1), 0.0, by_chance), best, free)
    assert worse(Best(np.zeros(1), 0.0, everywhere), best, free)


@pytest.mark.parametrize("seed", range(6))
def test_friction_that_holds_over_most_of_its_range_is_read(seed: int) -> None:
    """A square that falls flat, and hardly sideways, sticks at all friction but the least."""
    start, times = np.array([[0.0, 0.0305, 0.0, 0.05, -1.2, 0.0]] * 2), 0.004 * np.arange(4)
    after = rw.rollout(SCENE, "dynamic-rigid", start, durations=np.full((2, 3), 0.004), threads=1)
    q, v = (np.concatenate([start[:, None, k : k + 3], x], axis=1) for k, x in ((0, after.q), (3, after.v)))
    motions, options = rw.Motions(NAMES, times, q, v), Options(np.inf, 3, None, None, 1, seed)
    one = prepare(SCENE, rw.DYNAMIC_RIGID, motions, ("mu", "e"), None, None, options)
    runs = one.predictor(one.spans(), NEVER)
    assert telling(runs, one.layout, one.box, seed).read.all()


@pytest.mark.few(1)
@pytest.mark.parametrize("seed", range(4))
def test_a_search_leaves_a_plain_on_which_friction_decides_nothing(seed: int) -> None:
    scene = SCENE | {"parameters": SCENE["parameters"] | {"mu": {"default": 1.0, "range": [0.0, 1.0]}}}
    fit = rw.fit(scene, "dynamic-rigid", drops(8, 12, seed=seed, mu=0.12), ("mu", "e"), seed=seed)
    low, high = fit.intervals["mu"]
    assert low <= 0.12 <= high < 0.3 and fit.values["mu"] == pytest.approx(0.12, abs=0.05)

"""How well motions determine parameters: intervals, correlations, and what they leave open.

Trials, not frames, are drawn anew by the bootstrap: errors within a trial are not independent. Each draw
takes one step of Newton's method from the values found (the score bootstrap, Kline and Santos 2012), so that
a thousand draws cost no run; intervals are those of percentiles, widened for few trials as Student's are
(Hesterberg 2015). What is not determined is read from the curvature of the loss beside that of knowing no
more than the box, and from slices through it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rungwise.fitting.box import Box
from rungwise.fitting.predict import Predictor
from rungwise.fitting.search import slopes, trial_losses
from rungwise.fitting.weights import Weights
from rungwise.kernel import Ints, Reals

DRAWS = 2000
CONFIDENCE = 0.95
BOX_PRECISION = 12.0
"""Precision of a number drawn evenly from 0..1."""
OPEN = 0.5
"""A parameter is open where its deviation is more than this part of that of a number drawn from its box."""
SHARED = 0.3
"""Parts of a unit direction below this are not named."""
NARROW, BROAD = 2e-3, 5e-2
"""Steps of differences at the end: as wide as the deviation found, within these parts of the box."""
SLICE = 9
"""Values of each parameter at which the loss is looked at, over its whole interval."""
CLEARLY = 2.0
"""Deviations of the mean difference of trials beyond which a loss is worse."""


class Certainty(NamedTuple):
    """lower, upper (k,): ends of 95 % intervals of the parameters; explains (k, 2): the interval of values
    that explain the motions as well, others being as found; correlation (k, k); deviation (k,): of each, as a
    part of the box; open_: what is not determined, by name or names joined by " and ", with a line on it."""

    lower: Reals
    upper: Reals
    explains: Reals
    correlation: Reals
    deviation: Reals
    open_: dict[str, str]


def certainty(
    predictor: Predictor, box: Box, weights: Weights, unit: Reals, seed: int
) -> Certainty:  # fmt: skip
    """What the motions say about the parameters at the best place (k,) of the cube."""
    trial = predictor.spans.trial
    steps = np.full(len(unit), 1e-2)
    for _ in range(2):
        whitened = weights.whitened(predictor(box.values(unit[None])).errors)[0]
        slope = slopes(predictor, box, weights, unit, steps)
        curvature = _curvature(slope, whitened)
        covariance = np.linalg.inv(curvature.sum(axis=0) + BOX_PRECISION * np.eye(len(unit)))
        steps = np.clip(np.sqrt(np.diag(covariance)), NARROW, BROAD)
    drawn = _bootstrap(slope, whitened, curvature, trial, unit, seed)
    deviation = np.sqrt(np.diag(covariance))
    explains = _explains(predictor, box, weights, unit)
    open_ = _open(box, curvature.sum(axis=0), covariance, explains)
    low, high = box.values(np.clip(drawn, 0.0, 1.0))
    for k, name in enumerate(box.names):
        if any(name in each.split(" and ") for each in open_):
            low[k], high[k] = min(low[k], explains[k, 0]), max(high[k], explains[k, 1])
    scale = np.sqrt(np.outer(np.diag(covariance), np.diag(covariance)))
    return Certainty(low, high, explains, covariance / scale, deviation, open_)


def _curvature(slope: Reals, whitened: Reals) -> Reals:
    """Second derivatives (s, k, k) of half the loss of each span (Gauss and Newton)."""
    weight = (1.0 + whitened**2) ** -1.5
    return np.asarray(np.einsum("ksd,lsd,sd->skl", slope, slope, weight))


def _bootstrap(
    slope: Reals, whitened: Reals, curvature: Reals, trial: Ints, unit: Reals, seed: int
) -> Reals:  # fmt: skip
    """Ends (2, k) of intervals in the cube."""
    from scipy.stats import norm, t

    names, of_trial = np.unique(trial, return_inverse=True)
    m, k = len(names), len(unit)
    gradient, bend = np.zeros((m, k)), np.zeros((m, k, k))
    score = np.einsum("ksd,sd->sk", slope, whitened / np.sqrt(1.0 + whitened**2))
    np.add.at(gradient, of_trial, score)
    np.add.at(bend, of_trial, curvature)
    if m < 2:
        return np.array([np.zeros(k), np.ones(k)])
    gradient -= gradient.mean(axis=0)
    rng = np.random.default_rng(seed)
    counts = rng.multinomial(m, np.full(m, 1.0 / m), size=DRAWS)
    total = np.einsum("bm,mkl->bkl", counts, bend) + 1e-6 * BOX_PRECISION * np.eye(k)
    moved = unit - np.linalg.solve(total, (counts @ gradient)[..., None])[..., 0]
    wider = np.sqrt(m / (m - 1.0)) * t.ppf(0.5 + CONFIDENCE / 2.0, m - 1) / norm.ppf(0.5 + CONFIDENCE / 2.0)
    ends = np.quantile(moved, [0.5 - CONFIDENCE / 2.0, 0.5 + CONFIDENCE / 2.0], axis=0)
    return np.asarray(unit + wider * (ends - unit))


def _explains(predictor: Predictor, box: Box, weights: Weights, unit: Reals) -> Reals:
    """Intervals (k, 2) of values that explain the motions as well as those found."""
    k, grid = len(unit), np.linspace(0.0, 1.0, SLICE)
    points = np.tile(unit, (1 + k * SLICE, 1))
    for j in range(k):
        points[1 + j * SLICE : 1 + (j + 1) * SLICE, j] = grid
    loss = trial_losses(weights.whitened(predictor(box.values(points)).errors))
    worse = loss[1:] - loss[0]
    trials = np.unique(predictor.spans.trial)
    by_trial = np.stack([worse[:, predictor.spans.trial == each].sum(axis=1) for each in trials], axis=1)
    mean = by_trial.mean(axis=1)
    error = by_trial.std(axis=1, ddof=min(1, len(trials) - 1)) / np.sqrt(len(trials))
    alike = (mean <= CLEARLY * error + 1.0 / len(trials)).reshape(k, SLICE)
    found = np.tile(unit[:, None], 2)
    for j in range(k):
        at = int(np.abs(grid - unit[j]).argmin())
        for end, way in ((0, -1), (1, 1)):
            i = at
            while 0 <= i < SLICE and (alike[j, i] or i == at):
                found[j, end] = (min, max)[end](found[j, end], grid[i]) if alike[j, i] else found[j, end]
                i += way
    return np.stack([box.values(found[:, 0]), box.values(found[:, 1])], axis=1)


def _open(box: Box, curvature: Reals, covariance: Reals, explains: Reals) -> dict[str, str]:
    """What the motions do not determine, alone and together."""
    even = 1.0 / np.sqrt(BOX_PRECISION)
    found, alone = dict[str, str](), set[int]()
    for k, name in enumerate(box.names):
        own = 1.0 / np.sqrt(curvature[k, k] + BOX_PRECISION)
        reach = np.ptp(box.unit(np.stack([explains[:, 0], explains[:, 1]]))[:, k])
        low, high = explains[k]
        if own > OPEN * even or reach >= OPEN:
            alone.add(k)
            whole = reach > 0.99
            between = "over its whole interval" if whole else f"from {low:.4g} to {high:.4g}"
            found[name] = f"{between} the runs explain the motions alike"
    values, vectors = np.linalg.eigh(covariance)
    for variance, direction in zip(values, vectors.T, strict=True):
        if np.sqrt(variance) > OPEN * even:
            shared = [k for k in np.flatnonzero(np.abs(direction) > SHARED) if k not in alone]
            if len(shared) > 1:
                names = " and ".join(box.names[k] for k in shared)
                found[names] = "only a combination of them is determined"
    return found

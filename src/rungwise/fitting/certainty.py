"""How well motions determine parameters: intervals, correlations, and what they leave open.

Trials, not frames, are weighted anew by the bootstrap: errors within a trial are not independent. Weights are
those of Rubin's (1981), which leave no trial out: of twenty trials one or two alone may say that a minimum is
the wrong one, and one draw in eight lacks both. In each draw the loss about each of its minima is a parabola
by the derivatives there, as the score bootstrap has it (Kline and Santos 2012), and the values are those of
the deepest one: intervals join minima that the motions cannot tell apart, and a thousand draws cost no run.
A trial that says much of a value has pulled it to itself, and little of its slope is left there: slopes are
divided by the root of what is left (CR2 of Bell and McCaffrey 2002), or where few trials say most, intervals
would be too narrow. They are those of percentiles, widened for few trials as Student's are (Hesterberg 2015),
with as many degrees of freedom as trials that say much (Imbens and Kolesar 2016). What is not
determined is read from the curvature of the loss beside that of knowing no more than the box, and from
slices.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from rungwise.fitting.box import Box
from rungwise.fitting.least_squares import BOX_PRECISION, BROAD, NARROW, SLICE, Best, derivatives, slices
from rungwise.fitting.loss import by_trial, span_losses
from rungwise.fitting.predict import Predictor
from rungwise.fitting.weights import Weights
from rungwise.kernel import Ints, Reals

DRAWS = 2000
CONFIDENCE = 0.95
OPEN = 0.5
"""A parameter is open where its deviation is more than this part of that of a number drawn from its box."""
WIDENED, WIDER, LEAST_BENT = 4, 1.3, 0.04
"""Times that derivatives are found anew at most, by steps as wide as the values are sure; by what factor
these are wider each time; and the least part to which second derivatives fall at each."""
ALONE = 0.05
"""Least part of what all trials say of a value that is taken to come from the others than one of them."""
SHARED = 0.3
"""Parts of a unit direction below this are not named."""
CLEARLY = 2.0
"""Deviations of the mean difference of trials beyond which a loss is worse."""
RARE = 2.5e-2
"""Part of the draws in which another minimum is the deepest, from which on its values fit alike."""


class Minimum(NamedTuple):
    """One minimum of the loss: its place (k,) in the cube, halves of losses of the trials (m,), their first
    (m, k) and second derivatives (m, k, k)."""

    unit: Reals
    half: Reals
    first: Reals
    second: Reals


class Certainty(NamedTuple):
    """lower, upper (k,): ends of 95 % intervals of the parameters; explains (k, 2): the interval of values
    that explain the motions as well, others being as found; correlation (k, k); open_: what is not
    determined, by name or names joined by " and ", with a line on it; alike (n, k), shares (n,): minima that
    the motions do not tell apart, and the part of the draws in which each is the deepest."""

    lower: Reals
    upper: Reals
    explains: Reals
    correlation: Reals
    open_: dict[str, str]
    alike: Reals
    shares: Reals


def certainty(
    predictor: Predictor, box: Box, weights: Weights, found: Sequence[Best], seed: int, some: Ints
) -> Certainty:  # fmt: skip
    """What the motions say about the parameters, by the minima of the loss, the best first; what is open, by
    some of the spans."""
    minima = [minimum(predictor, box, weights, each) for each in found]
    total = minima[0].second.sum(axis=0)
    covariance = np.linalg.inv(total + BOX_PRECISION * np.eye(len(total)))
    drawn, shares = _bootstrap(minima, seed)
    all_ = len(some) == len(predictor.spans.trial)
    fewer = predictor if all_ else predictor.on(predictor.spans.take(some))
    explains = _explains(fewer, box, weights.take(some), minima[0].unit)
    open_ = _open(box, total, covariance, explains)
    low, high = box.values(np.clip(drawn, 0.0, 1.0))
    for k, name in enumerate(box.names):
        if any(name in each.split(" and ") for each in open_):
            low[k], high[k] = min(low[k], explains[k, 0]), max(high[k], explains[k, 1])
    scale = np.sqrt(np.outer(np.diag(covariance), np.diag(covariance)))
    kept = np.argsort(-shares, kind="stable")[: int((shares >= RARE).sum())]
    places = box.values(np.array([minima[i].unit for i in kept]))
    return Certainty(low, high, explains, covariance / scale, open_, places, shares[kept])


def minimum(predictor: Predictor, box: Box, weights: Weights, best: Best) -> Minimum:
    """A minimum of the loss of trials.

    Its derivatives are those of the loss itself, over steps as wide as the values are sure, once and twice:
    where runs are rough, the slopes of errors are too great, the minimum lies in a dip, and by either of them
    values would seem too sure."""
    _, *bent = derivatives(predictor, box, weights, best)
    half = 0.5 * span_losses(best.whitened, weights.free)
    found = Minimum(best.unit, *(by_trial(predictor.spans.trial, each) for each in (half, *bent)))
    before = np.zeros(len(best.unit))
    for _ in range(WIDENED):
        steps = np.clip(_sure(found), NARROW, BROAD)
        if (steps < WIDER * before).all():
            break
        before = steps
        inside = (best.unit >= 2.0 * steps) & (best.unit <= 1.0 - 2.0 * steps)
        if not inside.any():
            break
        near, far = (_halves(predictor, box, weights, best.unit, x * steps) for x in (1.0, 2.0))
        curvature = (far.sum(axis=0) - near.sum(axis=0)).sum(axis=1) / (3.0 * steps**2)
        own = np.maximum(np.diag(found.second.sum(axis=0)), 1e-6 * BOX_PRECISION)
        less = inside & (curvature < own)
        scale = np.where(less, np.sqrt(np.maximum(curvature / own, LEAST_BENT)), 1.0)
        slope = ((near[0] - near[1]) + 2.0 * (far[0] - far[1])) / (10.0 * steps[:, None])
        first = np.where(less, slope.T, found.first)
        found = found._replace(first=first, second=found.second * np.outer(scale, scale))
    return found


def _halves(predictor: Predictor, box: Box, weights: Weights, unit: Reals, steps: Reals) -> Reals:
    """Halves of the losses of trials (2, k, m) at steps (k,) up and down along each parameter."""
    rows = np.vstack([unit + np.diag(steps), unit - np.diag(steps)])
    errors = weights.whitened(predictor(box.values(np.clip(rows, 0.0, 1.0))).errors)
    half = by_trial(predictor.spans.trial, 0.5 * span_losses(errors, weights.free).T).T
    return np.asarray(half.reshape(2, len(unit), -1))


def _sure(found: Minimum) -> Reals:
    """Deviations (k,) of the values in the cube, by how much trials differ in their first derivatives."""
    m, k = found.first.shape
    inverse = np.linalg.inv(found.second.sum(axis=0) + BOX_PRECISION * np.eye(k))
    apart = found.first - found.first.mean(axis=0)
    spread = apart.T @ apart * (m / max(m - 1.0, 1.0))
    return np.asarray(np.sqrt(np.diag(inverse @ spread @ inverse)))


def _bootstrap(minima: Sequence[Minimum], seed: int) -> tuple[Reals, Reals]:
    """Ends (2, k) of intervals in the cube, and how often each minimum is the deepest (n,)."""
    from scipy.stats import norm, t

    m, k = minima[0].first.shape
    if m < 2:
        return np.array([np.zeros(k), np.ones(k)]), np.eye(len(minima))[0]
    counts = m * np.random.default_rng(seed).dirichlet(np.ones(m), size=DRAWS)
    end = 0.5 + CONFIDENCE / 2.0
    places, depths = [], []
    for number, each in enumerate(minima):
        slopes, free = _unpulled(each)
        wider = np.sqrt((m + 1.0) / m) * t.ppf(end, free) / norm.ppf(end)
        first = counts @ slopes
        known = BOX_PRECISION if number else 1e-6 * BOX_PRECISION  # the parabola of a plain reaches far
        second = np.tensordot(counts, each.second, 1) + known * np.eye(k)
        step = np.linalg.solve(second, first[..., None])[..., 0]
        places.append(each.unit - wider * step)
        depths.append(counts @ each.half - 0.5 * (first * step).sum(axis=1))
    deepest = np.argmin(depths, axis=0)
    drawn = np.array(places)[deepest, np.arange(DRAWS)]
    ends = np.quantile(drawn, [0.5 - CONFIDENCE / 2.0, 0.5 + CONFIDENCE / 2.0], axis=0)
    return np.asarray(ends), np.bincount(deepest, minlength=len(minima)) / DRAWS


def _unpulled(found: Minimum) -> tuple[Reals, Reals]:
    """First derivatives of trials (m, k) as large as if no trial had pulled the values to itself, and degrees
    of freedom (k,): one less than the trials by which each value is known, were all to say the same."""
    total = found.second.sum(axis=0) + 1e-6 * BOX_PRECISION * np.eye(found.second.shape[1])
    values, vectors = np.linalg.eigh(total)
    root, inverse = ((vectors * values**power) @ vectors.T for power in (0.5, -0.5))
    said = inverse @ found.second @ inverse
    shares, own = np.linalg.eigh(said)
    apart = (found.first - found.first.mean(axis=0)) @ inverse
    along = np.einsum("mij,mi->mj", own, apart) / np.sqrt(np.maximum(1.0 - shares, ALONE))
    ways = inverse / np.linalg.norm(inverse, axis=0)
    parts = np.einsum("ik,mij,jk->mk", ways, said, ways)
    free = np.maximum(1.0 / np.maximum((parts**2).sum(axis=0), 1e-300) - 1.0, 1.0)
    return np.einsum("mij,mj->mi", own, along) @ root, np.minimum(free, len(parts) - 1.0)


def _explains(predictor: Predictor, box: Box, weights: Weights, unit: Reals) -> Reals:
    """Intervals (k, 2) of values that explain the motions as well as those found."""
    k, grid = len(unit), np.linspace(0.0, 1.0, SLICE)
    points = np.vstack([unit, slices(unit)])
    loss = span_losses(weights.whitened(predictor(box.values(points)).errors), weights.free)
    apart = by_trial(predictor.spans.trial, (loss[1:] - loss[0]).T).T
    m = apart.shape[1]
    mean = apart.mean(axis=1)
    error = apart.std(axis=1, ddof=min(1, m - 1)) / np.sqrt(m)
    alike = (mean <= CLEARLY * error + 1.0 / m).reshape(k, SLICE)
    found = np.tile(unit[:, None], 2)
    for j in range(k):
        at = int(np.abs(grid - unit[j]).argmin())
        for end, way in ((0, -1), (1, 1)):
            i = at
            while 0 <= i < SLICE and (alike[j, i] or i == at):
                found[j, end] = (min, max)[end](found[j, end], grid[i]) if alike[j, i] else found[j, end]
                i += way
    return np.stack([box.values(found[:, 0]), box.values(found[:, 1])], axis=1)


def _open(box: Box, curvature: Reals, covariance: Any, explains: Reals) -> dict[str, str]:
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

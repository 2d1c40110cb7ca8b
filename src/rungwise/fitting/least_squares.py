"""The parameters of least loss: samples of the whole box, then least squares from the best.

Samples are Sobol's (scipy.stats.qmc), which leave no part of the box out. Least squares are Levenberg and
Marquardt's with weights by the loss of Student's t (`loss`), by central differences over steps as wide as
what the motions leave open, for below that runs through impacts are rough. All candidates of a round, and
steps damped in several ways, are run in one call.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from rungwise.fitting.box import Box
from rungwise.fitting.loss import bend, losses, span_losses
from rungwise.fitting.predict import Predictor
from rungwise.fitting.weights import Weights
from rungwise.kernel import Ints, Reals

SAMPLES, STARTS, ROUNDS = 32, 4, 4
"""Samples for each parameter, of which so many begin a search by least squares, of so many rounds at most."""
APART = 0.1
"""Such beginnings are farther from each other than this part of the box."""
WIDE = 1e-2
"""Steps of the first differences, as parts of the box."""
NARROW, BROAD = 2e-3, 0.1
"""Steps of differences later on: as wide as the deviation found, within these parts of the box."""
ROUGH = 0.7
"""Where over steps twice as wide the loss bends less than this part, it was its roughness that was seen."""
SETTLED, LESS = 1e-4, 5e-2
"""A search ends where its step is less than this part of the box, or the loss falls by less than this."""
DAMPING = (0.0, 0.2, 2.0, 20.0)
"""Parts of the second derivatives that are added to them in the steps that are tried."""
FARTHER = (2.0, 4.0)
"""Multiples of the undamped step that are tried, too: derivatives of rough runs are too great."""
VALLEY = 5.0
"""Minima within so many deviations are one: a flat direction has ends anywhere, and a rough one several."""
CHANCE = 4.0
"""Deviations of the difference of spans beyond which a minimum is worse than another by more than chance."""
SLICE = 9
"""Values of each parameter at which the loss is looked at, over its whole interval."""
BOX_PRECISION = 12.0
"""Precision of a number drawn evenly from 0..1."""


class Best(NamedTuple):
    """A place (k,) of the unit cube, its loss, and whitened errors (s, d)."""

    unit: Reals
    loss: float
    whitened: Reals


def samples(box: Box, seed: int, start: Reals) -> Reals:
    """Places (p, k) of the cube to begin with, the first one given."""
    from scipy.stats import qmc

    k = len(box.names)
    exponent = int(np.ceil(np.log2(SAMPLES * k)))
    drawn = qmc.Sobol(k, seed=seed).random_base2(exponent)
    return np.vstack([start, drawn])


def spread_apart(places: Reals, loss: Reals, most: int = STARTS, apart: float = APART) -> Ints:
    """Of places (p, k) so many at most, by their loss (p,), none of them near a better one."""
    found: list[int] = []
    for i in np.argsort(loss, kind="stable").tolist():
        if all(np.abs(places[i] - places[j]).max() > apart for j in found):
            found.append(i)
    return np.array(found[:most], np.int64)


def slopes(predictor: Predictor, box: Box, weights: Weights, unit: Reals, steps: Reals) -> Reals:
    """Derivatives (k, s, d) of whitened errors at a place (k,), by central differences of steps (k,)."""
    k = len(unit)
    up, down = np.minimum(unit + np.diag(steps), 1.0), np.maximum(unit - np.diag(steps), 0.0)
    found = weights.whitened(predictor(box.values(np.vstack([up, down]))).errors)
    width = np.diag(up - down)
    return np.asarray((found[:k] - found[k:]) / width[:, None, None])


def slices(unit: Reals) -> Reals:
    """Places (k SLICE, k) of the cube on lines through one (k,), along each parameter."""
    k = len(unit)
    found = np.tile(unit, (k, SLICE, 1))
    found[np.arange(k), :, np.arange(k)] = np.linspace(0.0, 1.0, SLICE)
    return np.asarray(found.reshape(k * SLICE, k))


def deviations(curvature: Reals) -> Reals:
    """Deviations (k,) of the parameters in the cube, by second derivatives (k, k) of half the loss."""
    return np.sqrt(np.diag(np.linalg.inv(curvature + BOX_PRECISION * np.eye(len(curvature)))))


def descend(
    predictor: Predictor, box: Box, weights: Weights, unit: Reals, rounds: int = ROUNDS,
    told: Callable[[Best], None] | None = None,
) -> Best:  # fmt: skip
    """Least squares from a place of the cube, within it."""
    best = best_of(predictor, box, weights, unit[None])
    if told is not None:
        told(best)
    steps = np.full(len(unit), WIDE)
    for _ in range(rounds):
        slope = slopes(predictor, box, weights, best.unit, steps)
        first, second = (each.sum(axis=0) for each in bend(slope, best.whitened, weights.free))
        steps = np.clip(deviations(second), NARROW, BROAD)
        tried = _steps(best.unit, first, second)
        if not len(tried):
            break
        found = best_of(predictor, box, weights, tried)
        gained, moved = best.loss - found.loss, np.abs(found.unit - best.unit).max()
        if gained > 0.0:
            best = found
            if told is not None:
                told(best)
        if gained < LESS or moved < SETTLED:
            break
    return best


def best_of(predictor: Predictor, box: Box, weights: Weights, places: Reals) -> Best:
    """The best of places (p, k)."""
    whitened = weights.whitened(predictor(box.values(places)).errors)
    loss = losses(whitened, weights.free)
    i = int(loss.argmin())
    return Best(places[i].copy(), float(loss[i]), whitened[i])


def _steps(unit: Reals, first: Reals, second: Reals) -> Reals:
    """Places (p, k) of the cube to try from one, by derivatives of half the loss."""
    free = ~(((unit <= 0.0) & (first > 0.0)) | ((unit >= 1.0) & (first < 0.0)))
    own = second[np.ix_(free, free)]
    if not free.any():
        return np.zeros((0, len(unit)))
    found = np.tile(unit, (len(DAMPING) + len(FARTHER), 1))
    for i, damping in enumerate(DAMPING):
        bent = own + np.diag(damping * np.diag(own) + 1e-6 * BOX_PRECISION)
        found[i, free] -= np.linalg.solve(bent, first[free])
    found[len(DAMPING) :] += np.array(FARTHER)[:, None] * (found[DAMPING.index(0.0)] - unit)
    return np.asarray(np.unique(np.clip(found, 0.0, 1.0), axis=0))


def derivatives(
    predictor: Predictor, box: Box, weights: Weights, best: Best
) -> tuple[Reals, Reals, Reals]:  # fmt: skip
    """Derivatives (k, s, d) of whitened errors at a place, and those of half the loss of each span (`bend`).

    Steps are as wide as what the motions leave open, and wider while the loss seems to bend less over wider
    ones: through impacts it has dips below a certain width, which say how rough runs are and not how sure a
    value is."""
    steps = np.full(len(best.unit), WIDE)
    slope = slopes(predictor, box, weights, best.unit, steps)
    bent = bend(slope, best.whitened, weights.free)
    own = np.clip(deviations(bent[1].sum(axis=0)), NARROW, BROAD)
    if (np.abs(np.log(own / steps)) > np.log(2.0)).any():
        steps = own
        slope = slopes(predictor, box, weights, best.unit, steps)
        bent = bend(slope, best.whitened, weights.free)
    while (steps < BROAD).any():
        wider = np.minimum(2.0 * steps, BROAD)
        tried = slopes(predictor, box, weights, best.unit, wider)
        flatter = bend(tried, best.whitened, weights.free)[1].sum(axis=0)
        less = (np.diag(flatter) < ROUGH * np.diag(bent[1].sum(axis=0))) & (steps < BROAD)
        if not less.any():
            break
        steps = np.where(less, wider, steps)
        slope = np.where(less[:, None, None], tried, slope)
        bent = bend(slope, best.whitened, weights.free)
    return slope, *bent


def merged(found: Sequence[Best], curvature: Reals) -> list[Best]:
    """Minima by their loss, and one alone of such as lie in the same valley: within `VALLEY` deviations by
    second derivatives (k, k) of half the loss."""
    kept: list[Best] = []
    bent = curvature + BOX_PRECISION * np.eye(len(curvature))
    for each in sorted(found, key=lambda best: best.loss):
        ways = [each.unit - other.unit for other in kept]
        if all(way @ bent @ way > VALLEY**2 for way in ways):
            kept.append(each)
    return kept


def worse(a: Best, b: Best, free: Reals) -> bool:
    """Whether one minimum is worse than another by more than spans differ by chance."""
    apart = span_losses(a.whitened, free) - span_losses(b.whitened, free)
    return bool(apart.sum() > CHANCE * np.linalg.norm(apart))

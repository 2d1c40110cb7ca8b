"""The parameters of least loss: samples of the whole box, then least squares from the best.

Samples are Sobol's (scipy.stats.qmc), which leave no part of the box out; least squares is scipy's, with the
robust loss 2 (sqrt(1 + z^2) - 1) ("soft_l1"), by central differences over steps as wide as the errors of
starts make runs rough. All candidates of a round are run in one call.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from rungwise.fitting.box import Box
from rungwise.fitting.predict import Predictor
from rungwise.fitting.weights import Weights
from rungwise.kernel import Reals

SAMPLES, STARTS, ROUNDS = 32, 2, 8
"""Samples for each parameter, of which so many begin a search by least squares, of so many rounds at most."""
WIDE = 1e-2
"""Steps of differences, as parts of the box: below them runs through impacts are rough."""
SETTLED = 1e-4
"""A search ends where its step is less than this part of the box."""


EXPECTED = 0.7099
"""Mean of the loss of a standard normal number."""


class Best(NamedTuple):
    """A place (k,) of the unit cube, its loss, and whitened errors (s, d)."""

    unit: Reals
    loss: float
    whitened: Reals


def losses(whitened: Reals) -> Reals:
    """The robust loss (p,) of whitened errors (p, s, d)."""
    return np.asarray(2.0 * (np.sqrt(1.0 + whitened**2) - 1.0).sum(axis=(1, 2)))


def trial_losses(whitened: Reals) -> Reals:
    """The robust loss (p, s) of each span."""
    return np.asarray(2.0 * (np.sqrt(1.0 + whitened**2) - 1.0).sum(axis=2))


def samples(box: Box, seed: int, start: Reals) -> Reals:
    """Places (p, k) of the cube to begin with, the first one given."""
    from scipy.stats import qmc

    k = len(box.names)
    exponent = int(np.ceil(np.log2(SAMPLES * k)))
    drawn = qmc.Sobol(k, seed=seed).random_base2(exponent)
    return np.vstack([start, drawn])


def slopes(predictor: Predictor, box: Box, weights: Weights, unit: Reals, steps: Reals) -> Reals:
    """Derivatives (k, s, d) of whitened errors at a place (k,), by central differences of steps (k,)."""
    k = len(unit)
    up, down = np.minimum(unit + np.diag(steps), 1.0), np.maximum(unit - np.diag(steps), 0.0)
    found = weights.whitened(predictor(box.values(np.vstack([up, down]))).errors)
    width = np.diag(up - down)
    return np.asarray((found[:k] - found[k:]) / width[:, None, None])


def descend(
    predictor: Predictor, box: Box, weights: Weights, unit: Reals, rounds: int = ROUNDS,
    told: Callable[[Best], None] | None = None,
) -> Best:  # fmt: skip
    """Least squares from a place of the cube, within it."""
    from scipy.optimize import least_squares

    best = [Best(unit, np.inf, np.zeros((0, 0)))]

    def errors(at: Reals) -> Reals:
        whitened = weights.whitened(predictor(box.values(at[None])).errors)
        loss = float(losses(whitened)[0])
        if loss < best[0].loss:
            best[0] = Best(at.copy(), loss, whitened[0])
            if told is not None:
                told(best[0])
        return np.asarray(whitened.reshape(-1))

    def jacobian(at: Reals) -> Reals:
        found = slopes(predictor, box, weights, at, np.full(len(at), WIDE))
        return np.asarray(found.reshape(len(at), -1).T)

    inside = np.clip(unit, SETTLED, 1.0 - SETTLED)
    least_squares(
        errors, inside, jacobian, bounds=(0.0, 1.0), loss="soft_l1", xtol=SETTLED, ftol=SETTLED,
        gtol=1e-12, max_nfev=rounds,
    )  # fmt: skip
    return best[0]

"""What an error of a prediction weighs: by the deviation of the measurement, and by that of the start.

A run begins at a measured state, which is off by the measurement's deviation; where that is amplified, by
impacts above all, later errors say little. To first order errors r of a span are normal with the covariance

    S = R + J P J^T

R: deviations of the measured places, P: those of the start, J: what a change of the start changes. Starts are
thereby unknowns that are integrated out, as multiple shooting with uncertain starts does it (Bock 1987): the
whitened errors L^-1 r, with L L^T = S, are what is left when the most probable start of each span is taken.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rungwise.fitting.measured.layout import Layout
from rungwise.fitting.predict import Predictor
from rungwise.kernel import Ints, Reals

NORMAL_MEDIAN = 0.6745
"""Median of the absolute value of a standard normal number."""


class Weights(NamedTuple):
    """L^-1 of each span (s, d, d), d = g e errors; `spread` (s, g, e): deviations that S gives to errors;
    extra (e,): the deviation that was added to R because the model does not explain more; free (s,): how many
    errors of each are compared."""

    inverse: Reals
    spread: Reals
    extra: Reals
    free: Reals

    def take(self, rows: Ints) -> Weights:
        """Those of some of the spans."""
        return Weights(self.inverse[rows], self.spread[rows], self.extra, self.free[rows])

    def whitened(self, errors: Reals) -> Reals:
        """Whitened errors (p, s, d) of errors (p, s, g, e)."""
        flat = errors.reshape(*errors.shape[:2], -1)
        return np.asarray(np.matmul(self.inverse, flat[..., None])[..., 0])


def free_flight(layout: Layout, predictor: Predictor, extra: Reals) -> Weights:
    """Weights as if no contact amplified the errors of starts: these grow with time."""
    spans, names = predictor.spans, predictor.scene.template.coordinates
    velocities = list(predictor.scene.template.velocities)
    n = len(names)
    place, rate = np.zeros((2, len(spans.trial), len(layout.sigma)))
    for e, column in enumerate(layout.compared.plain):
        place[:, e] = spans.start[:, column]
        if names[column] in velocities:
            rate[:, e] = spans.start[:, n + velocities.index(names[column])]
    for r, four in enumerate(layout.compared.turns):
        rows = slice(len(layout.compared.plain) + 3 * r, len(layout.compared.plain) + 3 * r + 3)
        place[:, rows] = 2.0 * spans.start[:, four[0], None]
        body = names[four[0]].rsplit(".", 1)[0]
        about = [n + velocities.index(f"{body}.{axis}") for axis in ("rx", "ry", "rz")]
        rate[:, rows] = spans.start[:, about]
    variance = (
        place[:, None] ** 2 + (rate[:, None] * spans.since[..., None]) ** 2 + layout.sigma**2 + extra**2
    )
    spread = np.sqrt(variance)
    flat = spread.reshape(len(spread), -1)
    inverse = np.einsum("sd,de->sde", 1.0 / flat, np.eye(flat.shape[1]))
    return Weights(inverse, spread, extra, _compared(predictor, len(layout.sigma)))


def by_sensitivity(
    layout: Layout, predictor: Predictor, point: Reals, errors: Reals | None = None
) -> Weights:  # fmt: skip
    """Weights by how errors of starts grow in the runs at a point (k,); where its errors (s, g, e) are given,
    with what measurement and starts leave of these unexplained."""
    spans = predictor.spans
    s, (g, e) = len(spans.trial), (spans.counts.shape[1], len(layout.sigma))
    uncertain = np.flatnonzero(layout.start > 0.0)
    if predictor.model.inertia == 0.0:
        uncertain = uncertain[uncertain < spans.q.shape[1]]  # runs without inertia do not read velocities
    shifts = np.zeros((2 * len(uncertain), s, len(layout.start)))
    for j, column in enumerate(uncertain):
        shifts[2 * j, :, column] = spans.start[:, column]
        shifts[2 * j + 1, :, column] = -spans.start[:, column]
    runs = predictor(np.tile(point, (len(shifts), 1)), shifts).errors
    change = 0.5 * (runs[0::2] - runs[1::2]).reshape(len(uncertain), s, g * e)
    free, none = _compared(predictor, e), np.zeros(e)
    found = _weights(layout, change, none, free, (s, g, e))
    extra = none if errors is None else unexplained(found, predictor, errors, none)
    return _weights(layout, change, extra, free, (s, g, e)) if extra.any() else found


def _compared(predictor: Predictor, e: int) -> Reals:
    """How many of e errors a moment are compared in each span (s,)."""
    return np.asarray(predictor.spans.counts.sum(axis=1) * float(e))


def _weights(
    layout: Layout, change: Reals, extra: Reals, free: Reals, shape: tuple[int, int, int]
) -> Weights:  # fmt: skip
    """Weights from changes (n, s, d) of errors by a deviation of each part of the start."""
    s, g, e = shape
    own = np.tile(layout.sigma**2 + extra**2, g)
    covariance = np.einsum("nsd,nse->sde", change, change)
    covariance[:, np.arange(g * e), np.arange(g * e)] += own
    inverse = np.linalg.inv(np.linalg.cholesky(covariance))
    spread = np.sqrt(np.einsum("sdd->sd", covariance)).reshape(s, g, e)
    return Weights(inverse, spread, extra, free)


def unexplained(weights: Weights, predictor: Predictor, errors: Reals, before: Reals) -> Reals:
    """The deviation (e,) of errors (s, g, e) beyond what measurement and starts give them: what the model
    does not explain, by medians."""
    counts = predictor.spans.counts
    ratio = np.median(np.abs(errors[counts]) / weights.spread[counts], axis=0) / NORMAL_MEDIAN
    typical = np.median(weights.spread[counts], axis=0)
    more = np.sqrt(np.maximum(ratio**2 - 1.0, 0.0)) * typical
    return np.asarray(np.hypot(before, np.where(ratio > 1.2, more, 0.0)))

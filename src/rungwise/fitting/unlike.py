"""Whether errors are like those that the rung itself would make: a test by simulation.

To first order in the errors of starts it is known how large errors are; near impacts that is not true, and a
threshold above all that starts do there lets much pass. So the errors are drawn instead: runs from displaced
starts, at parameters that are displaced by what the motions leave open, and with noise, are motions that the
rung explains. Means and sizes of errors, by coordinate, lag, contact and trial, are compared with those of
the draws. The greatest of all their distances is compared with the greatest of each draw, which allows for
their number (Westfall and Young 1993).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rungwise.fitting.box import Box
from rungwise.fitting.measured.layout import Layout
from rungwise.fitting.measured.smoothing import WINDOW
from rungwise.fitting.measured.spans import Spans
from rungwise.fitting.measured.touching import within
from rungwise.fitting.predict import Predictor
from rungwise.fitting.weights import by_sensitivity
from rungwise.kernel import Ints, Reals

DRAWS = 99
"""Draws of motions that the rung explains."""
SPANS = 40
"""Spans of each length that are tested at most."""
LEVEL = 4.935
"""Deviations above its mean that the greatest of many distances exceeds in one of 1000 draws (Gumbel)."""
FAR = 3.0
"""Deviations beyond which an error counts no more: one run that parted by chance is no evidence."""
LEAST = 8
"""Errors of which a mean is looked at, at least."""
GIVEN, ESTIMATED = 0.05, 0.15
"""Parts of themselves to which deviations are known that are given, and that are estimated."""
LAGS = 3
"""Parts of a span."""
STATES = ("before a contact", "in contact", "after a contact")


BENT = 1.5
"""Deviations, over those that are usual, beyond which a velocity by regression is one through an impact."""


class Unlike(NamedTuple):
    """What is farthest from what the rung makes, in words; how far (deviations), and how far it may be."""

    what: str
    distance: float
    limit: float

    @property
    def is_so(self) -> bool:
        return self.distance > self.limit


class _Means(NamedTuple):
    """Means (1 + draws, n), the observed ones first, their names, and which may only be too great."""

    values: Reals
    names: list[str]
    upward: NDArray[np.bool_]


def begins_clear(layout: Layout, closed: Sequence[NDArray[np.bool_]], spans: Spans) -> NDArray[np.bool_]:
    """Whether the velocity at the start of each span (s,) was measured, or is one by regression over frames
    of which none is near a contact; closed: the frames of each trial at which bodies touch."""
    usual = np.median(spans.start, axis=0)
    found = np.array((spans.start <= BENT * usual).all(axis=1), np.bool_)
    for i, number in enumerate(spans.trial.tolist()):
        frames = layout.trials[number]
        first = int(np.searchsorted(frames.times, spans.first[i]))
        touched = bool(closed[number][first : first + WINDOW].any())
        found[i] = frames.trial.v is not None or (found[i] and not touched)
    return found


def unlike(
    predictors: Sequence[tuple[str, Predictor]], layout: Layout, box: Box, unit: Reals, covariance: Reals,
    seed: int, known: bool,
) -> Unlike:  # fmt: skip
    """The test at values (k,) with this covariance (k, k), as parts of the box, on spans of several lengths,
    each with its name; known: whether the deviations were given. Raises TimeOver."""
    rng = np.random.default_rng(seed)
    root = np.linalg.cholesky(covariance + 1e-12 * np.eye(len(unit)))
    units = np.clip(unit + rng.normal(size=(DRAWS, len(unit))) @ root.T, 0.0, 1.0)
    scale = np.exp((GIVEN if known else ESTIMATED) * rng.normal(size=DRAWS))
    found = [
        _means(name, each, layout, box.values(unit), box.values(units), scale, rng)
        for name, each in predictors
    ]
    values = np.concatenate([each.values for each in found], axis=1)
    names = [name for each in found for name in each.names]
    middle, deviation = values[1:].mean(axis=0), values[1:].std(axis=0, ddof=1)
    apart = (values - middle) / np.where(deviation > 0.0, deviation, np.inf)
    apart = np.where(np.concatenate([each.upward for each in found]), apart, np.abs(apart))
    greatest, at = apart.max(axis=1), int(apart[0].argmax())
    limit = float(greatest[1:].mean() + LEVEL * greatest[1:].std(ddof=1))
    return Unlike(names[at], float(greatest[0]), limit)


def _means(
    length: str, predictor: Predictor, layout: Layout, point: Reals, points: Reals, scale: Reals,
    rng: np.random.Generator,
) -> _Means:  # fmt: skip
    """Means of the errors of spans and of draws of these."""
    errors = _drawn(predictor, layout, point, points, scale, rng)
    weights = by_sensitivity(layout, predictor, point)
    counts = predictor.spans.counts
    alone = errors / weights.spread
    whitened = weights.whitened(errors).reshape(errors.shape)
    cells = _cells(predictor, layout, point)
    values, names, upward = list[Reals](), list[str](), list[bool]()
    for kind, each in (("errors", alone), ("changes of errors", whitened)):
        near = np.clip(each, -FAR, FAR)
        for cell, rows in cells:
            for e, name in enumerate(layout.compared.names):
                part = near[:, rows, e]
                values += [part.mean(axis=1), (part**2).mean(axis=1)]
                names += [f"the mean of {kind} of {name} {cell} in {length}"]
                names += [f"the size of {kind} of {name} {cell} in {length}"]
                upward += [False, True]
        if kind != "errors":
            for e, name in enumerate(layout.compared.names):
                values.append(_pulled(near, weights.inverse, predictor, cells, e))
                names.append(f"the acceleration of {name} before a contact in {length}")
                upward.append(False)
        for trial in np.unique(predictor.spans.trial):
            rows = counts & (predictor.spans.trial == trial)[:, None]
            values.append((near[:, rows] ** 2).mean(axis=(1, 2)))
            names.append(f"the size of {kind} of trial {trial} in {length}")
            upward.append(True)
    return _Means(np.stack(values, axis=1), names, np.array(upward))


def _pulled(
    near: Reals, inverse: Reals, predictor: Predictor, cells: list[tuple[str, NDArray[np.bool_]]], e: int
) -> Reals:  # fmt: skip
    """What whitened errors (1 + draws, s, g, e) have of the way that a constant acceleration of a coordinate
    makes before a contact."""
    way = np.zeros(near.shape[1:])
    way[..., e] = np.where(dict(cells).get(STATES[0], False), predictor.spans.since**2, 0.0)
    white = np.einsum("sde,se->sd", inverse, way.reshape(len(way), -1)).reshape(way.shape)
    size = float(np.linalg.norm(white))
    return np.asarray((near * white).sum(axis=(1, 2, 3)) / (size if size > 0.0 else 1.0))


def _drawn(
    predictor: Predictor, layout: Layout, point: Reals, points: Reals, scale: Reals, rng: np.random.Generator
) -> Reals:  # fmt: skip
    """Errors (1 + draws, s, g, e): those of the motions, and of draws of motions that the rung explains. What
    steps of finite length change is a part of these."""
    spans = predictor.spans
    observed = predictor(point[None]).errors[0]
    coarse = np.zeros_like(observed)
    if predictor.tol is not None:
        coarse = predictor.finer(0.1 * predictor.tol)(point[None]).errors[0] - observed
    shifts = rng.normal(size=(len(points), *spans.start.shape)) * spans.start * scale[:, None, None]
    drawn = observed - predictor(points, shifts).errors
    drawn += rng.normal(size=drawn.shape) * layout.sigma * scale[:, None, None, None]
    drawn += rng.normal(size=(len(points), 1, 1, 1)) * coarse
    drawn[:, ~spans.counts] = 0.0
    return np.concatenate([observed[None], drawn])


def _cells(
    predictor: Predictor, layout: Layout, point: Reals
) -> list[tuple[str, NDArray[np.bool_]]]:  # fmt: skip
    """Moments (s, g) of which means are taken, and their names: by contact, and by lag."""
    spans = predictor.spans
    gaps = predictor.gaps(point, spans.aims).min(axis=2, initial=np.inf)
    closed = (gaps <= within(predictor.scene, layout)) & spans.counts
    ever = np.logical_or.accumulate(closed, axis=1)
    state: Ints = np.where(closed, 1, np.where(ever, 2, 0))
    lag: Ints = np.arange(spans.counts.shape[1])[None] * LAGS // spans.counts.sum(axis=1)[:, None]
    found = [(name, spans.counts & (state == k)) for k, name in enumerate(STATES)]
    found += [(f"in part {k + 1} of {LAGS}", spans.counts & (lag == k)) for k in range(LAGS)]
    return [(name, rows) for name, rows in found if rows.sum() >= LEAST]

"""Whether errors are like those that the rung itself would make: a test by simulation.

To first order in the errors of starts it is known how large errors are; near impacts that is not true, and a
threshold above all that starts do there lets much pass. So the errors are drawn instead: runs from displaced
starts, at parameters that are displaced by what the motions leave open, and with noise, are motions that the
rung explains. Means and sizes of errors, by coordinate, lag, contact and trial, are compared with those of
the draws. The greatest of all their distances is compared with the greatest of each draw, which allows for
their number (Westfall and Young 1993). A third of the draws is made first: mostly they leave no doubt (Besag
and Clifford 1991).
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
FIRST = 33
"""So many of them are made first, and the others only where these leave it in doubt."""
DOUBT = 2.0
"""There is no doubt where the distance is at most so many deviations above the mean of those of the draws, or
so many times as great as it may be."""
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

    def joined(self, more: _Means) -> _Means:
        """These and the draws of more."""
        return self._replace(values=np.concatenate([self.values, more.values[1:]]))


def begins_clear(
    layout: Layout, closed: Sequence[NDArray[np.bool_]], spans: Spans, yields: bool = False
) -> NDArray[np.bool_]:  # fmt: skip
    """Whether the velocity at the start of each span (s,) was measured, or is one by regression over frames
    of which none is near a contact; and where contacts yield, whether none is closed there: how far it has
    yielded was not measured. closed: the frames of each trial at which bodies touch."""
    usual = np.median(spans.start, axis=0)
    found = np.array((spans.start <= BENT * usual).all(axis=1), np.bool_)
    for i, number in enumerate(spans.trial.tolist()):
        frames = layout.trials[number]
        first = int(np.searchsorted(frames.times, spans.first[i]))
        touched = bool(closed[number][first : first + WINDOW].any())
        found[i] = frames.trial.v is not None or (found[i] and not touched)
        found[i] &= not (yields and closed[number][first])
    return found


def unlike(
    predictors: Sequence[tuple[str, Predictor]], layout: Layout, box: Box, unit: Reals, covariance: Reals,
    seed: int, known: bool,
) -> Unlike:  # fmt: skip
    """The test at values (k,) with this covariance (k, k), as parts of the box, on spans of several lengths,
    each with its name; known: whether the deviations were given. Raises TimeOver."""
    rng = np.random.default_rng(seed)
    root = np.linalg.cholesky(covariance + 1e-12 * np.eye(len(unit)))
    lengths = [_Length(name, each, layout, box.values(unit)) for name, each in predictors]
    found = [each.means(np.zeros((0, len(unit))), np.zeros(0), rng) for each in lengths]
    for draws in (FIRST, DRAWS - FIRST):
        units = np.clip(unit + rng.normal(size=(draws, len(unit))) @ root.T, 0.0, 1.0)
        scale = np.exp((GIVEN if known else ESTIMATED) * rng.normal(size=draws))
        more = [each.means(box.values(units), scale, rng) for each in lengths]
        found = [a.joined(b) for a, b in zip(found, more, strict=True)]
        told, plain = _farthest(found)
        if told.distance <= plain or told.distance >= DOUBT * told.limit:
            break
    return told


def _farthest(found: Sequence[_Means]) -> tuple[Unlike, float]:
    """What is farthest, and the distance up to which there is no doubt that motions are explained."""
    values = np.concatenate([each.values for each in found], axis=1)
    names = [name for each in found for name in each.names]
    middle, deviation = values[1:].mean(axis=0), values[1:].std(axis=0, ddof=1)
    apart = (values - middle) / np.where(deviation > 0.0, deviation, np.inf)
    apart = np.where(np.concatenate([each.upward for each in found]), apart, np.abs(apart))
    greatest, at = apart.max(axis=1), int(apart[0].argmax())
    mean, spread = float(greatest[1:].mean()), float(greatest[1:].std(ddof=1))
    return Unlike(names[at], float(greatest[0]), mean + LEVEL * spread), mean + DOUBT * spread


class _Length:
    """Spans of one length, at a point (k,) of the parameters."""

    def __init__(self, name: str, predictor: Predictor, layout: Layout, point: Reals) -> None:
        self._name, self._predictor, self._layout = name, predictor, layout
        self._weights = by_sensitivity(layout, predictor, point)
        self._cells = _cells(predictor, layout, point)
        self._observed = predictor(point[None]).errors[0]
        self._coarse = np.zeros_like(self._observed)
        if predictor.tol is not None:
            finer = predictor.at_tol(0.1 * predictor.tol)
            self._coarse = finer(point[None]).errors[0] - self._observed

    def means(self, points: Reals, scale: Reals, rng: np.random.Generator) -> _Means:
        """Means of the errors of the motions, and of draws of these at points (p, k), with deviations of so
        many times (p,) those that are known."""
        errors = np.concatenate([self._observed[None], self._drawn(points, scale, rng)])
        weights, trials, names_of = self._weights, self._predictor.spans.trial, self._layout.compared.names
        whitened = weights.whitened(errors).reshape(errors.shape)
        values, names, upward = list[Reals](), list[str](), list[bool]()
        for kind, each in (("errors", errors / weights.spread), ("changes of errors", whitened)):
            near = np.clip(each, -FAR, FAR)
            for cell, rows in self._cells:
                for e, name in enumerate(names_of):
                    part = near[:, rows, e]
                    values += [part.mean(axis=1), (part**2).mean(axis=1)]
                    names += [f"the mean of {kind} of {name} {cell} in {self._name}"]
                    names += [f"the size of {kind} of {name} {cell} in {self._name}"]
                    upward += [False, True]
            if kind != "errors":
                for e, name in enumerate(names_of):
                    values.append(_pulled(near, weights.inverse, self._predictor, self._cells, e))
                    names.append(f"the acceleration of {name} before a contact in {self._name}")
                    upward.append(False)
            for trial in np.unique(trials):
                rows = self._predictor.spans.counts & (trials == trial)[:, None]
                values.append((near[:, rows] ** 2).mean(axis=(1, 2)))
                names.append(f"the size of {kind} of trial {trial} in {self._name}")
                upward.append(True)
        return _Means(np.stack(values, axis=1), names, np.array(upward))

    def _drawn(self, points: Reals, scale: Reals, rng: np.random.Generator) -> Reals:
        """Errors (p, s, g, e) of draws of motions that the rung explains. What steps of finite length change
        is a part of these."""
        spans, p = self._predictor.spans, len(points)
        if not p:
            return np.zeros((0, *self._observed.shape))
        shifts = rng.normal(size=(p, *spans.start.shape)) * spans.start * scale[:, None, None]
        drawn = self._observed - self._predictor(points, shifts).errors
        drawn += rng.normal(size=drawn.shape) * self._layout.sigma * scale[:, None, None, None]
        drawn += rng.normal(size=(p, 1, 1, 1)) * self._coarse
        drawn[:, ~spans.counts] = 0.0
        return np.asarray(drawn)


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

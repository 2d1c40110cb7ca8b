"""The loss of whitened errors: that of Student's t over each span.

A span whose run parted from the motion by chance, at an impact that was an edge or a corner, is no normal
error many times over: all its errors are great together. Under Student's distribution in as many dimensions
as errors are compared (Lange, Little, Taylor 1989) such a span counts by the logarithm of its size. So the
loss stays smooth where the runs of a few spans scatter, and what these say does not outweigh all others.
"""

from __future__ import annotations

import numpy as np

from rungwise.kernel import Ints, Reals

TAIL = 4.0
"""Degrees of freedom: the usual choice where outliers are expected."""
EXPECTED = 0.7099
"""Mean of 2 (sqrt(1 + z^2) - 1) of a standard normal number z."""


def span_losses(whitened: Reals, free: Reals) -> Reals:
    """The loss (p, s) of whitened errors (p, s, d), of which so many (s,) are compared: it grows as their sum
    of squares does where that is as expected."""
    return np.asarray((TAIL + free) * np.log1p((whitened**2).sum(axis=-1) / TAIL))


def losses(whitened: Reals, free: Reals) -> Reals:
    """The loss (p,) of all spans."""
    return np.asarray(span_losses(whitened, free).sum(axis=-1))


def influence(whitened: Reals, free: Reals) -> Reals:
    """What the errors (s, d) of each span count for (s,): 1 where they are as expected, nearly 0 where they
    are far greater."""
    return np.asarray((TAIL + free) / (TAIL + (whitened**2).sum(axis=-1)))


def bend(slopes: Reals, whitened: Reals, free: Reals) -> tuple[Reals, Reals]:
    """First (s, k) and second derivatives (s, k, k), as expected, of half the loss of each span, by slopes
    (k, s, d) of errors (s, d)."""
    counts = influence(whitened, free)
    first = np.einsum("ksd,sd,s->sk", slopes, whitened, counts, optimize=True)
    known = counts * (TAIL + free) / (TAIL + free + 2.0)
    rows = slopes.transpose(1, 0, 2)
    return np.asarray(first), np.asarray(np.matmul(rows, rows.transpose(0, 2, 1)) * known[:, None, None])


def typical_losses(whitened: Reals) -> Reals:
    """The losses (..., s) of 2 (sqrt(1 + z^2) - 1) over errors (..., s, d), beside `EXPECTED`: they tell how
    far motions are from being explained."""
    return np.asarray(2.0 * (np.sqrt(1.0 + whitened**2) - 1.0).sum(axis=-1))


def by_trial(trial: Ints, values: Reals) -> Reals:
    """Sums (m, ...) over the spans (s, ...) of each trial."""
    names, of_trial = np.unique(trial, return_inverse=True)
    found = np.zeros((len(names), *values.shape[1:]))
    np.add.at(found, of_trial, values)
    return found

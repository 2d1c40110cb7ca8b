"""Which parameters runs depend on, and which spans say something of them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rungwise.fitting.box import Box
from rungwise.fitting.measured.layout import Layout
from rungwise.fitting.predict import Predictor
from rungwise.fitting.weights import free_flight
from rungwise.kernel import Ints

PROBED = 600
"""Spans on which it is seen whether runs depend on parameters, at most."""
TELLS = 0.1
"""Deviations by which errors of a span change at least, over the box, where it says something."""


class Telling(NamedTuple):
    """read (k,): whether any run depends on a parameter; rows (s,): spans that say something of some of them,
    in a random order, one of each trial first."""

    read: NDArray[np.bool_]
    rows: Ints


def telling(whole: Predictor, layout: Layout, box: Box, seed: int) -> Telling:
    """What the spans tell of the parameters, by runs at random places of the box, and with each parameter at
    both its ends: between two values within the box nothing may change, as where friction holds at both."""
    rng, k = np.random.default_rng(seed), len(box.names)
    rows = _by_turns(whole.spans.trial, rng)[:PROBED]
    probe = whole.on(whole.spans.take(rows))
    points = np.repeat(rng.uniform(size=(2, 1, k)), 2 * k + 1, axis=1)
    for end in (0, 1):
        points[:, np.arange(1 + end, 2 * k + 1, 2), np.arange(k)] = end
    errors = probe(box.values(points.reshape(-1, k))).errors
    errors = errors.reshape(2, 2 * k + 1, *errors.shape[1:])
    apart = np.abs(errors[:, 1:] - errors[:, :1]).reshape(2, k, 2, *errors.shape[2:])
    changes = np.fmax(apart[:, :, 0], apart[:, :, 1])
    spread = free_flight(layout, probe, np.zeros(len(layout.sigma))).spread
    says = ((changes / spread).max(axis=(0, 1, 3, 4)) > TELLS) if k else np.zeros(len(rows), bool)
    read = np.asarray(np.any(changes > 0.0, axis=(0, 2, 3, 4)))
    return Telling(read, rows[says] if says.any() else rows)


def _by_turns(trial: Ints, rng: np.random.Generator) -> Ints:
    """All spans in a random order, one of each trial, then a second one of each, and so on."""
    drawn = rng.permutation(len(trial))
    turn = np.zeros(len(trial), np.int64)
    for each in np.unique(trial):
        own = drawn[trial[drawn] == each]
        turn[own] = np.arange(len(own))
    return np.asarray(drawn[np.argsort(turn[drawn], kind="stable")])

"""Definition 1: for each input of the simpler model, the input of the richer one that moves most alike."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from rungwise.hierarchy.motions import Bench, Motions, apart
from rungwise.kernel import Reals
from rungwise.models.ladder import Rung

ROUNDS, TRIED = 6, 10
"""Rounds of the search, and inputs tried in each for each sample."""
FIRST, SHRINKS = 0.2, 0.4
"""How far the first round looks, as a part of the intervals, and by how much each round looks nearer."""


@dataclass(frozen=True)
class Nearest:
    """For samples (m,): the distance under the same inputs, the least that was found, and under which inputs
    (m, k) of the richer model."""

    same: Reals
    least: Reals
    inputs: Reals

    @property
    def value(self) -> float:
        """The largest over samples of the smallest distance found. Samples bound a maximum from below, a
        search a minimum from above."""
        return float(np.nanmax(self.least, initial=0.0))

    @property
    def worst(self) -> int:
        return int(np.nanargmax(self.least)) if (self.least == self.least).any() else 0


def nearest(
    bench: Bench, model: Rung, wanted: Motions, richer: Motions, inputs: Reals, until: Reals, tol: float,
    enough: float, rng: np.random.Generator,
) -> Nearest:  # fmt: skip
    """Search inputs of the richer model whose motions are like those wanted, beginning with the same inputs;
    what is within `enough` is not improved."""
    same = apart(richer, wanted)
    least, best = same.copy(), inputs.copy()
    low, high = bench.inputs.low, bench.inputs.high
    for k in range(ROUNDS if bench.inputs.names else 0):
        rows = np.flatnonzero(least > enough)
        if not len(rows):
            break
        many = np.repeat(rows, TRIED)
        reach = FIRST * SHRINKS**k * (high - low)
        tried = best[many] + reach * rng.standard_normal(best[many].shape)
        tried = np.clip(tried, low, high)
        found = bench.run(model, tried, until[many], tol)
        distance = np.abs(found.places - wanted.places[many]).max(axis=(1, 2))
        distance = np.where(found.known, distance, math.inf).reshape(len(rows), TRIED)
        winner = distance.argmin(axis=1)
        value = distance[np.arange(len(rows)), winner]
        better = value < least[rows]
        least[rows[better]] = value[better]
        best[rows[better]] = tried.reshape(len(rows), TRIED, *best.shape[1:])[better, winner[better]]
    return Nearest(same, least, best)

"""Definition 1: for each input of the simpler model, the input of the richer one that moves most alike."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from rungwise.hierarchy.distance import farthest
from rungwise.hierarchy.motions import Bench, Motions, apart
from rungwise.hierarchy.refine import settle
from rungwise.kernel import Reals
from rungwise.models.ladder import Rung

QUICK = 3000
"""Most steps of one run of the search."""
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
        """The largest over samples of the smallest distance found; nan where none was found. Samples bound a
        maximum from below, a search a minimum from above."""
        return float(np.nanmax(self.least)) if self.told else math.nan

    @property
    def worst(self) -> int:
        return int(np.nanargmax(self.least)) if self.told else 0

    @property
    def told(self) -> bool:
        """Whether there is a distance for any sample."""
        return not np.isnan(self.least).all()


def nearest(
    bench: Bench, model: Rung, wanted: Motions, richer: Motions, inputs: Reals, until: Reals, tol: float,
    enough: float, rng: np.random.Generator,
) -> Nearest:  # fmt: skip
    """Search inputs of the richer model whose motions are like those wanted, beginning with the same inputs;
    what is within `enough` is not improved. What is found is repeated at a smaller error per step."""
    same = apart(richer, wanted)
    rough, best = np.where(np.isnan(same), math.inf, same), inputs.copy()
    low, high = bench.inputs.low, bench.inputs.high
    for k in range(ROUNDS if bench.inputs.names else 0):
        rows = np.flatnonzero((rough > enough) & wanted.known)
        if not len(rows):
            break
        many = np.repeat(rows, TRIED)
        reach = FIRST * SHRINKS**k * (high - low)
        tried = best[many] + reach * rng.standard_normal(best[many].shape)
        tried = np.clip(tried, low, high)
        found = bench.run(model, tried, until[many], tol, budget=QUICK)
        distance = farthest(found.places - wanted.places[many])
        distance = np.where(found.known, distance, math.inf).reshape(len(rows), TRIED)
        winner = distance.argmin(axis=1)
        value = distance[np.arange(len(rows)), winner]
        better = value < rough[rows]
        rough[rows[better]] = value[better]
        best[rows[better]] = tried.reshape(len(rows), TRIED, *best.shape[1:])[better, winner[better]]
    least = same.copy()
    rows = np.flatnonzero((best != inputs).any(axis=1))
    if len(rows):
        settled = settle(bench, model, best[rows], until[rows], enough).motions
        least[rows] = np.fmin(least[rows], apart(settled, wanted.rows(rows)))
        worse = rows[~(least[rows] < same[rows]) & ~np.isnan(same[rows])]
        best[worse] = inputs[worse]
    return Nearest(same, least, best)

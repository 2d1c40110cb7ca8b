"""Losses and gains of a richer rung: two sets over the same box, compared point by point."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rungwise.keywords import keywords
from rungwise.sets.cells.labels import Label
from rungwise.sets.feasible.feasible import FeasibleSet
from rungwise.sets.store import SetError


@dataclass(frozen=True)
class Between:
    """Parts of the box: feasible on both rungs, `cheap` and `rich` by name, lost or gained by the richer
    rung; and the error of each part.

    `error` is one standard error of sampling, sqrt(p (1 - p) / n) at its greatest, 1/2.
    """

    cheap: str
    rich: str
    both: float
    lost: float
    gained: float
    error: float


@keywords
def between(cheap: FeasibleSet, rich: FeasibleSet, n: int = 200_000, seed: int = 3) -> Between:
    """Compare the sets of a `cheap` and a `rich` rung at n random points, drawn by `seed`. Raises SetError
    when they are not over the same box."""
    if cheap.over != rich.over or not np.array_equal(cheap.box, rich.box):
        raise SetError("between: the sets must be over the same parameters and box")
    points = cheap.random(n, seed)
    a, b = cheap.labels(points) == Label.FEASIBLE, rich.labels(points) == Label.FEASIBLE
    return Between(
        cheap=cheap.name,
        rich=rich.name,
        both=float(np.mean(a & b)),
        lost=float(np.mean(a & ~b)),
        gained=float(np.mean(b & ~a)),
        error=0.5 / n**0.5,
    )

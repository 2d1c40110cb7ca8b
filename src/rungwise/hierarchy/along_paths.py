"""Walks along a path: how far two models are apart at its values, and how well that is known."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from rungwise.hierarchy.distance import farthest
from rungwise.hierarchy.motions import MOMENTS, Bench, Motions, joined
from rungwise.hierarchy.paths import Path
from rungwise.hierarchy.refine import LONGER
from rungwise.kernel import Ints, Reals
from rungwise.models.ladder import Rung

LEVELS = (1e-5, 1e-6, 1e-7, 1e-8, 1e-9)
"""Error allowed per step of runs along a path, as a part of the extent: the next where distances need it."""
EQUAL = (4, 8, 16, 32)
"""Steps from moment to moment of runs with equal steps."""
FLOOR = 10.0
"""Distances below so many times their errors say nothing."""
ROUNDING = 1e-10
"""Errors are not taken to be less than this, whatever is seen of them."""


def exponent(values: Reals, distances: Reals) -> tuple[float, float]:
    """The exponent p of distances ~ values^p by regression, and its standard error; nan for fewer than three
    points."""
    if len(values) < 3:
        return math.nan, math.nan
    x, y = np.log(values), np.log(distances)
    slope, offset = np.polyfit(x, y, 1)
    left = y - slope * x - offset
    return float(slope), float(math.sqrt(left @ left / (len(x) - 2) / ((x - x.mean()) ** 2).sum()))


class Distances(NamedTuple):
    """At the values of a path (k,): the difference of places (k, s, p, d) in the second half, nan where a run
    said nothing; its greatest, and by how much that is wrong; the error per step, or the one step of all.
    """

    apart: Reals
    found: Reals
    error: Reals
    tols: Reals
    step: float | None = None

    @property
    def floors(self) -> Reals:
        return FLOOR * np.maximum(self.error, ROUNDING)

    @property
    def seen(self) -> int:
        """How many are above their floors."""
        return int((self.found > self.floors).sum())

    def order(self, values: tuple[float, ...]) -> tuple[float, float]:
        """The exponent of the values with which distances above their floors go, and its standard error."""
        kept = self.found > self.floors  # false for runs that say nothing
        return exponent(np.array(values)[kept], self.found[kept])

    @property
    def hidden(self) -> bool:
        """Whether there are differences that are not above their floors."""
        return bool(((self.found > ROUNDING) & (self.found <= self.floors)).any())


NOWHERE = Distances(np.zeros((0, 0, 0, 1)), np.zeros(0), np.zeros(0), np.zeros(0))
"""What is known of a path that leads nowhere."""


@dataclass(frozen=True)
class Walk:
    """A path from one model to another, under one sample's inputs (1, k), until a time (1,)."""

    bench: Bench
    path: Path
    richer: Rung
    simpler: Rung
    inputs: Reals
    end: Reals

    def simple(self, tol: float | None = None, halved: bool = False, step: float | None = None) -> Motions:
        """The simpler model's run."""
        return self._run(self.simpler, {}, 1, tol, halved, step)

    def rich(
        self, rows: Ints, tol: float | None = None, halved: bool = False, step: float | None = None
    ) -> Motions:
        """The richer model's runs at these of the path's values."""
        at = [self.path.values[k] for k in rows]
        models = [self.path.rung(self.richer, each) for each in at]
        factors = [self.path.factors(each) for each in at]
        if models[0] == models[-1]:  # one model, and its threads
            values = {name: np.array([each[name] for each in factors]) for name in factors[0]}
            return self._run(models[0], values, len(rows), tol, halved, step)
        both = zip(models, factors, strict=True)
        return joined([self._run(model, values, 1, tol, halved, step) for model, values in both])

    def _run(
        self, model: Rung, values: dict[str, Any], m: int, tol: float | None, halved: bool, step: float | None
    ) -> Motions:  # fmt: skip
        return self.bench.run(
            model, self.inputs.repeat(m, axis=0), self.end.repeat(m), tol, step=step, bare=True,
            parameters=self.bench.matched.bouncing(self.path.bounce) | values, halved=halved,
        )  # fmt: skip

    def distances(self) -> Distances:
        """With chosen steps: both models' runs are repeated alike until the difference is far above what it
        changes by. What both are wrong by alike is no error of the difference."""
        count, known = len(self.path.values), None
        rows = np.arange(count)
        for level, tol in enumerate(LEVELS):
            wanted = self.simple(tol, level % 2 == 1)
            if not wanted.known[0]:
                break
            runs = self.rich(rows, tol, level % 2 == 1)
            known = _better(known, count, rows, runs, wanted, tol)
            rows = rows[runs.known & (runs.steps * LONGER <= self.bench.budget)]
            told = np.isfinite(known.error[rows]) & (known.found[rows] <= ROUNDING)
            rows = rows[~told & ~(2.0 * known.floors[rows] <= known.found[rows])]
            if not len(rows) or wanted.steps[0] * LONGER > self.bench.budget:
                break
        return _nothing(count) if known is None else known

    def equal(self, sure: Distances) -> Distances | None:
        """With equal steps of both models, where that tells as much as what is sure, and agrees with it; None
        otherwise. Errors of both runs are alike then, but what happens within a step stays unseen."""
        count, known, step = len(self.path.values), None, 0.0
        rows = np.arange(count)
        for parts in EQUAL:
            step = float(self.end[0]) / (MOMENTS * parts)
            wanted, runs = self.simple(step=step), self.rich(rows, step=step)
            if not (wanted.known[0] and runs.known.all()):
                return None
            known = _better(known, count, rows, runs, wanted, math.nan)
        assert known is not None
        parted = farthest(known.apart - sure.apart) if sure.apart.size else np.array([math.nan])
        agree = (
            bool((np.isfinite(sure.error) & (parted <= known.floors + sure.floors)).all()) and sure.seen > 0
        )
        return known._replace(step=step) if agree and known.seen >= sure.seen else None


def _nothing(count: int, shape: Iterable[int] = (0, 0, 1)) -> Distances:
    none = np.full(count, math.nan)
    return Distances(np.full((count, *shape), math.nan), none, np.full(count, math.inf), none.copy())


def _better(
    known: Distances | None, count: int, rows: Ints, runs: Motions, wanted: Motions, tol: float
) -> Distances:  # fmt: skip
    """What is known once these rows have been run more exactly than before. Distances are those in the second
    half, after the boundary layer."""
    apart = (runs.places - wanted.places)[:, MOMENTS // 2 :]
    if known is None:
        known = _nothing(count, apart.shape[1:])
    known = Distances(known.apart.copy(), known.found.copy(), known.error.copy(), known.tols.copy())
    good, kept = runs.known, rows[runs.known]
    changed = farthest(apart - known.apart[rows])[good]
    known.error[kept] = np.where(np.isnan(changed), math.inf, changed)
    known.apart[kept], known.tols[kept] = apart[good], tol
    known.found[kept] = farthest(apart)[good]
    return known

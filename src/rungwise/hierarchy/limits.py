"""Definition 2: the order at which a model comes near another along a path of its parameters."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from rungwise.hierarchy.along_paths import FLOOR, LEVELS, NOWHERE, Distances, Walk
from rungwise.hierarchy.motions import Bench, Motions, apart
from rungwise.hierarchy.paths import Path
from rungwise.kernel import Reals
from rungwise.models.ladder import Rung

NONE = 1e-8
"""Distances below this are none: solvers, not models, make them."""
ALIKE = 1e-5
"""Distances below this are none where they lie within the floor."""
CONSTANT = 1e-3
"""Distances are the same where they differ by less than this part of them, and less than the floor."""
SHORT = 1e-3
"""Motions that end before this part of the longest duration lead nowhere."""
LEAST = 0.1
"""Models come near each other where the order, less two standard errors, is above this."""
SCATTER = 0.05
"""Standard error of an order from which on equal steps are tried."""
BEFORE = 0.98
"""Part of the time until the first of the runs ends: until then, both pass the same contacts."""

TENDS, STAYS, INDEPENDENT, SAME, UNDECIDED = (
    "tends", "does not tend", "does not depend on the parameter", "no difference", "undecided",
)  # fmt: skip


@dataclass(frozen=True)
class Fit:
    """What was found along a path: distances at its values, until a time, under a sample's inputs; the order,
    as the exponent of the small number, with its standard error; `budget`: most steps of a run."""

    path: Path
    known: Distances
    order: float
    error: float
    until: float
    sample: int
    short: str = ""
    budget: int = 0

    @property
    def values(self) -> tuple[float, ...]:
        """The values of the path's parameter."""
        return self.path.values

    @property
    def distances(self) -> tuple[float, ...]:
        """Distances at the values, nan where a run said nothing."""
        return tuple(self.known.found.tolist())

    @property
    def floors(self) -> tuple[float, ...]:
        """What distances must be above to say something."""
        return tuple(self.known.floors.tolist())

    @property
    def verdict(self) -> str:
        pairs = [(d, floor) for d, floor in zip(self.distances, self.floors, strict=True) if d == d]
        seen = [d for d, floor in pairs if d > floor]
        if pairs and max(pairs)[0] <= NONE and len(pairs) == len(self.distances):
            return SAME
        if self.short or not pairs or (not seen and max(pairs)[0] > ALIKE):
            return UNDECIDED
        if not seen:
            return SAME if len(pairs) == len(self.distances) else UNDECIDED
        spread = max(seen) - min(seen)
        if len(seen) == len(self.distances) and spread < min(max(self.floors), CONSTANT * max(seen)):
            return INDEPENDENT
        if math.isnan(self.order):
            last = pairs[-1][0] + pairs[-1][1]
            return TENDS if self.distances[-1] == pairs[-1][0] and last < LEAST * seen[0] else UNDECIDED
        if _tends(self.order, self.error):
            return TENDS
        return STAYS if self.order + 2.0 * self.error < LEAST else UNDECIDED

    @property
    def why(self) -> str:
        """Why there is no order, or no verdict; empty where there are both."""
        if self.verdict in (INDEPENDENT, SAME):
            return ""
        if self.short:
            return self.short
        lost = sum(math.isnan(d) for d in self.distances)
        hidden = sum(d <= floor for d, floor in zip(self.distances, self.floors, strict=True))
        told = [
            f"{lost} of {len(self.values)} runs took more than {self.budget} steps or did not converge"
        ] * (lost > 0)
        told += [f"{hidden} of {len(self.values)} distances are below {FLOOR:g} times their error"] * (
            hidden > 0
        )
        if math.isnan(self.order):
            return " and ".join(told)
        return "the distances follow no one power" if self.verdict == UNDECIDED else ""

    def __str__(self) -> str:
        order = (
            ""
            if math.isnan(self.order)
            else f": order {self.order:.2f} +- {self.error:.2f} in {self.path.name}"
        )
        known = [d for d in self.distances if d == d]
        ends = f"{known[0]:.1e} to {known[-1]:.1e}" if known else "no runs"
        steps = "" if self.known.step is None else ", equal steps"
        return f"{self.path.words}{order}; {self.verdict} ({ends}{steps})" + (
            f": {self.why}" if self.why else ""
        )


def _tends(order: float, error: float) -> bool:
    return order - 2.0 * error > LEAST


def fit(
    bench: Bench, path: Path, richer: Rung, simpler: Rung, inputs: Reals, until: Reals
) -> Fit:  # fmt: skip
    """Walk the path under those of the inputs (m, k) under which the two motions differ most at its
    beginning, until just before times (m,), or before the first of them ends. Distances are those in the
    second half of the run, after the boundary layer."""
    until = BEFORE * until
    sample, lost = _telling(bench, path, richer, simpler, inputs, until)
    end, every = until[sample : sample + 1], np.arange(len(path.values))
    for _ in range(2):  # once more, if a run ends sooner: jams belong to distances, not to orders
        walk = Walk(bench, path, richer, simpler, inputs[sample : sample + 1], end)
        sooner = float(first(walk.simple(LEVELS[0]), walk.rich(every, LEVELS[0]), end).min())
        if sooner >= end[0] * (1.0 - 1e-9):
            break
        end = np.array([BEFORE * sooner])
    many = f"{lost} of {len(inputs)} inputs take too many steps, and the others make no difference"
    short = many if lost else ""
    if end[0] < SHORT * bench.duration:
        short = f"a run ends at {end[0]:.2g}, before there is anything to compare"
    if short:
        return Fit(path, NOWHERE, math.nan, math.nan, float(end[0]), sample, short)
    known = walk.distances()
    order, error = known.order(path.values)
    if known.hidden or error > SCATTER:
        other = walk.equal(known)
        if other is not None:
            new = other.order(path.values)
            falls = other.found[-1] + other.floors[-1] < LEAST * other.found[0]
            if (_tends(*new) or falls) and not new[1] >= error:
                known, (order, error) = other, new
    return Fit(path, known, order, error, float(end[0]), sample, budget=bench.budget)


def first(a: Motions, b: Motions, until: Reals) -> Reals:
    """When the first of the runs that say something ends (m,), at the latest at times (m,)."""
    times = [np.where(each.known, each.time, np.inf) for each in (a, b)]
    return np.minimum(until, np.minimum(*times))


def _telling(
    bench: Bench, path: Path, richer: Rung, simpler: Rung, inputs: Reals, until: Reals
) -> tuple[int, int]:
    """The sample in which motions differ most at the beginning of the path, of those that go on to the end,
    and not much shorter than others; of all, if they differ in no such one. Also how many samples took too
    many steps, if motions differ in no other."""
    at, bounce = path.values[0], bench.matched.bouncing(path.bounce)

    def run(model: Rung, values: dict[str, float]) -> Motions:
        return bench.run(model, inputs, until, LEVELS[0], bare=True, parameters=values | bounce)

    a, b = run(path.rung(richer, at), path.factors(at)), run(simpler, {})
    away = apart(a, b, late=True)
    unknown = int(np.isnan(away).sum())
    away = np.nan_to_num(away)
    whole = (a.time >= until * (1.0 - 1e-9)) & (b.time >= until * (1.0 - 1e-9))
    whole &= until >= 0.1 * until.max()
    sample = int(np.argmax(away * whole if (away * whole).max() > 10.0 * LEVELS[0] else away))
    return sample, unknown if away.max() <= NONE else 0

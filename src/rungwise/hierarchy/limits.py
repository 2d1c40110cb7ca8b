"""Definition 2: the order at which a model comes near another along a path of its parameters."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from rungwise.hierarchy.matching import DAMPING, STIFFNESS
from rungwise.hierarchy.motions import Bench, Motions, apart, joined
from rungwise.hierarchy.settling import Settling
from rungwise.kernel import Ints, Reals
from rungwise.models.ladder import Rung

LEVELS = (1e-5, 1e-6, 1e-7, 1e-8, 1e-9)
"""Error allowed per step of runs along a path, as a part of the extent: the next where distances need it."""
BUDGET = 20_000
"""Most steps of one run along a path."""
QUICK = 3000
"""Most steps of one run that helps to choose the inputs."""
FLOOR = 10.0
"""Distances below so many times the errors of both runs say nothing."""
ROUNDING = 1e-11
"""Errors of runs are not taken to be less than this, whatever is seen of them."""
ALIKE = 1e-5
"""Distances below this are none where they lie within the floor."""
CONSTANT = 1e-3
"""Distances are the same where they differ by less than this part of them, and less than the floor."""
SHORT = 1e-3
"""Motions that end before this part of the longest duration lead nowhere."""
LEAST = 0.1
"""Models come near each other where the order, less two standard errors, is above this."""
CONTACT = tuple(10.0 ** np.linspace(0.0, 4.0, 5))
INERTIA = tuple(10.0 ** np.linspace(-1.0, -5.0, 5))
BEFORE = 0.98
"""Part of the time until the first of the runs ends: until then, both pass the same contacts."""

TENDS, STAYS, INDEPENDENT, SAME, UNDECIDED = (
    "tends", "does not tend", "does not depend on the parameter", "no difference", "undecided",
)  # fmt: skip


@dataclass(frozen=True)
class Path:
    """A way through parameters: in words, the small number's name and values, and what runs take at each: the
    factor of inertia, factors of stiffness and damping, and the restitution of the limit (None: matched)."""

    words: str
    name: str
    values: tuple[float, ...]
    inertia: Callable[[float], float]
    stiffness: Callable[[float], float]
    damping: Callable[[float], float]
    bounce: float | None = None

    def rung(self, model: Rung, at: float) -> Rung:
        return model.with_inertia(self.inertia(at)) if model.inertia > 0.0 else model

    def factors(self, at: float) -> dict[str, float]:
        """Factors of stiffness and damping, by the names of the matched scene's parameters."""
        return {STIFFNESS: self.stiffness(at), DAMPING: self.damping(at)}


def _one(_: float) -> float:
    return 1.0


def _zero(_: float) -> float:
    return 0.0


def _inverse(at: float) -> float:
    return 1.0 / at


_SMALL = tuple(1.0 / factor for factor in CONTACT)
RATIO = Path(
    "stiffness times 1 to 1e4 at a fixed damping ratio", "1/K", _SMALL, _one, _inverse,
    lambda at: at**-0.5,
)  # fmt: skip
PROPORTIONAL = Path(
    "stiffness times 1 to 1e4 with damping in proportion", "1/K", _SMALL, _one, _inverse, _inverse, 0.0
)
UNDAMPED = Path("stiffness times 1 to 1e4 without damping", "1/K", _SMALL, _one, _inverse, _zero, 1.0)
LIGHT = Path("inertia times 1e-1 to 1e-5", "epsilon", INERTIA, lambda at: at, _one, _one)
BOTH = Path(
    "inertia times 1e-1 to 1e-5 and stiffness times 10 to 1e5, at a fixed damping ratio", "epsilon", INERTIA,
    lambda at: at, _inverse, _one,
)  # fmt: skip


@dataclass(frozen=True)
class Fit:
    """What was found along a path: distances at its values, nan where a run said nothing, until a time, under
    a sample's inputs, at errors per step; the order, as the exponent of the small number, with its standard
    error; `floors`: below those, distances say nothing."""

    path: Path
    values: tuple[float, ...]
    distances: tuple[float, ...]
    floors: tuple[float, ...]
    order: float
    error: float
    until: float
    sample: int
    tols: tuple[tuple[float, float], ...]
    short: str = ""

    @property
    def verdict(self) -> str:
        pairs = [(d, floor) for d, floor in zip(self.distances, self.floors, strict=True) if d == d]
        seen = [d for d, floor in pairs if d > floor]
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
        if self.order - 2.0 * self.error > LEAST:
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
        told = [f"{lost} of {len(self.values)} runs took more than {BUDGET} steps or did not converge"] * (
            lost > 0
        )
        told += [
            f"{hidden} of {len(self.values)} distances are below {FLOOR:g} times the error of the runs"
        ] * (hidden > 0)
        if math.isnan(self.order):
            return " and ".join(told)
        return "the distances follow no one power" if self.verdict == UNDECIDED else ""

    def __str__(self) -> str:
        order = (
            ""
            if math.isnan(self.order)
            else f": order {self.order:.2f} +- {self.error:.2f} in {self.path.name}"
        )
        ends = f"{self.distances[0]:.1e} to {self.distances[-1]:.1e}" if self.distances else "no runs"
        return f"{self.path.words}{order}; {self.verdict} ({ends})" + (f": {self.why}" if self.why else "")


def exponent(values: Reals, distances: Reals) -> tuple[float, float]:
    """The exponent p of distances ~ values^p by regression, and its standard error; nan for fewer than three
    points."""
    if len(values) < 3:
        return math.nan, math.nan
    x, y = np.log(values), np.log(distances)
    slope, offset = np.polyfit(x, y, 1)
    left = y - slope * x - offset
    return float(slope), float(math.sqrt(left @ left / (len(x) - 2) / ((x - x.mean()) ** 2).sum()))


def fit(
    bench: Bench, path: Path, richer: Rung, simpler: Rung, inputs: Reals, until: Reals
) -> Fit:  # fmt: skip
    """Walk the path under those of the inputs (m, k) under which the two motions differ most at its
    beginning, until just before times (m,), or before the first of them ends. Distances are those in the
    second half of the run, after the boundary layer."""
    until = BEFORE * until
    sample = _telling(bench, path, richer, simpler, inputs, until)
    chosen, end = inputs[sample : sample + 1], until[sample : sample + 1]
    bounce, count = bench.matched.bouncing(path.bounce), len(path.values)

    def run(model: Rung, tol: float, halved: bool, values: dict[str, Any], m: int = 1) -> Motions:
        return bench.run(
            model, chosen.repeat(m, axis=0), end.repeat(m), tol, bare=True, budget=BUDGET,
            parameters=bounce | values, halved=halved,
        )  # fmt: skip

    def walk(rows: Ints, tol: float, halved: bool) -> Motions:
        at = [path.values[k] for k in rows]
        if path.rung(richer, at[0]) == path.rung(richer, at[-1]):  # one model, and its threads
            factors = [path.factors(each) for each in at]
            values = {name: np.array([each[name] for each in factors]) for name in factors[0]}
            return run(path.rung(richer, at[0]), tol, halved, values, len(rows))
        return joined([run(path.rung(richer, each), tol, halved, path.factors(each)) for each in at])

    for _ in range(2):  # once more, if a run ends sooner: jams belong to distances, not to orders
        wanted = Settling(lambda _, tol, halved: run(simpler, tol, halved, {}), 1, LEVELS, BUDGET)
        runs = Settling(walk, count, LEVELS, BUDGET)
        sooner = float(first(wanted.motions, runs.motions, end).min())
        if sooner >= end[0] * (1.0 - 1e-9):
            break
        end = np.array([BEFORE * sooner])
    if end[0] < SHORT * bench.duration:
        short = f"a run ends at {end[0]:.2g}"
        return Fit(path, path.values, (), (), math.nan, math.nan, float(end[0]), sample, (), short)
    found = _settled(wanted, runs)
    floors = FLOOR * (np.maximum(wanted.error, ROUNDING) + np.maximum(runs.error, ROUNDING))
    kept = found > floors  # false for runs that say nothing
    order, error = exponent(np.array(path.values)[kept], found[kept])
    return Fit(
        path, path.values, tuple(found.tolist()), tuple(floors.tolist()), order, error, float(end[0]), sample,
        tuple((float(tol), float(wanted.tol[0])) for tol in runs.tol),
    )  # fmt: skip


def _settled(wanted: Settling, runs: Settling) -> Reals:
    """The distances, when runs are so exact that they are far above the errors, or cannot be more exact."""
    while True:
        found = apart(runs.motions, wanted.motions, late=True)
        rough = ~(2.0 * FLOOR * runs.error <= found)
        least = float(np.nanmin(found)) if (found == found).any() else math.nan
        again = runs.refine(rough)
        again |= wanted.refine(~(2.0 * FLOOR * wanted.error <= least))
        if not again:
            return found


def first(a: Motions, b: Motions, until: Reals) -> Reals:
    """When the first of the runs that say something ends (m,), at the latest at times (m,)."""
    times = [np.where(each.known, each.time, np.inf) for each in (a, b)]
    return np.minimum(until, np.minimum(*times))


def _telling(bench: Bench, path: Path, richer: Rung, simpler: Rung, inputs: Reals, until: Reals) -> int:
    """The sample in which motions differ most at the beginning of the path, of those that go on to the end,
    and not much shorter than others; of all, if they differ in no such one."""
    at, bounce = path.values[0], bench.matched.bouncing(path.bounce)

    def run(model: Rung, values: dict[str, float]) -> Motions:
        return bench.run(model, inputs, until, LEVELS[0], bare=True, parameters=values | bounce, budget=QUICK)

    a, b = run(path.rung(richer, at), path.factors(at)), run(simpler, {})
    away = np.nan_to_num(apart(a, b, late=True))
    whole = (a.time >= until * (1.0 - 1e-9)) & (b.time >= until * (1.0 - 1e-9))
    whole &= until >= 0.1 * until.max()
    return int(np.argmax(away * whole if (away * whole).max() > 10.0 * LEVELS[0] else away))

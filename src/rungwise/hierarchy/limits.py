"""Definition 2: the order at which a model comes near another along a path of its parameters."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from rungwise.hierarchy.matching import DAMPING, STIFFNESS
from rungwise.hierarchy.motions import Bench, apart
from rungwise.kernel import Reals
from rungwise.models.ladder import Rung

ACCURACY = 1e-9
"""Error allowed per step of runs along a path, as a part of the extent."""
ROUGH = 1e-5
"""The same of runs that choose the inputs."""
BUDGET = 20_000
"""Most steps of one run along a path."""
FLOOR = 10.0
"""Distances below so many times the error of the runs say nothing."""
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
    """What was found along a path: distances at the values that were run, until a time; the order, as the
    exponent of the small number, with its standard error; `floor`: below it distances say nothing."""

    path: Path
    values: tuple[float, ...]
    distances: tuple[float, ...]
    floor: float
    order: float
    error: float
    until: float
    sample: int

    @property
    def verdict(self) -> str:
        seen = [d for d in self.distances if d > self.floor]
        if any(math.isnan(d) for d in self.distances) and len(seen) < 3:
            return UNDECIDED
        if not seen:
            return SAME
        if len(seen) == len(self.distances) and max(seen) - min(seen) <= max(self.floor, 1e-6 * max(seen)):
            return INDEPENDENT
        if math.isnan(self.order):
            return TENDS if self.distances[-1] <= self.floor else UNDECIDED
        if self.order - 2.0 * self.error > LEAST:
            return TENDS
        return STAYS if self.order + 2.0 * self.error < LEAST else UNDECIDED

    def __str__(self) -> str:
        order = (
            ""
            if math.isnan(self.order)
            else f": order {self.order:.2f} +- {self.error:.2f} in {self.path.name}"
        )
        return (
            f"{self.path.words}{order}; {self.verdict} ({self.distances[0]:.1e} to {self.distances[-1]:.1e})"
        )


def exponent(values: Reals, distances: Reals) -> tuple[float, float]:
    """The exponent p of distances ~ values^p by regression, and its standard error; nan for fewer than three
    points."""
    if len(values) < 3:
        return math.nan, math.nan
    x, y = np.log(values), np.log(distances)
    slope, offset = np.polyfit(x, y, 1)
    left = y - slope * x - offset
    return float(slope), float(math.sqrt(left @ left / (len(x) - 2) / ((x - x.mean()) ** 2).sum()))


def fit(bench: Bench, path: Path, richer: Rung, simpler: Rung, inputs: Reals, until: Reals) -> Fit:
    """Walk the path under those of the inputs (m, pieces, k) under which the two motions differ most at its
    beginning, until just before times (m,). Distances are those in the second half of the run, after the
    boundary layer."""
    bounce = bench.matched.bouncing(path.bounce)
    sample = _telling(bench, path, richer, simpler, inputs, until)
    chosen, end = inputs[sample : sample + 1], BEFORE * until[sample : sample + 1]

    def factors(at: float) -> dict[str, float]:
        return {STIFFNESS: path.stiffness(at), DAMPING: path.damping(at), **bounce}

    for _ in range(2):  # once more, if a run ends sooner: jams belong to distances, not to orders
        wanted = bench.run(simpler, chosen, end, ACCURACY, budget=BUDGET, parameters=bounce)
        rough = bench.run(simpler, chosen, end, 10.0 * ACCURACY, budget=BUDGET, parameters=bounce)
        runs = [
            bench.run(path.rung(richer, at), chosen, end, ACCURACY, budget=BUDGET, parameters=factors(at))
            for at in path.values
        ]
        first = min(float(run.time[0]) for run in (wanted, *runs))
        if first >= end[0] * (1.0 - 1e-9):
            break
        end = np.array([BEFORE * first])
    found = np.array([apart(run, wanted, late=True)[0] for run in runs])
    floor = FLOOR * max(float(np.nan_to_num(apart(rough, wanted, late=True)[0])), 10.0 * ACCURACY)
    kept = found > floor  # false for runs that say nothing
    order, error = exponent(np.array(path.values)[kept], found[kept])
    return Fit(
        path, path.values, tuple(found.tolist()), floor, order, error, float(end[0]), sample,
    )  # fmt: skip


def _telling(bench: Bench, path: Path, richer: Rung, simpler: Rung, inputs: Reals, until: Reals) -> int:
    """The sample in which motions differ most at the beginning of the path, of those that go on to the end;
    of all, if they differ in no such one."""
    at, bounce = path.values[0], bench.matched.bouncing(path.bounce)
    factors = {STIFFNESS: path.stiffness(at), DAMPING: path.damping(at), **bounce}
    end = BEFORE * until
    a = bench.run(path.rung(richer, at), inputs, end, ROUGH, parameters=factors)
    b = bench.run(simpler, inputs, end, ROUGH, parameters=bounce)
    away = np.nan_to_num(apart(a, b, late=True))
    whole = (a.time >= end * (1.0 - 1e-9)) & (b.time >= end * (1.0 - 1e-9))
    return int(np.argmax(away * whole if (away * whole).max() > 10.0 * ROUGH else away))

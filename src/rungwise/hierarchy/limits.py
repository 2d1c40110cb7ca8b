"""Definition 2: the order at which a model comes near another along a path of its parameters."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from rungwise.hierarchy.matching import DAMPING, STIFFNESS
from rungwise.hierarchy.motions import Bench, Motions, apart
from rungwise.kernel import Reals
from rungwise.models.ladder import Rung

ACCURACIES = (1e-9, 1e-7)
"""Error allowed per step of runs along a path, as a part of the extent: the second where the first takes too
many steps."""
ROUGH = 1e-5
"""The same of runs that choose the inputs."""
BUDGET = 8000
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
    """What was found along a path: distances at its values, nan where a run took too many steps, until a
    time, under a sample's inputs, at an accuracy; the order, as the exponent of the small number, with its
    standard error; `floor`: below it distances say nothing."""

    path: Path
    values: tuple[float, ...]
    distances: tuple[float, ...]
    floor: float
    order: float
    error: float
    until: float
    sample: int
    tol: float

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
    """Walk the path under those of the inputs (m, k) under which the two motions differ most at its
    beginning, until just before times (m,). Distances are those in the second half of the run, after the
    boundary layer."""
    sample = _telling(bench, path, richer, simpler, inputs, until)
    chosen, end = inputs[sample : sample + 1], BEFORE * until[sample : sample + 1]
    for tol in ACCURACIES:
        for _ in range(2):  # once more, if a run ends sooner: jams belong to distances, not to orders
            wanted, rough, runs = _walk(bench, path, richer, simpler, chosen, end, tol)
            first = min(
                (float(run.time[0]) for run in (wanted, *runs) if run.known[0]), default=float(end[0])
            )
            if first >= end[0] * (1.0 - 1e-9):
                break
            end = np.array([BEFORE * first])
        if len(runs) == len(path.values) and all(run.known[0] for run in runs):
            break
    found = np.array([apart(run, wanted, late=True)[0] for run in runs])
    errors = [apart(a, b, late=True)[0] for a, b in zip(rough, (wanted, *runs[-1:]), strict=False)]
    floor = FLOOR * float(np.nan_to_num([*errors, 3.0 * tol]).max())
    kept = found > floor  # false for runs that say nothing
    order, error = exponent(np.array(path.values)[kept], found[kept])
    return Fit(
        path, path.values, tuple(found.tolist()), floor, order, error, float(end[0]), sample, tol,
    )  # fmt: skip


def _walk(
    bench: Bench, path: Path, richer: Rung, simpler: Rung, chosen: Reals, end: Reals, tol: float
) -> tuple[Motions, list[Motions], list[Motions]]:
    """The simpler motion; the simpler one and the last of the richer ones at ten times the error; and the
    richer ones along the path, unless one takes too many steps for this accuracy."""
    bounce = bench.matched.bouncing(path.bounce)

    def run(at: float | None, error: float) -> Motions:
        model = simpler if at is None else path.rung(richer, at)
        values = bounce if at is None else path.factors(at) | bounce
        return bench.run(model, chosen, end, error, bare=True, budget=BUDGET, parameters=values)

    wanted, runs = run(None, tol), list[Motions]()
    for at in reversed(path.values):  # those that take most steps first
        if tol != ACCURACIES[-1] and not (runs[-1] if runs else wanted).known[0]:
            break
        runs.append(run(at, tol))
    rough = [run(at, 10.0 * tol) for at in (None, path.values[-1])] if len(runs) == len(path.values) else []
    return wanted, rough, runs[::-1]


def _telling(bench: Bench, path: Path, richer: Rung, simpler: Rung, inputs: Reals, until: Reals) -> int:
    """The sample in which motions differ most at the beginning of the path, of those that go on to the end;
    of all, if they differ in no such one."""
    at, bounce = path.values[0], bench.matched.bouncing(path.bounce)
    factors = path.factors(at) | bounce
    end = BEFORE * until
    a = bench.run(path.rung(richer, at), inputs, end, ROUGH, bare=True, parameters=factors)
    b = bench.run(simpler, inputs, end, ROUGH, bare=True, parameters=bounce)
    away = np.nan_to_num(apart(a, b, late=True))
    whole = (a.time >= end * (1.0 - 1e-9)) & (b.time >= end * (1.0 - 1e-9))
    return int(np.argmax(away * whole if (away * whole).max() > 10.0 * ROUGH else away))

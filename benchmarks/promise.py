"""What `tol` promises and what runs keep: random pushes on every rung, and the cost of rungs at equal error.

    python benchmarks/promise.py [--pushes N] [--json]

One rod or two, on rails, push a box, a disc, a triangle or a polygon that lies on a table; shapes, places,
directions, speeds, mass and friction are drawn. The truth of each rung is its own run at `FINE`. An error is
the distance of the part's place at the end from the true one, or what it is turned by times `LEVER`,
whichever is greater. `tol` is promised of a step: the first table says how many times `tol` a whole run is
off. The second compares rungs on pushes that both pass to their end: solves and time for the same error,
interpolated between values of `tol`, over solves and time of the rung above. The third turns every scene by
`TURN` and says how far apart the ends are then, over `tol`, and how many runs take other steps.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

import rungwise as rw

RUNGS = tuple(rung for rung in rw.LADDER if rung.moves)
TOLS = (1e-3, 1e-4, 1e-5, 1e-6)
"""In metres; parts are about 0.12 m wide."""
FINE = 1e-8
LEVER = 0.06
REPEATS = 3
AT = (1e-4, 1e-5, 1e-6)
TURN, ROD, APART = 0.7, 0.005, 1e-3


@dataclass(frozen=True)
class Kept:
    """Errors over `tol` of a rung's runs at one `tol`: median, 90 %, greatest; and the share below ten."""

    model: str
    tol: float
    runs: int
    median: float
    most: float
    greatest: float
    within_ten: float


@dataclass(frozen=True)
class Cost:
    """Solves and time of a rung over those of the rung above it, at equal error: medians over pushes."""

    model: str
    above: str
    error: float
    pushes: int
    solves: float
    microseconds: float


@dataclass(frozen=True)
class Turned:
    """Runs of turned scenes: how many take other steps, and the greatest distance of their ends over tol."""

    model: str
    tol: float
    runs: int
    other_steps: int
    greatest: float


@dataclass(frozen=True)
class Measured:
    """A run: its error (m), solves and time."""

    error: float
    solves: int
    microseconds: float


def outline(rng: np.random.Generator) -> tuple[dict[str, Any], NDArray[np.float64]]:
    """A shape, and corners (n, 2) of its outline, counter-clockwise."""
    kind = rng.choice(["box", "disc", "triangle", "polygon"])
    if kind == "box":
        width, height = (float(x) for x in rng.uniform(0.06, 0.15, 2))
        corners = 0.5 * np.array([[-width, -height], [width, -height], [width, height], [-width, height]])
        return {"kind": "box", "width": width, "height": height}, corners
    if kind == "disc":
        radius = float(rng.uniform(0.03, 0.07))
        angles = np.linspace(0.0, 2.0 * math.pi, 60, endpoint=False)
        return {"kind": "disc", "radius": radius}, radius * np.c_[np.cos(angles), np.sin(angles)]
    count = 3 if kind == "triangle" else int(rng.integers(4, 8))
    between = np.zeros(count)
    while between.min() < 0.3 or between.max() > 2.5:
        angles = np.sort(rng.uniform(0.0, 2.0 * math.pi, count))
        between = np.diff(angles, append=angles[0] + 2.0 * math.pi)
    corners = 0.06 * np.c_[np.cos(angles), np.sin(angles)]
    following = np.roll(corners, -1, axis=0)
    areas = np.cross(np.c_[corners, np.zeros(count)], np.c_[following, np.zeros(count)])[:, 2]
    corners -= ((corners + following) * areas[:, None]).sum(axis=0) / (3.0 * areas.sum())
    return {"kind": "polygon", "vertices": corners.tolist()}, corners


def turned(x: float, y: float, angle: float) -> tuple[float, float]:
    """A point or direction, turned about the origin."""
    return math.cos(angle) * x - math.sin(angle) * y, math.sin(angle) * x + math.cos(angle) * y


def push(seed: int, turn: float = 0.0) -> rw.Scene:
    """A random push of a second, in a frame turned by `turn`."""
    rng = np.random.default_rng(seed)
    shape, corners = outline(rng)
    mu, bodies, contacts = float(rng.uniform(0.0, 0.8)), {}, []
    for k in range(int(rng.integers(1, 3))):
        edge = int(rng.integers(len(corners)))
        along = corners[(edge + 1) % len(corners)] - corners[edge]
        normal = np.array([along[1], -along[0]]) / np.hypot(*along)
        place = corners[edge] + rng.uniform(0.15, 0.85) * along + (ROD + APART) * normal
        way, speed = turned(*-normal, rng.uniform(-0.6, 0.6)), float(rng.uniform(0.03, 0.1))
        x, y = turned(*place, turn)
        bodies[f"rod{k}"] = {
            "role": "robot",
            "shape": {"kind": "disc", "radius": ROD},
            "pose": {"x": x, "y": y},
            "motion": {"kind": "slide", "axis": list(turned(*way, turn)), "name": "way"},
            "coordinates": {"way": {"drive": {"kind": "speed", "speed": speed}}},
        }
        contacts.append({"between": [f"rod{k}", "part"], "friction": mu, "stiffness": 1e5, "damping": 450.0})
    mass, friction = (float(x) for x in rng.uniform([0.2, 0.2], [1.0, 0.5]))
    bodies["part"] = {
        "role": "object",
        "mass": mass,
        "shape": shape,
        "pose": {"angle": turn},
        "motion": {"kind": "free"},
        "support": {"friction": friction, "gravity": 9.81},
    }
    data = {"name": f"push_{seed}", "bodies": bodies, "contacts": contacts}
    return rw.load(data | {"tolerance": 1e-5, "duration": 1.0, "step": 1e-3})


def end(run: rw.Run, turn: float = 0.0) -> NDArray[np.float64]:
    """Where the part ends in the frame of the scene that is not turned: x, y and angle times LEVER."""
    x, y, angle = run.final["part"].values()
    return np.array([*turned(x, y, -turn), LEVER * (angle - turn)])


def distance(one: NDArray[np.float64], other: NDArray[np.float64]) -> float:
    return max(math.hypot(*(one - other)[:2]), abs(float((one - other)[2])))


def runs(scene: rw.Scene, rung: rw.Rung, fine_tol: float, repeats: int) -> list[Measured]:
    """A rung's runs at all `TOLS`; none where the fine run does not go through to the end of the time."""
    fine = rw.simulate(scene, rung, tol=fine_tol, frames=3)
    if fine.outcome.name != "timeout":
        return []
    found = []
    for tol in TOLS:
        same = [rw.simulate(scene, rung, tol=tol, frames=3) for _ in range(repeats)]
        least = 1e6 * min(run.wall_s for run in same)
        found.append(Measured(distance(end(same[0]), end(fine)), same[0].solves, least))
    return found


def kept(rung: rw.Rung, pushes: Sequence[list[Measured]]) -> list[Kept]:
    """How many times `tol` the runs of a rung are off."""
    rows = []
    for k, tol in enumerate(TOLS):
        over = np.array([found[k].error / tol for found in pushes if found])
        if len(over):
            middle, most = (float(x) for x in np.quantile(over, [0.5, 0.9]))
            share = float((over <= 10.0).mean())
            rows.append(Kept(rung.name, tol, len(over), middle, most, float(over.max()), share))
    return rows


def needed(found: Sequence[Measured], error: float, what: str) -> float:
    """Solves or time for an error, by interpolation of logarithms; nan outside the errors of the runs."""
    falling = sorted((run for run in found if run.error > 0.0), key=lambda run: run.error)
    if not falling:
        return math.nan
    known = np.log([run.error for run in falling])
    values = np.log([float(getattr(run, what)) for run in falling])
    return math.exp(np.interp(math.log(error), known, values, left=math.nan, right=math.nan))


def costs(low: rw.Rung, high: rw.Rung, of: dict[str, list[list[Measured]]]) -> list[Cost]:
    """Cost of a rung over that of the rung above it."""
    rows = []
    for error in AT:
        parts = {
            what: [
                needed(a, error, what) / needed(b, error, what)
                for a, b in zip(of[low.name], of[high.name], strict=True)
            ]
            for what in ("solves", "microseconds")
        }
        both = [k for k, part in enumerate(parts["solves"]) if math.isfinite(part)]
        if both:
            solves, micro = (float(np.median([parts[what][k] for k in both])) for what in parts)
            rows.append(Cost(low.name, high.name, error, len(both), solves, micro))
    return rows


def frames(rung: rw.Rung, tol: float, seeds: Sequence[int]) -> Turned:
    """Runs in a frame and in a turned one."""
    apart, others = [], 0
    for seed in seeds:
        one, other = (rw.simulate(push(seed, turn), rung, tol=tol, frames=3) for turn in (0.0, TURN))
        if one.outcome.name == other.outcome.name == "timeout":
            apart.append(distance(end(one), end(other, TURN)) / tol)
            others += one.steps != other.steps
    return Turned(rung.name, tol, len(apart), others, max(apart, default=math.nan))


def main(arguments: Sequence[str] | None = None, *, fine: float = FINE, repeats: int = REPEATS) -> int:
    """Print the three tables, or one JSON object."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--pushes", type=int, default=100, metavar="N", help="random pushes")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    options = parser.parse_args(arguments)
    seeds = range(options.pushes)
    of = {rung.name: [runs(push(seed), rung, fine, repeats) for seed in seeds] for rung in RUNGS}
    promises = [row for rung in RUNGS for row in kept(rung, of[rung.name])]
    beside = [row for low, high in pairwise(RUNGS) for row in costs(low, high, of)]
    other_frames = [frames(rung, 1e-5, seeds) for rung in RUNGS]
    if options.json:
        tables = {"kept": promises, "costs": beside, "turned": other_frames}
        print(json.dumps({name: [asdict(row) for row in rows] for name, rows in tables.items()}))
        return 0
    print(
        f"error over tol:\n{'rung':22} {'tol':>7} {'runs':>5} {'median':>7} {'90 %':>7} {'most':>7}"
        f" {'<= 10':>6}"
    )
    for row in promises:
        print(
            f"{row.model:22} {row.tol:7.0e} {row.runs:5d} {row.median:7.2f} {row.most:7.2f}"
            f" {row.greatest:7.2f} {row.within_ten:6.1%}"
        )
    print("cost over that of the rung above, at equal error, in the median:")
    for part in beside:
        print(
            f"{part.model} / {part.above}, error {part.error:.0e} m, {part.pushes} pushes:"
            f" solves {part.solves:.2f}, microseconds {part.microseconds:.2f}"
        )
    print(f"turned by {TURN}:")
    for frame in other_frames:
        print(
            f"{frame.model:22} tol {frame.tol:.0e}: {frame.runs} runs, {frame.other_steps} with different"
            f" steps, ends apart by {frame.greatest:.0e} of tol at most"
        )
    return 0


if __name__ == "__main__":
    sys.exit(main())

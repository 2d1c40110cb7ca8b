"""Work against error: steps, solves and time of each rung at several tolerances, beside its own fine run.

    python benchmarks/work_precision.py [--json]

The error is the greatest difference of a coordinate at the end, angles times the longest lever, over the
scene's extent. The observed order is that of errors over solves. The last table has the cost of each rung
beside the rung above it in richness, at equal error: solves and time are interpolated between tolerances.
Runs that end at a goal end within a nominal step of it: there errors have that floor.
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

import rungwise as rw

TOLS = (1e-3, 1e-4, 1e-5, 1e-6)
FINE = 1e-3
RUNGS = tuple(rung for rung in rw.LADDER if rung.moves)
SHIPPED = ("two_finger", "four_finger", "two_link")
AT = (1e-3, 1e-4, 1e-5)


@dataclass(frozen=True)
class Row:
    """A run; error is a part of the scene's extent."""

    scene: str
    model: str
    tol: float
    steps: int
    solves: int
    microseconds: float
    error: float


def push() -> rw.Scene:
    """A box of 0.2 on a plane that resists its sliding, pushed aside its centre by as much as its length."""
    damping = 0.5 * 9.81 * 0.3 / 0.05
    rubs = {"x": {"damping": damping}, "y": {"damping": damping}, "angle": {"damping": damping * 0.0645**2}}
    pusher = {
        "role": "robot",
        "shape": {"kind": "disc", "radius": 0.01},
        "pose": {"x": -0.112, "y": 0.02},
        "motion": {"kind": "slide", "axis": [1, 0], "name": "x"},
        "coordinates": {"x": {"drive": {"kind": "speed", "speed": 0.1}}},
    }
    box = {"role": "object", "mass": 0.5, "shape": {"kind": "box", "width": 0.2, "height": 0.1}}
    box |= {"motion": {"kind": "free"}, "coordinates": rubs}
    contact = {"between": ["pusher", "box"], "friction": 0.3, "stiffness": 1e5, "damping": 450.0}
    data: dict[str, Any] = {"name": "push", "bodies": {"pusher": pusher, "box": box}, "contacts": [contact]}
    return rw.load(data | {"tolerance": 1e-5, "duration": 2.0, "step": 1e-3})


def measure(scene: rw.Scene, model: rw.Rung, tols: Sequence[float], repeats: int) -> list[Row]:
    """Rows of one rung, at tolerances relative to the scene's extent."""
    first = rw.simulate(scene, model, frames=3)
    if first.workspace is None:
        raise RuntimeError(first.reason)
    clock = first.workspace.state.clock[0]
    extent, reach = float(clock["extent"]), float(clock["reach"])
    lever = np.array([reach if name.endswith("angle") else 1.0 for name in scene.template.coordinates])

    def run(tol: float) -> rw.Run:
        return rw.simulate(scene, model, tol=tol * extent, duration=first.time, frames=3)

    def end(done: rw.Run) -> np.ndarray[Any, Any]:
        return np.array([x for body in done.final.values() for x in body.values()]) * lever

    reference, rows = end(run(FINE * min(tols))), []
    for tol in tols:
        runs = [run(tol) for _ in range(repeats)]
        error = float(np.abs(end(runs[0]) - reference).max()) / extent
        least = 1e6 * min(done.wall_s for done in runs)
        rows.append(Row(scene.name, model.name, tol, runs[0].steps, runs[0].solves, least, error))
    return rows


def order(rows: Sequence[Row]) -> float:
    """Exponent p of errors ~ solves^-p; nan where errors are rounding."""
    rows = [row for row in rows if row.error > 1e-11]
    if len({row.solves for row in rows}) < 2:
        return math.nan
    fit = np.polyfit(np.log([row.solves for row in rows]), np.log([row.error for row in rows]), 1)
    return float(-fit[0])


def cost(rows: Sequence[Row], error: float, what: str) -> float:
    """Solves or time for an error, by interpolation of logarithms; nan outside the errors measured."""
    rows = sorted((row for row in rows if row.error > 0.0), key=lambda row: row.error)
    known = np.log([row.error for row in rows])
    values = np.log([float(getattr(row, what)) for row in rows])
    found = np.interp(math.log(error), known, values, left=math.nan, right=math.nan) if rows else math.nan
    return math.exp(found)


def ratios(rows: Sequence[Row]) -> list[dict[str, Any]]:
    """Cost of each rung over that of the rung above it, for the push, where all pass the same modes."""
    of = {rung.name: [row for row in rows if (row.scene, row.model) == ("push", rung.name)] for rung in RUNGS}
    found = []
    for low, high in pairwise(RUNGS):
        for error in AT:
            parts = {
                what: cost(of[low.name], error, what) / cost(of[high.name], error, what)
                for what in ("solves", "microseconds")
            }
            if all(math.isfinite(part) for part in parts.values()):
                found.append({"model": low.name, "above": high.name, "error": error} | parts)
    return found


def main(
    arguments: Sequence[str] | None = None,
    *,
    tols: Sequence[float] = TOLS,
    repeats: int = 5,
    shipped: Sequence[str] = SHIPPED,
) -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    chosen = parser.parse_args(arguments)
    groups = [
        measure(scene, rung, tols, repeats)
        for scene in (push(), *(rw.load(name) for name in shipped))
        for rung in RUNGS
    ]
    rows = [row for group in groups for row in group]
    beside = ratios(rows)
    if chosen.json:
        orders = {f"{group[0].scene} {group[0].model}": order(group) for group in groups}
        print(json.dumps({"rows": [asdict(row) for row in rows], "orders": orders, "ratios": beside}))
        return 0
    print(f"{'scene':12} {'rung':22} {'tol':>8} {'steps':>7} {'solves':>7} {'us':>9} {'error':>9}")
    for group in groups:
        for row in group:
            print(
                f"{row.scene:12} {row.model:22} {row.tol:8.0e} {row.steps:7d} {row.solves:7d}"
                f" {row.microseconds:9.0f} {row.error:9.1e}"
            )
        print(f"{'':12} {'':22} order {order(group):.2f}")
    for part in beside:
        print(
            f"{part['model']} / {part['above']} at {part['error']:.0e}:"
            f" solves {part['solves']:.2f}, time {part['microseconds']:.2f}"
        )
    return 0


if __name__ == "__main__":
    sys.exit(main())

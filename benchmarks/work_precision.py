"""Work against error: steps, solves and time of each rung at several tolerances, beside its own fine run.

    python benchmarks/work_precision.py [--json]

Each scene runs without its conditions, up to 98 % of the time at which the first of its rungs ends
with them. The error is the greatest difference of a coordinate at the end, angles times the longest lever,
over the scene's extent. The observed order is that of errors over solves. The last tables are of the slow
pushes, on which all rungs pass the same modes: solves for a given error in sizes of the part that is pushed,
and the cost of each rung beside the rung above it in richness, at equal error; solves and time are
interpolated between tolerances.
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

TOLS = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6)
FINE = 1e-2
CONDITIONS = ("goal", "unsafe", "doomed")
RUNGS = tuple(rung for rung in rw.LADDER if rung.moves)
SHIPPED: dict[str, dict[str, float]] = {
    "two_finger": {"v2": 0.7}, "push": {}, "four_finger": {"x": 0.08, "y": 0.03, "angle": 0.1},
    "two_link": {}, "pivot": {},
}  # fmt: skip
"""Scenes, and their parameters where these are not the defaults."""
AT = (1e-3, 1e-4, 1e-5, 1e-6)
SLOW = ("drag", "push")
SIZE = 0.2
"""Width of the part in both."""
PART = 0.98


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
    extent: float


def drag() -> rw.Scene:
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
    data: dict[str, Any] = {"name": "drag", "bodies": {"pusher": pusher, "box": box}, "contacts": [contact]}
    return rw.load(data | {"tolerance": 1e-5, "duration": 2.0, "step": 1e-3})


def without_conditions(scene: rw.Scene, parameters: dict[str, float]) -> tuple[rw.Scene, float]:
    """The scene with these parameters, without goal, unsafe and doomed, and the end of its runs."""
    end = PART * min(rw.simulate(scene, rung, parameters=parameters, frames=3).time for rung in RUNGS)
    data = scene.file.model_copy(update=dict.fromkeys((*CONDITIONS, "task"))).model_dump(mode="json")
    for name, value in parameters.items():
        data["parameters"][name]["default"] = value
    return rw.load(data), end


def measure(
    scene: rw.Scene, model: rw.Rung, duration: float, tols: Sequence[float], repeats: int
) -> list[Row]:
    """Rows of one rung, at tolerances relative to the scene's extent."""
    first = rw.simulate(scene, model, frames=3, duration=duration, tol=1e-2)
    if first.workspace is None:
        raise RuntimeError(first.reason)
    clock = first.workspace.state.clock[0]
    extent, reach = float(clock["extent"]), float(clock["reach"])
    lever = np.array([reach if name.endswith("angle") else 1.0 for name in scene.template.coordinates])

    def run(tol: float) -> rw.Run:
        return rw.simulate(scene, model, tol=tol * extent, duration=duration, frames=3)

    def end(done: rw.Run) -> np.ndarray[Any, Any]:
        return np.array([x for body in done.final.values() for x in body.values()]) * lever

    reference, rows = end(run(FINE * min(tols))), []
    for tol in tols:
        runs = [run(tol) for _ in range(repeats)]
        error = float(np.abs(end(runs[0]) - reference).max()) / extent
        least = 1e6 * min(done.wall_s for done in runs)
        rows.append(Row(scene.name, model.name, tol, runs[0].steps, runs[0].solves, least, error, extent))
    return rows


def order(rows: Sequence[Row]) -> float:
    """Exponent p of errors ~ solves^-p; nan where errors are rounding."""
    rows = [row for row in rows if row.error > 1e-11]
    if len({row.solves for row in rows}) < 2:
        return math.nan
    fit = np.polyfit(np.log([row.solves for row in rows]), np.log([row.error for row in rows]), 1)
    return float(-fit[0])


def cost(rows: Sequence[Row], error: float, what: str) -> float:
    """Solves or time for an error in sizes of the part, by interpolation of logarithms; nan outside the
    errors measured."""
    rows = sorted((row for row in rows if row.error > 0.0), key=lambda row: row.error)
    known = np.log([row.error * row.extent / SIZE for row in rows])
    values = np.log([float(getattr(row, what)) for row in rows])
    found = np.interp(math.log(error), known, values, left=math.nan, right=math.nan) if rows else math.nan
    return math.exp(found)


def costs(rows: Sequence[Row]) -> list[dict[str, Any]]:
    """Solves and time of each rung for given errors, on the slow pushes."""
    return [
        {"scene": scene, "model": rung.name, "error": error}
        | {what: cost(of, error, what) for what in ("solves", "microseconds")}
        for scene in SLOW
        for rung in RUNGS
        for of in [[row for row in rows if (row.scene, row.model) == (scene, rung.name)]]
        for error in AT
    ]


def ratios(found: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """Cost of each rung over that of the rung above it: geometric mean and greatest, over the slow pushes and
    all errors that both reach."""
    rows = []
    for low, high in pairwise(RUNGS):
        pairs = [
            (a, b)
            for a in found
            for b in found
            if (a["model"], b["model"]) == (low.name, high.name)
            and (a["scene"], a["error"]) == (b["scene"], b["error"])
        ]
        for what in ("solves", "microseconds"):
            parts = [a[what] / b[what] for a, b in pairs if math.isfinite(a[what] / b[what])]
            if parts:
                mean = math.exp(sum(map(math.log, parts)) / len(parts))
                rows.append(
                    {"model": low.name, "above": high.name, "what": what, "mean": mean, "most": max(parts)}
                )
    return rows


def main(
    arguments: Sequence[str] | None = None,
    *,
    tols: Sequence[float] = TOLS,
    repeats: int = 5,
    shipped: Sequence[str] = tuple(SHIPPED),
) -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    chosen = parser.parse_args(arguments)
    groups = [
        measure(scene, rung, duration, tols, repeats)
        for scene, duration in (
            without_conditions(drag(), {}),
            *(without_conditions(rw.load(name), SHIPPED[name]) for name in shipped),
        )
        for rung in RUNGS
    ]
    rows = [row for group in groups for row in group]
    needed = costs(rows)
    beside = ratios(needed)
    if chosen.json:
        orders = {f"{group[0].scene} {group[0].model}": order(group) for group in groups}
        print(
            json.dumps(
                {"rows": [asdict(row) for row in rows], "orders": orders, "costs": needed, "ratios": beside}
            )
        )
        return 0
    print(f"{'scene':12} {'rung':22} {'tol':>8} {'steps':>7} {'solves':>7} {'us':>9} {'error':>9}")
    for group in groups:
        for row in group:
            print(
                f"{row.scene:12} {row.model:22} {row.tol:8.0e} {row.steps:7d} {row.solves:7d}"
                f" {row.microseconds:9.0f} {row.error:9.1e}"
            )
        print(f"{'':12} {'':22} order {order(group):.2f}")
    for part in needed:
        if math.isfinite(part["solves"]):
            print(
                f"{part['scene']:12} {part['model']:22} error {part['error']:.0e}:"
                f" {part['solves']:5.0f} solves {part['microseconds']:7.0f} us"
            )
    for part in beside:
        print(
            f"{part['model']} / {part['above']}, {part['what']}: {part['mean']:.2f} on average,"
            f" {part['most']:.2f} at most"
        )
    return 0


if __name__ == "__main__":
    sys.exit(main())

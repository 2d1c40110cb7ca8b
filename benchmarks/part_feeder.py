"""How a pin is found that turns all cups the same way up: directly, or after geometry and a cheaper rung.

    python benchmarks/part_feeder.py [--fresh 100] [--rigid] [--budget 250] [--seed 0] [--json]

Direct search looks for the pin's place in a box, on dynamic-compliant. The other two begin as the authors of
the device do, with geometry: the pin's tip must enter the cavity of a cup that comes open end first, beyond
where its closed end drops off the lip, and must be reached by the closed end of the other while its rear is
still on the chute and its centre of mass is beyond the lip. In the chute's frame that is a box. In it the
search is made directly, or on dynamic-rigid first. All are the search of `rw.design`, with fewer designs and
cups in a round; told are runs until a design turns all cups of its round, and what the last design is worth
on the same fresh cups.
"""

from __future__ import annotations

import argparse
import json
import time
from dataclasses import dataclass, field
from typing import Any

import numpy as np

import rungwise as rw
from rungwise.planning.design.coarse_to_fine import searched_earlier
from rungwise.planning.design.design import NEAR
from rungwise.planning.design.optimise import SPREAD, Tuner
from rungwise.sets.request import box_of

SCENE, BOX = "part_feeder", {"pin_x": (0.015, 0.045), "pin_y": (-0.025, 0.015)}
DESIGNS, CUPS, TOL = 10, 10, 1e-4

Box = dict[str, tuple[float, float]]


@dataclass
class Watched(Tuner):
    """Notes after how many runs a design turned all cups."""

    solved: list[int] = field(default_factory=list)

    def tried(
        self, designs: np.ndarray, quantiles: np.ndarray | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        rates, margins = super().tried(designs, quantiles)
        if rates.max() == 1.0:
            self.solved.append(self.count)
        return rates, margins


def chute_frame() -> rw.Scene:
    """The scene with the pin's tip given along the chute, from the lip, and above it."""
    file = json.loads(rw.load(SCENE).file.model_dump_json(exclude_unset=True))
    for name, value in (("along", 0.028), ("above", 0.01)):
        file["parameters"][name] = {"default": value, "range": [-1.0, 1.0], "unit": "m"}
    pose = file["bodies"]["protrusion"]["pose"]
    pose["x"] = pose["x"].replace("pin_x", "along * cos(slope) + above * sin(slope)")
    pose["y"] = pose["y"].replace("pin_y", "above * cos(slope) - along * sin(slope)")
    return rw.load(file)


def geometry() -> dict[str, tuple[float, float]]:
    """Places of the tip, in the chute's frame, that geometry does not rule out."""
    at = rw.load(SCENE).parameters()
    areas = at["closed"] * at["width"], 2.0 * (at["length"] - at["closed"]) * at["wall"]
    middles = at["closed"] / 2.0, (at["length"] + at["closed"]) / 2.0
    centre = float(np.dot(areas, middles) / sum(areas))
    inside = at["wall"] + at["pin"]
    return {"along": (max(centre, at["closed"]), at["length"]), "above": (inside, at["width"] - inside)}


def successes(scene: rw.Scene, values: dict[str, float], fresh: int) -> int:
    """How many of the same fresh cups leave closed end down."""
    task, rng = scene.file.task, np.random.default_rng(12345)
    assert task is not None
    drawn = {name: rng.uniform(*spread.uniform, fresh) for name, spread in task.uncertain.items()}
    found = rw.rollout(scene, "dynamic-compliant", parameters=values | drawn, tol=TOL, keep=False)
    return int(np.sum(found.outcomes == "goal"))


def searched(scene: rw.Scene, box: Box, rungs: tuple[rw.Rung, ...], given: Any) -> dict[str, Any]:
    """One search: its runs on each rung, its time, its design and what that is worth."""
    rng, names, began = np.random.default_rng(given.seed), tuple(box), time.perf_counter()
    task = scene.file.task
    assert task is not None
    quantiles = np.stack([(rng.permutation(CUPS) + 0.5) / CUPS for _ in task.uncertain], axis=-1)

    def tuner_of(rung: rw.Rung) -> Watched:
        return Watched(scene, rung, names, box_of(scene, names, box), scene.parameters(), quantiles, TOL)

    start, earlier = searched_earlier(rungs, tuner_of, DESIGNS, given.budget, rng)
    tuner = tuner_of(rw.DYNAMIC_COMPLIANT)
    best = tuner.searched(start, DESIGNS, given.budget, rng, SPREAD if start is None else NEAR)[0]
    seconds, values = time.perf_counter() - began, dict(zip(names, best.tolist(), strict=True))
    return {
        "solved": tuner.solved[0] if tuner.solved else None,
        "runs": tuner.count,
        "earlier": sum(each.runs for each in earlier),
        "seconds": seconds,
        "values": values,
        "successes": successes(scene, values, given.fresh),
    }


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--fresh", type=int, default=100, help="cups on which designs are tried")
    parser.add_argument("--budget", type=int, default=250, help="most runs of a search on a rung")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--rigid", action="store_true", help="search on dynamic-rigid, too")
    parser.add_argument("--json", action="store_true")
    given = parser.parse_args(arguments)
    plain, turned, region = rw.load(SCENE), chute_frame(), geometry()
    rows = {
        "direct": searched(plain, BOX, (), given),
        "geometry, then direct": searched(turned, region, (), given),
    }
    if given.rigid:
        name = "geometry, dynamic-rigid, then direct"
        rows[name] = searched(turned, region, (rw.DYNAMIC_RIGID,), given)
    if given.json:
        print(json.dumps({"fresh": given.fresh, "region": region, "rows": rows}))
        return 0
    (a, b), (c, d) = ([1e3 * end for end in interval] for interval in region.values())
    print(f"geometry leaves {a:.1f} to {b:.1f} mm along the chute, {c:.1f} to {d:.1f} mm above it")
    print(
        f"  {'search':37s} {'all turned after':>16s} {'runs':>6s} {'rigid':>6s} {'s':>5s}  of {given.fresh}"
    )
    for name, row in rows.items():
        after = "never" if row["solved"] is None else str(row["solved"])
        runs = f"{row['runs']:6d} {row['earlier']:6d} {row['seconds']:5.0f}"
        print(f"  {name:37s} {after:>16s} {runs}  {row['successes']}")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())

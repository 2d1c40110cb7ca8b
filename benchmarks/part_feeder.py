"""How a pin is found that turns all cups the same way up: directly, or after geometry and a cheaper rung.

    python benchmarks/part_feeder.py [--fresh 1000] [--budget 8000] [--seed 0] [--json]

Direct search looks for the pin's place in a box, on dynamic-compliant. The other two begin as the authors of
the device do, with geometry: the pin's tip must enter the cavity of a cup that comes open end first, beyond
where its closed end drops off the lip, and must be reached by the closed end of the other while its rear is
still on the chute and its centre of mass is beyond the lip. In the chute's frame that is a box. In it the
search is made directly, or on dynamic-rigid first. Runs are those of each search, without those that confirm
a design, which is tried on the same fresh cups.
"""

from __future__ import annotations

import argparse
import json
import time
from typing import Any

import numpy as np

import rungwise as rw
from rungwise.planning.design import DRAWS
from rungwise.planning.tune import HALVINGS, SCAN

SCENE, BOX = "part_feeder", {"pin_x": (0.015, 0.045), "pin_y": (-0.025, 0.015)}


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
    found = rw.rollout(scene, "dynamic-compliant", parameters=values | drawn, tol=5e-5, keep=False)
    return int(np.sum(found.outcomes == "goal"))


def searched(scene: rw.Scene, box: dict[str, tuple[float, float]], first: str | None, given: Any) -> dict[str, Any]:
    """One search: its runs on each rung, its time, its design and what that is worth."""
    began = time.perf_counter()
    found = rw.design(
        scene, tuple(box), box=box, from_=first, robust=True, samples=1, budget=given.budget, seed=given.seed
    )
    seconds = time.perf_counter() - began
    drift = 2 * len(box) * (SCAN - 1 + HALVINGS) * DRAWS + 1 + DRAWS
    return {
        "runs": found.runs - (drift if found.found else 0),
        "earlier": sum(each.runs for each in found.earlier),
        "seconds": seconds,
        "values": found.values,
        "successes": successes(scene, found.values, given.fresh) if found.found else 0,
    }


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--fresh", type=int, default=1000, help="cups on which designs are tried")
    parser.add_argument("--budget", type=int, default=8000, help="most runs of a search on a rung")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--json", action="store_true")
    given = parser.parse_args(arguments)
    plain, turned, region = rw.load(SCENE), chute_frame(), geometry()
    rows = {
        "direct": searched(plain, BOX, None, given),
        "geometry, then direct": searched(turned, region, None, given),
        "geometry, dynamic-rigid, then direct": searched(turned, region, "dynamic-rigid", given),
    }
    if given.json:
        print(json.dumps({"fresh": given.fresh, "region": region, "rows": rows}))
        return 0
    (a, b), (c, d) = region.values()
    print(f"geometry leaves {1e3 * a:.1f} to {1e3 * b:.1f} mm along the chute, {1e3 * c:.1f} to {1e3 * d:.1f} mm above it")
    print(f"  {'search':38s} {'runs':>6s} {'on rigid':>9s} {'seconds':>8s}  successes of {given.fresh}")
    for name, row in rows.items():
        print(f"  {name:38s} {row['runs']:6d} {row['earlier']:9d} {row['seconds']:8.0f}  {row['successes']}")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())

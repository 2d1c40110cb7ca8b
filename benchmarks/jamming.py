"""Whether a peg in a hole slides or jams under given forces, beside Whitney's parallelogram.

    python benchmarks/jamming.py [--cases 500] [--model quasistatic-rigid] [--json]

A peg of half-width r is at the depth l in a hole, with forces Fx across it, Fz into it, and a moment M about
its tip. It slides in if |Fx / Fz| < 1 / mu and M / (r Fz) is between +-L - mu (1 + L) Fx / Fz, two lines with
L = l / (2 r mu). On them it touches the hole at two points, on the other sides of the parallelogram along one
face. Each case draws mu, l and a point of the boundary; loads of (1 - MARGIN) and of (1 + MARGIN) times that
point must slide and jam.

Two points may wedge the peg, hold it whatever the load, if its angle is greater than c / mu, c the clearance
over the width of the hole: then they close it by force. That is asked at angles MARGIN beyond and below.
"""

from __future__ import annotations

import argparse
import json
import math
import time
from typing import Any, NamedTuple

import numpy as np

import rungwise as rw

HALF, CLEARANCE, PUSH = 0.01, 2e-6, 10.0
"""Half the peg's width, the clearance, and Fz."""
MARGIN = 0.02
SLIDES = 1e-9
"""Motion that counts as sliding: a hundredth of what the drag lets by at a hundredth of the load."""
SIDES = ("upper", "lower", "right", "left")


class Case(NamedTuple):
    """A point of the parallelogram: Fx / Fz and M / (r Fz); and the pose of the peg that touches there."""

    side: str
    mu: float
    depth: float
    across: float
    turning: float


def drawn(rng: np.random.Generator) -> Case:
    """A point of a side; where two points could hold the peg there is no parallelogram, and none is drawn."""
    mu = float(rng.uniform(0.1, 0.8))
    length = float(rng.uniform(1.05, 5.0))
    side, at = SIDES[int(rng.integers(4))], float(rng.uniform(0.02, 0.98))
    corners = {"upper": (-1.0, 1.0 + 2.0 * length, 1.0, -1.0), "right": (1.0, -1.0, 1.0, -1.0 - 2.0 * length)}
    mirrored = -1.0 if side in ("lower", "left") else 1.0
    x0, y0, x1, y1 = corners["upper" if side in ("upper", "lower") else "right"]
    across, turning = x0 + at * (x1 - x0), y0 + at * (y1 - y0)
    return Case(side, mu, 2.0 * HALF * mu * length, mirrored * across / mu, mirrored * turning)


def pose(side: str, depth: float) -> dict[str, float]:
    """The start of a peg that touches both sides of the hole, or one along its depth."""
    if side in ("right", "left"):
        shift = CLEARANCE / 2.0 * (1.0 if side == "right" else -1.0)
        return {"start_x": shift, "apart": -depth, "start_angle": 0.0}
    hole, angle = 2.0 * HALF + CLEARANCE, CLEARANCE / depth
    for _ in range(20):
        angle = math.asin((hole - 2.0 * HALF * math.cos(angle)) / depth)
    across, down = hole / 2.0 - HALF * math.cos(angle), HALF * math.sin(angle) - depth * math.cos(angle)
    sign = 1.0 if side == "upper" else -1.0
    return {"start_x": sign * across, "apart": down, "start_angle": sign * angle}


def moved(cases: list[Case], scale: float, model: str) -> np.ndarray:
    """How far the tip goes down under `scale` times the loads of the cases."""
    rows = [
        pose(case.side, case.depth)
        | {"mu": case.mu, "fx": scale * case.across * PUSH, "moment": scale * case.turning * HALF * PUSH}
        | {"deep": case.depth + 0.02, "length": case.depth + 0.02}
        for case in cases
    ]
    given: dict[str, Any] = {name: np.array([row[name] for row in rows]) for name in rows[0]}
    # The mouth's edges are the lower ends of chamfers that are next to nothing.
    given |= {"fy": -PUSH, "clearance": CLEARANCE, "width": 2.0 * HALF, "chamfer": 1e-9, "depth": 1.0}
    given |= {"spring": 0.0, "push_spring": 0.0, "turn_spring": 0.0, "drag": 1e4}
    found = rw.rollout(
        "peg_in_hole", model, parameters=given, durations=[1e-2], step=1e-3, tol=None, keep=False
    )
    return np.asarray(given["apart"] - found.final[:, 1])


def closes(case: Case) -> bool:
    """Whether the two points close the peg by force: the line between them is in both friction cones."""
    start = pose("upper", case.depth)
    hole, turn = HALF + CLEARANCE / 2.0, start["start_angle"]
    tip = np.array([start["start_x"], start["apart"]])
    corner = tip + HALF * np.array([math.cos(turn), math.sin(turn)])
    normals = [[-1.0, 0.0], [math.cos(turn), math.sin(turn)]]
    return bool(rw.force_closure([corner, [-hole, 0.0]], normals, case.mu))


def measured(model: str, count: int) -> dict[str, Any]:
    """How many cases slide within the parallelogram and jam outside it; how many are wedged beyond c / mu."""
    rng = np.random.default_rng(0)
    cases = [drawn(rng) for _ in range(count)]
    sides = np.array([case.side for case in cases])
    slid = moved(cases, 1.0 - MARGIN, model) > SLIDES
    jammed = np.abs(moved(cases, 1.0 + MARGIN, model)) < SLIDES
    rows = [
        (side, int(np.sum(sides == side)), int(slid[sides == side].sum()), int(jammed[sides == side].sum()))
        for side in SIDES
    ]
    held, free = (
        sum(closes(case._replace(depth=depth_at(part, case.mu))) == wedges for case in cases)
        for part, wedges in ((1.0 + MARGIN, True), (1.0 - MARGIN, False))
    )
    return {"model": model, "sides": rows, "held": held, "free": free, "cases": count}


def depth_at(part: float, mu: float) -> float:
    """The depth at which a peg that touches both sides is at this part of the angle c / mu."""
    hole = 2.0 * HALF + CLEARANCE
    angle = part * CLEARANCE / hole / mu
    return (hole - 2.0 * HALF * math.cos(angle)) / math.sin(angle)


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--cases", type=int, default=500)
    parser.add_argument("--model", default="quasistatic-rigid")
    parser.add_argument("--json", action="store_true")
    given = parser.parse_args(arguments)
    began = time.perf_counter()
    found = measured(given.model, given.cases)
    found["seconds"] = time.perf_counter() - began
    if given.json:
        print(json.dumps(found))
    else:
        print(f"{given.model}, loads {100 * MARGIN:g} % within and beyond the parallelogram")
        for side, count, slid, jammed in found["sides"]:
            print(f"  {side:6} {slid:4} of {count:3} slide within, {jammed:4} jam beyond")
        print(
            f"two points hold {found['held']} of {given.cases} pegs {100 * MARGIN:g} % beyond the angle"
            f" c / mu, and let go {found['free']} below it"
        )
    right = sum(slid + jammed for _, _, slid, jammed in found["sides"]) == 2 * given.cases
    return 0 if right and found["held"] == found["free"] == given.cases else 1


if __name__ == "__main__":
    raise SystemExit(main())

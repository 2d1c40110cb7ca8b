"""A peg finds a hole without chamfers by guarded moves: how often, from 200 uncertain holes.

    python examples/peg_in_hole.py [--samples 200] [--model quasistatic-rigid] [--json]

The hole is up to 1 mm and 1 degree elsewhere. The peg is led straight down; or it is tilted, lowered with
one corner above the hole until it touches the far edge, drawn back until that corner touches the near side,
turned upright, and led down. Moves end at touches (`until`), which is all that is measured.
"""

from __future__ import annotations

import argparse
import json

import numpy as np

import rungwise as rw

MOVES = (
    rw.Segment({"tx": 0.002, "ty": 0.004, "tilt": 0.1}, 0.5, ramp=True),
    rw.Segment({"tx": 0.002, "ty": -0.02, "tilt": 0.1}, 2.0, "force(peg, right) >= 3", ramp=True),
    rw.Segment({"tx": -0.004, "ty": -0.02, "tilt": 0.1}, 2.0, "force(peg, left) >= 3", ramp=True),
    rw.Segment({"tx": 0.0, "ty": -0.02, "tilt": 0.0}, 1.0, ramp=True),
    rw.Segment({"tx": 0.0, "ty": -0.035, "tilt": 0.0}, 1.0, ramp=True),
)
FRICTIONS = (0.1, 0.2, 0.4)


def holes(samples: int) -> dict[str, np.ndarray]:
    """Places and angles of holes."""
    rng = np.random.default_rng(0)
    return {"x": rng.uniform(-1e-3, 1e-3, samples), "angle": np.radians(rng.uniform(-1.0, 1.0, samples))}


def successes(model: str, samples: int, friction: float, guarded: bool) -> int:
    """How many pegs come to the goal."""
    given = holes(samples) | {"chamfer": 1e-5, "apart": 0.004, "mu": friction}
    if not guarded:
        return int(np.sum(rw.rollout("peg_in_hole", model, parameters=given).outcomes == "goal"))
    inputs = {name: [move.inputs[name] for move in MOVES] for name in ("tx", "ty", "tilt")}
    found = rw.rollout(
        "peg_in_hole",
        model,
        inputs=inputs,
        durations=[move.duration for move in MOVES],
        until=[move.until for move in MOVES],
        ramp=True,
        parameters=given,
    )
    return int(np.sum(found.outcomes == "goal"))


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--samples", type=int, default=200)
    parser.add_argument("--model", default="quasistatic-rigid")
    parser.add_argument("--json", action="store_true")
    given = parser.parse_args(arguments)
    rows = [
        (mu, *(successes(given.model, given.samples, mu, guarded) for guarded in (False, True)))
        for mu in FRICTIONS
    ]
    if given.json:
        print(json.dumps({"model": given.model, "samples": given.samples, "rows": rows}))
    else:
        print(
            f"{given.model}, {given.samples} holes without chamfers\n  friction  straight down  guarded moves"
        )
        for mu, straight, guarded in rows:
            print(f"  {mu:8g} {straight:14} {guarded:14}")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())

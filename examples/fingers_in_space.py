"""Does a plan of fingers in space hold on other rungs and in MuJoCo? A shipped scene is planned, and drawn.

    python examples/fingers_in_space.py block_turn [--seed 0] [--limit 120] [--out block_turn.png]

The picture shows six moments of the plan on the richest rung.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

import rungwise as rw


def main(given: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("scene")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--limit", type=float, default=120.0)
    parser.add_argument("--out", type=Path)
    asked = parser.parse_args(given)
    plan = rw.plan(asked.scene, seed=asked.seed, limit=asked.limit)
    if not plan.found:
        print(plan.reason)
        return 1
    print(f"{asked.scene}: {len(plan.waypoints)} legs, {sum(each.duration for each in plan.segments):.3g} s")
    for model in rw.LADDER[2:]:
        print(f"  {model.name:22} {plan.replay(model, tol=0.1 * plan.tol).outcome}")
    run = plan.replay()
    print(f"  {'MuJoCo':22} {rw.replay(run).outcome}")
    if asked.out is not None:
        rw.view(run, png=asked.out)
    return 0


if __name__ == "__main__":
    sys.exit(main())

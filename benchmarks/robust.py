"""How often plans of pushes succeed where starts and friction vary, in each mode of execution.

    python benchmarks/robust.py [--instances N] [--samples M] [--first SEED] [--model RUNG]

Each instance of the task `push` is planned, and executed in M samples of what its task calls uncertain, in
each mode. The last column is the mode that `rw.plan(robust=0.9)` takes.
"""

from __future__ import annotations

import argparse
import statistics
import time

import rungwise as rw
from rungwise.planning.execution.guards import guarded

RATE = 0.9
MODES = ("open loop", "guarded moves", "re-planning")


def main() -> None:
    asked = arguments()
    print(f"{'seed':>6} {'moves':>5} " + " ".join(f"{mode:>22}" for mode in MODES) + "  mode taken")
    totals, seconds = dict.fromkeys(MODES, 0), list[float]()
    for seed in range(asked.first, asked.first + asked.instances):
        plan = rw.plan("push", to=asked.model, task_seed=seed)
        if not plan.found:
            print(f"{seed:6} no plan: {plan.reason}")
            continue
        cells, taken = list[str](), "none"
        for mode in MODES:
            if mode == "guarded moves" and guarded(plan) is None:
                cells.append("-")
                continue
            began = time.perf_counter()
            found = rw.verify(plan, samples=asked.samples, mode=mode, seed=seed)
            if mode == "re-planning":
                seconds.append((time.perf_counter() - began) / asked.samples)
            holds = found.lower >= RATE
            totals[mode] += holds
            taken = mode if holds and taken == "none" else taken
            cells.append(f"{found.successes} of {found.samples} (>= {found.lower:.3f})")
        print(
            f"{seed:6} {len(plan.waypoints):5} " + " ".join(f"{cell:>22}" for cell in cells) + f"  {taken}",
            flush=True,
        )
    held = ", ".join(f"{mode} {total}" for mode, total in totals.items())
    print(f"instances that succeed at a rate of {RATE}: {held}, of {asked.instances}")
    if seconds:
        print(f"median of a re-planned sample: {statistics.median(seconds):.2f} s")


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--instances", type=int, default=10)
    parser.add_argument("--samples", type=int, default=200)
    parser.add_argument("--first", type=int, default=1000)
    parser.add_argument("--model", default="dynamic-compliant")
    return parser.parse_args()


if __name__ == "__main__":
    main()

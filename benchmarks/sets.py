"""Runs per second and verdicts of batches on the two-finger scene, beside other engines; the cost of a set.

    python benchmarks/sets.py [--json]

One thread, processor time. Random speeds v1, v2 in 0.05..2; a verdict counts where r = v2 / v1 is further
than half a percent from the ends of the band, which are known in closed form; on the dynamic compliant rung
from where runs at a hundredth of the error change theirs. The other engines see the same ratios, at v1 = 1
(see peers.py), and are measured against the plastic band.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass

import numpy as np
import peers  # beside this file
from arguments import wants_json

import rungwise as rw

CLEAR = 0.005
ACCURACY = 3e-3
PEER_STEP = 5e-3
CASES: tuple[tuple[rw.Rung, dict[str, float], float | None], ...] = (
    (rw.KINEMATIC, {}, 0.5),
    (rw.QUASISTATIC_RIGID, {}, 0.5),
    (rw.DYNAMIC_RIGID, {}, 0.5),
    (rw.DYNAMIC_RIGID, {"restitution": 0.5}, 1.0 / (1.5 + 0.5 / 1.5)),
    (rw.DYNAMIC_RIGID, {"restitution": 1.0}, 4.0 / 7.0),
    (rw.QUASISTATIC_COMPLIANT, {}, 0.5),
    (rw.DYNAMIC_COMPLIANT, {"damping": 1e4}, None),
    (rw.DYNAMIC_COMPLIANT, {"damping": 0.0}, None),
)


@dataclass(frozen=True)
class Row:
    """Runs per second of one core, the part of the verdicts that are right, and of how many."""

    case: str
    runs_per_s: float
    right: float
    counted: int


@dataclass(frozen=True)
class Cost:
    """Runs that one set over v1, v2 and mu takes, and that part of a grid of cells of the size of `tol`.

    `lifted`: runs of the dynamic compliant set when it is looked for around that one, of those that it takes
    by itself.
    """

    tol: float
    evaluations: int
    part_of_grid: float
    seconds: float
    lifted: float


def measure(scene: rw.Scene, rung: rw.Rung, parameters: dict[str, float], end: float | None, n: int) -> Row:
    """Speed and verdicts of one case."""
    points = np.random.default_rng(0).uniform(0.05, 2.0, (n, 2))
    batch = rw.Batch(scene, rung, ("v1", "v2"), parameters=parameters, tol=ACCURACY, threads=1)
    batch.run(points[:10])
    began = time.process_time()
    caught = batch.run(points).outcome == rw.Code.GOAL
    took = time.process_time() - began
    ratio = points[:, 1] / points[:, 0]
    if end is None:
        exact = rw.Batch(scene, rung, ("v1", "v2"), parameters=parameters, tol=ACCURACY / 100, threads=1)
        truth = exact.run(points).outcome == rw.Code.GOAL
        clear = np.ones(n, bool)
        for sign in (-1.0, 1.0):
            beside = np.column_stack([points[:, 0], points[:, 1] * (1.0 + sign * CLEAR)])
            clear &= (exact.run(beside).outcome == rw.Code.GOAL) == truth
    else:
        truth = (ratio >= end) & (ratio <= 1.0 / end)
        clear = np.abs(np.minimum(ratio, 1.0 / ratio) / end - 1.0) > CLEAR
    name = ", ".join([rung.name, *(f"{key} {value:g}" for key, value in parameters.items())])
    return Row(name, n / took, float(np.mean((caught == truth)[clear])), int(clear.sum()))


def measure_peer(peer: peers.Peer, n: int) -> Row:
    """Speed and verdicts of another engine at the same ratios."""
    points = np.random.default_rng(0).uniform(0.05, 2.0, (n, 2))
    ratio = points[:, 1] / points[:, 0]
    ratio = ratio[np.abs(np.minimum(ratio, 1.0 / ratio) / 0.5 - 1.0) > CLEAR]
    began = time.process_time()
    caught = np.array([peer.catch(float(r), PEER_STEP)[0] for r in ratio])
    took = time.process_time() - began
    truth = (ratio >= 0.5) & (ratio <= 2.0)
    return Row(
        f"{peer.name}, step {PEER_STEP:g}", len(ratio) / took, float(np.mean(caught == truth)), len(ratio)
    )


def cost(tol: float) -> Cost:
    """What the set of the quasistatic rung over three parameters takes, and what a richer one around it."""
    over, box = ("v1", "v2", "mu"), {"v1": (0.1, 2.0), "v2": (0.1, 2.0), "mu": (0.0, 0.95)}
    began = time.perf_counter()
    found = rw.feasible_set("two_finger", rw.QUASISTATIC_RIGID, over, tol=tol, box=box)
    took = time.perf_counter() - began
    alone, around = (
        rw.feasible_set("two_finger", rw.DYNAMIC_COMPLIANT, over, tol=tol, box=box, near=near).evaluations
        for near in (None, found)
    )
    return Cost(tol, found.evaluations, found.evaluations * tol**3, took, around / alone)


def main(
    arguments: Sequence[str] | None = None,
    runs: int = 4000,
    peer_runs: int = 200,
    tols: Sequence[float] = (1 / 32, 1 / 64, 1 / 128, 1 / 256),
) -> int:
    """Print the tables, or one JSON object."""
    as_json = wants_json(arguments, "Speed and verdicts of batches, and the cost of sets.")
    scene = rw.load("two_finger")
    rows = [measure(scene, rung, parameters, end, runs) for rung, parameters, end in CASES]
    if peer_runs:
        rows += [measure_peer(peer, peer_runs) for peer in peers.peers()]
    costs = [cost(tol) for tol in tols]
    if as_json:
        print(json.dumps({"rows": [asdict(row) for row in rows], "costs": [asdict(each) for each in costs]}))
        return 0
    print(f"{'two_finger':40s} {'runs/s':>8s} {'right':>8s} {'of':>6s}")
    for row in rows:
        print(f"{row.case:40s} {row.runs_per_s:8.0f} {100 * row.right:7.2f}% {row.counted:6d}")
    print(
        f"\n{'set over v1, v2, mu: tol':40s} {'runs':>8s} {'growth':>7s} {'of the grid':>12s} {'seconds':>8s}"
        f" {'lifted':>7s}"
    )
    for before, each in zip([None, *costs], costs, strict=False):
        growth = f"{each.evaluations / before.evaluations:7.2f}" if before else f"{'':7s}"
        print(
            f"{each.tol:<40.4g} {each.evaluations:8d} {growth} {each.part_of_grid:12.2g} {each.seconds:8.1f}"
            f" {each.lifted:7.2f}"
        )
    return 0


if __name__ == "__main__":
    sys.exit(main())

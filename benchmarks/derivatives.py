"""Derivatives of one step by its start, beside forward differences of whole steps.

    python benchmarks/derivatives.py [--scenes NAME …] [--rungs NAME …]

From where each scene has come to at `--time`, a step is differentiated with respect to all positions, speeds
and inputs, and the same number of steps and one more are taken from starts with one unknown changed each.

  columns   unknowns
  ms        processor time of a derivative: the step, its assemblies with one unknown changed to either side,
            and the linear system
  ratio     over the processor time of the forward difference, of the fastest of a few repetitions of both
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence

import numpy as np

import rungwise as rw
from rungwise.deadline import Deadline
from rungwise.simulation.derivatives.sensitivity import differentiated, prepared, started

SCENES = ("two_finger", "ball", "three_fingers", "arm_push", "floor_push", "hand_turn")
KINDS = ("q", "v", "inputs")
TIMES = 5
SIZE = 1e-7


def main(arguments: Sequence[str] | None = None) -> None:
    given = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    given.add_argument("--scenes", nargs="+", default=SCENES)
    given.add_argument("--rungs", nargs="+", default=["quasistatic-compliant", "dynamic-compliant"])
    given.add_argument("--time", type=float, default=0.3)
    asked = given.parse_args(arguments)
    print(f"{'scene':15}{'rung':23}{'columns':>8}{'ms':>8}{'ratio':>8}")
    for name in asked.scenes:
        for rung in asked.rungs:
            columns, derivative, difference = measured(name, rung, asked.time)
            ratio = f"{derivative / difference:8.2f}"
            print(f"{name:15}{rung:23}{columns:8}{1e3 * derivative:8.2f}{ratio}", flush=True)


def measured(name: str, rung: str, until: float) -> tuple[int, float, float]:
    """Unknowns, and the processor times of a derivative and of a forward difference."""
    scene = rw.load(name)
    run = rw.simulate(scene, rung, duration=until)
    here, changes = prepared(scene, rung, None, run.time / run.steps, 1.0, KINDS, (), Deadline())
    state = run.state
    start = here.taken(started(here, state.q, state.v, None, run.time)).end
    n = len(here.lever)
    directions = {kind: np.eye(n, 3 * n, k * n) for k, kind in enumerate(KINDS)}

    def difference() -> None:
        here.taken(start)
        for kind in ("q", "v", "v"):  # a step with another input takes as long as one with another speed
            for i in range(n):
                here.taken(here.moved(start, kind, SIZE * np.eye(n)[i]))

    times = []
    for call in (lambda: differentiated(here, changes, start, directions, Deadline()), difference):
        call()
        took = []
        for _ in range(TIMES):
            began = time.process_time()
            call()
            took.append(time.process_time() - began)
        times.append(min(took))
    return 3 * n, times[0], times[1]


if __name__ == "__main__":
    main()

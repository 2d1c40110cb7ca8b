"""Runs cut at random steps and continued from the state there, beside the runs that were not interrupted.

    python benchmarks/restart.py [--cuts N] [--json]

Random scenes (tests/simulation/random_scenes.py) on every rung, half of them at fixed and half at controlled
steps, with theta of 1/2 or 1. A cut counts as equal where all that the continued run hands on, frame by
frame, has the bits of the run that was not interrupted; `in contact` counts cuts with a closed contact.
"""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

import rungwise as rw

sys.path.insert(0, str(Path(__file__).parents[1]))

from tests.simulation.random_scenes import random_scene
from tests.simulation.test_state import STEPS, recalled, taken

SCENES, EACH = 400, 5


@dataclass
class Cuts:
    """Cuts of runs on one rung."""

    model: str
    cuts: int = 0
    in_contact: int = 0
    equal: int = 0


def cut(model: rw.Rung, wanted: int) -> Cuts:
    """Cut runs on this rung as often as wanted, or as often as there are scenes for."""
    rng, found = np.random.default_rng(0), Cuts(model.name)
    for number in range(SCENES):
        tol = 1e-3 if number % 2 else None
        theta = float(rng.choice([0.5, 1.0]))
        scene = rw.load(random_scene(number))
        whole = taken(scene, model, STEPS, tol=tol, theta=theta)
        states = whole.states
        if len(states) < 2 or found.cuts >= wanted:
            continue
        expected = recalled(whole)
        for k in rng.choice(len(states) - 1, min(len(states) - 1, EACH), replace=False):
            again = taken(scene, model, len(states) - 1 - k, state=states[k], tol=tol, theta=theta)
            same = again.outcome == whole.outcome and all(
                np.array_equal(values, expected[name][k:], equal_nan=True)
                for name, values in recalled(again).items()
            )
            found.cuts += 1
            found.in_contact += bool(expected["modes"][k].any())
            found.equal += same
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--cuts", type=int, default=1000, help="cuts for each rung")
    parser.add_argument("--json", action="store_true")
    given = parser.parse_args()
    rows = [cut(model, given.cuts) for model in rw.LADDER if model.moves]
    if given.json:
        print(json.dumps([asdict(row) for row in rows]))
        return
    print(f"{'rung':24}{'cuts':>8}{'in contact':>12}{'equal':>8}")
    for row in rows:
        print(f"{row.model:24}{row.cuts:8}{row.in_contact:12}{row.equal:8}")


if __name__ == "__main__":
    main()

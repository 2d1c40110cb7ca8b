"""Derivatives of a whole push, on every rung, and a push corrected by them.

    python examples/sensitivity.py [--json]

Two fingers come down on a triangle; the first touches it halfway and pushes it aside. How far it is pushed,
x3, after 1.5 time units depends on the finger's speed v1, friction mu and mass: `rw.run_sensitivity` gives
the derivatives from one run, beside which stand differences of two runs. Then Newton's method finds the v1
that pushes the part to x3 = 0.1, one run for each iteration.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence

import rungwise as rw

SCENE, PART = "two_finger", 2
START = {"v1": 1.03, "v2": 0.7}
"""The finger touches off the grid of steps: on it, derivatives have two sides."""
STEP, STEPS = 1e-2, 150
NAMES = ("v1", "mu", "mass")
TARGET = 0.1
DIFFERENCE = 1e-5


def pushed(model: rw.Rung, parameters: dict[str, float]) -> float:
    run = rw.simulate(SCENE, model, parameters=parameters, step=STEP, duration=STEP * STEPS)
    return run.final["part"]["x3"]


def differences(model: rw.Rung) -> list[float]:
    """Central differences of runs, by each of the names."""
    values = rw.load(SCENE).parameters(START)
    found = []
    for name in NAMES:
        by = DIFFERENCE * values[name]
        ends = [pushed(model, {**START, name: values[name] + side * by}) for side in (1.0, -1.0)]
        found.append((ends[0] - ends[1]) / (2.0 * by))
    return found


def corrected(model: rw.Rung, tol: float = 1e-10) -> tuple[float, int]:
    """The v1 that pushes the part to the target, and the iterations."""
    v1 = START["v1"]
    for iteration in range(1, 20):
        s = rw.run_sensitivity(
            SCENE, model, {**START, "v1": v1}, steps=STEPS, h=STEP, wrt=("parameters",), names=("v1",)
        )
        miss = float(s.q[PART]) - TARGET
        if abs(miss) <= tol:
            return v1, iteration
        v1 -= miss / float(s.dq["parameters"][PART, 0])
    raise SystemExit(f"{model.name}: Newton's method does not converge")


def main(arguments: Sequence[str] | None = None, models: Sequence[rw.Rung] = rw.LADDER[1:]) -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    options = parser.parse_args(arguments)
    rows = []
    for model in models:
        s = rw.run_sensitivity(SCENE, model, START, steps=STEPS, h=STEP, wrt=("parameters",), names=NAMES)
        v1, iterations = corrected(model)
        rows.append(
            {
                "model": model.name,
                "x3": float(s.q[PART]),
                "derivatives": s.dq["parameters"][PART].tolist(),
                "differences": differences(model),
                "v1": v1,
                "iterations": iterations,
            }
        )
    if options.json:
        print(json.dumps({"names": NAMES, "target": TARGET, "rows": rows}))
        return 0
    print(f"{'model':24s}{'x3':>9s}" + "".join(f"{'d/d' + name:>13s}{'differences':>13s}" for name in NAMES))
    for row in rows:
        pairs = zip(row["derivatives"], row["differences"], strict=True)
        print(f"{row['model']:24s}{row['x3']:9.5f}" + "".join(f"{a:13.4e}{b:13.4e}" for a, b in pairs))
    print(f"\n{'model':24s}{'v1 to reach ' + str(TARGET):>20s}{'iterations':>12s}")
    for row in rows:
        print(f"{row['model']:24s}{row['v1']:20.10f}{row['iterations']:12d}")
    return 0


if __name__ == "__main__":
    sys.exit(main())

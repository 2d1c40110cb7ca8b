"""Random starts and speeds of the four-finger grasp on every rung: how they end, and which are form closures.

    python examples/four_finger.py [--runs 2000] [--seed 0]
    python examples/four_finger.py --figures docs     the counterpart of the paper's Figure 2

Finger speeds, friction, restitution and the part's place and angle are drawn at random. A run that reaches
the goal must be a form closure by the certificate of its contacts, and every other one must have a named
reason: `not_converged` would be an answer that nobody has.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import numpy as np

import rungwise as rw


def draw(rng: np.random.Generator) -> dict[str, float]:
    """Parameters of one run."""
    return {
        "v2": float(np.exp(rng.uniform(-1.0, 1.0))),
        "mu": float(rng.uniform(0.0, 1.2) * rng.integers(0, 2)),
        "restitution": float(rng.uniform(0.0, 1.0) * rng.integers(0, 2)),
        "x": float(rng.uniform(-0.4, 0.4)),
        "y": float(rng.uniform(0.0, 0.3)),
        "angle": float(rng.uniform(-0.3, 0.3)),
    }


def tally(scene: rw.Scene, model: rw.Rung, runs: int, seed: int) -> Counter[str]:
    """Outcomes of so many runs, with those at the goal told apart by the closure of their contacts."""
    rng = np.random.default_rng(seed)
    counts: Counter[str] = Counter()
    for k in range(runs):
        run = rw.simulate(scene, model, parameters=draw(rng), frames=3)
        name = run.outcome.name
        if name == "goal":
            # Compliant contacts deform: what touches at rest lies within the deformation, too.
            held = rw.touching(run, "part")
            name = "closed" if rw.form_closure(held.points, held.normals) else "open"
        counts[name] += 1
        if sys.stderr.isatty():
            print(f"\r{model.name} {k + 1}/{runs}", end="", file=sys.stderr, flush=True)
    return counts


FIGURES = {
    "caught": {"v2": 0.85, "mu": 0.2, "x": 0.1, "y": 0.12, "angle": 0.08},
    "lost": {"v2": 0.4, "mu": 0.2, "x": 0.1, "y": 0.12, "angle": 0.08},
}
"""Two runs of the dynamic rigid rung: the same start, the right finger fast enough and too slow."""


def draw_figures(scene: rw.Scene, folder: Path) -> None:
    """Strips of pictures of the two runs, `four_finger_caught.png` and `four_finger_lost.png`."""
    for name, parameters in FIGURES.items():
        run = rw.simulate(scene, rw.DYNAMIC_RIGID, parameters=parameters, duration=2.6)
        print(*rw.view(run, png=folder / f"four_finger_{name}.png", frames=3), run.outcome)


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--runs", type=int, default=2000, help="on each rung")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--figures", type=Path, help="folder to draw two runs into, instead")
    options = parser.parse_args(arguments)
    scene = rw.load("four_finger")
    if options.figures is not None:
        draw_figures(scene, options.figures)
        return
    columns = ("closed", "open", "missed", "jammed", "model_invalid", "invalid", "timeout", "not_converged")
    print(f"{'rung':22s}" + "".join(f"{name:>15s}" for name in columns))
    for model in rw.LADDER[1:]:
        counts = tally(scene, model, options.runs, options.seed)
        print(f"{model.name:22s}" + "".join(f"{counts.pop(name, 0):15d}" for name in columns), flush=True)
        if counts:
            print(f"  and {dict(counts)}")


if __name__ == "__main__":
    main()

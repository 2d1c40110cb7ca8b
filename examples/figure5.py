"""Figure 5 of the paper: which speeds of two fingers capture the part, by friction, on every rung.

    python examples/figure5.py [--tol T] [--out FILE]

Boundaries of the feasible sets over v1, v2 and mu on four models, and the planes r = v2 / v1 that bound
them in closed form (dashed): 1/2 and 2 where the part moves no more than it must or impacts are plastic, 4/7
and 7/4 where they are elastic. Damped compliant contact lies a little inside, more so with more friction.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

import rungwise as rw
from rungwise.viewing.slices import draw_surface

BOX = {"v1": (0.1, 2.0), "v2": (0.1, 2.0), "mu": (0.0, 0.95)}
CASES: tuple[tuple[rw.Rung, dict[str, float], float, str], ...] = (
    (rw.QUASISTATIC_RIGID, {}, 0.5, "#3b6fb6"),
    (rw.DYNAMIC_RIGID, {"restitution": 1.0}, 4.0 / 7.0, "#2a9d5c"),
    (rw.DYNAMIC_COMPLIANT, {"damping": 1e4}, 0.5, "#c8553d"),
    (rw.DYNAMIC_COMPLIANT, {"damping": 0.0}, 4.0 / 7.0, "#8d5fb0"),
)


def main(arguments: Sequence[str] | None = None) -> int:
    """Compute the sets, print their sizes and draw them."""
    parser = argparse.ArgumentParser(description="Feasible sets of the two-finger grasp (Figure 5).")
    parser.add_argument("--tol", type=float, default=0.01, help="accuracy, as a part of each interval")
    parser.add_argument("--out", type=Path, default=Path("out/figure5.png"), help="picture to write")
    options = parser.parse_args(arguments)
    from matplotlib.figure import Figure

    drawing = Figure(figsize=(11.0, 9.0), layout="constrained")
    for k, (rung, parameters, end, color) in enumerate(CASES):
        began = time.perf_counter()
        found = rw.feasible_set(
            "two_finger", rung, ("v1", "v2", "mu"), tol=options.tol, box=BOX, parameters=parameters
        )
        took = time.perf_counter() - began
        title = ", ".join([rung.name, *(f"{name} {value:g}" for name, value in parameters.items())])
        part = found.volumes()["feasible"]
        print(
            f"{title:36s} feasible {part:.4f} of the box, {found.evaluations} runs, {took:.1f} s", flush=True
        )
        axis = drawing.add_subplot(2, 2, k + 1, projection="3d")
        draw_surface(axis, found, color)
        for slope in (end, 1.0 / end):
            v1 = np.array([0.1, min(2.0, 2.0 / slope)])
            v1[0] = max(v1[0], 0.1 / slope)
            for mu in BOX["mu"]:
                axis.plot(v1, slope * v1, [mu, mu], "k--", linewidth=1.0)
        axis.set_title(title, fontsize=10)
        axis.view_init(elev=38.0, azim=-135.0)
    options.out.parent.mkdir(parents=True, exist_ok=True)
    drawing.savefig(options.out, dpi=110)
    print(f"wrote {options.out}")
    return 0


if __name__ == "__main__":
    sys.exit(main())

"""Figure 1 of the paper for a real scene: the goal set, the feasible, the doomed and the overlapping states.

    python examples/figure1.py [--points N] [--cells N] [--out FILE]

States of the two-finger grasp on the quasistatic rigid rung, in three planes that hold finger 2 at a height.
Z_F: some constant speeds of the fingers, of a grid within bounds, lead to the goal. Z_A: none within bounds
does, by backward reachability over cells (`rw.doomed_set`); the dashed lines are the scene's own rule, which
it approaches from outside. Z_U: bodies overlap. Between Z_F and Z_A neither is shown. Z_G, the goal: the
star, where both fingers touch.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

import rungwise as rw

STATE = ("finger1.x1", "part.x3", "finger2.x2")
BOX = {"finger1.x1": (0.0, 2.0), "part.x3": (-2.0, 2.0), "finger2.x2": (0.0, 2.0)}
SPEEDS = {"v1": (0.01, 1.0), "v2": (0.01, 1.0)}
HEIGHTS = (0.0, 1.0, 1.6)
NEITHER, FEASIBLE, DOOMED, OVERLAP = range(4)
NAMES = ("neither is shown", "feasible: Z_F", "doomed: Z_A", "overlap: Z_U")
COLORS = ("#e8e8e8", "#2a9d5c", "#6c7a8f", "#c8553d")


def plane(height: float, doomed: rw.DoomedSet, points: int, speeds: int) -> np.ndarray:
    """Labels (points, points) of states with finger 2 `height` below its start, x3 by rows, x1 by columns."""
    x1, x3 = np.meshgrid(np.linspace(0.0, 1.98, points), np.linspace(-2.0, 2.0, points))
    states = np.column_stack([x1.ravel(), x3.ravel(), np.full(x1.size, height)])
    ratios = np.geomspace(*SPEEDS["v1"], speeds)
    inputs = np.array([[v, 1.0] for v in ratios] + [[1.0, v] for v in ratios[:-1]])
    v1, v2 = np.tile(inputs, (len(states), 1)).T
    scene = rw.load("two_finger")
    order = [STATE.index(name) for name in scene.template.coordinates]
    runs = rw.rollout(
        scene, rw.QUASISTATIC_RIGID, np.repeat(states[:, order], len(inputs), axis=0),
        parameters={"v1": v1, "v2": v2}, tol=3e-3, keep=False,
    )  # fmt: skip
    outcome = runs.outcome.reshape(len(states), -1)
    labels = np.where(doomed.labels(states) == rw.Label.DOOMED, DOOMED, NEITHER)
    labels[(outcome == rw.Code.INVALID).all(axis=1)] = OVERLAP
    labels[(outcome == rw.Code.GOAL).any(axis=1)] = FEASIBLE
    return labels.reshape(x1.shape)


def main(arguments: Sequence[str] | None = None) -> int:
    """Compute the planes, print how large each set is in them, and draw them."""
    parser = argparse.ArgumentParser(description="States of the two-finger grasp (Figure 1).")
    parser.add_argument("--points", type=int, default=161, help="states along each axis of a plane")
    parser.add_argument("--cells", type=int, default=48, help="of the doomed set, along each axis")
    parser.add_argument("--speeds", type=int, default=7, help="speeds tried of each finger")
    parser.add_argument("--out", type=Path, default=Path("out/figure1.png"), help="picture to write")
    options = parser.parse_args(arguments)
    from matplotlib.colors import ListedColormap
    from matplotlib.figure import Figure
    from matplotlib.patches import Patch

    doomed = rw.doomed_set("two_finger", rw.QUASISTATIC_RIGID, STATE, SPEEDS, box=BOX, cells=options.cells)
    drawing = Figure(figsize=(13.0, 4.8), layout="constrained")
    for k, height in enumerate(HEIGHTS):
        labels = plane(height, doomed, options.points, options.speeds)
        parts = [f"{name} {np.mean(labels == code):.3f}" for code, name in enumerate(NAMES)]
        print(f"x2 = {height:g}: {', '.join(parts)}", flush=True)
        axis = drawing.add_subplot(1, len(HEIGHTS), k + 1)
        axis.imshow(
            labels, origin="lower", extent=(0.0, 1.98, -2.0, 2.0), aspect="auto", interpolation="nearest",
            cmap=ListedColormap(COLORS), vmin=-0.5, vmax=3.5,
        )  # fmt: skip
        for end in (-0.5, 0.5):
            axis.axhline(end, color="black", linestyle="--", linewidth=1.0)
        if 1.5 <= height <= 2.0:
            # Both fingers touch the part where x1 = 3/2 + x3 and x2 = 3/2 - x3.
            axis.plot([3.0 - height], [1.5 - height], "*", color="black", markersize=12)
        axis.set_title(f"finger 2 at x2 = {height:g}", fontsize=10)
        axis.set_xlabel("x1 [m]")
        axis.set_ylabel("x3 [m]" if k == 0 else "")
    patches = [Patch(color=color, label=name) for color, name in zip(COLORS, NAMES, strict=True)]
    drawing.legend(handles=patches, loc="outside lower center", ncols=4)
    options.out.parent.mkdir(parents=True, exist_ok=True)
    drawing.savefig(options.out, dpi=110)
    print(f"wrote {options.out}")
    return 0


if __name__ == "__main__":
    sys.exit(main())

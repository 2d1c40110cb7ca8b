"""Figure 1 of the paper for a real scene: the goal set, the feasible, the doomed and the overlapping states.

    python examples/figure1.py [--points N] [--cells N] [--out DIR]

States of the two-finger grasp on the quasistatic rigid rung, in three planes that hold finger 2 at a height.
Z_F: some constant speeds of the fingers, of a grid within bounds, lead to the goal. Z_A: none within bounds
does, by backward reachability over cells (`rw.doomed_set`); the dashed lines are the scene's own rule, which
it approaches from outside. Z_U: bodies overlap. Between Z_F and Z_A neither is shown. Z_G, the goal: the
star, where both fingers touch. Prints how much of each plane each set takes, and draws DIR/figure1.png.
"""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

import rungwise as rw

STATE = ("finger1.x1", "part.x3", "finger2.x2")
BOX = {"finger1.x1": (0.0, 2.0), "part.x3": (-2.0, 2.0), "finger2.x2": (0.0, 2.0)}
SPEEDS = {"v1": (0.01, 1.0), "v2": (0.01, 1.0)}
HEIGHTS = (0.0, 1.0, 1.6)
NEITHER, FEASIBLE, DOOMED, OVERLAP = range(4)
NAMES = ("neither is shown", "feasible: Z_F", "doomed: Z_A", "overlap: Z_U")
PLACES = {"$Z_F$": (0.45, -0.3), "$Z_A$": (0.45, -1.3), "$Z_U$": (1.7, -0.75)}
"""Of the sets' names in each plane."""
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
    parser.add_argument("--out", type=Path, default=Path("out"), help="folder for figure1.png")
    options = parser.parse_args(arguments)
    doomed = rw.doomed_set("two_finger", rw.QUASISTATIC_RIGID, STATE, SPEEDS, box=BOX, cells=options.cells)
    planes = [plane(height, doomed, options.points, options.speeds) for height in HEIGHTS]
    for height, labels in zip(HEIGHTS, planes, strict=True):
        parts = [f"{name} {np.mean(labels == code):.3f}" for code, name in enumerate(NAMES)]
        print(f"x2 = {height:g}: {', '.join(parts)}", flush=True)
    draw(options.out / "figure1.png", planes)
    print(f"wrote {options.out / 'figure1.png'}")
    return 0


def draw(path: Path, planes: Sequence[np.ndarray]) -> None:
    """One panel for each plane, and a legend of all that is in them."""
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    drawing = Figure(figsize=(7.2, 5.2), dpi=160, layout="constrained")
    axes = drawing.subplots(1, len(HEIGHTS), sharey=True)
    for axis, height, labels in zip(axes, HEIGHTS, planes, strict=True):
        _panel(axis, height, labels)
    axes[0].set_ylabel("$x_3$ of the part [m]", fontsize=11)
    handles: list[Patch | Line2D] = [
        Patch(fc=color, ec="#888888", label=in_italics(name))
        for color, name in zip(COLORS, NAMES, strict=True)
    ]
    handles.append(
        Line2D(
            [],
            [],
            ls="",
            marker="*",
            ms=12,
            mfc="white",
            mec="black",
            label="goal: $Z_G$, both fingers touch",
        )
    )
    handles.append(Line2D([], [], color="black", ls="--", label="the scene's rule: doomed beyond"))
    drawing.legend(handles=handles, loc="outside lower center", ncols=2, fontsize=11, frameon=False)
    path.parent.mkdir(parents=True, exist_ok=True)
    drawing.savefig(path)


def in_italics(name: str) -> str:
    """Symbols as they are written in the panels."""
    return re.sub(r"Z_(\w)", r"$Z_\1$", name)


def _panel(axis: Any, height: float, labels: np.ndarray) -> None:
    from matplotlib.colors import ListedColormap

    axis.imshow(
        labels, origin="lower", extent=(0.0, 1.98, -2.0, 2.0), aspect="auto", interpolation="nearest",
        cmap=ListedColormap(COLORS), vmin=-0.5, vmax=3.5,
    )  # fmt: skip
    for end in (-0.5, 0.5):
        axis.axhline(end, color="black", linestyle="--", linewidth=1.0)
    for text, (x1, x3) in PLACES.items():
        axis.text(x1, x3, text, color="white", fontsize=14, ha="center", va="center")
    if 1.5 <= height <= 2.0:
        # Both fingers touch the part where x1 = 3/2 + x3 and x2 = 3/2 - x3.
        axis.plot([3.0 - height], [1.5 - height], "*", mfc="white", mec="black", markersize=13)
        axis.annotate("$Z_G$", (3.0 - height, 1.5 - height), (0, 9), textcoords="offset points", fontsize=12,
                      color="white", ha="center")  # fmt: skip
    axis.set_title(f"finger 2: $x_2$ = {height:g} m", fontsize=11)
    axis.set_xlabel("$x_1$ of finger 1 [m]", fontsize=11)
    axis.set_xticks((0.0, 0.5, 1.0, 1.5), ("0", "0.5", "1", "1.5"))


if __name__ == "__main__":
    sys.exit(main())

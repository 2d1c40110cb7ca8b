"""Frames of runs in space: three fingers lift a ball, or slide off it.

    python examples/space_frames.py docs/space.png

Each row is a rung, with the same inputs: the fingers close, then rise. The kinematic rung has no friction.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

import rungwise as rw
from rungwise.viewing.space.runs import film_of
from rungwise.viewing.space.shapes import triangles, turned

if TYPE_CHECKING:
    from mpl_toolkits.mplot3d import Axes3D
    from numpy.typing import NDArray

    from rungwise.viewing.space.film import Film

SCENE, RUNGS = "three_finger_lift", ("kinematic", "dynamic-compliant")
INPUTS = [
    rw.Segment({"squeeze": 0.06}, 0.5, ramp=True),
    rw.Segment({"rise": 0.1}, 1.0, ramp=True),
    rw.Segment({}, 0.5),
]
TIMES = (0.0, 0.5, 1.0, 1.5)
REACH, HIGH = 0.16, 0.2
LIGHT = np.array([0.3, -0.6, 0.75])
COLOURS = {"ball": (0.62, 0.77, 0.93)}
OTHER = (0.88, 0.85, 0.77)
FLOOR = "#b9bec6"


def main(arguments: Sequence[str]) -> int:
    """Draw the runs into a file; returns the exit code."""
    if len(arguments) != 1:
        print(__doc__, file=sys.stderr)
        return 2
    runs = [rw.simulate(SCENE, rung, inputs=INPUTS) for rung in RUNGS]
    draw(runs, Path(arguments[0]))
    print(*(f"{run.model.name}: {run.outcome}" for run in runs), sep="\n")
    return 0


def draw(runs: Sequence[rw.Run | rw.SpaceRun], file: Path) -> None:
    """Write a row of frames for each run."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    figure = plt.figure(figsize=(2.4 * len(TIMES), 2.2 * len(runs)))
    for row, run in enumerate(runs):
        film = film_of(run)
        for column, time in enumerate(TIMES):
            axes: Axes3D = figure.add_axes(
                (
                    column / len(TIMES), 1.0 - (row + 1.0) / len(runs),
                    1.0 / len(TIMES), 0.86 / len(runs),
                ),
                projection="3d",
            )  # fmt: skip
            draw_frame(axes, film, time)
            said = f"{run.model.name}: {run.outcome}, t = {time:g} s" if column == 0 else f"t = {time:g} s"
            axes.set_title(said, fontsize=9, loc="left", x=0.04, y=1.0)
    figure.savefig(file, dpi=110)
    plt.close(figure)


def draw_frame(axes: Axes3D, film: Film, time: float) -> None:
    """Bodies at the frame nearest to a time, above a grid that stands for the floor."""
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    frame = int(np.abs(film.time - time).argmin())
    for at in np.linspace(-REACH, REACH, 7):
        axes.plot([at, at], [-REACH, REACH], [0, 0], color=FLOOR, lw=0.6, zorder=0)
        axes.plot([-REACH, REACH], [at, at], [0, 0], color=FLOOR, lw=0.6, zorder=0)
    for solid in film.solids:
        corners, faces = triangles(solid)
        if not len(faces):
            continue
        own = corners @ turned(solid.turn).T + solid.place
        world = own @ turned(film.turns[frame, solid.body]).T + film.places[frame, solid.body]
        colour = COLOURS.get(film.bodies[solid.body], OTHER)
        axes.add_collection3d(
            Poly3DCollection(world[faces], facecolors=shaded(world[faces], colour), antialiased=False)
        )
    axes.set(xlim=(-REACH, REACH), ylim=(-REACH, REACH), zlim=(0.0, HIGH))
    axes.set_box_aspect((2 * REACH, 2 * REACH, HIGH), zoom=1.4)
    axes.view_init(elev=22, azim=-80)
    axes.set_axis_off()


def shaded(corners: NDArray[np.float64], colour: tuple[float, float, float]) -> NDArray[np.float64]:
    """Colours (f, 3) of faces (f, 3, 3): the darker, the more they turn away from the light."""
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
    lit = 0.62 + 0.38 * np.maximum(normals @ (LIGHT / np.linalg.norm(LIGHT)), -0.4)
    return np.clip(lit[:, None] * np.array(colour), 0.0, 1.0)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

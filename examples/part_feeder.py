"""Where the pin of the part feeder turns every cup the same way up, and how it does.

    python examples/part_feeder.py [--model M] [--samples 40] [--grid 13] [--png FILE] [--json]

The pin's place is varied about the one that ships; every place is tried with the same cups, half of them
closed end first, drawn as the scene's task says. The picture has one cup of each kind on its way, and the
part of cups that leave closed end down over the place of the pin.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

import rungwise as rw
from rungwise.viewing.plane.clip import Clip, clip
from rungwise.viewing.plane.draw_frame import INK, ROLES, placed, pose_at, rounded

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SCENE = "part_feeder"
AROUND = 0.012
"""How far from the pin's place others are tried."""
TOL = 1e-4
FRAMES = 12


def cups(samples: int, seed: int = 0) -> dict[str, np.ndarray]:
    """Fresh arrivals, drawn as the scene's task says."""
    task, rng = rw.load(SCENE).file.task, np.random.default_rng(seed)
    assert task is not None
    return {name: rng.uniform(*spread.uniform, samples) for name, spread in task.uncertain.items()}


def rates(model: str, x: np.ndarray, y: np.ndarray, samples: int) -> np.ndarray:
    """Parts (len(y), len(x)) of cups that leave closed end down."""
    drawn, places = cups(samples), np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    given = {name: np.tile(values, len(places)) for name, values in drawn.items()}
    given |= {name: np.repeat(places[:, k], samples) for k, name in enumerate(("pin_x", "pin_y"))}
    found = rw.rollout(SCENE, model, parameters=given, tol=TOL, keep=False)
    return np.asarray((found.outcomes == "goal").reshape(len(y), len(x), samples).mean(axis=-1))


def draw(axes: Axes, shown: Clip, title: str) -> None:
    """A cup at times that are equally far apart, darker as time goes."""
    from matplotlib.patches import Polygon

    for time in np.linspace(0.0, shown.time[-1], FRAMES):
        part, pose = time / shown.time[-1], pose_at(shown, time)
        for outline in shown.outlines:
            if outline.halfplane:
                axes.axvspan(outline.vertices[0, 0], 1.0, color=ROLES["obstacle"], zorder=0)
            elif shown.moving[outline.body] or time == 0.0:
                moves, role = shown.moving[outline.body], shown.roles[outline.body]
                corners = placed(rounded(outline), pose[outline.body])
                strength = 0.15 + 0.85 * part**2 if moves else 1.0
                axes.add_patch(Polygon(corners, fc=ROLES[role], ec=INK, lw=0.5, alpha=strength))
    axes.set(xlim=(-0.06, 0.06), ylim=(-0.085, 0.055), aspect="equal", title=title)
    axes.set_axis_off()


def picture(file: Path, model: str, x: np.ndarray, y: np.ndarray, found: np.ndarray) -> None:
    """Both arrivals, and the map."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(12.0, 4.2), layout="constrained")
    first, second, right = figure.subplots(1, 3)
    for axes, arrival, title in ((first, 1.0, "closed end first"), (second, -1.0, "open end first")):
        run = rw.simulate(SCENE, model, parameters={"arrival": arrival}, tol=TOL, frames=2000)
        draw(axes, clip(run), f"{title}: {run.outcome}")
    shown = right.pcolormesh(1e3 * x, 1e3 * y, found, vmin=0.0, vmax=1.0, cmap="GnBu")
    figure.colorbar(shown, ax=right, label="part of cups that leave closed end down")
    at = rw.load(SCENE).parameters()
    right.plot(1e3 * at["pin_x"], 1e3 * at["pin_y"], "o", mfc="white", mec=INK, label="the pin that ships")
    right.set(xlabel="pin_x [mm]", ylabel="pin_y [mm]", title=f"place of the pin, {model}")
    right.legend(loc="upper center", bbox_to_anchor=(0.5, -0.15), frameon=False)
    figure.savefig(file, dpi=110)


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--model", default="dynamic-compliant")
    parser.add_argument("--samples", type=int, default=40, help="cups for each place of the pin")
    parser.add_argument("--grid", type=int, default=13, help="places of the pin along each axis")
    parser.add_argument("--png", type=Path)
    parser.add_argument("--json", action="store_true")
    given = parser.parse_args(arguments)
    at = rw.load(SCENE).parameters()
    around = np.linspace(-AROUND, AROUND, given.grid) if given.grid > 1 else np.zeros(1)
    x, y = (at[name] + around for name in ("pin_x", "pin_y"))
    found = rates(given.model, x, y, given.samples)
    if given.png is not None:
        picture(given.png, given.model, x, y, found)
    if given.json:
        print(
            json.dumps(
                {"model": given.model, "pin_x": x.tolist(), "pin_y": y.tolist(), "rates": found.tolist()}
            )
        )
        return 0
    print(f"{given.model}: cups in 100 that leave closed end down, {given.samples} for each place")
    print("  y \\ x, mm " + "".join(f"{1e3 * value:6.1f}" for value in x))
    for height, row in zip(y[::-1], found[::-1], strict=True):
        print(f"  {1e3 * height:9.1f} " + "".join(f"{100 * rate:6.1f}" for rate in row))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())

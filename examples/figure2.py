"""Figure 2 of the paper: a grasp that succeeds and others that fail, each with the closure of its contacts.

    python examples/figure2.py [--out DIR]

draws figure2.png in DIR (out if not given) and prints what touches the part in each, and what that means:

  form closure    the contacts hold the part without friction: no twist is free
  force closure   they hold it by friction alone: without friction it could follow the twist that is drawn
  neither         the part can follow the twist that is drawn, and friction does not hinder it

All runs begin at the same place (scene `four_finger`, dynamic-rigid). The right finger keeps up; or friction
wedges the part on the way, and the run ends as a jam with a certificate; or the right finger is too slow, and
the part slips out, here at 1.9 s. Verdicts are those of `rw.form_closure` and `rw.force_closure`; their
certificates are checked.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import rungwise as rw
from rungwise.contact.analysis.closure import check
from rungwise.viewing.plane.clip import Clip, Touches, clip
from rungwise.viewing.plane.draw_frame import draw_frame, placed, pose_at

START = {"x": 0.1, "y": 0.12, "angle": 0.08}
FORM, FORCE, NEITHER = "form closure", "force closure", "neither"
COLORS = {FORM: "#007f5f", FORCE: "#0072b2", NEITHER: "#d55e00"}
MEANING = {FORM: "holds without friction", FORCE: "holds by friction alone", NEITHER: "slips out"}
CONE, TURN = 0.34, 0.14
"""Length of a friction cone, and how far a free twist is followed, in the unit of the scene."""


@dataclass(frozen=True)
class Grasp:
    """A run up to `until`, or to its own end."""

    name: str
    parameters: dict[str, float]
    until: float | None = None

    def run(self) -> rw.Run:
        """The run, from the common start."""
        parameters = START | self.parameters
        return rw.simulate("four_finger", rw.DYNAMIC_RIGID, parameters=parameters, duration=self.until)


GRASPS = (
    Grasp("caught", {"v2": 0.85, "mu": 0.2}),
    Grasp("wedged", {"v2": 0.85, "mu": 0.5}),
    Grasp("too slow", {"v2": 0.4, "mu": 0.2}, until=1.9),
)


@dataclass(frozen=True)
class Held:
    """Contacts at the end of a run, and what they close."""

    contacts: rw.Touching
    form: rw.Closure
    force: rw.Closure

    @property
    def verdict(self) -> str:
        """The strongest closure there is; each verdict's certificate has been checked."""
        return FORM if self.form else FORCE if self.force else NEITHER

    @property
    def free(self) -> rw.Closure | None:
        """The closure that fails, whose certificate is a twist that no contact hinders; None: both hold."""
        return None if self.form else self.form if self.force else self.force


def held(run: rw.Run) -> Held:
    """Closure of the part at the end of a run."""
    touching = rw.touching(run, "part")
    form = rw.form_closure(touching.points, touching.normals)
    force = rw.force_closure(touching.points, touching.normals, touching.friction)
    assert check(form) and check(force)
    return Held(touching, form, force)


def describe(grasp: Grasp, run: rw.Run, found: Held) -> str:
    """A line about the end of a run."""
    values = ", ".join(f"{name} = {value:g}" for name, value in grasp.parameters.items())
    ended = "on the way" if grasp.until is not None else str(run.outcome)
    by = ", ".join(found.contacts.others)
    margins = [
        f"{name} margin {closure.margin:.3f}"
        for name, closure in (("form", found.form), ("force", found.force))
        if closure
    ]
    return f"{grasp.name:10s} {values}: {ended} at {run.time:.3f} s, touched by {by}: " + ", ".join(
        [found.verdict, *margins]
    )


def still(run: rw.Run) -> Clip:
    """The run's picture without its forces: only geometry closes."""
    shown = clip(run)
    empty = np.zeros((0, 2))
    none = np.zeros(0, np.int64)
    return replace(shown, touches=Touches(none, none, empty, empty, none))


def draw(path: Path, runs: Sequence[rw.Run], found: Sequence[Held]) -> None:
    """The common start, and the end of each run with its contacts."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.2, 7.6), dpi=160)
    axes = figure.subplots(2, 2).ravel()
    figure.subplots_adjust(left=0.015, right=0.985, top=0.955, bottom=0.065, wspace=0.04, hspace=0.12)
    _frame(axes[0], runs[0], 0.0)
    axes[0].set_title("the start of all three", fontsize=12)
    for axis, grasp, run, hold in zip(axes[1:], GRASPS, runs, found, strict=True):
        _frame(axis, run, run.time)
        _contacts(axis, hold)
        _twist(axis, run, hold)
        axis.set_title(
            f"{grasp.name}: $v_2$ = {grasp.parameters['v2']:g}, $\\mu$ = {grasp.parameters['mu']:g}",
            fontsize=12,
        )
        axis.text(
            0.5, 0.035, f"{hold.verdict}\n{MEANING[hold.verdict]}", transform=axis.transAxes, ha="center",
            va="bottom", fontsize=12.5, color=COLORS[hold.verdict], weight="bold",
        )  # fmt: skip
    _legend(figure)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path)


def _frame(axis: Any, run: rw.Run, time: float) -> None:
    draw_frame(axis, [still(run)], time)
    axis.set(xlim=(-1.35, 1.75), ylim=(-0.88, 2.2))


def _contacts(axis: Any, hold: Held) -> None:
    """Points, normals and friction cones of what touches."""
    from matplotlib.patches import Polygon

    color = COLORS[hold.verdict]
    touching = hold.contacts
    for point, normal, mu in zip(touching.points, touching.normals, touching.friction, strict=True):
        across = mu * np.array([-normal[1], normal[0]])
        tips = [point + CONE * (normal + side * across) for side in (-1.0, 1.0)]
        axis.add_patch(Polygon([point, *tips], fc=color, ec=color, alpha=0.3, lw=1.0, zorder=28))
        axis.annotate(
            "", point + CONE * normal, point, zorder=30,
            arrowprops={"arrowstyle": "-|>", "color": color, "lw": 1.8, "shrinkA": 0, "shrinkB": 0},
        )  # fmt: skip
        axis.plot(*point, "o", color=color, mec="white", ms=7, zorder=31)


def _twist(axis: Any, run: rw.Run, hold: Held) -> None:
    """The part a little further along the twist that its contacts leave it."""
    if hold.free is None:
        return
    shown = clip(run)
    part = shown.bodies.index("part")
    (outline,) = (o for o in shown.outlines if o.body == part)
    corners = placed(outline.vertices, pose_at(shown, run.time)[part])
    moved = _moved(corners, hold.free)
    axis.fill(*moved.T, fill=False, ec="#333333", ls="--", lw=1.3, zorder=25)


def _moved(points: NDArray[np.float64], closure: rw.Closure) -> NDArray[np.float64]:
    """Points carried on by the twist of a certificate, the farthest by `TURN`."""
    x, y, spin = closure.certificate / (1.0, 1.0, closure.length)
    arms = points - closure.centre
    rates = np.column_stack([x - spin * arms[:, 1], y + spin * arms[:, 0]])
    time = TURN / float(np.hypot(*rates.T).max())
    c, s = np.cos(spin * time), np.sin(spin * time)
    turned: NDArray[np.float64] = (
        closure.centre + arms @ np.array([[c, s], [-s, c]]) + time * np.array([x, y])
    )
    return turned


def _legend(figure: Any) -> None:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    handles = [
        Line2D(
            [], [], color="#555555", marker="o", mec="white", ms=7, lw=1.8, label="contact and its normal"
        ),
        Patch(fc="#555555", alpha=0.3, label="friction cone"),
        Line2D([], [], color="#333333", ls="--", label="where it can go"),
    ]
    figure.legend(handles=handles, loc="lower center", ncols=3, frameon=False, fontsize=11)


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the closures, and draw them."""
    parser = argparse.ArgumentParser(description="Grasps of a triangle and their closure (Figure 2).")
    parser.add_argument("--out", type=Path, default=Path("out"), help="folder for figure2.png")
    options = parser.parse_args(arguments)
    runs = [grasp.run() for grasp in GRASPS]
    found = [held(run) for run in runs]
    for grasp, run, hold in zip(GRASPS, runs, found, strict=True):
        print(describe(grasp, run, hold))
    draw(options.out / "figure2.png", runs, found)
    print(f"wrote {options.out / 'figure2.png'}")
    return 0


if __name__ == "__main__":
    sys.exit(main())

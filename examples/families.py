"""Families of runs in the free configuration space of a scene with three coordinates, panel by panel."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, cast

from rungwise.outcome import Code
from rungwise.scene import Scene
from rungwise.simulation.result import Run
from rungwise.viewing.plane.strata import Space, draw_strata, strata

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from mpl_toolkits.mplot3d import Axes3D

CAUGHT, LOST = "#007f5f", "#d55e00"
ORDER = (0, 2, 1)
"""Coordinates along x, y and z of the picture."""


BEYOND = "lost run without the rule, to its end"


@dataclass(frozen=True)
class Family:
    """Runs of one scene that differ in a ratio, and the intervals of that ratio that reach the goal.

    `beyond` are runs that go on where others of the same ratio were given up, and the times of that.
    """

    title: str
    scene: Scene
    runs: Sequence[Run]
    caught: Sequence[tuple[float, float]]
    beyond: Sequence[tuple[Run, float]] = ()


def draw_families(
    path: Path,
    families: Sequence[Family],
    low: Sequence[float],
    high: Sequence[float],
    bands: Mapping[str, tuple[float, float]],
    ratio_range: tuple[float, float],
) -> None:
    """Write a PNG: for each family its runs in C_free, and below them the ratios caught beside the
    `bands`."""
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    figure = Figure(figsize=(8.6, 11.3), dpi=150)
    for k, family in enumerate(families):
        left, top = 0.01 + 0.495 * (k % 2), 0.99 - 0.445 * (k // 2)
        axes = cast(
            "Axes3D",
            figure.add_axes((left, top - 0.356, 0.48, 0.356), projection="3d", computed_zorder=False),
        )
        space = Space(family.scene)
        draw_strata(axes, space, strata(space, low, high), low, high, ORDER)
        _runs(axes, family.runs, family.beyond)
        figure.text(left + 0.24, top, family.title, ha="center", va="top", fontsize=12)
        _bar(figure.add_axes((left + 0.12, top - 0.414, 0.3, 0.0475)), family.caught, bands, ratio_range)
    handles = [
        Line2D([], [], color=CAUGHT, lw=2, marker="o", ms=4, label="run that reaches the goal"),
        Line2D([], [], color=LOST, lw=2, marker="x", ms=5, label="run that is lost, by the scene's rule"),
        Line2D([], [], color=LOST, lw=1.6, ls=":", marker="o", mfc="none", label=BEYOND),
        Line2D([], [], color="#1f6fd6", lw=5, alpha=0.75, label="goal edge: both faces touched"),
        Patch(fc="0.88", ec="0.45", label="a finger touches a face of the part"),
        Patch(fc=CAUGHT, label="bars: ratios of speeds that catch the part"),
        Patch(fc="0.65", label="grey bars: closed forms, and the paper"),
    ]
    figure.legend(handles=handles, loc="lower center", ncols=2, frameon=False, fontsize=10)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path)


def _runs(axes: Axes3D, runs: Sequence[Run], beyond: Sequence[tuple[Run, float]]) -> None:
    ends: dict[str, list[float]] = {}
    for run, since in beyond:
        q = run.trajectory["position"].sel(time=slice(since, None)).to_numpy()
        axes.plot(*q[:, list(ORDER)].T, color=LOST, lw=2.2, ls=":", zorder=8)
        words = ", ".join(f"{x:.3g}".replace("-", "\N{MINUS SIGN}") for x in q[-1])
        ends[words] = [q[-1, k] for k in ORDER]
    for words, (x, y, z) in ends.items():
        axes.plot([x], [y], [z], "o", mfc="none", mec=LOST, ms=8, mew=1.4, zorder=8)
        back = {"boxstyle": "square,pad=0.1", "fc": "white", "ec": "none", "alpha": 0.85}
        axes.text(x, y, z - 0.12, f"({words})", fontsize=9, ha="right", va="top", zorder=9, bbox=back)
    for run in runs:
        is_caught = run.outcome.code == Code.GOAL
        colour = CAUGHT if is_caught else LOST
        q = run.trajectory["position"].to_numpy()[:, list(ORDER)]
        axes.plot(*q.T, color=colour, lw=1.3, zorder=6 if is_caught else 5)
        axes.plot(*q[-1:].T, "o" if is_caught else "x", color=colour, ms=4, mew=1.4, zorder=7)
    axes.view_init(elev=24.0, azim=-52.0)
    axes.set_box_aspect((1.0, 1.7, 1.0), zoom=0.97)
    axes.set(xlabel="$x_1$ [m]", ylabel="$x_3$ [m]", zlabel="$x_2$ [m]")
    axes.set(xticks=(0, 1, 2), yticks=(-1, 0, 1, 2), zticks=(0, 1, 2))
    for axis in (axes.xaxis, axes.yaxis, axes.zaxis):
        axis.pane.set_visible(False)
        axis.set_tick_params(pad=-1.0)
        axis.labelpad = 0.0
    axes.grid(False)


def _bar(
    axes: Axes,
    caught: Sequence[tuple[float, float]],
    bands: Mapping[str, tuple[float, float]],
    ratio_range: tuple[float, float],
) -> None:
    """Draw ratios on a logarithmic scale: caught ratios on top, the bands to compare with below."""
    axes.barh(len(bands), [0.0])
    rows = [("caught", list(caught), CAUGHT), *((name, [band], "0.65") for name, band in bands.items())]
    for k, (_, intervals, colour) in enumerate(rows):
        for first, last in intervals:
            axes.barh(-k, last - first, left=first, height=0.62, color=colour)
        if not any(last > first for first, last in intervals):
            axes.plot([first for first, _ in intervals], [-k] * len(intervals), "o", color=colour, ms=4)
    axes.set_xscale("log")
    axes.set(xlim=ratio_range, ylim=(-len(rows) + 0.4, 0.6), yticks=[-k for k in range(len(rows))])
    axes.set_yticklabels([name for name, _, _ in rows], fontsize=8.5)
    ticks = (0.1, 0.25, 0.5, 1.0, 2.0, 4.0, 10.0)
    axes.set_xticks(ticks, [f"{tick:g}" for tick in ticks], fontsize=8.5)
    axes.minorticks_off()
    axes.tick_params(length=2)
    axes.spines[["top", "right"]].set_visible(False)
    axes.text(1.01, 0.5, "$v_2/v_1$", transform=axes.transAxes, va="center", fontsize=10)

"""Families of runs in the free configuration space of a scene with three coordinates, panel by panel."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, cast

from rungwise.outcome import Code
from rungwise.scene import Scene
from rungwise.simulation.result import Run
from rungwise.viewing.strata import Space, draw_strata, strata

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from mpl_toolkits.mplot3d import Axes3D

CAUGHT, LOST = "#007f5f", "#d55e00"
ORDER = (0, 2, 1)
"""Coordinates along x, y and z of the picture."""


@dataclass(frozen=True)
class Family:
    """Runs of one scene that differ in a ratio, and the intervals of that ratio that reach the goal."""

    title: str
    scene: Scene
    runs: Sequence[Run]
    caught: Sequence[tuple[float, float]]


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

    figure = Figure(figsize=(12.0, 12.8), dpi=110)
    for k, family in enumerate(families):
        left, top = 0.01 + 0.495 * (k % 2), 0.985 - 0.483 * (k // 2)
        axes = cast(
            "Axes3D",
            figure.add_axes((left, top - 0.39, 0.48, 0.385), projection="3d", computed_zorder=False),
        )
        space = Space(family.scene)
        draw_strata(axes, space, strata(space, low, high), low, high, ORDER)
        _runs(axes, family.runs)
        figure.text(left + 0.24, top, family.title, ha="center", va="top", fontsize=13)
        _bar(figure.add_axes((left + 0.12, top - 0.453, 0.3, 0.048)), family.caught, bands, ratio_range)
    handles = [
        Line2D([], [], color=CAUGHT, lw=2, marker="o", ms=4, label="run that reaches the goal"),
        Line2D([], [], color=LOST, lw=2, marker="x", ms=5, label="run that does not"),
        Line2D([], [], color="#1f6fd6", lw=5, alpha=0.75, label="goal edge: both faces touched"),
    ]
    figure.legend(handles=handles, loc="lower center", ncols=3, frameon=False, fontsize=11)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path)


def _runs(axes: Axes3D, runs: Sequence[Run]) -> None:
    for run in runs:
        is_caught = run.outcome.code == Code.GOAL
        colour = CAUGHT if is_caught else LOST
        q = run.trajectory["position"].to_numpy()[:, list(ORDER)]
        axes.plot(*q.T, color=colour, lw=1.3, zorder=6 if is_caught else 5)
        axes.plot(*q[-1:].T, "o" if is_caught else "x", color=colour, ms=4, mew=1.4, zorder=7)
    axes.view_init(elev=24.0, azim=-52.0)
    axes.set_box_aspect((1.0, 1.7, 1.0), zoom=1.1)
    axes.set(xticks=(0, 1, 2), yticks=(-2, -1, 0, 1, 2), zticks=(0, 1, 2))
    for axis in (axes.xaxis, axes.yaxis, axes.zaxis):
        axis.pane.set_visible(False)
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
    ticks = (0.1, 0.25, 0.5, 0.7, 1.0, 1.4, 2.0, 4.0, 10.0)
    axes.set_xticks(ticks, [f"{tick:g}" for tick in ticks], fontsize=8.5)
    axes.minorticks_off()
    axes.tick_params(length=2)
    axes.spines[["top", "right"]].set_visible(False)
    axes.text(1.01, 0.5, "$v_2/v_1$", transform=axes.transAxes, va="center", fontsize=10)

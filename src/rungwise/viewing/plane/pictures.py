"""Strips of frames of runs, drawn with matplotlib, and animations made of them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path as File
from typing import TYPE_CHECKING

from rungwise.viewing.plane.arrows import MARKS, View, short, view_of
from rungwise.viewing.plane.clip import Clip
from rungwise.viewing.plane.draw_frame import GOAL, GOAL_LINE, INK, ROLES, draw_frame
from rungwise.viewing.plane.run_page import labels, title
from rungwise.viewing.sheet import MODELS, SMALL, Look, save_moving, sheet, times_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch


def legend(figure: Figure, clips: Sequence[Clip]) -> None:
    """Draw models (where there are several), contact modes and roles, below the picture."""
    figure.legend(
        handles=_models(clips) + _marks(clips), loc="lower center", ncols=3, frameon=False, fontsize=SMALL
    )


def _models(clips: Sequence[Clip]) -> list[Line2D | Patch]:
    from matplotlib.lines import Line2D

    if len(clips) == 1:
        return []
    return [
        Line2D([], [], color=MODELS[k % len(MODELS)], lw=3, label=f"{label}: {clip.outcome}")
        for k, (clip, label) in enumerate(zip(clips, labels(clips), strict=True))
    ]


def _marks(clips: Sequence[Clip]) -> list[Line2D | Patch]:
    from matplotlib.patches import Patch

    handles: list[Line2D | Patch] = [*of_modes()]
    roles = dict.fromkeys(role for clip in clips for role in clip.roles)
    handles += [Patch(fc=ROLES[role], ec=INK, label=role) for role in roles]
    if clips[0].wanted:
        handles.append(of_goal())
    return handles


def of_modes() -> list[Line2D]:
    """Entries of the legend: the modes of contact points."""
    from matplotlib.lines import Line2D

    return [
        Line2D([], [], marker=marker, mfc=face, mec=rim, ls="none", label=f"contact {word}")
        for marker, face, rim, word in MARKS.values()
    ]


def of_goal() -> Line2D:
    """Entry of the legend: the outline of a pose that the goal wants."""
    from matplotlib.lines import Line2D

    return Line2D([], [], color=GOAL, ls=GOAL_LINE, lw=1.6, label="pose that the goal wants")


def of_force(words: str) -> Line2D:
    """Entry of the legend: an arrow."""
    from matplotlib.lines import Line2D

    return Line2D([], [], color=INK, marker=r"$\rightarrow$", ms=16, ls="none", label=words)


def _scale(clips: Sequence[Clip], view: View) -> list[Line2D | Patch]:
    """The force of the longest arrow, where there are any."""
    if not any(clip.touches.force.any() for clip in clips):
        return []
    most = f"{short(view.longest / view.per_force)} {clips[0].units['force']}".rstrip()
    return [of_force(f"force, broken beyond {most}")]


def strip(clips: Sequence[Clip], count: int = 6, at: float | None = None, view: View | None = None) -> Figure:
    """Picture of `count` frames at equal times, the first and the last among them, or of one frame at time
    `at`. Of several clips each has a row of frames, or at one time a frame. All frames have one scale."""
    times = times_of(clips, count, at)
    seen = view_of(clips, times) if view is None else view

    def frame(axes: Axes, k: int, time: float, colour: str | None) -> None:
        draw_frame(axes, [clips[k]], time, seen, None if colour is None else [colour])

    unit = clips[0].units["length"]
    look = Look(
        title(clips), seen.extent, frame, lambda axes, first, last: _ticks(axes, unit, first, last),
        _marks(clips) + _scale(clips, seen),
    )  # fmt: skip
    return sheet(clips, times, look)


def _ticks(axes: Axes, unit: str, first: bool, last: bool) -> None:
    """Ticks on all frames, their values left of the first of a row and below the last of a column."""
    from matplotlib.ticker import MaxNLocator

    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(MaxNLocator(4, steps=[1, 2, 5, 10]))
    axes.tick_params(labelsize=SMALL, length=3, labelleft=first, labelbottom=last)
    if last:
        axes.set_xlabel(f"x [{unit}]" if unit else "x", fontsize=SMALL, labelpad=1)
    if first:
        axes.set_ylabel(f"y [{unit}]" if unit else "y", fontsize=SMALL, labelpad=3)


def save_gif(clips: Sequence[Clip], file: File, count: int = 60, seconds: float = 5.0) -> None:
    """Write an animation of `count` frames that takes `seconds` seconds, and begins again."""
    view = view_of(clips, times_of(clips, count, None))
    save_moving(clips, lambda time: strip(clips, at=time, view=view), file, count, seconds)

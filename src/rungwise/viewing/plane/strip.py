"""Strips of frames of runs, drawn with matplotlib, and animations made of them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from io import BytesIO
from pathlib import Path as File
from typing import TYPE_CHECKING

import numpy as np

from rungwise.viewing.plane.arrows import MARKS, View, short, view_of
from rungwise.viewing.plane.clip import Clip
from rungwise.viewing.plane.draw import GOAL, GOAL_LINE, INK, MODELS, ROLES, draw_frame
from rungwise.viewing.plane.html import labels, title

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

WIDE, GAP, MOST = 6.6, 0.2, 14.0
"""Width of a frame that stands alone, the space between frames and the width of a row of them, in inches."""
LEFT, ABOVE, BELOW, LINE = 0.6, 0.4, 0.55, 0.21
"""Inches left of frames for ticks, above them for the title, below them for ticks; a line of the legend."""
COLUMN, HEAD, ROW = 2.2, 0.3, 0.3
"""Inches: width of a column of the legend, height of the title of a frame, and of that of a row of frames."""


def legend(figure: Figure, clips: Sequence[Clip]) -> None:
    """Draw models (where there are several), contact modes and roles, below the picture."""
    figure.legend(
        handles=_models(clips) + _marks(clips), loc="lower center", ncols=3, frameon=False, fontsize=9
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
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    handles: list[Line2D | Patch] = [
        Line2D([], [], marker=marker, mfc=face, mec=rim, ls="none", label=f"contact {word}")
        for marker, face, rim, word in MARKS.values()
    ]
    roles = dict.fromkeys(role for clip in clips for role in clip.roles)
    handles += [Patch(fc=ROLES[role], ec=INK, label=role) for role in roles]
    if clips[0].wanted:
        handles.append(Line2D([], [], color=GOAL, ls=GOAL_LINE, lw=1.6, label="pose that the goal wants"))
    return handles


def _scale(clips: Sequence[Clip], view: View) -> list[Line2D | Patch]:
    """The force of the longest arrow, where there are any."""
    from matplotlib.lines import Line2D

    if not any(clip.touches.force.any() for clip in clips):
        return []
    most = f"{short(view.longest / view.per_force)} {clips[0].units['force']}".rstrip()
    words = f"force, broken beyond {most}"
    return [Line2D([], [], color=INK, marker=r"$\rightarrow$", ms=16, ls="none", label=words)]


def strip(clips: Sequence[Clip], count: int = 6, at: float | None = None, view: View | None = None) -> Figure:
    """Picture of `count` frames at equal times, the first and the last among them, or of one frame at time
    `at`. Of several clips each has a row of frames, or at one time a frame. All frames have one scale."""
    from matplotlib.figure import Figure

    end = max(float(clip.time[-1]) for clip in clips)
    times = [min(at, end)] if at is not None else np.linspace(0.0, end, count).tolist()
    several, alone = len(clips) > 1, len(times) == 1
    shown = [(k, time) for k in range(len(clips)) for time in times]
    columns = len(times) if several and not alone else min(len(shown), 3)
    view = view_of(clips, times) if view is None else view
    x0, y0, x1, y1 = view.extent
    wide = WIDE if len(shown) == 1 else min(0.55 * WIDE, MOST / columns - GAP)
    tall = wide * (y1 - y0) / (x1 - x0)
    row = tall + HEAD + (ROW if several and not alone else 0.0)
    marks, across = _marks(clips) + _scale(clips, view), columns * (wide + GAP)
    ncols = max(2, int(across / COLUMN))
    below = BELOW + LINE * math.ceil(len(marks) / ncols)
    width, height = LEFT + across, ABOVE + math.ceil(len(shown) / columns) * row + below
    figure = Figure(figsize=(width, height), dpi=110)
    for i, (k, time) in enumerate(shown):
        left, bottom = LEFT + i % columns * (wide + GAP), height - ABOVE - (i // columns + 1) * row
        axes = figure.add_axes((left / width, bottom / height, wide / width, tall / height))
        draw_frame(axes, [clips[k]], time, view, [MODELS[k % len(MODELS)]] if several else None)
        _ticks(axes, clips[k].units["length"], i % columns == 0, i + columns >= len(shown))
        axes.set_title(
            _ending(clips, k) if several and alone else _moment(clips[k], time), fontsize=10, pad=3
        )
        if several and not alone and i % columns == 0:
            figure.text(
                left / width, (bottom + tall + HEAD) / height, _ending(clips, k), va="bottom", fontsize=10,
                fontweight="bold", color=MODELS[k % len(MODELS)],
            )  # fmt: skip
    what = title(clips) + (f", {_moment(clips[0], times[0])}" if several and alone else "")
    what += "" if several else f": {clips[0].outcome}"
    figure.suptitle(what, fontsize=12, y=1.0 - 0.1 / height, va="top")
    figure.legend(handles=marks, loc="lower center", ncols=ncols, frameon=False, fontsize=9)
    return figure


def _ending(clips: Sequence[Clip], index: int) -> str:
    return f"{labels(clips)[index]}: {clips[index].outcome}"


def _moment(clip: Clip, time: float) -> str:
    return f"t = {time:.4g} {clip.units['time']}".rstrip()


def _ticks(axes: Axes, unit: str, first: bool, last: bool) -> None:
    """Ticks on all frames, their values left of the first of a row and below the last of a column."""
    from matplotlib.ticker import MaxNLocator

    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(MaxNLocator(4, steps=[1, 2, 5, 10]))
    axes.tick_params(labelsize=7.5, length=3, labelleft=first, labelbottom=last)
    if last:
        axes.set_xlabel(f"x [{unit}]" if unit else "x", fontsize=8, labelpad=1)
    if first:
        axes.set_ylabel(f"y [{unit}]" if unit else "y", fontsize=8, labelpad=1)


def save_png(clips: Sequence[Clip], file: File, count: int = 6, at: float | None = None) -> None:
    """Write `strip` as PNG."""
    strip(clips, count, at).savefig(file, format="png")


def save_gif(clips: Sequence[Clip], file: File, count: int = 60, seconds: float = 5.0) -> None:
    """Write an animation of `count` frames that takes `seconds` seconds, and begins again."""
    from PIL import Image

    end = max(float(clip.time[-1]) for clip in clips)
    images = []
    times = np.linspace(0.0, end, count).tolist()
    view = view_of(clips, times)
    for time in times:
        picture = BytesIO()
        strip(clips, at=time, view=view).savefig(picture, format="png")
        images.append(Image.open(picture).convert("RGB").quantize(64))
    pause = int(1000.0 * seconds / count)
    images[0].save(
        file, format="GIF", save_all=True, append_images=images[1:], loop=0,
        duration=[pause] * (count - 1) + [max(pause, 1000)],
    )  # fmt: skip

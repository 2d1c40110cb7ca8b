"""Sheets of frames of runs at equal times, drawn with matplotlib, and animations made of them."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path as File
from typing import TYPE_CHECKING, Any

import numpy as np

from rungwise.viewing.skeleton import numbered

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MODELS = ("#0072b2", "#d55e00", "#007f5f", "#b0508c", "#8a6d00", "#333333")
"""Colours that people see apart whatever their colour vision (Okabe and Ito, some darkened)."""
WIDE, GAP, MOST = 6.6, 0.2, 14.0
"""Width of a frame that stands alone, the space between frames and the width of a row of them, in inches."""
LEFT, ABOVE, BELOW, LINE = 0.7, 0.4, 0.6, 0.21
"""Inches left of frames for ticks, above them for the title, below them for ticks; a line of the legend."""
COLUMN, HEAD, ROW = 2.2, 0.3, 0.3
"""Inches: width of a column of the legend, height of the title of a frame, and of that of a row of frames."""
SMALL = 9.0
"""Points of the smallest letters, which a page of 800 pixels still shows readably."""


@dataclass(frozen=True)
class Look:
    """What is drawn of runs that have `model`, `outcome`, `time` and `units`: `extent` is x and y from, x and
    y to of a frame; `frame(axes, k, time, colour)` draws run k; `ticks(axes, first of its row, last of its
    column)`; `marks` are entries of the legend."""

    headline: str
    extent: tuple[float, float, float, float]
    frame: Callable[[Axes, int, float, str | None], None]
    ticks: Callable[[Axes, bool, bool], None]
    marks: Sequence[Any]


def times_of(runs: Sequence[Any], count: int, at: float | None) -> list[float]:
    """`count` equal times of runs, the first and the last among them; or the one time `at`."""
    end = max(float(run.time[-1]) for run in runs)
    return [min(at, end)] if at is not None else np.linspace(0.0, end, count).tolist()


def sheet(runs: Sequence[Any], times: Sequence[float], look: Look) -> Figure:
    """Picture of the frames at these times. Of several runs each has a row of frames, or at one time a frame.
    All frames have one scale."""
    from matplotlib.figure import Figure

    several, alone = len(runs) > 1, len(times) == 1
    shown = [(k, time) for k in range(len(runs)) for time in times]
    columns = len(times) if several and not alone else min(len(shown), 3)
    x0, y0, x1, y1 = look.extent
    wide = WIDE if len(shown) == 1 else min(0.55 * WIDE, MOST / columns - GAP)
    tall = wide * (y1 - y0) / (x1 - x0)
    row = tall + HEAD + (ROW if several and not alone else 0.0)
    across = columns * (wide + GAP)
    ncols = max(2, int(across / COLUMN))
    below = BELOW + LINE * math.ceil(len(look.marks) / ncols)
    width, height = LEFT + across, ABOVE + math.ceil(len(shown) / columns) * row + below
    figure = Figure(figsize=(width, height), dpi=110)
    for i, (k, time) in enumerate(shown):
        left, bottom = LEFT + i % columns * (wide + GAP), height - ABOVE - (i // columns + 1) * row
        axes = figure.add_axes((left / width, bottom / height, wide / width, tall / height))
        look.frame(axes, k, time, MODELS[k % len(MODELS)] if several else None)
        look.ticks(axes, i % columns == 0, i + columns >= len(shown))
        said = _ending(runs, k) if several and alone else _moment(runs[k], time)
        axes.set_title(said, fontsize=10, pad=3)
        if several and not alone and i % columns == 0:
            figure.text(
                left / width, (bottom + tall + HEAD) / height, _ending(runs, k), va="bottom", fontsize=10,
                fontweight="bold", color=MODELS[k % len(MODELS)],
            )  # fmt: skip
    what = look.headline + (f", {_moment(runs[0], times[0])}" if several and alone else "")
    what += "" if several else f": {runs[0].outcome}"
    figure.suptitle(what, fontsize=12, y=1.0 - 0.1 / height, va="top")
    if look.marks:
        figure.legend(handles=look.marks, loc="lower center", ncols=ncols, frameon=False, fontsize=SMALL)
    return figure


def _ending(runs: Sequence[Any], index: int) -> str:
    return f"{numbered([run.model for run in runs])[index]}: {runs[index].outcome}"


def _moment(run: Any, time: float) -> str:
    return f"t = {time:.4g} {run.units.get('time', '')}".rstrip()


def save_moving(
    runs: Sequence[Any], draw: Callable[[float], Figure], file: File, count: int, seconds: float
) -> None:
    """Write an animation, as GIF, of `count` frames `draw(time)` that takes `seconds` and begins again."""
    from PIL import Image

    images = []
    for time in times_of(runs, count, None):
        picture = BytesIO()
        draw(time).savefig(picture, format="png")
        images.append(Image.open(picture).convert("RGB").quantize(64))
    pause = int(1000.0 * seconds / count)
    images[0].save(
        file, format="GIF", save_all=True, append_images=images[1:], loop=0,
        duration=[pause] * (count - 1) + [max(pause, 1000)],
    )  # fmt: skip

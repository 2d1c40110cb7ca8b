"""Frames of runs drawn with matplotlib: one frame, a strip of frames, or a GIF."""

from __future__ import annotations

import math
from collections.abc import Sequence
from io import BytesIO
from pathlib import Path as File
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rungwise.viewing.clip import SHOWN_OPEN, SHOWN_SLIP, SHOWN_STICK, Clip, Outline
from rungwise.viewing.extent import bounds, largest_force, receives_first
from rungwise.viewing.html import labels, title

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MODELS = ("#0072b2", "#d55e00", "#007f5f", "#b0508c", "#8a6d00", "#333333")
"""Colours that people see apart whatever their colour vision (Okabe and Ito, some darkened)."""
ROLES = {"object": "#d5e3f2", "robot": "#e7e2d3", "obstacle": "#dcdfe3"}
INK = "#1b1f24"
MARKS = {
    SHOWN_OPEN: ("o", "white", "#7a828c", "open"),
    SHOWN_STICK: ("s", "#0072b2", "white", "sticks"),
    SHOWN_SLIP: ("^", "#c14e00", "white", "slips"),
}
"""Marker, face, edge and word of a contact mode."""
ARROW = 0.16
"""Length of the arrow of the nominal force, as a fraction of the picture's larger side."""
WIDE, GAP = 6.6, 0.2
"""Width of a frame that stands alone, and the space between frames, in inches."""
STEPS_OF_ARC = 24


def rounded(outline: Outline) -> NDArray[np.float64]:
    """Corners (k, 2) of the outline in its body's frame; arcs of the rounding as short chords."""
    if len(outline.vertices) == 1:
        angles = np.linspace(0.0, 2.0 * math.pi, 4 * STEPS_OF_ARC)
        return outline.vertices + outline.radius * np.column_stack([np.cos(angles), np.sin(angles)])
    if outline.radius == 0.0:
        return outline.vertices
    corners = []
    for vertex, before, after in zip(
        outline.vertices, np.roll(outline.normals, 1, axis=0), outline.normals, strict=True
    ):
        first = math.atan2(before[1], before[0])
        turn = (math.atan2(after[1], after[0]) - first) % (2.0 * math.pi)
        angles = first + np.linspace(0.0, turn, STEPS_OF_ARC)
        corners.append(vertex + outline.radius * np.column_stack([np.cos(angles), np.sin(angles)]))
    return np.concatenate(corners)


def placed(points: NDArray[np.float64], pose: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points (k, 2) of a body's frame in the world, at pose (x, y, angle)."""
    c, s = math.cos(pose[2]), math.sin(pose[2])
    moved: NDArray[np.float64] = points @ np.array([[c, s], [-s, c]]) + pose[:2]
    return moved


def pose_at(clip: Clip, time: float) -> NDArray[np.float64]:
    """Poses (bodies, 3) at a time, between frames in a straight line; the last frame lasts."""
    flat = clip.pose.reshape(len(clip.time), -1)
    return np.array([np.interp(time, clip.time, column) for column in flat.T]).reshape(-1, 3)


def draw_frame(axes: Axes, clips: Sequence[Clip], time: float) -> None:
    """Draw bodies, contact points and forces of the clips at one time, over each other."""
    x0, y0, x1, y1 = _seen(clips)
    axes.set(xlim=(x0, x1), ylim=(y0, y1), aspect="equal", xticks=(), yticks=())
    size, force = max(x1 - x0, y1 - y0), largest_force(clips)
    for index, clip in enumerate(clips):
        line = INK if len(clips) == 1 else MODELS[index % len(MODELS)]
        extra = len(clips) - 1 - index
        _bodies(axes, clip, pose_at(clip, time), line, extra, 4.0 * size, index)
        for body, x, y in clip.joints:
            at = placed(np.array([[x, y]]), pose_at(clip, time)[body])
            axes.plot(*at.T, "o", mfc="white", mec=line, mew=1.6, ms=7, zorder=20)
            axes.plot(*at.T, "o", color=line, ms=2, zorder=20)
    for index, clip in enumerate(clips):
        line = "white" if len(clips) == 1 else MODELS[index % len(MODELS)]
        _touches(axes, clip, time, ARROW * size / force, line)


def _bodies(
    axes: Axes, clip: Clip, pose: NDArray[np.float64], line: str, extra: int, far: float, over: int
) -> None:
    """Draw outlines of a body first, at double width, then one fill of all: seams inside the body stay
    hidden."""
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path

    for body, role in enumerate(clip.roles):
        shapes = [outline for outline in clip.outlines if outline.body == body]
        corners = []
        for outline in shapes:
            if outline.halfplane:
                corners.append(placed(_band(outline, far), pose[body]))
            elif len(outline.vertices) == 1 and outline.radius == 0.0:
                at = placed(outline.vertices, pose[body])
                axes.plot(*at.T, "o", color=line, ms=6 + 2 * extra, zorder=3 + over)
            else:
                corners.append(placed(rounded(outline), pose[body]))
                if len(outline.vertices) == 1 and clip.moving[body]:
                    spoke = outline.vertices + outline.radius * np.array([[0.0, 0.0], [1.0, 0.0]])
                    axes.plot(*placed(spoke, pose[body]).T, color=line, lw=1.0, zorder=2.5 + over)
        if corners:
            whole = Path.make_compound_path(*(Path(np.vstack([c, c[:1]]), closed=True) for c in corners))
            axes.add_patch(
                PathPatch(whole, fc="none", ec=line, lw=2.4 + 2.4 * extra, joinstyle="round", zorder=2 + over)
            )
            opaque = 1.0 if over == 0 else 0.75
            axes.add_patch(PathPatch(whole, fc=ROLES[role], ec="none", alpha=opaque, zorder=2 + over))


def _band(outline: Outline, far: float) -> NDArray[np.float64]:
    """The part of a half-plane that a picture can show."""
    (at,), (normal,) = outline.vertices, outline.normals
    along = np.array([-normal[1], normal[0]])
    return np.array(
        [at - far * along, at + far * along, at + far * (along - normal), at - far * (along + normal)]
    )


def _touches(axes: Axes, clip: Clip, time: float, per_force: float, edge: str) -> None:
    from matplotlib.patches import FancyArrowPatch

    t = clip.touches
    frame = int(np.abs(clip.time - time).argmin())
    rows = slice(*np.searchsorted(t.frame, [frame, frame + 1]))
    sign = np.where(receives_first(clip)[t.contact[rows]], 1.0, -1.0)[:, None]
    spots, forces, modes = t.place[rows], per_force * sign * t.force[rows], t.mode[rows]
    for mode, (marker, face, rim, _) in MARKS.items():
        at = spots[modes == mode]
        for spot, force in zip(at, forces[modes == mode], strict=True):
            if np.any(force != 0.0):
                axes.add_patch(
                    FancyArrowPatch(
                        tuple(spot - force), tuple(spot), arrowstyle="-|>", mutation_scale=11, color=face,
                        lw=1.8, shrinkA=0, shrinkB=0, zorder=30,
                    )
                )  # fmt: skip
        colour = rim if edge == "white" else edge
        axes.plot(*at.T, marker, mfc=face, mec=colour, mew=1.0, ms=6.5, zorder=31, ls="none", clip_on=False)


def legend(figure: Figure, clips: Sequence[Clip]) -> None:
    """Draw models (where there are several), contact modes and roles, below the picture."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    handles: list[Line2D | Patch] = []
    if len(clips) > 1:
        for k, (clip, label) in enumerate(zip(clips, labels(clips), strict=True)):
            handles.append(
                Line2D([], [], color=MODELS[k % len(MODELS)], lw=3, label=f"{label}: {clip.outcome}")
            )
    for marker, face, rim, word in MARKS.values():
        handles.append(Line2D([], [], marker=marker, mfc=face, mec=rim, ls="none", label=f"contact {word}"))
    for role in dict.fromkeys(role for clip in clips for role in clip.roles):
        handles.append(Patch(fc=ROLES[role], ec=INK, label=role))
    figure.legend(handles=handles, loc="lower center", ncols=3, frameon=False, fontsize=9)


def strip(clips: Sequence[Clip], count: int = 6, at: float | None = None) -> Figure:
    """Picture of `count` frames at equal times, the first and the last among them; or of one frame at time
    `at`."""
    from matplotlib.figure import Figure

    end = max(float(clip.time[-1]) for clip in clips)
    times = [min(at, end)] if at is not None else np.linspace(0.0, end, count).tolist()
    columns = min(len(times), 3)
    rows = math.ceil(len(times) / columns)
    x0, y0, x1, y1 = _seen(clips)
    wide = WIDE if len(times) == 1 else 0.55 * WIDE
    tall = wide * (y1 - y0) / (x1 - x0)
    across, above, below = columns * (wide + GAP) + GAP, rows * (tall + 2.0 * GAP) + 2.0 * GAP, 0.9
    figure = Figure(figsize=(across, above + below), dpi=110)
    for k, time in enumerate(times):
        left, top = GAP + k % columns * (wide + GAP), 4.0 * GAP + k // columns * (tall + 2.0 * GAP)
        bottom = above + below - top - tall
        axes = figure.add_axes(
            (left / across, bottom / (above + below), wide / across, tall / (above + below))
        )
        draw_frame(axes, clips, time)
        axes.set_title(f"t = {time:.4g}", fontsize=10, pad=3)
    what = title(clips) + (f": {clips[0].outcome}" if len(clips) == 1 else "")
    figure.suptitle(what, fontsize=12, y=1.0 - 0.8 * GAP / (above + below), va="top")
    legend(figure, clips)
    return figure


def _seen(clips: Sequence[Clip]) -> tuple[float, float, float, float]:
    """Extent of a picture: all moving bodies and a margin, at most five times as long as wide."""
    x0, y0, x1, y1 = bounds(clips)
    margin = 0.08 * max(x1 - x0, y1 - y0)
    width, height = x1 - x0 + 2.0 * margin, y1 - y0 + 2.0 * margin
    more_x, more_y = max(0.0, 0.2 * height - width), max(0.0, 0.2 * width - height)
    mx, my = margin + 0.5 * more_x, margin + 0.5 * more_y
    return x0 - mx, y0 - my, x1 + mx, y1 + my


def save_png(clips: Sequence[Clip], file: File, count: int = 6, at: float | None = None) -> None:
    """Write `strip` as PNG."""
    strip(clips, count, at).savefig(file, format="png")


def save_gif(clips: Sequence[Clip], file: File, count: int = 60, seconds: float = 5.0) -> None:
    """Write an animation of `count` frames that takes `seconds` seconds, and begins again."""
    from PIL import Image

    end = max(float(clip.time[-1]) for clip in clips)
    images = []
    for time in np.linspace(0.0, end, count):
        picture = BytesIO()
        strip(clips, at=float(time)).savefig(picture, format="png")
        images.append(Image.open(picture).convert("RGB").quantize(64))
    pause = int(1000.0 * seconds / count)
    images[0].save(
        file, format="GIF", save_all=True, append_images=images[1:], loop=0,
        duration=[pause] * (count - 1) + [max(pause, 1000)],
    )  # fmt: skip

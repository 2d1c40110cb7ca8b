"""Bodies of runs in one frame, drawn with matplotlib."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rungwise.viewing.plane.arrows import View, arrows_at, draw_touches, view_of
from rungwise.viewing.plane.clip import Clip, Outline
from rungwise.viewing.sheet import MODELS

if TYPE_CHECKING:
    from matplotlib.axes import Axes

ROLES = {"object": "#d5e3f2", "robot": "#e7e2d3", "obstacle": "#dcdfe3"}
INK = "#1b1f24"
GOAL, GOAL_LINE = "#00805c", (0, (4, 2))
STEPS_OF_ARC = 24
SHOWS = 0.6
"""How opaque bodies are that are raised off the plane."""


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


def raised_at(clip: Clip, time: float) -> NDArray[np.bool_]:
    """Which bodies are raised off the plane at a time (bodies,)."""
    frame = max(int(np.searchsorted(clip.time, time, side="right")) - 1, 0)
    return np.asarray(clip.raised[frame] > 0.0)


def draw_frame(
    axes: Axes,
    clips: Sequence[Clip],
    time: float,
    view: View | None = None,
    colors: Sequence[str] | None = None,
    touches: bool = True,
) -> None:
    """Draw bodies of the clips at one time, over each other, and with `touches` contact points and forces;
    outlines have these colours."""
    colors = colors or ([INK] if len(clips) == 1 else MODELS)
    view = view_of(clips, [time]) if view is None else view
    x0, y0, x1, y1 = view.extent
    axes.set(xlim=(x0, x1), ylim=(y0, y1), aspect="equal", xticks=(), yticks=())
    size = max(x1 - x0, y1 - y0)
    _goals(axes, clips[0])
    for index, clip in enumerate(clips):
        line = colors[index % len(colors)]
        extra = len(clips) - 1 - index
        _bodies(axes, clip, pose_at(clip, time), line, extra, 4.0 * size, index, raised_at(clip, time))
        for body, x, y in clip.joints:
            at = placed(np.array([[x, y]]), pose_at(clip, time)[body])
            axes.plot(*at.T, "o", mfc="white", mec=line, mew=1.6, ms=7, zorder=20)
            axes.plot(*at.T, "o", color=line, ms=2, zorder=20)
    for index, clip in enumerate(clips if touches else ()):
        line = "white" if len(clips) == 1 else colors[index % len(colors)]
        arrows = arrows_at(clip, time, view.per_force, view.longest).seen(view.extent)
        draw_touches(axes, arrows, clip.units["force"], line)


def _bodies(
    axes: Axes, clip: Clip, pose: NDArray[np.float64], line: str, extra: int, far: float, over: int,
    raised: NDArray[np.bool_],
) -> None:  # fmt: skip
    """Draw outlines of a body first, at double width, then one fill of all: seams inside the body stay
    hidden. Those that are raised are above all others, dashed, and what is below them shows."""
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
            above, style = (2.2 + over, "--") if raised[body] else (2.0 + over, "-")
            axes.add_patch(
                PathPatch(
                    whole, fc="none", ec=line, lw=2.4 + 2.4 * extra, ls=style, joinstyle="round", zorder=above
                )
            )
            opaque = SHOWS if raised[body] else 1.0 if over == 0 else 0.75
            axes.add_patch(PathPatch(whole, fc=ROLES[role], ec="none", alpha=opaque, zorder=above))


def _goals(axes: Axes, clip: Clip) -> None:
    """Draw bodies where the goal wants them, as dashed outlines below all others."""
    for outline in clip.outlines:
        if outline.body in clip.wanted and not outline.halfplane:
            corners = placed(rounded(outline), clip.goal[outline.body])
            axes.plot(*np.vstack([corners, corners[:1]]).T, ls=GOAL_LINE, color=GOAL, lw=1.6, zorder=1.5)


def _band(outline: Outline, far: float) -> NDArray[np.float64]:
    """The part of a half-plane that a picture can show."""
    (at,), (normal,) = outline.vertices, outline.normals
    along = np.array([-normal[1], normal[0]])
    return np.array(
        [at - far * along, at + far * along, at + far * (along - normal), at - far * (along + normal)]
    )

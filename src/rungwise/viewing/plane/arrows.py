"""Contact points and forces of runs, drawn with matplotlib: complete arrows at one scale."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rungwise.viewing.plane.clip import SHOWN_OPEN, SHOWN_SLIP, SHOWN_STICK, Clip
from rungwise.viewing.plane.extent import bounds, largest_force, receives_first
from rungwise.viewing.sheet import SMALL

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MARKS = {
    SHOWN_OPEN: ("o", "white", "#7a828c", "open"),
    SHOWN_STICK: ("s", "#0072b2", "white", "sticks"),
    SHOWN_SLIP: ("^", "#c14e00", "white", "slips"),
}
"""Marker, face, edge and word of a contact mode."""
ARROW = 0.16
"""Length of the arrow of the nominal force, as a fraction of the picture's larger side."""
LONGEST, SHORTEST, BREAK = 1.5, 0.08, 0.12
"""Longest and shortest arrow, as multiples of the nominal one; where along it strokes say it is broken."""


@dataclass(frozen=True)
class View:
    """What frames show: x and y from, x and y to; the length of an arrow per force, and of the longest."""

    extent: tuple[float, float, float, float]
    per_force: float
    longest: float


def view_of(clips: Sequence[Clip], times: Sequence[float]) -> View:
    """A view that has room for the bodies at all times (see `bounds`), and for the arrows at these."""
    x0, y0, x1, y1 = bounds(clips)
    margin = 0.08 * max(x1 - x0, y1 - y0)
    nominal = ARROW * (max(x1 - x0, y1 - y0) + 2.0 * margin)
    per_force, longest = nominal / largest_force(clips), LONGEST * nominal
    corners = [np.array([[x0, y0], [x1, y1]])]
    for clip in clips:
        for time in times:
            arrows = arrows_at(clip, time, per_force, longest)
            here = _inside(arrows.spot, (x0, y0, x1, y1))
            corners += [arrows.tail[here], arrows.spot[here & (arrows.long > 0.0)]]
    low, high = np.concatenate(corners).min(axis=0) - margin, np.concatenate(corners).max(axis=0) + margin
    least = 0.2 * float((high - low).max())
    more = 0.5 * np.maximum(0.0, least - (high - low))
    return View((*(low - more).tolist(), *(high + more).tolist()), per_force, longest)


def _inside(spots: NDArray[np.float64], extent: tuple[float, float, float, float]) -> NDArray[np.bool_]:
    """Which points (k, 2) a frame shows."""
    x0, y0, x1, y1 = extent
    x, y = spots.T
    return np.asarray((x >= x0) & (x <= x1) & (y >= y0) & (y <= y1))


@dataclass(frozen=True)
class Arrows:
    """Contact points of one frame: places, modes, sizes of forces; other ends and lengths of arrows."""

    spot: NDArray[np.float64]
    mode: NDArray[np.int64]
    size: NDArray[np.float64]
    tail: NDArray[np.float64]
    long: NDArray[np.float64]
    broken: NDArray[np.bool_]

    def seen(self, extent: tuple[float, float, float, float]) -> Arrows:
        """Those whose contact points a frame shows."""
        here = _inside(self.spot, extent)
        return Arrows(*(getattr(self, each.name)[here] for each in fields(self)))


def arrows_at(clip: Clip, time: float, per_force: float, longest: float) -> Arrows:
    t = clip.touches
    frame = int(np.abs(clip.time - time).argmin())
    rows = slice(*np.searchsorted(t.frame, [frame, frame + 1]))
    sign = np.where(receives_first(clip)[t.contact[rows]], 1.0, -1.0)[:, None]
    force = sign * t.force[rows]
    size = np.linalg.norm(force, axis=1)
    long = np.minimum(per_force * size, longest)
    long[long < SHORTEST / LONGEST * longest] = 0.0
    along = force / np.where(size > 0.0, size, 1.0)[:, None]
    spot = t.place[rows]
    return Arrows(spot, t.mode[rows], size, spot - long[:, None] * along, long, per_force * size > longest)


def draw_touches(axes: Axes, arrows: Arrows, unit: str, edge: str) -> None:
    from matplotlib.patches import FancyArrowPatch

    for mode, (marker, face, rim, _) in MARKS.items():
        for k in np.flatnonzero((arrows.mode == mode) & (arrows.long > 0.0)):
            ends = axes.transData.transform([arrows.spot[k], arrows.tail[k]])
            points = 72.0 / axes.figure.dpi * float(np.linalg.norm(ends[1] - ends[0]))
            axes.add_patch(
                FancyArrowPatch(
                    tuple(arrows.tail[k]), tuple(arrows.spot[k]), arrowstyle="-|>",
                    mutation_scale=min(11.0, 0.7 * points),
                    color=face, lw=1.8, shrinkA=0, shrinkB=3, zorder=30,
                )
            )  # fmt: skip
        colour = rim if edge == "white" else edge
        at = arrows.spot[arrows.mode == mode]
        axes.plot(*at.T, marker, mfc=face, mec=colour, mew=1.0, ms=6.5, zorder=31, ls="none", clip_on=False)
    for k in np.flatnonzero(arrows.broken):
        _break(axes, arrows.spot[k], arrows.tail[k], MARKS[int(arrows.mode[k])][1])
    _sizes(axes, arrows, unit)


def _break(axes: Axes, spot: NDArray[np.float64], tail: NDArray[np.float64], color: str) -> None:
    """Two strokes across the shaft of an arrow that is shorter than its force."""
    for stroke in _strokes(spot, tail):
        axes.plot(*stroke.T, color=color, lw=1.4, zorder=32)
    along = spot - tail
    gap = np.array([tail + BREAK * along, tail + (BREAK + 0.06) * along])
    axes.plot(*gap.T, color="white", lw=2.4, zorder=31.5, solid_capstyle="butt")


def _strokes(spot: NDArray[np.float64], tail: NDArray[np.float64]) -> NDArray[np.float64]:
    """Ends (2, 2, 2) of the strokes that say that an arrow is broken."""
    along = spot - tail
    across = 0.09 * np.array([-along[1], along[0]]) + 0.03 * along
    middles = tail + np.array([[BREAK], [BREAK + 0.06]]) * along
    return np.stack([middles - across, middles + across], axis=1)


def _sizes(axes: Axes, arrows: Arrows, unit: str) -> None:
    """The sizes of forces whose arrows are broken, the largest first, beyond their ends and strokes and
    towards the middle of the frame, where there is room."""
    middle, taken = sum(axes.get_xlim()) / 2.0, np.zeros((0, 2))
    for k in np.flatnonzero(arrows.broken)[np.argsort(-arrows.size[arrows.broken], kind="stable")]:
        tail, down = arrows.tail[k], arrows.tail[k, 1] >= arrows.spot[k, 1]
        if (np.linalg.norm(taken - tail, axis=1) < 0.5 * arrows.long[k]).any():
            continue
        taken = np.vstack([taken, tail])
        heights = np.append(_strokes(arrows.spot[k], tail)[..., 1], tail[1])
        beyond = (tail[0], heights.max() if down else heights.min())
        axes.annotate(
            f"{short(arrows.size[k])} {unit}".rstrip(), beyond, xytext=(0.0, 3.0 if down else -3.0),
            textcoords="offset points", fontsize=SMALL, zorder=33, ha="left" if tail[0] < middle else "right",
            va="bottom" if down else "top",
        )  # fmt: skip


def short(size: float) -> str:
    """Three digits, without an exponent up to a million."""
    return f"{float(f'{size:.3g}'):.0f}" if 1e3 <= size < 1e6 else f"{size:.3g}"

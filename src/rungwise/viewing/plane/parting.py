"""The picture of a diagnosis: both motions over each other where they part and where they are farthest apart,
and their distance over time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from textwrap import wrap
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rungwise.deadline import Deadline, seconds
from rungwise.models.ladder import rung
from rungwise.planning.diagnosis.diagnose import NOTHING, Diagnosis, Watch, both, distances
from rungwise.planning.diagnosis.sentences import UNTOUCHED
from rungwise.scene import Scene
from rungwise.viewing.plane.arrows import View, view_of
from rungwise.viewing.plane.clip import Clip, of_trajectory
from rungwise.viewing.plane.draw_frame import INK, draw_frame, placed, pose_at, rounded
from rungwise.viewing.plane.pictures import legend
from rungwise.viewing.sheet import GAP, MODELS, WIDE
from rungwise.viewing.write import ViewError, needs_matplotlib, write
from rungwise.world.find import world_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MOMENTS = 400
"""Points of the paths of bodies."""
ABOVE, CURVE, BELOW, LINE = 0.35, 1.1, 1.0, 0.17
"""Inches: above the frames for the title, the curve of distances, the legend, a line of text."""
COLUMNS = 150
"""Columns of text below the title."""
MARK = "#c1121f"
SEEN, LEAST, INSET, INSET_SEEN = 0.012, 1e-9, 0.36, 0.25
"""Parts of a picture's width: outlines less apart than the first are magnified, unless less than the second;
the side of an inset, of the picture's shorter one; of the inset, how far outlines are apart in it."""


def draw_parting(
    found: Diagnosis,
    scene: Scene,
    file: str | Path,
    *,
    parameters: Mapping[str, float] | None = None,
    other_parameters: Mapping[str, float] | None = None,
    at: float | None = None,
    limit: float | None = None,
) -> Path:
    """Draw the diagnosis `found` of a scene: both motions when they begin to differ, or at the time `at`,
    and when they are farthest apart.

    The runs are made again, with the inputs and accuracies of the diagnosis. `parameters` and
    `other_parameters` are those for which it was made. The kind of file (png, svg, pdf) follows from its
    ending. Raises ViewError if matplotlib is missing, the kind is unknown or the file cannot be written, and
    LimitError if `limit` seconds are over before the runs are made.
    """
    watch = Watch(None, Deadline(seconds(limit)))
    needs_matplotlib("parting")
    if UNTOUCHED in found.causes:
        raise ViewError(f"parting: {found.before} has places, but no motion to draw")
    own = scene.parameters(parameters)
    others = own if other_parameters is None else scene.parameters(other_parameters)
    names = [name.split(" @ ")[0] for name in (found.before, found.after)]
    one, other = (
        world_of(scene).variant(values, rung(name), tol)
        for values, name, tol in zip((own, others), names, found.tols, strict=True)
    )
    with watch.deadline.needed_for("the motions on both rungs were known"):
        _, motions, until = both(one, other, found.inputs, world_of(scene).at(own).moved.weights, watch)
    clips = [
        replace(
            of_trajectory(world.scene, world.parameters, motion.data), model=label, outcome=end["outcome"]
        )
        for world, motion, label, end in zip(
            (one, other), motions, (found.before, found.after), found.ends, strict=True
        )
    ]
    _, times, apart = distances(*motions, until)
    figure = _figure(clips, found, times, apart, found.time if at is None else min(at, until))
    kind = Path(file).suffix.lstrip(".") or "png"
    kinds = figure.canvas.get_supported_filetypes()
    if kind not in kinds:
        raise ViewError(f"parting: unknown kind of file {kind!r}; valid: {', '.join(sorted(kinds))}")
    return write("parting", file, lambda draft: figure.savefig(draft, format=kind))


def _figure(
    clips: Sequence[Clip],
    found: Diagnosis,
    times: NDArray[np.float64],
    apart: NDArray[np.float64],
    when: float,
) -> Figure:
    from matplotlib.figure import Figure

    farthest = float(times[apart.argmax()])
    view = view_of(clips, [when, farthest])
    x0, y0, x1, y1 = view.extent
    wide = 0.75 * WIDE
    tall = float(np.clip(wide * (y1 - y0) / (x1 - x0), 0.35 * wide, 1.3 * wide))
    said = [line for text in str(found).splitlines() for line in _wrapped(text)]
    words = LINE * len(said)
    across, high = 2.0 * wide + 3.0 * GAP, ABOVE + words + tall + 0.5 + CURVE + 0.4 + BELOW
    figure = Figure(figsize=(across, high), dpi=110)
    figure.text(GAP / across, 1.0 - 0.8 * GAP / high, "\n".join(said), fontsize=9, va="top", color=INK)
    body, units = clips[0].bodies.index(found.body), clips[0].units
    for k, (time, name) in enumerate(
        ((when, "the motions begin to differ"), (farthest, "the motions are farthest apart"))
    ):
        left, bottom = GAP + k * (wide + GAP), BELOW + 0.4 + CURVE + 0.5
        axes = figure.add_axes((left / across, bottom / high, wide / across, tall / high))
        draw_frame(axes, clips, time, view)
        _mark(axes, clips, body, time, joined=bool(k))
        _magnified(axes, clips, body, time, view)
        shown = name if k or time == found.time else "chosen time, the motions differ"
        away = np.interp(time, times, apart)
        when_said, away_said = (
            f"{time:.4g} {units['time']}".rstrip(),
            f"{away:.3g} {units['length']}".rstrip(),
        )
        axes.set_title(f"t = {when_said}, {shown}: by {away_said}", fontsize=10, pad=3)
    axes = figure.add_axes(
        (4.0 * GAP / across, (BELOW + 0.4) / high, (across - 5.0 * GAP) / across, CURVE / high)
    )
    _curve(axes, times, apart, when if found.cause != NOTHING else None)
    for put, name, unit in (
        (axes.set_xlabel, "time", units["time"]),
        (axes.set_ylabel, "distance", units["length"]),
    ):
        put(f"{name} [{unit}]" if unit else name, fontsize=9)
    legend(figure, clips)
    return figure


def _wrapped(line: str) -> list[str]:
    return wrap(line, COLUMNS, subsequent_indent="    ", break_on_hyphens=False)


def _mark(axes: Axes, clips: Sequence[Clip], body: int, time: float, joined: bool) -> None:
    """The ways of the body in both motions until this time, dotted after it; its places joined by a line, or
    in a ring."""
    end = max(float(clip.time[-1]) for clip in clips)
    for k, clip in enumerate(clips):
        for first, last, style in ((0.0, time, "-"), (time, end, ":")):
            way = np.array([pose_at(clip, t)[body, :2] for t in np.linspace(first, last, MOMENTS)])
            axes.plot(*way.T, style, color=MODELS[k], lw=1.4, zorder=25)
    places = np.array([pose_at(clip, time)[body, :2] for clip in clips])
    if joined:
        axes.plot(*places.T, "o-", color=MARK, lw=1.8, ms=4, zorder=40)
    else:
        axes.plot(*places.mean(axis=0), "o", mfc="none", mec=MARK, mew=1.8, ms=22, zorder=40)


def _magnified(axes: Axes, clips: Sequence[Clip], body: int, time: float, view: View) -> None:
    """An inset where outlines of the body are farthest apart, if that is too little to be seen."""
    one, other = (
        np.concatenate([placed(rounded(each), pose_at(clip, time)[body]) for each in clip.outlines
                        if each.body == body and not each.halfplane])
        for clip in clips
    )  # fmt: skip
    away = np.linalg.norm(one - other, axis=1)
    apart, side = float(away.max()), view.extent[2] - view.extent[0]
    if not LEAST * side < apart < SEEN * side:
        return
    x, y = 0.5 * (one + other)[away.argmax()]
    half = 0.5 * apart / INSET_SEEN
    wide, tall = axes.bbox.width, axes.bbox.height
    own = INSET * min(wide, tall)
    corner = _emptiest(clips, time, view)
    left, low = (0.5 + sign * (0.48 - 0.5 * own / length) - 0.5 * own / length
                 for sign, length in zip(corner, (wide, tall), strict=True))  # fmt: skip
    inset = axes.inset_axes((left, low, own / wide, own / tall))
    close = View((x - half, y - half, x + half, y + half), 0.0, view.longest)
    draw_frame(inset, clips, time, close, touches=False)
    scale = own / (2.0 * half) * max(side / wide, (view.extent[3] - view.extent[1]) / tall)
    said, back = f"\N{MULTIPLICATION SIGN} {scale:.2g}", {"fc": "white", "ec": "none", "pad": 1.0}
    inset.text(0.04, 0.05, said, fontsize=9, transform=inset.transAxes, bbox=back, zorder=60)
    inset.set_zorder(50)
    axes.indicate_inset_zoom(inset, edgecolor=INK, alpha=0.8)


def _emptiest(clips: Sequence[Clip], time: float, view: View) -> tuple[int, int]:
    """The corner of a picture that is farthest from all bodies: -1 for left and below."""
    x0, y0, x1, y1 = view.extent
    places = np.concatenate([
        placed(each.vertices, pose_at(clip, time)[each.body])
        for clip in clips for each in clip.outlines if not each.halfplane
    ])  # fmt: skip
    corners = {(a, b): ((x0, x1)[a > 0], (y0, y1)[b > 0]) for a in (-1, 1) for b in (-1, 1)}
    return max(corners, key=lambda k: float(np.linalg.norm(places - corners[k], axis=1).min()))


def _curve(axes: Axes, times: NDArray[np.float64], apart: NDArray[np.float64], when: float | None) -> None:
    axes.plot(times, apart, color=INK, lw=1.4)
    axes.fill_between(times, apart, color=INK, alpha=0.08, lw=0)
    if when is not None:
        axes.axvline(when, color=MARK, lw=1.4)
        axes.plot([when], [np.interp(when, times, apart)], "o", color=MARK, ms=6, clip_on=False, zorder=5)
    axes.set_xlim(0.0, float(times[-1]))
    axes.set_ylim(bottom=0.0)
    axes.tick_params(labelsize=8)
    axes.spines[["top", "right"]].set_visible(False)

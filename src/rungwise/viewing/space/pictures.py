"""Strips of frames of runs in space, seen from a slant without perspective, and animations made of them."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path as File
from typing import TYPE_CHECKING, Any

import numpy as np

from rungwise.kernel import Reals
from rungwise.viewing.plane.arrows import ARROW, LONGEST, MARKS, SHORTEST
from rungwise.viewing.plane.draw_frame import GOAL, GOAL_LINE
from rungwise.viewing.plane.pictures import of_force, of_goal, of_modes
from rungwise.viewing.sheet import Look, save_moving, sheet, times_of
from rungwise.viewing.space.extent import box, largest_force
from rungwise.viewing.space.film import OPEN, Film
from rungwise.viewing.space.raster import paint
from rungwise.viewing.space.shapes import triangles, turned

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

AZIMUTH, HEIGHT = -0.95, 0.38
"""Where the eye is, in radians: those of the page's first view."""
PIXELS = 720
"""Pixels along the larger side of a frame, of which the picture shows about half."""
MARGIN = 0.08
"""Room around bodies, as a part of the larger side."""
SUN = np.array([-0.25, -0.6, 1.0]) / math.hypot(0.25, 0.6, 1.0)
SHADE, LIT = 0.62, 0.38
"""Brightness of faces that turn away from the light, and how much brighter those are that it hits."""
OPAQUE = np.ones(4)
NEAR = 0.01
"""Part of the larger side: points between bodies that are farther apart lie in the air and are not drawn."""
FLOOR, CELLS = "#c9cdd3", 9
"""Colour of the grid that stands for a plane, and its cells along the larger side of the picture."""
AXES = np.array(
    [
        [-math.sin(AZIMUTH), math.cos(AZIMUTH), 0.0],
        [-math.sin(HEIGHT) * math.cos(AZIMUTH), -math.sin(HEIGHT) * math.sin(AZIMUTH), math.cos(HEIGHT)],
        [math.cos(HEIGHT) * math.cos(AZIMUTH), math.cos(HEIGHT) * math.sin(AZIMUTH), math.sin(HEIGHT)],
    ]
)
"""Right, up and towards the eye, in the world's axes."""


@dataclass(frozen=True)
class Sight:
    """What frames show: right and up from, right and up to; the arrow of a force of 1, and the longest."""

    extent: tuple[float, float, float, float]
    middle: Reals
    per_force: float
    longest: float

    @property
    def side(self) -> float:
        """The larger side of the frame."""
        x0, y0, x1, y1 = self.extent
        return max(x1 - x0, y1 - y0)


def sight_of(films: Sequence[Film]) -> Sight:
    """A frame that has room for the bodies at all times."""
    low, high = box([*films, *(there for film in films for there in _goals(film))])
    corners = np.array(list(itertools.product(*zip(low, high, strict=True)))) @ AXES[:2].T
    first, last = corners.min(axis=0), corners.max(axis=0)
    side = float((last - first).max())
    margin = MARGIN * side + 0.5 * np.maximum(0.0, 0.5 * side - (last - first))
    nominal = ARROW * side
    extent = (*(first - margin).tolist(), *(last + margin).tolist())
    return Sight(extent, 0.5 * (low + high), nominal / largest_force(films), LONGEST * nominal)


def strip(
    films: Sequence[Film], count: int = 6, at: float | None = None, view: Sight | None = None
) -> Figure:
    """Picture of `count` frames at equal times, or of one at time `at`, as those of runs in the plane."""
    sight = sight_of(films) if view is None else view
    name = " and ".join(dict.fromkeys(film.title for film in films))
    name += f" on {films[0].model}" if len(films) == 1 and films[0].model else ""
    look = Look(
        name, sight.extent, lambda axes, k, time, colour: draw_frame(axes, films[k], time, sight, colour),
        _no_ticks, _marks(films, sight),
    )  # fmt: skip
    return sheet(films, times_of(films, count, at), look)


def _no_ticks(axes: Axes, *_: bool) -> None:
    """Along axes that are seen from a slant, ticks say little; the cells of the floor give the scale."""
    axes.set(xticks=[], yticks=[])


def save_gif(films: Sequence[Film], file: File, count: int = 40, seconds: float = 5.0) -> None:
    """Write an animation of `count` frames that takes `seconds` seconds, and begins again."""
    sight = sight_of(films)
    save_moving(films, lambda time: strip(films, at=time, view=sight), file, count, seconds)


def draw_frame(axes: Axes, film: Film, time: float, sight: Sight, colour: str | None) -> None:
    """Bodies, contact points and forces at the frame nearest to a time."""
    k = int(np.abs(film.time - time).argmin())
    x0, y0, x1, y1 = sight.extent
    _floor(axes, film, k, sight)
    axes.imshow(_picture(film, k, sight), extent=(x0, x1, y0, y1), zorder=10, interpolation="antialiased")
    for there in _goals(film):
        covered = np.flipud(_picture(there, 0, sight)[..., 3])
        places = (
            np.linspace(*ends, n + 1) for ends, n in zip(((x0, x1), (y0, y1)), covered.T.shape, strict=True)
        )
        middles = (0.5 * (each[1:] + each[:-1]) for each in places)
        axes.contour(*middles, covered, [0.5], colors=GOAL, linestyles=[GOAL_LINE], linewidths=1.6, zorder=15)
    _touches(axes, film, k, sight)
    axes.set(xlim=(x0, x1), ylim=(y0, y1), aspect="equal")
    for spine in axes.spines.values():
        spine.set_color(FLOOR if colour is None else colour)


def _goals(film: Film) -> list[Film]:
    """For each body of which the goal wants a pose, its solids there, as a film of one frame."""
    found = []
    for body in film.wanted:
        place, turn = film.goal[body, :3], film.goal[body, 3:]
        solids = [replace(s, body=0, colour=OPAQUE) for s in film.solids if s.body == body]
        if solids:
            there = Film(
                film.title, film.model, (film.bodies[body],), tuple(solids), film.time[:1],
                place[None, None], turn[None, None],
            )  # fmt: skip
            found.append(there)
    return found


def _picture(film: Film, k: int, sight: Sight) -> Reals:
    """Pixels (h, w, 4) of the bodies in a frame; clear where there are none."""
    x0, y0, x1, y1 = sight.extent
    scale = PIXELS / sight.side
    high, wide = round(scale * (y1 - y0)), round(scale * (x1 - x0))
    pixels, depth = np.zeros((high, wide, 4)), np.full((high, wide), -np.inf)
    for _, corners, colours in sorted(_faces(film, k), key=lambda each: each[0]):
        seen = corners @ AXES.T
        seen[..., 0], seen[..., 1] = scale * (seen[..., 0] - x0) - 0.5, scale * (y1 - seen[..., 1]) - 0.5
        paint(np.ascontiguousarray(seen), np.ascontiguousarray(colours), pixels, depth)
    return np.clip(pixels, 0.0, 1.0)


def _faces(film: Film, k: int) -> list[tuple[bool, Reals, Reals]]:
    """Of each solid in a frame whether it can be seen through, its triangles (f, 3, 3) in the world and their
    colours (f, 4); of closed solids, those that face the eye."""
    found = []
    for solid in film.solids:
        vertices, faces = triangles(solid)
        if not len(faces) or solid.colour[3] == 0.0:
            continue
        own = vertices @ turned(solid.turn).T + solid.place
        world = (own @ turned(film.turns[k, solid.body]).T + film.places[k, solid.body])[faces]
        normals = np.cross(world[:, 1] - world[:, 0], world[:, 2] - world[:, 0])
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
        front = normals @ AXES[2] > 0.0
        bright = SHADE + LIT * np.maximum(normals[front] @ SUN, -0.4)
        colours = np.column_stack([bright[:, None] * solid.colour[:3], np.full(len(bright), solid.colour[3])])
        found.append((bool(solid.colour[3] < 1.0), world[front], colours))
    return found


def _floor(axes: Axes, film: Film, k: int, sight: Sight) -> None:
    """A grid for each plane, around the middle of what is seen."""
    cell = _round(sight.side / CELLS)
    for solid in film.solids:
        if solid.kind != "plane":
            continue
        frame = turned(film.turns[k, solid.body]) @ turned(solid.turn)
        origin = turned(film.turns[k, solid.body]) @ solid.place + film.places[k, solid.body]
        middle = np.round(((sight.middle - origin) @ frame)[:2] / cell)
        lines = np.arange(-2 * CELLS, 2 * CELLS + 1)
        for across, along in ((0, 1), (1, 0)):
            ends = np.zeros((len(lines), 2, 3))
            ends[:, :, across] = cell * (middle[across] + lines[:, None])
            ends[:, :, along] = cell * (middle[along] + lines[[0, -1]])
            seen = (ends @ frame.T + origin) @ AXES[:2].T
            axes.plot(seen[..., 0].T, seen[..., 1].T, color=FLOOR, lw=0.6, zorder=1)


def _round(x: float) -> float:
    """The greatest of 1, 2 and 5 times a power of ten that is not greater."""
    power = 10.0 ** math.floor(math.log10(x))
    return next(m * power for m in (5.0, 2.0, 1.0) if m * power <= x * (1.0 + 1e-9))


def _touches(axes: Axes, film: Film, k: int, sight: Sight) -> None:
    touches = film.touches
    rows = np.flatnonzero(touches.frame == k)
    if film.gaps is not None:
        rows = rows[(touches.mode[rows] != OPEN) | ~(film.gaps[k, touches.pair[rows]] > NEAR * sight.side)]
    spots = touches.point[rows] @ AXES[:2].T
    for row, spot in zip(rows, spots, strict=True):
        force = touches.force[row]
        size = float(np.linalg.norm(force))
        long = min(sight.per_force * size, sight.longest)
        _, face, rim, _ = MARKS[int(touches.mode[row])]
        colour = rim if face == "white" else face
        if long > SHORTEST * sight.longest:
            end = spot + long / size * (AXES[:2] @ force)
            shaft = {"arrowstyle": "-|>", "color": colour, "lw": 1.4, "shrinkA": 0.0, "shrinkB": 0.0}
            axes.annotate("", end, spot, arrowprops=shaft, zorder=20, annotation_clip=False)
    for mode, (marker, face, rim, _) in MARKS.items():
        some = spots[touches.mode[rows] == mode]
        axes.plot(some[:, 0], some[:, 1], marker, mfc=face, mec=rim, ms=5.5, zorder=21, ls="none")


def _marks(films: Sequence[Film], sight: Sight) -> list[Any]:
    """Entries of the legend: modes of contact, the force of the longest arrow, the side of a cell."""
    from matplotlib.lines import Line2D

    handles = []
    if any(len(film.touches.frame) for film in films):
        handles += of_modes()
    if any(film.touches.force.any() for film in films):
        most = f"{sight.longest / sight.per_force:.3g} {films[0].units.get('force', '')}".rstrip()
        handles.append(of_force(f"force, cut off beyond {most}"))
    if any(film.wanted for film in films):
        handles.append(of_goal())
    if any(solid.kind == "plane" for film in films for solid in film.solids):
        side = f"{_round(sight.side / CELLS):.3g} {films[0].units.get('length', '')}".rstrip()
        handles.append(
            Line2D([], [], color=FLOOR, marker="s", mfc="none", ms=9, ls="none", label=f"cell of {side}")
        )
    return handles

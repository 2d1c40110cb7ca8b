"""Where sets of several models differ: the parts of a slice, shaded, lettered and put into words."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt, label

from rungwise.kernel import Ints
from rungwise.sets.cells.labels import Label

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SHADES = ("#d55e00", "#0072b2", "#cc79a7", "#8a6d00", "#56b4e9", "#1b1f24")
"""Colours of kinds of differences, the largest first; further kinds have the last."""
LEAST, ROOM, PALE = 1e-3, 9, 0.35
"""Smallest part of a slice that has a letter; half the pixels that a letter needs; how strongly labels are
painted where all models agree."""


@dataclass(frozen=True)
class Difference:
    """One way in which labels of the models differ: labels in the order of the models, the letter, and the
    part of the slices where it is so."""

    labels: tuple[Label, ...]
    letter: str
    part: float

    def words(self, names: Sequence[str]) -> str:
        """The labels and the models that have them; those of the most common label are `the others`."""
        common, count = Counter(self.labels).most_common(1)[0]
        groups = {
            each: " and ".join(name for name, own in zip(names, self.labels, strict=True) if own is each)
            for each in dict.fromkeys(self.labels)
        }
        if count > 1:
            groups = {each: text for each, text in groups.items() if each is not common}
            groups[common] = "the others"
        said = ", ".join(f"{each} on {text}" for each, text in groups.items())
        return f"{self.letter}: {said} ({100.0 * self.part:.2g} %)"


def differences(slices: Sequence[Ints]) -> list[Difference]:
    """All ways in which models differ in slices (models, rows, columns), the largest first."""
    columns = np.concatenate([each.reshape(len(each), -1) for each in slices], axis=1)
    kinds, counts = np.unique(columns[:, (columns != columns[0]).any(axis=0)], axis=1, return_counts=True)
    order = np.argsort(-counts, kind="stable")
    return [
        Difference(
            tuple(Label(value) for value in kinds[:, k]),
            chr(ord("A") + min(rank, 25)),
            float(counts[k] / columns.shape[1]),
        )
        for rank, k in enumerate(order)
    ]


def shade(rank: int) -> str:
    """The colour of the difference of that rank."""
    return SHADES[min(rank, len(SHADES) - 1)]


def draw_differences(
    axis: Axes,
    shown: Ints,
    kinds: Sequence[Difference],
    colors: Sequence[str],
    extent: tuple[float, float, float, float],
) -> None:
    """Draw labels of models (models, rows, columns): pale where they agree, shaded and lettered where not."""
    from matplotlib.colors import to_rgb

    paints = np.array([to_rgb(color) for color in colors])
    picture = 1.0 - PALE + PALE * paints[shown[0]]
    masks = [(shown == np.array(kind.labels)[:, None, None]).all(axis=0) for kind in kinds]
    for rank, mask in enumerate(masks):
        picture[mask] = to_rgb(shade(rank))
    axis.imshow(picture, origin="lower", extent=extent, aspect="auto", interpolation="nearest")
    for rank, (kind, mask) in enumerate(zip(kinds, masks, strict=True)):
        for place, room in _spots(mask):
            _letter(axis, kind.letter, shade(rank), place, room, mask.shape)


def _spots(mask: NDArray[np.bool_]) -> list[tuple[NDArray[np.float64], float]]:
    """For each large piece, the place (column, row) farthest from its edge, and how far that is."""
    pieces, count = label(mask, np.ones((3, 3)))
    found = []
    for piece in range(1, count + 1):
        inside = pieces == piece
        if inside.sum() < LEAST * mask.size:
            continue
        depth = distance_transform_edt(np.pad(inside, 1))[1:-1, 1:-1]
        row, column = np.unravel_index(int(depth.argmax()), depth.shape)
        found.append((np.array([column + 0.5, row + 0.5]), float(depth.max())))
    return found


def _letter(
    axis: Axes,
    letter: str,
    color: str,
    place: NDArray[np.float64],
    room: float,
    shape: tuple[int, ...],
) -> None:
    """Write a letter into its piece, or beside a thin one, towards the middle of the picture."""
    rows, columns = shape
    at = place / np.array([columns, rows])
    if room >= ROOM:
        axis.text(
            at[0], at[1], letter, transform=axis.transAxes, ha="center", va="center", fontsize=9,
            fontweight="bold", color="white", zorder=5,
        )  # fmt: skip
        return
    axis.annotate(
        letter, at, xycoords="axes fraction", xytext=tuple(np.where(at > 0.5, -17.0, 17.0)),
        textcoords="offset points", ha="center", va="center", fontsize=9, fontweight="bold", color=color,
        bbox={"boxstyle": "circle,pad=0.15", "fc": "white", "ec": color, "lw": 1.0}, zorder=5,
        arrowprops={"arrowstyle": "-", "color": color, "lw": 1.2, "shrinkA": 0.0, "shrinkB": 0.0},
    )  # fmt: skip

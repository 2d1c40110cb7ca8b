"""Slices of sets, drawn with matplotlib."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rungwise.kernel import Ints
from rungwise.sets.cells.labels import Label
from rungwise.sets.cells.surface import boundary
from rungwise.sets.doomed.doomed import DoomedSet
from rungwise.sets.feasible.feasible import FeasibleSet
from rungwise.stored import whole
from rungwise.viewing.sets.differences import differences, draw_differences, shade
from rungwise.viewing.units import titled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLORS = {
    Label.FEASIBLE: "#2a9d5c",
    Label.INFEASIBLE: "#d9d9d9",
    Label.DOOMED: "#6b7a8f",
    Label.UNSAFE: "#c8553d",
    Label.JAMMED: "#e0a030",
    Label.INVALID: "#ffffff",
    Label.UNKNOWN: "#b09cc8",
}
PIXELS, LAYERS, STATE_LAYERS = 400, 3, 4
"""Resolution of a slice; slices shown of a set over more than two parameters, or states."""
WIDEST, MOST = 3, 5
"""Panels side by side of sets over two parameters; kinds of differences that the legend tells apart."""


def feasible_slices(found: Sequence[FeasibleSet]) -> Figure:
    """Slices of each set over its first two parameters and, of several sets, the same slices with the parts
    where they differ."""
    from matplotlib.figure import Figure
    from matplotlib.patches import Patch

    first, several = found[0], len(found) > 1
    layers = LAYERS if len(first.over) > 2 else 1
    count = (len(found) + several) * layers
    columns = layers if layers > 1 else min(count, WIDEST)
    rows = -(-count // columns)
    parts = [(k + 1) / (layers + 1) for k in range(layers)]
    labels = [np.stack([slice_labels(each, part) for each in found]) for part in parts]
    kinds = differences(labels) if several else []
    drawing = Figure(
        figsize=(1.0 + 3.2 * columns, 1.0 + 2.9 * rows + 0.2 * min(len(kinds), MOST)), layout="constrained"
    )
    axes = drawing.subplots(rows, columns, squeeze=False, sharex=True, sharey=True).ravel()
    panels = [(each.name, k, part) for each in found for k, part in enumerate(parts)]
    for i, (axis, (name, k, part)) in enumerate(zip(axes, panels, strict=False)):
        _paint(axis, labels[k][i // layers], _extent(first))
        axis.set_title(name + _fixed(first, part), fontsize=9)
    for axis, shown, part in zip(axes[len(panels) : count], labels, parts, strict=False):
        draw_differences(axis, shown, kinds, [COLORS[label] for label in Label], _extent(first))
        axis.set_title(("where they differ" if kinds else "they agree") + _fixed(first, part), fontsize=9)
    for axis in axes[count:]:
        axis.set_axis_off()
    _name_axes(list(axes[:count]), first, columns)
    drawing.suptitle(f"{first.scene.name}: {', '.join(first.over)}", fontsize=11)
    seen = sorted({Label(value) for each in labels for value in np.unique(each)})
    handles = [Patch(facecolor=COLORS[label], edgecolor="#888888", label=str(label)) for label in seen]
    names = [each.name for each in found]
    handles += [Patch(facecolor=shade(k), label=kind.words(names)) for k, kind in enumerate(kinds[:MOST])]
    if len(kinds) > MOST:
        rest = 100.0 * sum(kind.part for kind in kinds[MOST:])
        handles.append(Patch(facecolor=shade(MOST), label=f"{len(kinds) - MOST} other ways ({rest:.2g} %)"))
    drawing.legend(
        handles=handles, loc="outside lower center", ncols=1 if kinds else len(handles), fontsize=9,
        frameon=False,
    )  # fmt: skip
    return drawing


def slice_labels(found: FeasibleSet, part: float) -> Ints:
    """Labels (rows, columns) over the first two parameters, the others at that part 0..1 of their range."""
    low, high = found.box.T
    grid = (np.arange(PIXELS) + 0.5) / PIXELS
    x, y = np.meshgrid(grid, grid if len(found.over) > 1 else np.array([0.5]))
    places = [x.ravel(), y.ravel()][: len(found.over)]
    places += [np.full(x.size, part) for _ in found.over[2:]]
    shown: Ints = found.labels(low + np.stack(places, axis=1) * (high - low))
    return shown.reshape(x.shape)


def _extent(found: FeasibleSet) -> tuple[float, float, float, float]:
    low, high = found.box.T
    ends = (low[1], high[1]) if len(found.over) > 1 else (0.0, 1.0)
    return float(low[0]), float(high[0]), float(ends[0]), float(ends[1])


def _paint(axis: Axes, shown: Ints, extent: tuple[float, float, float, float]) -> None:
    from matplotlib.colors import ListedColormap

    axis.imshow(
        shown, origin="lower", extent=extent, aspect="auto",
        cmap=ListedColormap([COLORS[label] for label in Label]), vmin=-0.5, vmax=len(Label) - 0.5,
        interpolation="nearest",
    )  # fmt: skip


def _name_axes(axes: Sequence[Axes], found: FeasibleSet, columns: int) -> None:
    """Names below the last panel of each column, and left of each row."""
    for i, axis in enumerate(axes):
        axis.tick_params(labelsize=8)
        if i + columns >= len(axes):
            axis.set_xlabel(titled(found.scene.file, found.over[0]), fontsize=9)
            axis.tick_params(labelbottom=True)
        if i % columns == 0 and len(found.over) > 1:
            axis.set_ylabel(titled(found.scene.file, found.over[1]), fontsize=9)
        if len(found.over) == 1:
            axis.set_yticks(())


def _fixed(found: FeasibleSet, part: float) -> str:
    low, high = found.box.T
    values = [
        f"{name} = {low[i] + part * (high[i] - low[i]):.3g}" for i, name in enumerate(found.over) if i > 1
    ]
    return "".join(f", {value}" for value in values)


def write_figure(drawing: Figure, file: Path) -> Path:
    """Save a drawing, whole or not at all. Raises OSError."""
    file.parent.mkdir(parents=True, exist_ok=True)
    with whole(file) as draft:
        drawing.savefig(draft, dpi=120)
    return file


def draw_surface(axis: Any, found: FeasibleSet, color: str) -> None:
    """Draw the boundary of the feasible part of a set over three parameters into three-dimensional `axis`."""
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    mesh = boundary(found)
    faces = list(mesh.vertices[mesh.pieces])
    axis.add_collection3d(Poly3DCollection(faces, facecolor=color, edgecolor="none", alpha=0.6))
    for setter, (low, high) in zip((axis.set_xlim, axis.set_ylim, axis.set_zlim), found.box, strict=True):
        setter(low, high)
    for k, setter in enumerate((axis.set_xlabel, axis.set_ylabel, axis.set_zlabel)):
        setter(titled(found.scene.file, found.over[k]))


def doomed_slices(found: DoomedSet) -> Figure:
    """Slices over the first two states, others fixed."""
    from matplotlib.colors import ListedColormap
    from matplotlib.figure import Figure
    from matplotlib.patches import Patch

    layers = STATE_LAYERS if len(found.over) > 2 else 1
    drawing = Figure(figsize=(1.2 + 3.0 * layers, 3.9), layout="constrained")
    colors = ListedColormap([COLORS[label] for label in Label])
    for k, axis in enumerate(drawing.subplots(1, layers, squeeze=False, sharex=True, sharey=True)[0]):
        fixed = [int((k + 0.5) / layers * count) for count in found.cells.shape[2:]]
        shown = found.cells.reshape(len(found.cells), -1, *found.cells.shape[2:])
        for index in fixed:
            shown = shown[:, :, index]
        ends = found.box[1] if len(found.over) > 1 else (0.0, 1.0)
        axis.imshow(
            shown.T, origin="lower", extent=(*found.box[0], *ends), aspect="auto", cmap=colors,
            vmin=-0.5, vmax=len(Label) - 0.5, interpolation="nearest",
        )  # fmt: skip
        axis.set_xlabel(found.over[0], fontsize=9)
        if k == 0 and len(found.over) > 1:
            axis.set_ylabel(found.over[1], fontsize=9)
        axis.tick_params(labelsize=8)
        middles = found.box[2:, 0] + (np.array(fixed, float) + 0.5) * found.unit[2:]
        axis.set_title(
            ", ".join(f"{name} = {x:.3g}" for name, x in zip(found.over[2:], middles, strict=True)),
            fontsize=9,
        )
    drawing.suptitle(f"{found.scene.name}, {found.model.name}: no input reaches the goal", fontsize=11)
    handles = [
        Patch(facecolor=COLORS[Label(code)], edgecolor="#888888", label=str(Label(code)))
        for code in np.unique(found.cells)
    ]
    drawing.legend(handles=handles, loc="outside lower center", ncols=len(handles), fontsize=9, frameon=False)
    return drawing

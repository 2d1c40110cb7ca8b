"""Slices of sets, drawn with matplotlib."""

from __future__ import annotations

import os
import uuid
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rungwise.kernel import Ints
from rungwise.sets.doomed import DoomedSet
from rungwise.sets.feasible import FeasibleSet
from rungwise.sets.labels import Label
from rungwise.sets.surface import boundary

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


def feasible_slices(found: Sequence[FeasibleSet]) -> Figure:
    """Slices of each set, in one row, over its first two parameters."""
    from matplotlib.figure import Figure
    from matplotlib.patches import Patch

    first = found[0]
    layers = LAYERS if len(first.over) > 2 else 1
    drawing = Figure(figsize=(1.2 + 3.0 * layers, 0.8 + 2.9 * len(found)), layout="constrained")
    axes = drawing.subplots(len(found), layers, squeeze=False, sharex=True, sharey=True)
    seen: set[Label] = set()
    for row, each in zip(axes, found, strict=True):
        for k, axis in enumerate(row):
            part = (k + 1) / (layers + 1)
            seen |= draw_slice(axis, each, dict.fromkeys(each.over[2:], part))
        row[0].set_ylabel(f"{each.name}\n\n{row[0].get_ylabel()}", fontsize=9)
    drawing.suptitle(f"{first.scene.name}: {', '.join(first.over)}", fontsize=11)
    handles = [
        Patch(facecolor=COLORS[label], edgecolor="#888888", label=str(label)) for label in sorted(seen)
    ]
    drawing.legend(handles=handles, loc="outside lower center", ncols=len(handles), fontsize=9, frameon=False)
    return drawing


def draw_slice(axis: Axes, found: FeasibleSet, at: dict[str, float]) -> set[Label]:
    """Draw labels over the first two parameters, the others at parts 0..1 of their range; returns the labels
    shown."""
    from matplotlib.colors import ListedColormap

    low, high = found.box.T
    grid = (np.arange(PIXELS) + 0.5) / PIXELS
    columns = [grid, grid] if len(found.over) > 1 else [grid, np.array([0.5])]
    x, y = np.meshgrid(*columns)
    places = [x.ravel(), y.ravel()][: len(found.over)]
    places += [np.full(x.size, at[name]) for name in found.over[2:]]
    shown: Ints = found.labels(low + np.stack(places, axis=1) * (high - low))
    extent = (low[0], high[0], *((low[1], high[1]) if len(found.over) > 1 else (0.0, 1.0)))
    colors = ListedColormap([COLORS[label] for label in Label])
    axis.imshow(
        shown.reshape(x.shape), origin="lower", extent=extent, aspect="auto", cmap=colors,
        vmin=-0.5, vmax=len(Label) - 0.5, interpolation="nearest",
    )  # fmt: skip
    axis.set_xlabel(_unit_of(found, 0), fontsize=9)
    axis.set_ylabel(_unit_of(found, 1) if len(found.over) > 1 else "", fontsize=9)
    axis.tick_params(labelsize=8)
    if found.over[2:]:
        axis.set_title(_fixed(found, next(iter(at.values()))).lstrip(", "), fontsize=9)
    return {Label(value) for value in np.unique(shown)}


def _unit_of(found: FeasibleSet, index: int) -> str:
    name = found.over[index]
    unit = found.scene.file.parameters[name].unit
    return f"{name} [{unit}]" if unit else name


def _fixed(found: FeasibleSet, part: float) -> str:
    low, high = found.box.T
    values = [
        f"{name} = {low[i] + part * (high[i] - low[i]):.3g}" for i, name in enumerate(found.over) if i > 1
    ]
    return "".join(f", {value}" for value in values)


def write_figure(drawing: Figure, file: Path) -> Path:
    """Save a drawing, whole or not at all. Raises OSError."""
    file.parent.mkdir(parents=True, exist_ok=True)
    mark = file.with_name(f".{uuid.uuid4().hex[:8]}{file.suffix}")
    try:
        drawing.savefig(mark, dpi=120)
        os.replace(mark, file)
    finally:
        mark.unlink(missing_ok=True)
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
        setter(_unit_of(found, k))


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

"""Sets as plain values, as text and as figures."""

from __future__ import annotations

import os
import uuid
from collections.abc import Sequence
from dataclasses import asdict
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rungwise.kernel import Ints
from rungwise.sets.between import between
from rungwise.sets.feasible import FeasibleSet
from rungwise.sets.labels import Label
from rungwise.sets.motions import SLOWEST
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
PIXELS, LAYERS = 400, 3
"""Resolution of a slice; slices shown of a set over more than two parameters."""


def summary(found: Sequence[FeasibleSet], certify: int = 0) -> dict[str, Any]:
    """Counts, volumes and differences of neighbours on the ladder, as `rungwise sets --json` prints them.

    With `certify` > 0, each set is tested at so many fresh points.
    """
    first = found[0]
    return {
        "scene": first.scene.name,
        "over": {name: list(box) for name, box in zip(first.over, first.box.tolist(), strict=True)},
        "parameters": first.parameters,
        "tol": first.tol,
        "sets": [
            {
                "model": each.model.name,
                "solutions": each.solutions,
                "evaluations": each.evaluations,
                "complete": each.complete,
                "probes": each.probes,
                "hits": each.hits,
                "volumes": each.volumes(),
                "certified": asdict(each.certify(certify)) if certify else None,
            }
            for each in found
        ],
        "between": [asdict(between(a, b)) for a, b in _neighbours(found)],
    }


def _neighbours(found: Sequence[FeasibleSet]) -> list[tuple[FeasibleSet, FeasibleSet]]:
    """Pairs to compare: sets of one rung for different motions, and one rung with the next."""
    rungs = list(dict.fromkeys(each.model for each in found))
    kinds = list(dict.fromkeys(each.solutions for each in found))
    groups = [[each for each in found if each.model == rung] for rung in rungs]
    groups += [[each for each in found if each.solutions == kind] for kind in kinds]
    return [pair for group in groups for pair in pairwise(group)]


def text(summary: dict[str, Any]) -> str:
    """The summary for people."""
    over = ", ".join(f"{name} in {low:g}..{high:g}" for name, (low, high) in summary["over"].items())
    lines = [f"{summary['scene']} over {over}, boundary within {summary['tol']:g} of each side"]
    names = [_name(each) for each in summary["sets"]]
    width = max(22, *(len(name) for name in names))
    for name, each in zip(names, summary["sets"], strict=True):
        parts = ", ".join(f"{label} {part:.4f}" for label, part in each["volumes"].items())
        lines.append(f"  {name:{width}s} {parts}")
        note = "" if each["complete"] else "; the budget ended the refinement"
        lines.append(
            f"  {'':{width}s} {each['evaluations']} runs, {each['hits']} of {each['probes']} probes"
            f" contradicted their cell{note}"
        )
        if each["certified"]:
            c = each["certified"]
            lines.append(
                f"  {'':{width}s} {c['wrong']} of {c['samples']} fresh points wrong ({c['near']} of them"
                f" within the tolerance): error rate below {c['bound']:.2g}"
                f" with confidence {1 - c['delta']:g}"
            )
    for pair in summary["between"]:
        lines.append(
            f"  {pair['cheap']} -> {pair['rich']}: loses {pair['lost']:.4f} of the box, gains"
            f" {pair['gained']:.4f} (+- {pair['error']:.4f})"
        )
    lines += [f"wrote {file}" for file in summary.get("files", ())]
    return "\n".join(lines)


def _name(summary: dict[str, Any]) -> str:
    """Name of a summarised set, as `FeasibleSet.name`."""
    model, solutions = summary["model"], summary["solutions"]
    return f"{model}" if solutions == SLOWEST else f"{model}, {solutions}"


def figure(found: Sequence[FeasibleSet], file: str | Path) -> Path:
    """Draw slices of each set, in one row, over its first two parameters; whole or not at all. Raises
    OSError."""
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
    return write_figure(drawing, Path(file))


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

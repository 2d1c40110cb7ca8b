"""Doomed sets as plain values, as text and as a figure."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from rungwise.models.ladder import LADDER
from rungwise.report.sets import COLORS, write_figure
from rungwise.sets.doomed import DoomedSet
from rungwise.sets.labels import Label

LAYERS = 4
"""Slices shown of a set over more than two states."""


def summary(found: DoomedSet) -> dict[str, Any]:
    """Bounds, parts of the box, and rungs on which the set holds, as `rungwise doomed --json` prints them."""
    return {
        "scene": found.scene.name,
        "model": found.model.name,
        "solutions": found.solutions,
        "over": {name: list(box) for name, box in zip(found.over, found.box.tolist(), strict=True)},
        "inputs": {name: list(bounds) for name, bounds in found.inputs.items()},
        "cells": list(found.cells.shape),
        "volumes": found.volumes,
        "runs": found.runs,
        "steps": list(found.steps),
        "padding": found.request["padding"],
        "escapes": found.escapes,
        "rule": None if found.scene.file.doomed is None else found.beside_rule(),
        "holds_on": {rung.name: found.holds_on(rung)[0] for rung in LADDER if rung.moves},
    }


def text(summary: dict[str, Any]) -> str:
    """The summary for people."""
    over = ", ".join(f"{name} in {low:g}..{high:g}" for name, (low, high) in summary["over"].items())
    inputs = ", ".join(f"{name} in {low:g}..{high:g}" for name, (low, high) in summary["inputs"].items())
    parts = ", ".join(f"{label} {part:.4f}" for label, part in summary["volumes"].items())
    steps = ", ".join(f"{step:.3g}" for step in summary["steps"])
    motion = "" if summary["solutions"] == "slowest" else " and any motion of what nothing drives"
    lines = [
        f"{summary['scene']} on {summary['model']} over {over}",
        f"  inputs {inputs}{motion}; {' x '.join(str(n) for n in summary['cells'])} cells",
        f"  {parts}",
        f"  {summary['runs']} runs of {steps}, padding {summary['padding']};"
        f" the box may be left from {summary['escapes']:.4f} of the cells",
    ]
    if summary["rule"] is not None:
        rule = ", ".join(f"{name} {part:.4f}" for name, part in summary["rule"].items())
        lines.append(f"  beside the scene's own rule, of random states: {rule}")
    rungs = [name for name, holds in summary["holds_on"].items() if holds]
    lines.append(f"  what is doomed here is doomed on {', '.join(rungs)}")
    return "\n".join(lines)


def figure(found: DoomedSet, file: str | Path) -> Path:
    """Draw slices over the first two states, others fixed; the file appears whole or not at all. Raises
    OSError."""
    from matplotlib.colors import ListedColormap
    from matplotlib.figure import Figure
    from matplotlib.patches import Patch

    layers = LAYERS if len(found.over) > 2 else 1
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
    return write_figure(drawing, Path(file))

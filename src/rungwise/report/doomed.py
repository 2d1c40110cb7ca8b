"""Doomed sets as plain values and as text."""

from __future__ import annotations

from typing import Any

from rungwise.models.ladder import LADDER
from rungwise.sets.doomed.doomed import DoomedSet


def summary(found: DoomedSet, limit: float | None = None) -> dict[str, Any]:
    """Bounds, parts of the box, and rungs on which the set holds, as `rungwise doomed --json` prints them;
    within `limit` seconds."""
    return {
        "scene": found.scene.name,
        "model": found.model.name,
        "solutions": found.solutions,
        "over": {name: list(box) for name, box in zip(found.over, found.box.tolist(), strict=True)},
        "inputs": {name: list(bounds) for name, bounds in found.inputs.items()},
        "cells": list(found.cells.shape),
        "volumes": found.volumes,
        "unfinished": found.unfinished,
        "runs": found.runs,
        "steps": list(found.steps),
        "padding": found.request["padding"],
        "escapes": found.escapes,
        "rule": None if found.scene.file.doomed is None else found.beside_rule(limit=limit),
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
        lines.append(f"  compared with the scene's own rule, at random states: {rule}")
    lines += [f"  {summary['unfinished']}"] if summary["unfinished"] else []
    rungs = [name for name, holds in summary["holds_on"].items() if holds]
    lines.append(f"  these states are doomed on {', '.join(rungs)}")
    return "\n".join(lines)

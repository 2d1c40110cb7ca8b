"""Sets of several models over one box, as one HTML file: surfaces, slices, and runs to look at."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from importlib.resources import files
from typing import Any

import numpy as np

from rungwise.deadline import NEVER, Deadline
from rungwise.kernel import Ints, Reals
from rungwise.models.ladder import LADDER
from rungwise.outcome import Code
from rungwise.scene import shipped
from rungwise.sets.cells.labels import Label, labels
from rungwise.sets.cells.surface import Mesh, boundary
from rungwise.sets.feasible.feasible import FeasibleSet
from rungwise.sets.motions import SLOWEST
from rungwise.viewing.plane.clip import Clip, clip
from rungwise.viewing.plane.extent import bounds, largest_force
from rungwise.viewing.plane.run_page import STAGE, clip_data
from rungwise.viewing.skeleton import LARGEST, Kind, bytes_of, fill, quantised
from rungwise.viewing.units import units_of

OWN = files("rungwise.viewing.sets") / "page"
KIND = Kind(
    "sets",
    parts=(OWN / "sets.html",),
    data=OWN / "setdata.js",
    drawing=(*STAGE, OWN / "slice.js", OWN / "surfaces.js"),
    main=(OWN / "sets.js",),
)
CELLS, SIDE = 1_000_000, 400
"""Cells in which labels are shown, at most, and along one parameter."""
TRIANGLES = 20_000
"""Most triangles of a surface: where there are more, vertices are joined."""
RUNS, FRAMES, CANDIDATES = 48, 60, 4096
"""Points at which every model is run, and frames of each run; they are chosen from so many random points."""
VOLUME_SAMPLES = 100_000
LEAST_SEEN = 0.01
"""Least part of the box that can be seen: the page opens on a model of which so much is feasible, and so much
is not."""


def page(found: Sequence[FeasibleSet], deadline: Deadline = NEVER, largest: int = LARGEST) -> str:
    """Text of the file, with runs at the points that are run before the deadline. Sets must be of one scene
    over the same box (see `view`)."""
    rows = _played(found, run_points(found, RUNS), deadline)
    title = f"sets of {found[0].scene.name} over {', '.join(found[0].over)}"
    fixed = _data(found)
    while True:
        text = fill(KIND, title, fixed | _runs(found[0].box, rows) | {"opening": _opening(found, rows)})
        if len(text) <= largest or len(rows) <= 1:
            return text
        rows = rows[: len(rows) // 2]


def run_points(found: Sequence[FeasibleSet], count: int) -> Reals:
    """Points (count, d) of the box at which to show runs: for each way in which the models' labels differ in
    turn, the point of this kind that is farthest from the points taken. None is invalid."""
    low, high = found[0].box.T
    points = found[0].random(CANDIDATES, 5)
    here = np.stack([each.labels(points) for each in found], axis=1)
    valid = (here != Label.INVALID).all(axis=1)
    points, here = points[valid], here[valid]
    if not len(points):
        return np.asarray(points)
    _, kinds = np.unique(here, axis=0, return_inverse=True)
    places = (points - low) / (high - low)
    away = np.linalg.norm(places - 0.5, axis=1)
    away = away.max() - away + 1.0  # the first point is the nearest to the middle
    taken: list[int] = []
    while len(taken) < min(count, len(points)):
        for kind in range(kinds.max() + 1):
            best = int(np.argmax(np.where(kinds == kind, away, -1.0)))
            if away[best] > 0.0 and len(taken) < count:
                taken.append(best)
                away = np.minimum(away, np.linalg.norm(places - places[best], axis=1))
    return np.asarray(points[taken])


@dataclass(frozen=True)
class _Row:
    """A point of the box, every model's run there, and the labels of those runs (not of the sets)."""

    point: Reals
    clips: list[Clip]
    labels: list[int]


def _played(found: Sequence[FeasibleSet], points: Reals, deadline: Deadline) -> list[_Row]:
    rows = []
    for point in points:
        values = dict(zip(found[0].over, point.tolist(), strict=True))
        runs = [each.replay(each.parameters | values, limit=deadline.seconds) for each in found]
        codes = np.array([run.outcome.code for run in runs])
        if (codes == Code.RUNNING).any():
            break
        if (codes != Code.INVALID).all():
            rows.append(_Row(point, [_thin(clip(run)) for run in runs], labels(codes).tolist()))
    return rows


def _thin(whole: Clip) -> Clip:
    count = len(whole.time)
    return whole.thinned(np.unique(np.linspace(0, count - 1, min(count, FRAMES)).astype(np.int64)))


def _runs(box: Reals, rows: Sequence[_Row]) -> dict[str, Any]:
    clips = [each for row in rows for each in row.clips]
    low, high = box.T
    bodies: list[Any] = []
    data = [clip_data(each, np.zeros(0, np.int64)) for each in clips]
    for each in data:
        if each["bodies"] not in bodies:
            bodies.append(each["bodies"])
        each["bodies"] = bodies.index(each["bodies"])
    return {
        "bounds": bounds(clips),
        "force": largest_force(clips, 0.5) if clips else 1.0,
        "bodies": bodies,
        "clips": data,
        "runs": [{"at": ((row.point - low) / (high - low)).tolist(), "labels": row.labels} for row in rows],
    }


def _opening(found: Sequence[FeasibleSet], rows: Sequence[_Row]) -> dict[str, Any]:
    """The model and the point with which the page opens: the first model of whose set and of whose complement
    there is something to see, and the middle of the box where its run reaches the goal, else the nearest
    stored run that does."""
    parts = np.array([each.volumes(VOLUME_SAMPLES).get(str(Label.FEASIBLE), 0.0) for each in found])
    seen = np.minimum(parts, 1.0 - parts)
    front = int(np.argmax(seen >= min(LEAST_SEEN, float(seen.max()))))
    low, high = found[0].box.T
    middle = 0.5 * (low + high)
    point = middle
    if found[front].labels(middle[None])[0] != Label.FEASIBLE:
        good = [row.point for row in rows if row.labels[front] == Label.FEASIBLE]
        point = min(good, key=lambda at: float(np.linalg.norm((at - middle) / (high - low))), default=middle)
    return {"front": front, "at": ((point - low) / (high - low)).tolist()}


def _data(found: Sequence[FeasibleSet]) -> dict[str, Any]:
    first = found[0]
    cells = min(SIDE, int(CELLS ** (1.0 / len(first.over)) + 1e-9))
    grids = [_grid(each, cells) for each in found]
    declared = first.scene.file.parameters
    return {
        "over": [
            {"name": name, "unit": _unit(declared[name].unit), "low": low, "high": high}
            for name, (low, high) in zip(first.over, first.box.tolist(), strict=True)
        ],
        "units": units_of(first.scene.file),
        "cells": cells,
        "tol": first.tol,
        "labels": [str(label) for label in Label],
        "feasible": int(Label.FEASIBLE),
        "present": np.unique(np.concatenate(grids)).tolist(),
        "error": 0.5 / VOLUME_SAMPLES**0.5,
        "sets": [
            {
                "name": each.name,
                "evaluations": each.evaluations,
                "complete": each.complete,
                "volumes": each.volumes(VOLUME_SAMPLES),
                "command": _command(each),
                "grid": _packed(grid),
                "mesh": _mesh(each) if len(each.over) in (2, 3) else None,
            }
            for each, grid in zip(found, grids, strict=True)
        ],
    }


def _unit(declared: str | None) -> str:
    return "" if declared in (None, "1") else str(declared)


def _grid(found: FeasibleSet, cells: int) -> Ints:
    """Labels (cells^d,) at the middles of cells, the last parameter fastest."""
    low, high = found.box.T
    middle = (np.arange(cells) + 0.5) / cells
    places = np.stack(np.meshgrid(*[middle] * len(low), indexing="ij"), axis=-1).reshape(-1, len(low))
    return found.labels(low + places * (high - low))


def _packed(grid: Ints) -> dict[str, str]:
    """Runs of equal labels, none longer than 16 bits can count."""
    change = np.diff(grid, prepend=-1) != 0
    change[::65535] = True
    starts = np.flatnonzero(change)
    counts = np.diff(np.append(starts, len(grid)))
    return {"labels": bytes_of(grid[starts], "<u1"), "counts": bytes_of(counts, "<u2")}


def _mesh(found: FeasibleSet) -> dict[str, Any]:
    """The boundary, in parts of the box around its middle."""
    mesh = _light(boundary(found), found.box)
    low, high = found.box.T
    places = (mesh.vertices - low) / (high - low) - 0.5
    return {"vertices": quantised(places), "pieces": bytes_of(mesh.pieces, "<u4")}


def _light(mesh: Mesh, box: Reals) -> Mesh:
    cells, light = 128, mesh
    while len(light.pieces) > TRIANGLES:
        light, cells = mesh.coarsened(cells, box), cells * 3 // 4
    return light


def _command(found: FeasibleSet) -> dict[str, str]:
    """Parts of a command that repeats a run: the scene, settings beside the point, and accuracy."""
    name = found.scene.name
    defaults = found.scene.parameters()
    fixed = [f"--set {key}={x!r} " for key, x in found.parameters.items() if x != defaults[key]]
    return {
        "scene": name if name in shipped() else f"{name}.yaml",
        "model": found.model.name if found.model in LADDER and found.solutions == SLOWEST else "",
        "fixed": "".join(fixed),
        "options": f"--tol {found.request['accuracy']!r} --theta {found.request['theta']!r}",
    }

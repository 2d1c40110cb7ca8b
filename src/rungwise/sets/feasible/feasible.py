"""The set of a scene's parameters, labelled by the outcome of the scene, on one rung."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.special import betaincinv

from rungwise.deadline import Deadline, LimitError, seconds
from rungwise.kernel import Ints, Reals
from rungwise.keywords import keywords
from rungwise.models.ladder import Rung
from rungwise.outcome import Code
from rungwise.plain import cut
from rungwise.scene.contract import AnyScene
from rungwise.scene.fields.values import shown
from rungwise.scene.read import load
from rungwise.sets import store
from rungwise.sets.cells.crossings import planes, solve
from rungwise.sets.cells.labelled import LabelledBox
from rungwise.sets.cells.labels import Label, bounds_of, labels
from rungwise.sets.cells.tree import FIRST_LEVEL, BudgetSpent, Tree
from rungwise.sets.feasible import arrays, export
from rungwise.sets.feasible.cluster import runner
from rungwise.sets.feasible.oracle import Oracle
from rungwise.sets.motions import SLOWEST, SOLUTIONS, decisive
from rungwise.sets.request import ACCURACY, THETA, batch_of, box_of, digest, smallest
from rungwise.sets.store import Log, SetError
from rungwise.simulation.options import moving_rung
from rungwise.simulation.result import Run
from rungwise.wording import choices

if TYPE_CHECKING:
    import xarray

CELL, DEEPER = 4.0, 2
"""Side of the cells along the boundary, in tolerances: crossings of their edges are located to within a
tolerance. A cell in which the boundary is no plane is split at most `DEEPER` times more, to the side of a
tolerance."""
MAX_AXES = 6
PROBE_ROUNDS = 4
"""Rounds of random probes, at most, as long as one contradicts its leaf."""
BUDGET = 50_000_000
"""Most runs, if not given."""


@dataclass(frozen=True)
class Certified:
    """With a confidence of 1 - delta, a random point is labelled wrongly with a probability below `bound`.

    `samples`: points that were run, fewer than asked for where a limit ended them; `near` counts the points
    among the `wrong` that lie within the tolerance of the boundary.
    """

    samples: int
    wrong: int
    near: int
    bound: float
    delta: float


@dataclass(frozen=True, eq=False)
class FeasibleSet(LabelledBox):
    """A set of parameters: labels over a box, and questions about them.

    `tree` holds cells, and labels and margins at their corners; `crossings`, by level, the keys of edges that
    the boundary crosses, and where along them (see `rungwise.sets.cells.crossings`). `evaluations` counts
    runs; `probes` counts the random probes of the last round, `hits` the probes that contradicted their leaf;
    `complete` is false when the budget ended the refinement; `tol` is the resolution asked for; `request`
    holds all that was asked, for a file.
    """

    def __repr__(self) -> str:
        parts = ", ".join(f"{label} {part:.3f}" for label, part in self.volumes(10_000).items())
        return f"<FeasibleSet of {cut(self.scene.name)} on {cut(self.name)} over {bounds_of(self)}: {parts}>"

    @keywords
    def witness(self, point: Reals) -> dict[str, float] | None:
        """Parameters near a point at which a run reached the goal: the nearest such corner of the leaf that
        holds the point, or None; corners with a borrowed label do not count. `replay` runs them."""
        place = (np.asarray(point, np.float64)[None, :] - self.box[:, 0]) / self.unit
        levels, index = self.tree.locate(place)
        level = int(levels[0])
        origin = self.tree.leaves[level][index[0]]
        corners = origin + self.tree.size(level) * self.tree.corners
        at, _ = self.tree.vertices.find(self.tree.vertices.key(corners))
        good = (self.tree.vertices.labels[at] == Label.FEASIBLE) & ~self.tree.vertices.borrowed[at]
        if not good.any():
            return None
        distance = np.where(good, np.linalg.norm(corners - place, axis=1), math.inf)
        best = self.box[:, 0] + corners[int(np.argmin(distance))] * self.unit
        return self.parameters | {name: float(x) for name, x in zip(self.over, best, strict=True)}

    @keywords
    def replay(self, parameters: Mapping[str, float], *, limit: float | None = None) -> Run:
        """The run at these parameters, repeated step by step; if there are several motions, the one that
        decides the label. After `limit` seconds the unfinished run, whose outcome is `running`."""
        options = {"tol": self.request["accuracy"], "theta": self.request["theta"]}
        deadline = Deadline(seconds(limit))
        return decisive(self.scene, self.model, self.solutions, deadline, parameters=parameters, **options)

    @keywords
    def certify(
        self, n: int = 1000, delta: float = 0.01, *, seed: int = 1, threads: int | None = None,
        limit: float | None = None,
    ) -> Certified:  # fmt: skip
        """Run fresh random points, and bound the rate of wrong labels (Clopper and Pearson).

        Args:
            n: number of points.
            delta: the bound holds with a confidence of 1 - delta.
            seed: seed by which the points are drawn.
            threads: number of threads; all cores if not given.
            limit: seconds, after which only points whose runs had begun count. Unfinished runs count as
                wrong, because points with long runs may be wrong more often.
        """
        deadline = Deadline(seconds(limit))
        if n < 1 or not 0.0 < delta < 1.0:
            raise SetError("certify: n must be at least 1, and delta lie in 0..1")
        points = self.random(n, seed)
        batch = batch_of(self.scene, self.model, self.over, self.request, threads)
        found = batch.run(points, deadline=deadline)
        began = (found.outcome != Code.RUNNING) | np.isfinite(found.final).all(axis=1)
        points, n = points[began], int(began.sum())
        is_open = found.outcome[began] == Code.RUNNING
        truth = labels(found.outcome[began])
        wrong = (self.labels(points) != truth) | is_open
        near = np.zeros(n, bool)
        for axis in range(len(self.over)):
            for sign in (-1.0, 1.0):
                moved = points.copy()
                moved[:, axis] += sign * self.tol * np.ptp(self.box[axis])
                near |= (self.labels(np.clip(moved, *self.box.T)) == truth) & ~is_open
        count = int(wrong.sum())
        bound = 1.0 if count == n else float(betaincinv(count + 1, n - count, 1.0 - delta))
        return Certified(n, count, int((wrong & near).sum()), bound, delta)

    def random(self, n: int, seed: int) -> Reals:
        """Points (n, d), drawn by `seed` uniformly in the box."""
        low, high = self.box.T
        return np.asarray(np.random.default_rng(seed).uniform(low, high, (n, len(low))))

    @keywords
    def volumes(self, n: int = 100_000, seed: int = 2) -> dict[str, float]:
        """Part of the box that each label takes, from n random points drawn by `seed` (standard error up to
        0.5 / sqrt n)."""
        found = np.bincount(self.labels(self.random(n, seed)), minlength=len(Label)) / n
        return {str(label): float(found[label]) for label in Label if found[label] > 0.0}

    @cached_property
    def data(self) -> xarray.Dataset:
        """Everything as arrays: vertices, leaves and crossings, in the units of the parameters."""
        return arrays.dataset(self)

    @keywords
    def save(self, folder: str | Path) -> Path:
        """Write the set into `folder` as zarr, whole or not at all. Raises OSError."""
        return store.save(Path(folder), self.data)

    @keywords
    def to_csv(self, file: str | Path) -> Path:
        """Write all runs and all located boundary points to `file` as a table; returns the file."""
        return export.to_csv(self, file)

    @keywords
    def to_mesh(self, file: str | Path, label: Label = Label.FEASIBLE) -> Path:
        """Write the boundary of the part with this label, over two or three parameters, to `file`; its ending
        is .obj or .stl."""
        return export.to_mesh(self, file, label)

    @cached_property
    def _planes(self) -> dict[int, tuple[Reals, Reals, Ints]]:
        return {level: planes(self.tree, level, *found) for level, found in self.crossings.items()}

    def _labels(self, places: Reals) -> Ints:
        levels, index = self.tree.locate(places)
        result = np.full(len(places), int(Label.UNKNOWN))
        for level, origins in enumerate(self.tree.leaves):
            here = np.flatnonzero(levels == level)
            if not len(here):
                continue
            inside = places[here] / self.tree.size(level) - origins[index[here]] / self.tree.size(level)
            corner_labels, _ = self.tree.corner_labels(origins[index[here]], level)
            nearest = (inside >= 0.5).astype(np.int64) @ (2 ** np.arange(len(self.over))[::-1])
            result[here] = corner_labels[np.arange(len(here)), nearest]
            if level in self._planes:
                normal, offset, sides = (part[index[here]] for part in self._planes[level])
                side = np.einsum("mi,mi->m", normal, inside) >= offset
                known = sides[:, 0] >= 0
                result[here[known]] = sides[known, side[known].astype(np.int64)]
        return result


@keywords
def feasible_set(
    scene: AnyScene | str | Path | Mapping[str, Any],
    model: Rung | str,
    over: Sequence[str],
    *,
    tol: float = 0.01,
    box: Mapping[str, tuple[float, float]] | None = None,
    parameters: Mapping[str, float] | None = None,
    solutions: str = SLOWEST,
    near: FeasibleSet | None = None,
    accuracy: float | None = None,
    probes: int | None = None,
    budget: int = BUDGET,
    limit: float | None = None,
    seed: int = 0,
    threads: int | None = None,
    cluster: str | None = None,
    out: str | Path | None = None,
    resume: bool = False,
    on_progress: Callable[[str, int, int], None] | None = None,
) -> FeasibleSet:
    """Find the points of a box of parameters at which the scene reaches its goal, and label all others.

    The number of runs grows like the surface between labels, not like the volume. A part thinner than a cell
    of the first grid is missed if no random probe meets it: see `probes` and `hits` of the result.

    Args:
        scene, model: as for `simulate`.
        over: names of 1 to 6 parameters.
        tol: how well the boundary is located, as a part of the box's side along each axis. Cells are four
            times as large, and as large as `tol` where the boundary is no plane.
        box: interval (low, high) by name; see `box_of` for parameters not given.
        parameters: values of the other parameters.
        solutions: if the model admits several motions: the slowest one must reach the goal ("slowest"), or
            some motion ("possible"), or every motion tried ("guaranteed"); see `rungwise.sets.motions`.
        near: another rung's set over the same box. The search begins at its boundary and follows it from
            there. Elsewhere its labels are used until a probe finds another label.
        accuracy: error allowed per step of a run; `ACCURACY` times the smallest shape if not given.
        probes: random points per round; as many as the first grid has if not given.
        budget: greatest number of runs; limit: seconds after which the call returns with the cells known so
            far, also from within a long step, and the set is not `complete`.
        threads: as many as there are cores if not given. The set does not depend on it.
        cluster: address of a dask scheduler whose workers run instead of threads; the set is the same.
        out: folder for the finished batches of runs, also of a batch that a limit ended, and for the set.
        seed: of the random probes.
        resume: go on from the batches kept in `out`.
        on_progress: called with the present task, runs so far, and runs asked for so far.

    Raises SceneError, ModelError or SetError for wrong input, OSError when `out` cannot be written, and
    LimitError where the limit is over before the first cells are known; in `out` the runs that are done then
    are kept, and `resume` goes on from them.
    """
    deadline = Deadline(seconds(limit))
    loaded = load(scene)
    rung = moving_rung(model)
    if isinstance(over, (str, Mapping)) or not hasattr(over, "__len__"):
        raise SetError(f"over: must be a list of names of parameters, not {shown(over)}; intervals go to box")
    if not 1 <= len(over) <= MAX_AXES:
        raise SetError(f"over: 1 to {MAX_AXES} parameters, not {len(over)}")
    if not 1e-6 <= tol <= 0.25:
        raise SetError(f"tol: {tol!r} must lie in 1e-6..0.25 (a part of the box)")
    if solutions not in SOLUTIONS:
        raise SetError(f"solutions: unknown {shown(solutions)}{choices(solutions, SOLUTIONS)}")
    values = loaded.parameters(parameters)
    request: dict[str, Any] = {
        "scene": loaded.name,
        "digest": digest(loaded),
        "model": rung.name,
        "inertia": rung.inertia,
        "over": list(over),
        "parameters": values,
        "solutions": solutions,
        "tol": tol,
        "accuracy": ACCURACY * smallest(loaded, values) if accuracy is None else accuracy,
        "theta": THETA,
        "budget": budget,
        "seed": seed,
    }
    batch = batch_of(loaded, rung, over, request, threads)
    intervals = box_of(loaded, batch.over, box)
    axes = len(batch.over)
    target = max(1, math.ceil(math.log2(1.0 / (CELL * tol)) - 1e-9))
    probes = (1 << min(FIRST_LEVEL[axes], target)) ** axes if probes is None else probes
    request |= {"box": intervals.tolist(), "probes": probes, "target": target}
    if near is not None:
        request["near"] = _neighbour(near, request)
    log = None if out is None else Log(Path(out), request, resume)
    tree = Tree.empty(axes, target, target + DEEPER)
    with runner(batch, cluster, loaded, request, deadline) as runs:
        oracle = Oracle(runs, intervals, tree.finest, budget, log, on_progress, deadline)
        made, hits = _grow(tree, oracle, near, probes, np.random.default_rng(seed))
        crossings = _cross(tree, oracle)
    result = FeasibleSet(
        scene=loaded, model=rung, over=batch.over, box=intervals, tol=tol, tree=tree,
        crossings=crossings, evaluations=oracle.count, probes=made, hits=hits, request=request,
    )  # fmt: skip
    if out is not None:
        result.save(out)
    return result


@keywords
def load_set(folder: str | Path) -> FeasibleSet:
    """A finished set from the folder in which it was saved. Raises FileNotFoundError when it holds no set,
    SetError for a set of states, SceneError when this version does not read its scene."""
    data = store.load(folder)
    request = store.attributes(data)
    if "tol" not in request:
        raise SetError(f"{folder} holds a set of states; read it with load_doomed_set")
    loaded = load(json.loads(data.attrs["scene_file"]))
    target = request["target"]
    tree, crossings = arrays.read(data, len(request["over"]), target, target + DEEPER)
    model = moving_rung(request["model"])
    return FeasibleSet(
        scene=loaded, model=model if model.metric else model.with_inertia(request["inertia"]),
        over=tuple(request["over"]), box=np.array(request["box"]), tol=request["tol"], tree=tree,
        crossings=crossings, evaluations=int(data.attrs["evaluations"]), probes=int(data.attrs["probes"]),
        hits=int(data.attrs["hits"]), request=request,
    )  # fmt: skip


def _neighbour(near: FeasibleSet, request: Mapping[str, Any]) -> str:
    """Mark of the set whose boundary is near. Raises SetError when that set is over another box."""
    for field_ in ("over", "box", "tol"):
        if near.request[field_] != request[field_]:
            raise SetError(f"near: its {field_} must be the same, not {near.request[field_]}")
    return sha256(json.dumps(near.request, sort_keys=True).encode()).hexdigest()


def _grow(
    tree: Tree, oracle: Oracle, near: FeasibleSet | None, probes: int, generator: np.random.Generator
) -> tuple[int, int]:
    """Refine, then probe leaves that look uniform until a round finds nothing new; returns its probes and
    hits."""
    oracle.task = "cells"
    try:
        if near is None:
            tree.grow(oracle)
        else:
            tree.grow_around(near.tree, oracle)
    except BudgetSpent:
        if oracle.deadline.is_over:
            kept = "runs that are done are kept, resume goes on from them" if oracle.keeps else ""
            raise LimitError(
                f"limit: the time was over before the first cells were known; {kept or 'give more time'}"
            ) from None
        raise SetError("budget: is too small for the first cells; give more runs") from None
    made = hits = 0
    for _ in range(PROBE_ROUNDS if probes else 0):
        oracle.task = "probes"
        places = generator.uniform(0.0, 1 << tree.finest, (probes, tree.axes))
        levels, index = tree.locate(places)
        expected = np.full(len(places), -1, np.int64)
        for level in range(tree.finest + 1):
            here = levels == level
            cells = tree.leaves[level][index[here]]
            found, _ = tree.corner_labels(cells, level)
            expected[here] = np.where((found == found[:, :1]).all(axis=1), found[:, 0], -1)
        places, expected = places[expected >= 0], expected[expected >= 0]
        try:
            found, _ = oracle(places)
        except BudgetSpent:
            tree.spent = True
            break
        wrong = found != expected
        made, hits = len(places), int(wrong.sum())
        if not hits:
            break
        oracle.task = "cells"
        tree.probe(places[wrong], oracle)
    return made, hits


def _cross(tree: Tree, oracle: Oracle) -> dict[int, tuple[Ints, Reals]]:
    """Crossings by level; cells in which the boundary is no plane go to the next level."""
    oracle.task = "boundary"
    crossings = {}
    for level in range(tree.target, tree.finest + 1):
        crossings[level] = solve(tree, level, oracle)
        _, _, sides = planes(tree, level, *crossings[level])
        coarse = (sides[:, 0] < 0) & tree.is_mixed(tree.leaves[level], level)
        if level == tree.finest or not coarse.any():
            break
        tree.split(level, coarse, oracle)
    return crossings

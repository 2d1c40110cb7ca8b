"""States from which no input within bounds reaches the goal, by backward reachability over cells.

A grid covers a box of states. From each of its vertices runs of one macro-step are made, for a grid of the
inputs. A cell may lead, for each of these inputs, to the cell moved by the displacements of its vertices and
of its neighbours' vertices: by all between the least and the greatest in each coordinate. Cells from which no
chain of macro-steps leads to a cell about which a run met the goal are doomed. A state that leaves the box,
or that a run did not decide, counts as reaching the goal.

So the doomed set is found too small rather than too large, as far as the vertices about a cell show how far
motions differ in it. The set is an estimate, not a proof: `padding` says from how many cells around a cell it
is made.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rungwise.deadline import Deadline, TimeOver, seconds
from rungwise.kernel import Ints, Reals
from rungwise.keywords import keywords
from rungwise.models.ladder import KINEMATIC, Rung
from rungwise.outcome import Code
from rungwise.plain import cut
from rungwise.scene.contract import AnyScene
from rungwise.scene.read import load
from rungwise.sets import store
from rungwise.sets.cells.labels import Label, LabelledSet, bounds_of
from rungwise.sets.doomed.cell_mapping import Images
from rungwise.sets.doomed.macro_steps import Macro, Stated
from rungwise.sets.doomed.states import box_of_states, check_states, columns_of, input_box, state_name
from rungwise.sets.motions import SLOWEST
from rungwise.sets.request import ACCURACY, digest, smallest
from rungwise.sets.store import SetError
from rungwise.simulation.options import moving_rung
from rungwise.world.find import world_of

if TYPE_CHECKING:
    import xarray

ANY = "any"
MAX_AXES = 4
CELLS = (0, 512, 96, 40, 16)
"""Cells along each axis, by the number of axes."""
STRIDES = (2.0,)
"""Lengths of macro-steps: how many cells the fastest coordinate moves. A cell that one of them dooms is
doomed."""
POINTS = 100_000


@dataclass(frozen=True, eq=False)
class DoomedSet(LabelledSet):
    """Labels (n1, ..., nd) of cells over a box of states: `DOOMED`; `INVALID` where every vertex about the
    cell is no state (bodies overlap); `UNKNOWN` otherwise.

    `inputs` (k, 2) are the bounds of the inputs, `steps` the lengths of the macro-steps in time, `runs` the
    number of runs, `escapes` the fraction of valid cells from which a motion may leave the box. `unfinished`
    names the macro-steps that a limit in seconds left undone; cells that need them are unknown. `request`
    holds all that was asked, for a file.
    """

    inputs: dict[str, tuple[float, float]]
    cells: Ints
    steps: tuple[float, ...]
    runs: int
    escapes: float
    request: dict[str, Any] = field(repr=False)
    unfinished: str = ""

    @property
    def solutions(self) -> str:
        """ "slowest" or "any": how objects move that nothing drives."""
        return str(self.request["solutions"])

    def __repr__(self) -> str:
        parts = ", ".join(f"{label} {part:.3f}" for label, part in self.volumes.items())
        model = f"{cut(self.scene.name)} on {cut(self.model.name)}"
        return f"<DoomedSet of {model} over {bounds_of(self)}: {parts}>"

    def _labels(self, places: Reals) -> Ints:
        at = np.minimum(places.astype(np.int64), np.array(self.cells.shape) - 1)
        return np.asarray(self.cells[tuple(at.T)])

    @property
    def unit(self) -> Reals:
        """Sides (d,) of a cell."""
        return np.asarray((self.box[:, 1] - self.box[:, 0]) / self.cells.shape)

    @property
    def volumes(self) -> dict[str, float]:
        """Part of the box that each label takes."""
        count = np.bincount(self.cells.ravel(), minlength=len(Label)) / self.cells.size
        return {str(label): float(count[label]) for label in Label if count[label] > 0.0}

    @keywords
    def holds_on(self, model: Rung | str) -> tuple[bool, str]:
        """Whether the states that are doomed here are also doomed on the rung `model` with the same inputs,
        and why."""
        other = moving_rung(model)
        if other == self.model:
            return True, "it is the same rung"
        if self.solutions != ANY:
            return False, f"a motion of the {other.name} rung need not be one of the {self.model.name} rung"
        if other.compliant:
            return False, "compliant contacts let bodies overlap, and in this set bodies never overlap"
        if world_of(self.scene).is_forced:
            return False, "bodies that servos and forces drive may move differently on the other rung"
        return True, "this set allows every motion without overlap, whatever causes it"

    @keywords
    def beside_rule(
        self, n: int = POINTS, seed: int = 4, threads: int | None = None, *, limit: float | None = None
    ) -> dict[str, float]:
        """Compare the set with the scene's own rule `doomed` at random states of the box. The answer has the
        parts of the states that are doomed by "both", "only here", and "only by rule"; the last is no
        contradiction, because this set is smaller than the exact one.

        Args:
            n: number of states.
            seed: seed by which the states are drawn.
            threads: number of threads; all cores if not given.
            limit: seconds; states that have not been run by then are the part "not run".
        """
        deadline = Deadline(seconds(limit))
        low, high = self.box.T
        points = np.random.default_rng(seed).uniform(low, high, (n, len(low)))
        side = Stated(self.scene)
        macro = Macro(self.model, (), self.request["parameters"], self.request["accuracy"], threads)
        columns, moment = columns_of(side, self.over), 1e-9 * self.steps[0]
        outcome, _ = side.run(macro, np.zeros((n, 0)), columns, points, moment, deadline, None)
        states = outcome != Code.INVALID
        rule, here = outcome[states] == Code.DOOMED, self.labels(points[states]) == Label.DOOMED
        ran = outcome[states] != Code.RUNNING
        parts = {"both": here & rule, "only here": here & ~rule & ran, "only by rule": rule & ~here}
        parts |= {} if ran.all() else {"not run": ~ran}
        return {name: float(part.mean()) if len(part) else 0.0 for name, part in parts.items()}

    @cached_property
    def data(self) -> xarray.Dataset:
        """Everything as arrays, in the units of the states."""
        import xarray as xr

        axes = tuple(name.replace("(", "_").replace(")", "").replace(".", "_") for name in self.over)
        middles = {
            axis: low + (np.arange(count) + 0.5) * unit
            for axis, (low, _), count, unit in zip(axes, self.box, self.cells.shape, self.unit, strict=True)
        }
        return xr.Dataset(
            {"label": (axes, self.cells.astype(np.int8), {"labels": [str(x) for x in Label]})},
            coords=middles,
            attrs={
                "request": json.dumps(self.request),
                "runs": self.runs,
                "escapes": self.escapes,
                "steps": list(self.steps),
                "unfinished": self.unfinished,
            },
        )

    @keywords
    def save(self, folder: str | Path) -> Path:
        """Write the set into `folder` as zarr, whole or not at all. Raises OSError."""
        return store.save(Path(folder), self.data)


@keywords
def doomed_set(
    scene: AnyScene | str | Path | Mapping[str, Any],
    model: Rung | str,
    over: Sequence[str],
    inputs: Mapping[str, tuple[float, float]],
    *,
    box: Mapping[str, tuple[float, float]] | None = None,
    cells: int | Sequence[int] | None = None,
    parameters: Mapping[str, float] | None = None,
    solutions: str = SLOWEST,
    strides: Sequence[float] = STRIDES,
    padding: int = 1,
    accuracy: float | None = None,
    threads: int | None = None,
    limit: float | None = None,
    out: str | Path | None = None,
    on_progress: Callable[[str, int, int], None] | None = None,
) -> DoomedSet:
    """States of a scene from which no input within bounds reaches its goal, whatever the scene's own rule.

    Args:
        scene, model: as for `simulate`; a rung with rigid contact.
        over: 1 to 4 names of the scene's state: all its coordinates ("part.x3", or "x3" where that is clear)
            and, on dynamic rungs, the speeds of coordinates not prescribed ("speed(part.x3)"). In space some
            of them are enough if all others stay where the scene starts, which every run checks.
        inputs: bounds of the parameters that may change in time, for example speeds of drives.
        box: interval of each state by name; travel limits where not given.
        cells: along each axis; `CELLS` if not given.
        parameters: values of the other parameters.
        solutions: "slowest", or, on the kinematic rung, "any": objects that nothing drives move in every way
            without overlap.
        strides: macro-steps, in cells that the fastest coordinate moves.
        padding: number of cells around a cell whose motions estimate how far motions differ within it.
        accuracy, threads: as for `feasible_set`.
        limit: seconds after which the call returns with the cells that whole rounds of macro-steps, of one
            length each, doom; see `unfinished`.
        out: folder for the result.
        on_progress: called with the present task, runs so far, and runs known to be needed.

    Raises SceneError, ModelError or SetError for wrong input, OSError when `out` cannot be written, and
    LimitError where the limit is over before it is known which vertices are states, and how fast they move.
    """
    deadline = Deadline(seconds(limit))
    loaded = load(scene)
    rung = moving_rung(model)
    side = Stated(loaded)
    names = tuple(state_name(side, name) for name in over)
    check_states(side, loaded, rung, names, MAX_AXES)
    if solutions == ANY and not side.world.many_motions:
        raise SetError(f"solutions: of {loaded.name} only the {SLOWEST} motion is known")
    if solutions not in (SLOWEST, ANY) or (solutions == ANY and not rung.metric):
        raise SetError(f"solutions: must be {SLOWEST}, or {ANY} on the {KINEMATIC.name} rung")
    if not strides or not all(0.25 <= stride <= 100.0 for stride in strides) or not 0 <= padding <= 4:
        raise SetError("strides must lie in 0.25..100 cells, padding in 0..4")
    values = loaded.parameters(parameters)
    shape = _shape(cells, len(names))
    bounds = input_box(loaded, inputs)
    request: dict[str, Any] = {
        "kind": "doomed",
        "scene": loaded.name,
        "digest": digest(loaded),
        "model": rung.name,
        "inertia": rung.inertia,
        "over": list(names),
        "inputs": {name: list(interval) for name, interval in bounds.items()},
        "parameters": values,
        "solutions": solutions,
        "strides": list(strides),
        "padding": padding,
        "accuracy": ACCURACY * smallest(loaded, values) if accuracy is None else accuracy,
    }
    intervals, travel = box_of_states(side, values, names, box)
    request |= {"box": intervals.tolist(), "cells": list(shape)}
    with deadline.needed_for("it was known where states are and how fast they move"):
        images = Images(
            loaded, rung, names, bounds, intervals, travel, shape, request, threads, on_progress, deadline
        )
    labels, unfinished = np.full(shape, int(Label.UNKNOWN)), ""
    for number, stride in enumerate(strides):
        try:
            labels[images.doomed(stride, solutions == ANY)] = Label.DOOMED
        except TimeOver:
            if not deadline.is_over:
                raise  # by what is told of progress
            unfinished = f"{number} of {len(strides)} rounds of macro-steps were run before the time was over"
            break
    labels[~images.states] = Label.INVALID
    result = DoomedSet(
        scene=loaded, model=rung, over=names, box=intervals, inputs=bounds, cells=labels,
        steps=tuple(images.steps), runs=images.runs, request=request,
        escapes=float(images.escapes.sum() / images.states.sum()), unfinished=unfinished,
    )  # fmt: skip
    if out is not None:
        result.save(out)
    return result


@keywords
def load_doomed_set(folder: str | Path, scene: AnyScene | None = None) -> DoomedSet:
    """A set from the folder in which it was saved; `scene` if the scene does not ship.

    Raises FileNotFoundError when the folder holds no set, SceneError or SetError when the scene is another.
    """
    data = store.load(folder)
    request = store.attributes(data)
    if request.get("kind") != "doomed":
        raise SetError(f"{folder} holds a set of parameters, not of states")
    loaded = load(request["scene"]) if scene is None else scene
    if digest(loaded) != request["digest"]:
        raise SetError(f"scene: {loaded.name} is not the scene as it was for the set in {folder}")
    model = moving_rung(request["model"])
    return DoomedSet(
        scene=loaded, model=model if model.metric else model.with_inertia(request["inertia"]),
        over=tuple(request["over"]), box=np.array(request["box"]),
        inputs={name: (low, high) for name, (low, high) in request["inputs"].items()},
        cells=data.label.values.astype(np.int64), steps=tuple(data.attrs["steps"]),
        runs=int(data.attrs["runs"]), escapes=float(data.attrs["escapes"]), request=request,
        unfinished=str(data.attrs.get("unfinished", "")),
    )  # fmt: skip


def _shape(cells: int | Sequence[int] | None, axes: int) -> tuple[int, ...]:
    counts = CELLS[axes] if cells is None else cells
    shape = (counts,) * axes if isinstance(counts, int) else tuple(counts)
    if len(shape) != axes or not all(2 <= count <= 4096 for count in shape) or np.prod(shape) > 2e7:
        raise SetError(f"cells: 2 to 4096 along each of {axes} axes, 20 million at most, not {cells!r}")
    return shape

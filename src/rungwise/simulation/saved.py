"""Runs that were saved, as they were: their record, trajectory and states."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from rungwise.contact.judge import Certificate
from rungwise.models.ladder import rung
from rungwise.outcome import Outcome
from rungwise.simulation.inputs import Segment
from rungwise.simulation.moving.result import MovingRun
from rungwise.simulation.planar.state.allocation import allocate
from rungwise.simulation.planar.state.workspace import Workspace
from rungwise.simulation.result import Run
from rungwise.simulation.state import StateError
from rungwise.simulation.trajectory import STATES, read_saved

if TYPE_CHECKING:
    import xarray

COPIED = ("parameters", "reason", "time", "steps", "solves", "worst_residual", "wall_s")
Kind = TypeVar("Kind", bound=MovingRun)


class SavedFrame(NamedTuple):
    """A frame of a saved run in any world but the plane; what else frames hold is in the trajectory."""

    time: float
    q: NDArray[np.float64]
    v: NDArray[np.float64]
    memory: NDArray[np.float64]


class Saved(NamedTuple):
    """A run as its folder holds it: the fields of `Record` but for the scene, and the summary (`told`)."""

    fields: dict[str, Any]
    told: dict[str, Any]
    data: xarray.Dataset
    states: Mapping[str, NDArray[Any]]

    @property
    def scene_data(self) -> Any:
        """What `load` makes the scene of."""
        return json.loads(self.data.attrs["scene_file"])

    @property
    def memories(self) -> list[NDArray[np.float64]]:
        """The memory of each frame."""
        ends = np.cumsum(self.states["lengths"])
        return np.split(self.states["memory"], ends[:-1])


def read(folder: str | Path) -> Saved:
    """The run that was saved in a folder. Raises FileNotFoundError where there is none, and StateError where
    it has no states."""
    data, told = read_saved(folder)
    file = Path(folder) / STATES
    if not file.is_file():
        raise StateError(
            f"{folder}: holds a run that an earlier version saved, without its states; xarray.open_zarr reads"
            " its trajectory"
        )
    with np.load(file, allow_pickle=False) as arrays:
        states = dict(arrays)
    model, inertia = rung(told["model"].partition(",")[0]), float(states["inertia"])
    proof = json.loads(str(states["certificate"]))
    fields = {name: told[name] for name in COPIED} | {
        "model": model if model.inertia == inertia else model.with_inertia(inertia),
        "theta": float(states["theta"]),
        "inputs": tuple(Segment(**segment) for segment in told["inputs"]),
        "outcome": next(each for each in Outcome if str(each) == told["outcome"]),
        "certificate": None if proof is None else _certificate(*proof),
        "notes": tuple(told["notes"]),
    }
    return Saved(fields, told, data, states)


def _certificate(kind: str, vectors: list[list[float]], modes: list[list[int]]) -> Certificate:
    return Certificate(kind, tuple(map(np.array, vectors)), tuple(map(tuple, modes)))


def planar_run(scene: Any, saved: Saved) -> Run:
    """A planar run. Raises StateError where another version saved it."""
    memories = np.array(saved.memories)
    bound = scene.bind(saved.fields["parameters"])
    workspace = allocate(scene.template, bound.values, max(3, len(memories)))
    _recall(workspace, memories)
    run = Run(
        scene=scene, **saved.fields, motion=saved.told["motion"], attempts=saved.told["attempts"],
        problem=None, workspace=workspace,
    )  # fmt: skip
    run.__dict__["trajectory"] = saved.data
    return run


def _recall(workspace: Workspace, memories: NDArray[np.float64]) -> None:
    state, frames = workspace.state, workspace.frames
    if memories.shape[1] != len(state.memory) or len(memories) > len(frames.memory):
        raise StateError("run: another version of rungwise saved it; xarray.open_zarr reads its trajectory")
    frames.memory[: len(memories)] = memories
    state.memory[:] = memories[-1]
    state.clock["frames"] = len(memories)


def moving_run(kind: type[Kind], scene: Any, saved: Saved) -> Kind:
    """A run in any world but the plane."""
    data = saved.data
    rows = zip(data.time.values, data.position.values, data.velocity.values, saved.memories, strict=True)
    frames = tuple(SavedFrame(float(time), q, v, memory) for time, q, v, memory in rows)
    gained = float(saved.told["energy_gained"])
    run = kind(scene=scene, **saved.fields, frames=frames, energy_gained=gained)
    run.__dict__["trajectory"] = data
    return run

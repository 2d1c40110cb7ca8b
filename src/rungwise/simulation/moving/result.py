"""The end of a run of whatever moves, and its record."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from rungwise.scene.stated import StatedScene
from rungwise.simulation.any_run import AnyRun, by_body
from rungwise.simulation.state import Memory, State, digest
from rungwise.simulation.stepping.record import WORK

if TYPE_CHECKING:
    import xarray

MEASURED = ("residual", "energy")


@dataclass(frozen=True, kw_only=True, repr=False, eq=False)
class MovingRun(AnyRun):
    """The end of a run and its record; what a planar `Run` has, it has under the same names.

    `frames` are the states kept; `energy_gained` is the energy that contacts added in steps in which
    something bounced."""

    scene: StatedScene
    frames: Sequence[Any]
    energy_gained: float = 0.0

    @property
    def began(self) -> bool:
        return bool(self.frames)

    @property
    def final(self) -> dict[str, dict[str, float]]:
        return by_body(self.scene.template.coordinates, self.frames[-1].q) if self.frames else {}

    @property
    def state(self) -> State:
        """The state at the end of the run. Raises ValueError for a run that never began."""
        self.check_begun()
        return self.states[-1]

    @cached_property
    def states(self) -> list[State]:
        """The states of the recorded frames, in the order of its times."""
        names, scene = self.scene.template.coordinates, digest(self.scene)
        return [
            State(
                names, each.q, each.v, each.time,
                Memory(each.memory, scene, self.model, self.theta, self.inputs),
            )
            for each in self.frames
        ]  # fmt: skip

    @cached_property
    def trajectory(self) -> xarray.Dataset:
        """The recorded frames (see `dataset`). Raises ValueError for a run that never began."""
        self.check_begun()
        return self.dataset()

    def dataset(self) -> xarray.Dataset:
        """Recorded frames with named coordinates (see `dataset`)."""
        return dataset(self)


def dataset(run: MovingRun) -> xarray.Dataset:
    """Recorded frames with named coordinates.

    Variables over `time`: position per coordinate, velocity per rate, gap and contact_force (normal, of the
    last step) per pair of bodies, residual, energy, and the work of drives, loads, contacts, supports and
    joints. Attribute `scene_file` is the scene as JSON.
    """
    import xarray as xr

    template = run.scene.template
    pairs = [f"{a}|{b}" for a, b in template.contacts]
    return xr.Dataset(
        {
            "position": (("time", "coordinate"), np.array([each.q for each in run.frames])),
            "velocity": (("time", "rate"), np.array([each.v for each in run.frames])),
            "gap": (("time", "contact"), np.array([each.gap for each in run.frames])),
            "contact_force": (("time", "contact"), np.array([each.force for each in run.frames])),
            **measured(run),
            **worked(run),
        },
        coords=named(run) | {"contact": np.array(pairs, object)},
        attrs=told(run),
    )


def measured(run: MovingRun) -> dict[str, Any]:
    """Residual and energy over time."""
    return {name: (("time",), np.array([getattr(each, name) for each in run.frames])) for name in MEASURED}


def worked(run: MovingRun) -> dict[str, Any]:
    """Work over time."""
    work = np.array([each.work for each in run.frames])
    return {name: (("time",), work[:, k]) for k, name in enumerate(WORK)}


def named(run: MovingRun) -> dict[str, Any]:
    """Times and names."""
    return {
        "time": np.array([each.time for each in run.frames]),
        "coordinate": np.array(run.scene.template.coordinates, object),
        "rate": np.array(run.scene.template.velocities, object),
    }


def told(run: MovingRun) -> dict[str, str]:
    """What a record says of its run."""
    return {
        "scene": run.scene.name,
        "model": run.model.name,
        "scene_file": run.scene.stored,
        "outcome": str(run.outcome),
        "reason": run.reason,
    }

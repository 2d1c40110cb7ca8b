"""The end of a run in space and its record."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rungwise.contact.judge import Certificate
from rungwise.keywords import keywords
from rungwise.models.ladder import Rung
from rungwise.outcome import Outcome
from rungwise.plain import cut
from rungwise.scene.space import SpaceScene
from rungwise.simulation.inputs import Segment
from rungwise.simulation.spatial.frames import REACTIONS, WORK, Frame
from rungwise.simulation.state import Memory, State, digest
from rungwise.simulation.trajectory import save
from rungwise.system.spatial.space import Space

if TYPE_CHECKING:
    import xarray


@dataclass(frozen=True, eq=False)
class SpaceRun:
    """The end of a run in space and its record; what a planar `Run` has, it has under the same names.

    `frames` are the states kept, with their contacts; `space` is the system as the run left it;
    `energy_gained` is the energy that contacts added in steps in which something bounced."""

    scene: SpaceScene
    model: Rung
    parameters: dict[str, float]
    inputs: tuple[Segment, ...]
    theta: float
    outcome: Outcome
    reason: str
    time: float
    steps: int
    solves: int
    worst_residual: float
    wall_s: float
    certificate: Certificate | None
    frames: tuple[Frame, ...]
    space: Space | None
    energy_gained: float = 0.0
    notes: tuple[str, ...] = ()

    @property
    def ok(self) -> bool:
        """Whether the answer is positive: the run came to the goal."""
        return self.outcome.exit_code == 0

    @property
    def began(self) -> bool:
        """Whether the scene is possible at its start."""
        return bool(self.frames)

    def __repr__(self) -> str:
        return (
            f"<SpaceRun of {cut(self.scene.name)} on {cut(self.model.name)}: {self.outcome} at t ="
            f" {self.time:.6g}, {self.steps} steps, worst residual {self.worst_residual:.1e}>"
        )

    @property
    def final(self) -> dict[str, dict[str, float]]:
        """Coordinates at the end, by body and name."""
        places: dict[str, dict[str, float]] = {}
        if self.frames:
            for name, value in zip(self.scene.template.coordinates, self.frames[-1].q, strict=True):
                body, _, coordinate = name.partition(".")
                places.setdefault(body, {})[coordinate] = float(value)
        return places

    @property
    def state(self) -> State:
        """The state at the end of the run. Raises ValueError for a run that never began."""
        if not self.frames:
            raise ValueError(f"the run did not begin: {self.reason}")
        return self.states[-1]

    @cached_property
    def states(self) -> list[State]:
        """The states of the recorded frames, in the order of `trajectory.time`."""
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
        if not self.frames:
            raise ValueError(f"the run did not begin: {self.reason}")
        return dataset(self)

    def summary(self) -> dict[str, object]:
        """Plain values, as `rungwise sim --json` prints them."""
        return {
            "scene": self.scene.name,
            "model": self.model.name,
            "parameters": self.parameters,
            "inputs": [asdict(segment) for segment in self.inputs],
            "outcome": str(self.outcome),
            "reason": self.reason,
            "time": self.time,
            "steps": self.steps,
            "solves": self.solves,
            "final": self.final,
            "worst_residual": self.worst_residual,
            "certificate": None if self.certificate is None else self.certificate.kind,
            "energy_gained": self.energy_gained,
            "notes": list(self.notes),
            "wall_s": round(self.wall_s, 6),
        }

    @keywords
    def save(self, folder: str | Path) -> Path:
        """Write trajectory and summary into `folder` (see `trajectory.save`)."""
        return save(folder, self.trajectory, self.summary())


def dataset(run: SpaceRun) -> xarray.Dataset:
    """Recorded frames with named coordinates.

    Variables over `time`: position per coordinate, velocity per velocity, residual, energy, and the work of
    drives, loads, contacts, supports and joints; drive_force, limit_force, joint_force (of equalities) and
    dry_friction per velocity, in the last step; gap and contact_force (normal, and the length of the
    tangential force) per pair of geoms that touched or came near in some frame, and its mode: the greatest of
    its contacts. Over `touch`, contacts of all frames one after the other: touch_frame, touch_geoms, point,
    normal, force on the second geom (in the world), friction, mode and gap. Where impacts make forces
    meaningless, they are those of the last step. Attribute `scene_file` is the scene as JSON.
    """
    import xarray as xr

    template, frames = run.scene.template, run.frames
    pairs, gap, force, mode = _of_pairs(run, frames)
    data = {
        "position": (("time", "coordinate"), np.array([each.q for each in frames])),
        "velocity": (("time", "rate"), np.array([each.v for each in frames])),
        "gap": (("time", "pair"), gap),
        "mode": (("time", "pair"), mode, {"flags": ["open", "stick", "slip"]}),
        "contact_force": (("time", "pair", "direction"), force),
        "residual": (("time",), np.array([each.residual for each in frames])),
        "energy": (("time",), np.array([each.energy for each in frames])),
    }
    data |= _touches(frames)
    acting = np.array([each.reactions for each in frames])
    data |= {name: (("time", "rate"), acting[:, k]) for k, name in enumerate(REACTIONS)}
    work = np.array([each.work for each in frames])
    data |= {name: (("time",), work[:, k]) for k, name in enumerate(WORK)}
    return xr.Dataset(
        data,
        coords={
            "time": np.array([each.time for each in frames]),
            "coordinate": np.array(template.coordinates, object),
            "rate": np.array(template.velocities, object),
            "pair": np.array(pairs, object),
            "direction": np.array(["normal", "tangent"], object),
        },
        attrs={
            "scene": run.scene.name,
            "model": run.model.name,
            "scene_file": run.scene.stored,
            "outcome": str(run.outcome),
            "reason": run.reason,
        },
    )


def _touches(frames: Sequence[Frame]) -> dict[str, Any]:
    """Contacts of all frames, one after the other."""
    touches = [each.touch for each in frames]
    numbers = np.repeat(np.arange(len(frames)), [len(touch.gap) for touch in touches])
    found: dict[str, Any] = {"touch_frame": (("touch",), numbers)}
    for name, axes in (
        ("point", ("axis",)), ("normal", ("axis",)), ("force", ("axis",)), ("geoms", ("side",)),
        ("friction", ()), ("mode", ()), ("gap", ()),
    ):  # fmt: skip
        found[f"touch_{name}"] = (("touch", *axes), np.concatenate([getattr(t, name) for t in touches]))
    return found


def _of_pairs(run: SpaceRun, frames: Sequence[Frame]) -> tuple[list[str], Any, Any, Any]:
    """Labels of pairs (p,), gaps (f, p), forces (f, p, 2) and modes (f, p)."""
    geoms = run.scene.labels.geoms
    met = sorted({(int(a), int(b)) for each in frames for a, b in each.touch.geoms})
    number = {pair: k for k, pair in enumerate(met)}
    gap = np.full((len(frames), len(met)), np.nan)
    force = np.zeros((len(frames), len(met), 2))
    mode = np.zeros((len(frames), len(met)), np.int8)
    for f, each in enumerate(frames):
        touch = each.touch
        for c, pair in enumerate(touch.geoms):
            k = number[int(pair[0]), int(pair[1])]
            push = float(touch.force[c] @ touch.normal[c])
            gap[f, k] = np.fmin(gap[f, k], touch.gap[c])
            force[f, k, 0] += push
            force[f, k, 1] += float(np.linalg.norm(touch.force[c] - push * touch.normal[c]))
            mode[f, k] = max(mode[f, k], touch.mode[c])
    return [f"{geoms[a]}|{geoms[b]}" for a, b in met], gap, force, mode

"""The end of a run in space and its record."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from rungwise.scene.space import SpaceScene
from rungwise.simulation.moving.result import MovingRun, measured, named, told, worked
from rungwise.simulation.spatial.frames import REACTIONS, Frame
from rungwise.simulation.spatial.prepared import Prepared
from rungwise.system.spatial.space import Space

if TYPE_CHECKING:
    import xarray


@dataclass(frozen=True, kw_only=True, repr=False, eq=False)
class SpaceRun(MovingRun):
    """The end of a run in space and its record; what a planar `Run` has, it has under the same names.

    `frames` are the states kept, with their contacts; `space` is the system as the run left it;
    `energy_gained` is the energy that contacts added in steps in which something bounced."""

    scene: SpaceScene
    frames: Sequence[Frame]
    space: Space | None = None

    def dataset(self) -> xarray.Dataset:
        return dataset(self)

    def __getstate__(self) -> dict[str, Any]:
        """The run without its system, of which only whether there is one is kept: MuJoCo's data stay here."""
        return self.__dict__ | {"space": self.space is not None}

    def __setstate__(self, state: dict[str, Any]) -> None:
        space = Prepared.of(state["scene"], state["parameters"]).system if state["space"] else None
        self.__dict__.update(state | {"space": space})


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

    frames = run.frames
    pairs, gap, force, mode = _of_pairs(run, frames)
    data = {
        "position": (("time", "coordinate"), np.array([each.q for each in frames])),
        "velocity": (("time", "rate"), np.array([each.v for each in frames])),
        "gap": (("time", "pair"), gap),
        "mode": (("time", "pair"), mode, {"flags": ["open", "stick", "slip"]}),
        "contact_force": (("time", "pair", "direction"), force),
        **measured(run),
    }
    data |= _touches(frames)
    acting = np.array([each.reactions for each in frames])
    data |= {name: (("time", "rate"), acting[:, k]) for k, name in enumerate(REACTIONS)}
    data |= worked(run)
    return xr.Dataset(
        data,
        coords=named(run)
        | {"pair": np.array(pairs, object), "direction": np.array(["normal", "tangent"], object)},
        attrs=told(run),
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
    of = [geoms.index(name) for name in geoms]  # pieces have the label of the geom that they stand for
    met = sorted({(of[a], of[b]) for each in frames for a, b in each.touch.geoms})
    number = {pair: k for k, pair in enumerate(met)}
    gap = np.full((len(frames), len(met)), np.nan)
    force = np.zeros((len(frames), len(met), 2))
    mode = np.zeros((len(frames), len(met)), np.int8)
    for f, each in enumerate(frames):
        touch = each.touch
        for c, pair in enumerate(touch.geoms):
            k = number[of[pair[0]], of[pair[1]]]
            push = float(touch.force[c] @ touch.normal[c])
            gap[f, k] = np.fmin(gap[f, k], touch.gap[c])
            force[f, k, 0] += push
            force[f, k, 1] += float(np.linalg.norm(touch.force[c] - push * touch.normal[c]))
            mode[f, k] = max(mode[f, k], touch.mode[c])
    return [f"{geoms[a]}|{geoms[b]}" for a, b in met], gap, force, mode

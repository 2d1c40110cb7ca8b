"""The frames of a run as an xarray Dataset; saving and loading."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from rungwise.contact.step import NAMES
from rungwise.plain import json_text
from rungwise.simulation.planar.state.workspace import SCALARS, recorded
from rungwise.simulation.raised import raised_in
from rungwise.stored import store_dataset, whole

if TYPE_CHECKING:
    import xarray

    from rungwise.models.ladder import Rung
    from rungwise.scene import Scene
    from rungwise.simulation.planar.state.workspace import Workspace

MEASURES = ("along", "across", "angle")
STORE = "trajectory.zarr"
SUMMARY = "run.json"
STATES = "states.npz"


def dataset(scene: Scene, model: Rung, workspace: Workspace, pairs: list[str]) -> xarray.Dataset:
    """Recorded frames with named coordinates.

    Variables over `time`: position and velocity per coordinate, gap per contact, mode per contact point (two
    for each pair of shapes, then two travel limits per coordinate), drive_force, residual, energies and work.
    Where impacts make forces meaningless (rigid dynamic rung), contact_impulse holds the impulse of each
    point since the frame before; otherwise contact_force holds the force at the frame. The kinematic rung has
    neither variable. A scene with joints has, for each of their three measures (along and across the axis of
    the first body, angle), joint_position and the joint_force, or torque, on the second body. Where bodies
    may be raised off the plane, raised holds the height of each of these. Attribute `scene_file` is the scene
    as JSON, as `load` takes it once decoded.
    """
    import xarray as xr

    template = scene.template
    contacts = [f"{a}|{b}" for a, b in template.contacts]
    points = [f"{pair}/{k}" for pair in pairs for k in (0, 1)]
    measures = [f"{joint}.{measure}" for joint in template.joints for measure in MEASURES]
    points += [f"{name}/{side}" for name in (*template.coordinates, *measures) for side in ("lower", "upper")]
    frames, cut = workspace.frames, slice(0, int(workspace.state.clock[0]["frames"]))
    variables: dict[str, Any] = {
        "position": (("time", "coordinate"), recorded(workspace, "q")),
        "velocity": (("time", "coordinate"), recorded(workspace, "v")),
        "gap": (("time", "contact"), recorded(workspace, "gaps")),
        "mode": (("time", "point"), recorded(workspace, "modes").astype(np.int8), {"flags": list(NAMES)}),
    }
    if measures:
        variables["joint_position"] = (("time", "measure"), frames.joint[cut])
        if model.loads:
            variables["joint_force"] = (("time", "measure"), frames.joint_force[cut])
    if model.loads:
        variables["drive_force"] = (("time", "coordinate"), frames.reaction[cut])
        impacts = model.inertia > 0.0 and not model.compliant
        name = "contact_impulse" if impacts else "contact_force"
        values = frames.impulse[cut] if impacts else recorded(workspace, "force")
        variables[name] = (("time", "point", "direction"), values)
    heights = raised_in(scene, recorded(workspace, "values"))
    if heights:
        variables["raised"] = (("time", "body"), np.stack(list(heights.values()), axis=1))
    for k, name in enumerate(SCALARS):
        variables[name] = (("time",), frames.scalars[cut, k])
    return xr.Dataset(
        {name: (value[0], np.array(value[1]), *value[2:]) for name, value in variables.items()},
        coords={
            "time": recorded(workspace, "time"),
            "coordinate": _labels(template.coordinates),
            "contact": _labels(contacts),
            "point": _labels(points),
            **({"measure": _labels(measures)} if measures else {}),
            **({"body": _labels(tuple(heights))} if heights else {}),
            "direction": _labels(("normal", "tangent")),
        },
        attrs={
            "scene": scene.name,
            "model": model.name,
            "scene_file": scene.stored,
        },
    )


def _labels(names: Sequence[str]) -> np.ndarray[Any, Any]:
    """Text of any length: the only kind that zarr's format specifies."""
    return np.array(names, dtype=object)


def save(
    folder: str | Path,
    trajectory: xarray.Dataset,
    summary: dict[str, object],
    states: Mapping[str, NDArray[Any]],
) -> Path:
    """Write trajectory, summary and states into `folder`, whole or not at all: each part is renamed into
    place.

    Raises OSError when the folder cannot be written.
    """
    target = Path(folder)
    target.mkdir(parents=True, exist_ok=True)
    with (
        whole(target / SUMMARY) as text,
        whole(target / STORE) as store,
        whole(target / STATES) as kept,
        kept.open("wb") as stream,
    ):
        store_dataset(trajectory, store)
        text.write_text(json_text(summary, indent=1), "utf-8")
        np.savez_compressed(stream, **states)  # type: ignore[arg-type]
    return target


def read_saved(folder: str | Path) -> tuple[xarray.Dataset, dict[str, Any]]:
    """Trajectory and summary of a saved run. Raises FileNotFoundError when the folder holds none."""
    import xarray as xr

    target = Path(folder)
    if not (target / STORE).is_dir() or not (target / SUMMARY).is_file():
        raise FileNotFoundError(f"{target} holds no saved run ({SUMMARY} and {STORE})")
    summary: dict[str, Any] = json.loads((target / SUMMARY).read_text("utf-8"))
    return xr.open_zarr(target / STORE, consolidated=False).load(), summary

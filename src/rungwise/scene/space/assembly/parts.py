"""A scene's model, put together from its file and its parts."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from rungwise.kernel import Reals
from rungwise.scene.errors import SceneError
from rungwise.scene.fields.values import shown
from rungwise.scene.space.assembly.servos import add_servos
from rungwise.scene.space.fields import Model, Part
from rungwise.scene.space.mujoco_model import compiled, library, model_path, read_spec
from rungwise.scene.space.packages import with_files
from rungwise.scene.stated import Numbers
from rungwise.wording import choices

if TYPE_CHECKING:
    import mujoco

SIZES = (
    "memory", "nconmax", "njmax", "nuserdata", "nuser_actuator", "nuser_body", "nuser_cam", "nuser_geom",
    "nuser_jnt", "nuser_sensor", "nuser_site", "nuser_tendon",
)  # fmt: skip
"""Sizes of a model as a whole."""
TOLD = ("gravity", "timestep", "disableflags", "enableflags")
"""Options of a part that are told of where they give way."""
BALANCED = "inertias that no body can have were balanced: equal about all axes"
"""What is told of a URDF file whose inertias MuJoCo corrects."""


class Assembled(NamedTuple):
    """The specification of a scene's model, the file that it begins with, and remarks on its parts."""

    spec: mujoco.MjSpec
    path: Path
    notes: tuple[str, ...]


def assembled(model: Model, folder: Path, numbers: Numbers | None = None) -> Assembled:
    """The specification of a model whose files are looked for in a folder. Without `numbers` parts lie at the
    origin, and servos are of stiffness 1. Raises SceneError that names the field."""
    path, notes = model_path(model.file, folder), list[str]()
    spec = read_spec(path)
    for name, part in model.parts.items():
        notes += (f"model.parts.{name}: {note}" for note in _attach(spec, name, part, folder, numbers))
    add_servos(spec, model.servos, numbers)
    return Assembled(spec, path, tuple(notes))


def _attach(spec: mujoco.MjSpec, name: str, part: Part, folder: Path, numbers: Numbers | None) -> list[str]:
    """Put a part into a specification. Returns remarks on it."""
    field = f"model.parts.{name}"
    own = model_path(part.file, folder, f"{field}.file")
    child = read_spec(own)
    with_files(child, Path(child.modelfiledir or own.parent))
    child.compiler.fusestatic = False  # the part's base stays a body, of which its links are kin
    compiled(child, own)
    under = spec.worldbody if part.body is None else spec.body(part.body)
    if under is None:
        bodies = [each.name for each in spec.bodies if each.name]
        raise SceneError(
            f"{field}.body: no body is called {shown(part.body)}{choices(part.body or '', bodies)}"
        )
    frame = under.add_frame()
    if numbers is not None:
        frame.pos = [numbers.one(each, f"{field}.xyz.{k}") for k, each in enumerate(part.xyz)]
        frame.quat = _quaternion(*(numbers.one(each, f"{field}.rpy.{k}") for k, each in enumerate(part.rpy)))
    notes = _with_settings_of(child, spec)
    try:
        spec.attach(child, prefix=f"{name}_", frame=frame)
    except (ValueError, RuntimeError) as error:
        raise SceneError(f"{field}: {' '.join(str(error).split())[:300]}") from None
    if child.compiler.balanceinertia and own.suffix.lower() == ".urdf":
        notes.append(BALANCED)
    return notes


def _with_settings_of(child: mujoco.MjSpec, spec: mujoco.MjSpec) -> list[str]:
    """Give a part the settings of the model as a whole. (MuJoCo keeps the model's where both differ, and
    warns each time that the model is compiled.) Returns a remark where the part asked for other options."""
    other = [each for each in TOLD if np.any(getattr(child.option, each) != getattr(spec.option, each))]
    _copy_settings(child.option, spec.option)
    _copy_settings(child.visual, spec.visual)
    for size in SIZES:
        setattr(child, size, getattr(spec, size))
    named = " and ".join(other)
    return [f"its {named} gave way to the model's own"] if other else []


def _copy_settings(to: Any, of: Any) -> None:
    """Copy numbers, and numbers of groups of them."""
    for name in dir(of):
        value = getattr(of, name)
        if isinstance(value, int | float):
            setattr(to, name, value)
        elif isinstance(value, np.ndarray):
            getattr(to, name)[:] = value
        elif not name.startswith("_") and not callable(value):
            _copy_settings(getattr(to, name), value)


def _quaternion(roll: float, pitch: float, yaw: float) -> Reals:
    """The quaternion (4,) of turns about the fixed axes x, y and z, in this order."""
    mujoco, found = library(), np.array([1.0, 0.0, 0.0, 0.0])
    for angle, axis in zip((roll, pitch, yaw), np.eye(3), strict=True):
        turn, before = np.zeros(4), found.copy()
        mujoco.mju_axisAngle2Quat(turn, axis, angle)
        mujoco.mju_mulQuat(found, turn, before)
    return found

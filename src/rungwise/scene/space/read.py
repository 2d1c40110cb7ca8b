"""Reading a scene in space: a YAML file that names a model, or a model file alone."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from pydantic import ValidationError

from rungwise.scene.errors import SceneError
from rungwise.scene.fields.values import shown
from rungwise.scene.language.expression import CONSTANTS, FUNCTIONS
from rungwise.scene.language.names import OF_CONTACTS
from rungwise.scene.scene import explain, read_yaml
from rungwise.scene.space.assembly.parts import assembled
from rungwise.scene.space.bind import check_names
from rungwise.scene.space.fields import SpaceFile
from rungwise.scene.space.labels import Labels, as_labels, label, labels
from rungwise.scene.space.meshes.pieces import with_pieces
from rungwise.scene.space.mujoco_model import LIBRARY, compiled, no_file
from rungwise.scene.space.refused import refuse
from rungwise.scene.space.scene import SpaceScene
from rungwise.scene.stated import NameTemplate, Numbers
from rungwise.scene.template.task import check_fingers, check_task

if TYPE_CHECKING:
    import mujoco

MODELS = (".xml", ".mjcf", ".urdf")
"""Endings of model files."""
OF_JOINT = 0
"""MuJoCo's number of actuators on joints."""


def is_space(source: object) -> bool:
    """Whether a source that `load` takes is a scene in space."""
    if isinstance(source, SpaceScene):
        return True
    if isinstance(source, Mapping):
        return "model" in source and "bodies" not in source
    if not isinstance(source, str | Path):
        return False
    if str(source) in shipped_in_space() or Path(source).suffix.lower() in MODELS:
        return True
    if Path(source).suffix.lower() not in (".yaml", ".yml") or not Path(source).is_file():
        return False
    content = read_yaml("scene", source)
    return isinstance(content, Mapping) and is_space(content)


def shipped_in_space() -> tuple[str, ...]:
    """Names of the scenes in space that come with the package."""
    return tuple(sorted(p.name.removesuffix(".yaml") for p in LIBRARY.iterdir() if p.name.endswith(".yaml")))


def load_space(source: SpaceScene | str | Path | Mapping[str, Any]) -> SpaceScene:
    """Read a scene in space: the name of one that ships, a YAML file or its content, or a model file. Raises
    SceneError: one line that names the field."""
    if isinstance(source, SpaceScene):
        return source
    if isinstance(source, Mapping):
        return _scene(dict(source), Path())
    if str(source) in shipped_in_space():
        folder = Path(str(LIBRARY))
        return _scene(read_yaml("scene", folder / f"{source}.yaml"), folder)
    path = Path(source)
    if path.suffix.lower() not in MODELS:
        return _scene(read_yaml("scene", path), path.parent)
    return _of_model(path)


def file_of(name: str) -> SpaceFile:
    """The fields of a scene that ships, without its model."""
    return _checked(read_yaml("scene", Path(str(LIBRARY)) / f"{name}.yaml"))


def _checked(data: Any) -> SpaceFile:
    try:
        return SpaceFile.model_validate(data)
    except ValidationError as error:
        raise SceneError(explain(error, data)) from None


def _scene(data: Any, folder: Path) -> SpaceScene:
    file = _checked(data)
    spec, path, _ = assembled(file.model, folder)
    model = compiled(spec, path)
    refuse(model)
    text = spec.to_xml()
    model, _ = with_pieces(spec, model, path, file.model.meshes)
    names = labels(model)
    if "controls" not in file.model_fields_set and names.actuators:
        file = _checked(_with_inputs(data, file, model, names))
    scene = SpaceScene(file, _template(file, model, names), folder, names, text)
    try:
        check_names(scene, spec, model)
        if file.task is not None:
            moving = [names.bodies[b] for b in range(model.nbody) if model.body_weldid[b]]
            check_task(file.task, scene.template.names(), file.inputs, moving)
            check_fingers(file.task, moving, moving, "xyz")
    except SceneError as error:
        raise SceneError(str(error) + _to_write(str(error), data, model, names)) from None
    return scene


def _to_write(error: str, data: Any, model: mujoco.MjModel, names: Labels) -> str:
    """How the text to which an error belongs is written with labels in place of the model's own names; empty
    where it has none."""
    for path, text in sorted(_texts(data), key=lambda each: -len(each[0])):
        instead = as_labels(text, model, names)
        if instead != text and error.startswith(f"{path}:"):
            return f"; write {shown(instead)}: names keep letters, digits and _"
    return ""


def _texts(given: Any, path: str = "") -> Iterator[tuple[str, str]]:
    """All keys and texts of a scene, with their paths."""
    items = given.items() if isinstance(given, Mapping) else enumerate(given)
    for key, value in items:
        own = f"{path}.{key}" if path else str(key)
        if isinstance(key, str):
            yield own, key
        if isinstance(value, Mapping | list | tuple):
            yield from _texts(value, own)
        elif isinstance(value, str):
            yield own, value


def _template(file: SpaceFile, model: mujoco.MjModel, names: Labels) -> NameTemplate:
    return NameTemplate(
        tuple(file.parameters),
        file.inputs,
        names.bodies,
        names.coordinates,
        names.velocities,
        tuple(
            (names.bodies[a], names.bodies[b])
            for a in range(model.nbody)
            for b in range(a + 1, model.nbody)
            if model.body_geomnum[a]
            and model.body_geomnum[b]
            and model.body_weldid[a] != model.body_weldid[b]
        ),
        names.turns,
        posed=names.bodies,
    )


def _of_model(path: Path) -> SpaceScene:
    """A scene of a model alone: its actuators are the inputs, and contacts have the laws of
    `contact_laws`."""
    if not path.is_file():
        raise SceneError(f"scene: {str(path)[:200]!r} is {no_file(path)}")
    return _scene({"name": label(path.stem), "model": {"file": path.name}}, path.parent)


def _with_inputs(data: Any, file: SpaceFile, model: mujoco.MjModel, names: Labels) -> Any:
    """The content of a scene that states no controls, with its actuators as inputs: parameters of their
    names, of which each is what the keyframe says, or for a servo the place that the scene gives its joint,
    or else 0, within the actuator's range."""
    given = dict(data.get("parameters") or {})
    taken = (*FUNCTIONS, *CONSTANTS, "t", "tolerance", "speed", *OF_CONTACTS, *given)
    key = (data.get("start") or {}).get("keyframe")
    keys = [k for k in range(model.nkey) if model.key(k).name == key]
    parameters, controls = {}, {}
    defaults = np.array([*(each.default for each in file.parameters.values()), 0.0])
    number = Numbers(_template(file, model, names).names(), defaults)
    for a, name in enumerate(names.actuators):
        low, high = (float(x) for x in model.actuator_ctrlrange[a])
        own = f"u_{name}" if name in taken else name
        told = float(model.key_ctrl[keys[0], a]) if keys else _begun(file, number, model, names, a)
        parameters[own] = {"default": told, "about": f"control of {name}"}
        if model.actuator_ctrllimited[a]:
            parameters[own] |= {"default": min(max(told, low), high), "range": (low, high)}
        controls[name] = own
    inputs = (*(data.get("inputs") or ()), *parameters)
    return data | {"parameters": given | parameters, "inputs": inputs, "controls": controls}


def _begun(
    file: SpaceFile, number: Numbers, model: mujoco.MjModel, names: Labels, actuator: int
) -> float:  # fmt: skip
    """The place that a scene gives the joint of a servo, at the defaults of its parameters; 0 where it gives
    none, or one that is refused later."""
    is_servo = model.actuator_biasprm[actuator, 1] < 0.0 and model.actuator_trntype[actuator] == OF_JOINT
    if not is_servo or model.actuator_gear[actuator, 0] != 1.0:
        return 0.0
    joint = int(model.actuator_trnid[actuator, 0])
    label = names.coordinates[int(model.jnt_qposadr[joint])]
    try:
        return number.one(file.start.places.get(label, 0.0), f"start.places.{label}")
    except SceneError:
        return 0.0

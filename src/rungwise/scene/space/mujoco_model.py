"""Reading a model file with MuJoCo, with numbers of the scene in place of its own."""

from __future__ import annotations

import copy
import warnings
from collections.abc import Callable, Iterable, Sequence
from fnmatch import fnmatchcase
from importlib import import_module
from importlib.resources import files
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from rungwise.errors import InputError
from rungwise.scene.errors import SceneError
from rungwise.scene.fields.values import shown
from rungwise.scene.space.fields import Changes, Numbers
from rungwise.scene.space.numbers import check_numbers
from rungwise.scene.space.packages import in_package, with_places
from rungwise.wording import choices

if TYPE_CHECKING:
    import mujoco

LIBRARY = files("rungwise.scene") / "library" / "space"
KINDS = {
    "geoms": "geom",
    "bodies": "body",
    "joints": "joint",
    "actuators": "actuator",
    "tendons": "tendon",
}
"""Groups of elements that a scene may change -> what MuJoCo calls one of them."""


def library() -> Any:
    """The module mujoco. Raises InputError where it is not installed."""
    try:
        return import_module("mujoco")
    except ImportError:
        raise InputError("scene: scenes in space need MuJoCo: pip install 'rungwise[space]'") from None


def model_path(name: str, folder: Path, field: str = "model.file") -> Path:
    """Where a model file lies. Raises SceneError, at the field."""
    package, colon, inner = name.partition(":")
    if colon and inner.startswith("//"):
        return in_package(inner.lstrip("/"), name, folder / "scene", field)
    if colon and package.isidentifier():
        spec = find_spec(package)
        if spec is None or not spec.submodule_search_locations:
            raise SceneError(f"{field}: {shown(name)} lies in the package {package}, which is not installed")
        found = Path(spec.submodule_search_locations[0]) / inner
        candidates = [found]
    else:
        candidates = [folder / name, Path(str(LIBRARY / name))]
    for path in candidates:
        if path.is_file():
            return path
    raise SceneError(f"{field}: {shown(name)} is {no_file(candidates[0])}")


def no_file(path: Path) -> str:
    """What stands where a model file should."""
    return "a folder, not a model file" if path.is_dir() else "no file"


def read_spec(path: Path) -> mujoco.MjSpec:
    """The specification in a file. Raises SceneError with the parser's message."""
    mujoco = library()
    try:
        errors = "strict" if path.suffix.lower() == ".urdf" else "ignore"
        placed = with_places(path.read_text(errors=errors), path)
        if placed is None:
            return mujoco.MjSpec.from_file(str(path))
        spec = mujoco.MjSpec.from_string(placed)
        spec.modelfiledir = str(path.parent.resolve())
        return spec
    except (ValueError, RuntimeError, OSError, UnicodeDecodeError) as error:
        raise SceneError(f"model: {path.name!r}: {_line(error)}") from None


def compiled(spec: mujoco.MjSpec, path: Path) -> mujoco.MjModel:
    """The model of a specification. Raises SceneError with the compiler's message."""
    try:
        with warnings.catch_warnings(record=True) as told:
            warnings.simplefilter("always")
            model = _compiled(spec, path.suffix.lower() == ".urdf")
    except (ValueError, RuntimeError) as error:
        raise SceneError(f"model: {path.name!r}: {_line(error)}") from None
    try:
        bytes(model.names).decode()
    except UnicodeDecodeError:
        raise SceneError(f"model: {path.name!r}: a name in it is not UTF-8") from None
    check_numbers(model)
    for each in told:  # of a model that is not refused
        warnings.warn(str(each.message), stacklevel=2)
    return model


def _compiled(spec: mujoco.MjSpec, is_urdf: bool) -> mujoco.MjModel:
    """The model; of a URDF, which cannot say how, inertias that no body can have are balanced."""
    try:
        return spec.compile()
    except ValueError as error:
        if not is_urdf or "balanceinertia" not in str(error):
            raise
    spec.compiler.balanceinertia = True
    return spec.compile()


def _line(error: BaseException) -> str:
    """A message of the parser on one line."""
    return " ".join(str(error).split()).removeprefix("Error: ")[:300]


class Target(NamedTuple):
    """A field of an element, where it stands in the scene, and what it is set to."""

    path: str
    element: Any
    field: str
    given: Numbers


def targets(spec: mujoco.MjSpec, changes: Changes) -> list[Target]:
    """What a scene changes in a specification. Raises SceneError that names the field and lists the valid
    ones."""
    found = []
    for group, kind in KINDS.items():
        known = {each.name: each for each in getattr(spec, group) if each.name}
        for name, fields in getattr(changes, group).items():
            path = f"model.set.{group}.{name}"
            fitting = named(name, known)
            if not fitting:
                raise SceneError(f"{path}: unknown {kind}{choices(name, known)}")
            found += [
                Target(f"{path}.{key}", known[each], key, given)
                for each in fitting for key, given in fields.items()
            ]  # fmt: skip
    option = changes.option.items()
    found += [Target(f"model.set.option.{key}", spec.option, key, given) for key, given in option]
    for target in found:
        _check(target)
    return found


def named(pattern: str, names: Iterable[str]) -> list[str]:
    """The names that a pattern fits; the one that it is, if it is one."""
    every = list(names)
    return [pattern] if pattern in every else [name for name in every if fnmatchcase(name, pattern)]


def _check(target: Target) -> None:
    element, name, given = target.element, target.field, target.given
    fields = [each for each in dir(element) if not each.startswith("_") and _is_number(element, each)]
    if name not in fields:
        raise SceneError(f"{target.path}: unknown field {shown(name)}{choices(name, fields)}")
    old = getattr(element, name)
    if not isinstance(given, tuple):
        return
    if not isinstance(old, np.ndarray):
        raise SceneError(f"{target.path}: must be a number, not a list")
    if len(given) > len(old):
        raise SceneError(f"{target.path}: must have at most {len(old)} numbers, not {len(given)}")


def change(targets: Sequence[Target], number: Callable[[float | str, str], float]) -> None:
    """Set fields of elements to the values of numbers."""
    for path, element, field, given in targets:
        if isinstance(given, tuple):
            values = [number(each, f"{path}.{k}") for k, each in enumerate(given)]
            getattr(element, field)[: len(given)] = values
        elif isinstance(getattr(element, field), np.ndarray):
            getattr(element, field)[0] = number(given, path)
        else:
            setattr(element, field, number(given, path))


def _is_number(element: Any, name: str) -> bool:
    try:
        value = getattr(element, name)
    except Exception:  # properties of elements that have no such value raise what they like
        return False
    if isinstance(value, np.ndarray):
        return bool(value.dtype.kind == "f")
    return isinstance(value, float)


def of_unit_mass(model: mujoco.MjModel) -> mujoco.MjModel:
    """The same bodies with mass 1 each and the same radii of gyration."""
    unit = copy.copy(model)
    mass = np.where(model.body_mass > 0.0, model.body_mass, 1.0)
    unit.body_inertia[:] = model.body_inertia / mass[:, None]
    unit.body_mass[:] = np.where(model.body_mass > 0.0, 1.0, 0.0)
    unit.dof_armature[:] = 0.0
    unit.tendon_armature[:] = 0.0
    return unit

"""Reading a model file with MuJoCo, with numbers of the scene in place of its own."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from importlib.resources import files
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rungwise.errors import InputError
from rungwise.scene.template import SceneError
from rungwise.scene.values import shown
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
Values = Mapping[str, Mapping[str, Mapping[str, float | tuple[float, ...]]]]


def library() -> Any:
    """The module mujoco. Raises InputError where it is not installed."""
    try:
        return import_module("mujoco")
    except ImportError:
        raise InputError("scene: scenes in space need MuJoCo: pip install 'rungwise[space]'") from None


def model_path(name: str, folder: Path) -> Path:
    """Where a model file lies. Raises SceneError."""
    package, colon, inner = name.partition(":")
    if colon and package.isidentifier():
        spec = find_spec(package)
        if spec is None or not spec.submodule_search_locations:
            raise SceneError(
                f"model.file: {shown(name)} lies in the package {package}, which is not installed"
            )
        found = Path(spec.submodule_search_locations[0]) / inner
        candidates = [found]
    else:
        candidates = [folder / name, Path(str(LIBRARY / name))]
    for path in candidates:
        if path.is_file():
            return path
    raise SceneError(f"model.file: {shown(name)} is no file")


def read_spec(path: Path) -> mujoco.MjSpec:
    """The specification in a file. Raises SceneError with the parser's message."""
    mujoco = library()
    try:
        return mujoco.MjSpec.from_file(str(path))
    except (ValueError, RuntimeError, OSError, UnicodeDecodeError) as error:
        raise SceneError(f"model: {path.name!r}: {_line(error)}") from None


def compiled(spec: mujoco.MjSpec, path: Path) -> mujoco.MjModel:
    """The model of a specification. Raises SceneError with the compiler's message."""
    try:
        model = spec.compile()
    except (ValueError, RuntimeError) as error:
        raise SceneError(f"model: {path.name!r}: {_line(error)}") from None
    if model.nv == 0:
        raise SceneError(f"model: {path.name!r}: nothing can move in it")
    return model


def _line(error: BaseException) -> str:
    """A message of the parser on one line."""
    return " ".join(str(error).split())[:300]


def change(spec: mujoco.MjSpec, values: Values, option: Mapping[str, float | tuple[float, ...]]) -> None:
    """Set fields of elements. Raises SceneError that names the field and lists the valid ones."""
    for group, elements in values.items():
        known = {each.name: each for each in getattr(spec, group)}
        for name, given in elements.items():
            path = f"model.set.{group}.{name}"
            if name not in known:
                raise SceneError(f"{path}: unknown {KINDS[group]}{choices(name, [k for k in known if k])}")
            for field, value in given.items():
                _set(known[name], field, value, f"{path}.{field}")
    for field, value in option.items():
        _set(spec.option, field, value, f"model.set.option.{field}")


def _set(element: Any, field: str, value: float | tuple[float, ...], path: str) -> None:
    fields = [name for name in dir(element) if not name.startswith("_") and _is_number(element, name)]
    if field not in fields:
        raise SceneError(f"{path}: unknown field {shown(field)}{choices(field, fields)}")
    old = getattr(element, field)
    if not isinstance(old, np.ndarray):
        if isinstance(value, tuple):
            raise SceneError(f"{path}: must be a number, not a list")
        setattr(element, field, type(old)(value))
        return
    given = np.atleast_1d(np.array(value, float))
    if len(given) > len(old):
        raise SceneError(f"{path}: must have at most {len(old)} numbers, not {len(given)}")
    old[: len(given)] = given


def _is_number(element: Any, name: str) -> bool:
    try:
        value = getattr(element, name)
    except Exception:  # properties of elements that have no such value raise what they like
        return False
    if isinstance(value, np.ndarray):
        return bool(value.dtype.kind == "f")
    return isinstance(value, float)

"""Reading a scene of any world."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, overload

from rungwise.keywords import keywords
from rungwise.scene import scene as planar
from rungwise.scene.contract import AnyScene
from rungwise.scene.dimensions.check import check_dimensions
from rungwise.scene.errors import SceneError
from rungwise.scene.fields.values import shown
from rungwise.scene.scene import Scene
from rungwise.scene.space import SpaceScene, is_space, load_space
from rungwise.scene.space.read import shipped_in_space
from rungwise.scene.worlds import is_of_world, load_of_world


@overload
def load(source: Scene, *, settle: bool = False) -> Scene: ...
@overload
def load(source: SpaceScene, *, settle: bool = False) -> SpaceScene: ...
@overload
def load(source: AnyScene | str | Path | Mapping[str, Any], *, settle: bool = False) -> AnyScene: ...
@keywords
def load(source: AnyScene | str | Path | Mapping[str, Any], *, settle: bool = False) -> AnyScene:
    """Read a scene. `source`: the name of a shipped scene, the path of a YAML file, or its content as a
    mapping; or, in space, from a model file (MJCF or URDF). A scene that has been read is returned as it is.
    Drawings and model files are looked for beside the YAML file, for a mapping in the working folder. Content
    with a field `world` is read by the world of that name (see `add_world`). `settle`: a scene in space
    begins at the nearest places without overlap, with equalities closed and joints within their ranges, as
    where it states ``start: {settle: true}``.

    Raises SceneError: one line that names the field and its valid values.
    """
    scene = _read(source)
    if scene is not source:
        check_dimensions(scene)
    if not settle:
        return scene
    if not isinstance(scene, SpaceScene):
        raise SceneError(f"settle: works for scenes in space only, and {scene.name} is not in space")
    start = scene.file.start.model_copy(update={"settle": True})
    return replace(scene, file=scene.file.model_copy(update={"start": start}))


def _read(source: AnyScene | str | Path | Mapping[str, Any]) -> AnyScene:
    if isinstance(source, AnyScene):
        return source
    if not isinstance(source, str | Path | Mapping):
        if not hasattr(source, "world"):
            raise SceneError(f"scene: must be a name, a path or a mapping, not {shown(source)}")
        return source
    named = _content(source)
    if is_of_world(named):
        return load_of_world(named)
    if is_space(source):
        return load_space(source)
    return planar.read(source, sorted((*planar.shipped(), *shipped_in_space())))


def _content(source: str | Path | Mapping[str, Any]) -> Any:
    """The content of a mapping, or of a YAML file; None of anything else, and of scenes that ship."""
    if isinstance(source, Mapping):
        return source
    is_file = Path(source).suffix.lower() in (".yaml", ".yml") and Path(source).is_file()
    return planar.read_yaml("scene", source) if is_file else None


def load_planar(source: AnyScene | str | Path | Mapping[str, Any]) -> Scene:
    """A planar scene. Raises SceneError as `load` does, and for scenes of other worlds."""
    scene = load(source)
    if not isinstance(scene, Scene):
        raise SceneError(f"scene: {scene.name} is not planar; this works for planar scenes only")
    return scene


def load_in_space(source: AnyScene | str | Path | Mapping[str, Any]) -> SpaceScene:
    """A scene in space. Raises SceneError as `load` does, and for scenes of other worlds."""
    scene = load(source)
    if not isinstance(scene, SpaceScene):
        raise SceneError(f"scene: {scene.name} is not in space; this works for scenes in space only")
    return scene

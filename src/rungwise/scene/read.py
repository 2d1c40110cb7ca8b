"""Reading a scene of either kind."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rungwise.keywords import keywords
from rungwise.scene import scene as planar
from rungwise.scene.contract import AnyScene
from rungwise.scene.errors import SceneError
from rungwise.scene.fields.values import shown
from rungwise.scene.scene import Scene
from rungwise.scene.space import is_space, load_space
from rungwise.scene.space.read import shipped_in_space


@keywords
def load(source: AnyScene | str | Path | Mapping[str, Any]) -> AnyScene:
    """Read a scene: from the name of a shipped scene, the path of a YAML file, or its content as a mapping;
    or, in space, from a model file (MJCF or URDF). A scene that has been read is returned as it is. Drawings
    and model files are looked for beside the YAML file, for a mapping in the working folder.

    Raises SceneError: one line that names the field and its valid values.
    """
    if not isinstance(source, str | Path | Mapping):
        if not hasattr(source, "world"):
            raise SceneError(f"scene: must be a name, a path or a mapping, not {shown(source)}")
        return source
    if is_space(source):
        return load_space(source)
    return planar.read(source, sorted((*planar.shipped(), *shipped_in_space())))


def load_planar(source: AnyScene | str | Path | Mapping[str, Any]) -> Scene:
    """A planar scene. Raises SceneError as `load` does, and for scenes of other worlds."""
    scene = load(source)
    if not isinstance(scene, Scene):
        raise SceneError("scene: is in space, and what is asked is known of planar scenes only")
    return scene

"""Reading a scene of either kind."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rungwise.keywords import keywords
from rungwise.scene import scene as planar
from rungwise.scene.scene import Scene
from rungwise.scene.space import SpaceScene, is_space, load_space
from rungwise.scene.space.read import shipped_in_space


@keywords
def load(source: Scene | SpaceScene | str | Path | Mapping[str, Any]) -> Scene | SpaceScene:
    """Read a scene: from the name of a shipped scene, the path of a YAML file, or its content as a mapping;
    or, in space, from a model file (MJCF or URDF). A scene that has been read is returned as it is. Drawings
    and model files are looked for beside the YAML file, for a mapping in the working folder.

    Raises SceneError: one line that names the field and its valid values.
    """
    if is_space(source):
        return load_space(source)  # type: ignore[arg-type]
    return planar.read(source, sorted((*planar.shipped(), *shipped_in_space())))  # type: ignore[arg-type]

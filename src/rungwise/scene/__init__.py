"""Scenes: descriptions of manipulation tasks, read from YAML, checked, and bound to numbers."""

from rungwise.scene.builder import parts
from rungwise.scene.builder.builder import SceneBuilder
from rungwise.scene.errors import SceneError
from rungwise.scene.scene import Bound, InvalidScene, Scene, load, schema, shipped

__all__ = [
    "Bound",
    "InvalidScene",
    "Scene",
    "SceneBuilder",
    "SceneError",
    "load",
    "parts",
    "schema",
    "shipped",
]

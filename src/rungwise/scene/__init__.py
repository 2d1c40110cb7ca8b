"""Scenes: descriptions of manipulation tasks, read from YAML, checked, and bound to numbers."""

from rungwise.scene import parts
from rungwise.scene.draft import SceneBuilder
from rungwise.scene.scene import Bound, InvalidScene, Scene, load, schema, shipped
from rungwise.scene.template import SceneError

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

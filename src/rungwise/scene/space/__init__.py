"""Scenes in space: a model file (MJCF or URDF), and what a task adds to it."""

from rungwise.scene.space.bind import SpaceBound
from rungwise.scene.space.read import is_space, load_space
from rungwise.scene.space.scene import SpaceScene

__all__ = ["SpaceBound", "SpaceScene", "is_space", "load_space"]

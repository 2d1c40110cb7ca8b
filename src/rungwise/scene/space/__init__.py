"""Scenes in space: a model file (MJCF or URDF), and what a task adds to it."""

from rungwise.scene.space.scene import SpaceBound, SpaceScene, is_space, load_space

__all__ = ["SpaceBound", "SpaceScene", "is_space", "load_space"]

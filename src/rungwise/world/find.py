"""The world of a scene."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from rungwise.world.contract import World


def world_of(scene: Any) -> World:
    """The world of a scene, from the module that the scene names."""
    world: World = import_module(scene.world).world(scene)
    return world

"""The world of a scene, and whether there is one at the ends of its parameters' intervals."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from itertools import islice, product
from typing import Any

from rungwise.errors import InputError
from rungwise.world.contract import World

CORNERS = 256
"""Corners of a box that are tried at most: all of eight parameters."""


def world_of(scene: Any) -> World:
    """The world of a scene, from the module that the scene names."""
    world: World = import_module(scene.world).world(scene)
    return world


def impossible(
    scene: Any, box: Mapping[str, tuple[float, float]], parameters: Mapping[str, float]
) -> str:  # fmt: skip
    """What is wrong with the scene, and where, at the first corner of the box at which it cannot be; empty
    where there is none."""
    for corner in islice(product(*box.values()), CORNERS):
        values = dict(zip(box, corner, strict=True))
        try:
            world_of(scene).place({**parameters, **values})
        except InputError as error:
            return f"{error} (at {', '.join(f'{name} {value:g}' for name, value in values.items())})"
    return ""

"""Worlds of scenes that this package does not know: by the name that a scene's field `world` gives.

A name is known once its module is: by `add_world` in Python, or by an entry point `rungwise.worlds` of a
package that is installed. A scene file never names a module: nothing is imported because a file says so.
"""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from importlib.metadata import entry_points
from typing import Any, Protocol, cast

from rungwise.scene.contract import AnyScene
from rungwise.scene.errors import SceneError
from rungwise.scene.fields.values import shown
from rungwise.wording import choices

GROUP = "rungwise.worlds"
"""Entry points that name modules of worlds."""
_added: dict[str, str] = {}


class WorldModule(Protocol):
    """The module of a world; see `world.contract.World` for what its `world` makes."""

    def load(self, data: Mapping[str, Any]) -> AnyScene:
        """Read a scene of this world. Raises SceneError."""

    def world(self, scene: Any) -> Any:
        """The world of a scene."""


def add_world(name: str, module: str) -> None:
    """Make the world in an importable module known under a name, in this process; a name given before is
    overwritten."""
    _added[name] = module


def worlds() -> dict[str, str]:
    """Modules of worlds by name."""
    return {each.name: each.value for each in entry_points(group=GROUP)} | _added


def is_of_world(source: object) -> bool:
    """Whether the content of a scene names a world."""
    return isinstance(source, Mapping) and "world" in source


def load_of_world(data: Mapping[str, Any]) -> AnyScene:
    """A scene of the world that its content names. Raises SceneError."""
    known = worlds()
    if not isinstance(data["world"], str) or data["world"] not in known:
        raise SceneError(
            f"world: unknown {shown(data['world'])}{choices(data['world'], known)}; a package makes its own"
            " known by an entry point, and Python by rungwise.add_world"
        )
    module = cast(WorldModule, import_module(known[data["world"]]))
    return module.load(data)

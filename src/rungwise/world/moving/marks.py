"""Places by which motions are compared: coordinates."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from rungwise.kernel import Reals
from rungwise.scene.contract import AnyScene


@dataclass(frozen=True)
class Coordinates:
    """The coordinates of a scene, each a place on a line."""

    names: tuple[str, ...]

    def __call__(self, q: Reals) -> Reals:
        """Places (..., n, 1) of states q (..., n)."""
        return q[..., None]


def coordinates_of(scene: AnyScene, _parameters: Mapping[str, float]) -> Coordinates:
    """The coordinates of a scene, whatever its parameters."""
    return Coordinates(scene.template.coordinates)

"""A scene in space at given parameters, ready to run again and again."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from rungwise.scene.space import SpaceBound, SpaceScene
from rungwise.system.spatial.space import Laws, Space

OWN = 1_000_000
"""Bytes beside those of the model, as measured on scenes of a few bodies."""


class Prepared(NamedTuple):
    """A bound scene and its system, which one run at a time may use."""

    bound: SpaceBound
    system: Space

    @property
    def bytes(self) -> int:
        """Memory that it takes, about."""
        return OWN + int(self.system.model.nbuffer + self.system.data.nbuffer)

    @classmethod
    def of(cls, scene: SpaceScene, parameters: Mapping[str, float]) -> Prepared:
        """Raises InvalidScene, naming the field, where the scene is impossible at these parameters."""
        bound = scene.bind(parameters)
        laws = Laws(bound.law, bound.laws, bound.named)
        start = bound.place, bound.motion, bound.numbers, bound.activation
        return cls(bound, Space(bound.model, laws, *start))

"""Rollouts of scenes in space."""

from __future__ import annotations

from dataclasses import dataclass

from rungwise.scene.space import SpaceScene
from rungwise.world.moving.rollouts import MovingRollouts


@dataclass(frozen=True, repr=False)
class SpaceRollouts(MovingRollouts):
    """Rollouts of a scene in space, as of `Rolled`."""

    scene: SpaceScene

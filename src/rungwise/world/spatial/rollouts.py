"""Rollouts of scenes in space."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

from rungwise.scene.space import SpaceScene
from rungwise.world.moving.rollouts import MovingRollouts
from rungwise.world.moving.rollouts import rollout as moving_rollout
from rungwise.world.spatial.runs import SpatialRuns


@dataclass(frozen=True, repr=False, eq=False)
class SpaceRollouts(MovingRollouts):
    """Rollouts of a scene in space, as of `Rolled`."""

    scene: SpaceScene


rollout = partial(moving_rollout, SpaceRollouts, SpatialRuns)
"""The runs that are asked for (see `rungwise.rollout`)."""

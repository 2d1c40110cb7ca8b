"""The world of scenes in space: bodies of a MuJoCo model."""

from rungwise.world.spatial.world import SpatialWorld as world

__all__ = ["world"]

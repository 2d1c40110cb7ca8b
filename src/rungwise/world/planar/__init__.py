"""The world of planar scenes."""

from rungwise.world.planar.world import PlanarWorld as world

__all__ = ["world"]

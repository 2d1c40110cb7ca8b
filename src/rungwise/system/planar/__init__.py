"""The planar system: rigid bodies in SE(2) with outlines that are rounded convex polygons."""

"""Pictures of planar runs."""

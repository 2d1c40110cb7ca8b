"""Outlines from drawings, and outlines as convex pieces."""

"""Meshes that are not convex: how much of their hulls they leave out, and convex pieces in their place."""

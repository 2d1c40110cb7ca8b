"""Measured motions: read, laid out for a scene, and cut into spans."""

"""Derivatives of a step, and of several."""

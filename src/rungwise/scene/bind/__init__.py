"""Binding: every number of a scene known."""

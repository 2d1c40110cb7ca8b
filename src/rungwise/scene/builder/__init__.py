"""Scenes built in Python."""

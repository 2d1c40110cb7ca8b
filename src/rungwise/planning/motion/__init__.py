"""Moves of robots and objects: how they are propagated, where robots push, ways through free space."""

"""Runs of scenes in space: a Python loop around the core's kernels and MuJoCo's."""

"""Solvers of contact problems, one file each."""

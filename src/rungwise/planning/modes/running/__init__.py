"""Legs that trees propose, run on a rung, one by one."""

"""Feasible, doomed and unsafe sets of a scene's parameters, for every rung."""

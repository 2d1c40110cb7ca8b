"""Numbers that several solvers share: those of methods that follow the path of the cones' products, and those
of Newton's method. Chosen by trial."""

from __future__ import annotations

FORCE, RATE = 10.0, 1.0
"""The first z and w of an interior point method, times the unit of the cones, over the root of their number,
or in units of the energy of the rates without forces."""
TO_THE_BOUNDARY, RETAINED = 0.95, 0.7
"""The fraction to the boundary, a share of the longest step inside the cones, a little below 1 as usual in
interior point methods; and the share of the centring by which faults remain."""
SHORT = 0.1
"""A step shorter than this is repeated with slips held: where they turn fast, their derivative misleads.
As a share of the whole step."""
STALLED = 0.7
"""A method ends where what must fall is above this share of its value a window of steps earlier."""
FINISH, NEARER = 1e-2, 0.1
"""Residual, in scaled units, below which Newton steps, or another method, first try to finish from a path;
and the factor by which the residual must fall before the next try. To a decade."""
HALVINGS, CHORDS = 7, 3
"""Most lengths of a Newton step, and most steps with old factors."""

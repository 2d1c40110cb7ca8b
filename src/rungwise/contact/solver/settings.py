"""All numbers of the contact solver."""

from __future__ import annotations

GOAL, ENOUGH = 1e-15, 1e-9
"""Residual at which the solver ends, and at which it ends where the residual falls by half no more."""
WEDGED = 1e8
"""Forces over what loads, demanded rates and limits call for, at most: beside greater ones any error is
small."""
GUESS = 1e-8
"""Weight of the proximal term of the first Newton steps, which take the active set from the forces given."""
WEIGHT, LEAST, MOST = 1e-2, 1e-10, 1e1
"""Weight of the proximal term at first, at least, and at most: yield added to each group, which yields
one."""
CHANGE = 0.1
"""Factor on the weight after a proximal problem that is solved; its inverse after one that is not."""
GUESSES, STEPS, PROBLEMS, LENGTHS = 3, 20, 60, 8
"""Newton steps of the first guess, of a proximal problem, proximal problems, and lengths of a step that a
line search tries."""
NEWTON_STEPS = 10_000
"""Newton steps of an island at most, with all starts."""
STARTS, GIVEN = 4, 2
"""Starts at most; and those from what is given, before those from the ends of paths."""
HELD = 3
"""Proximal problems that are solved before a weight is tried again that was too little."""
ROUNDING = 1e-14
"""Size of the map that is rounding, where the greatest load or demanded rate is one."""
NOTHING = 1e-12
"""Part of the greatest rate, and of what the greatest force does in a row of balance, that is no motion."""
SLOW, CORRECTIONS = 1e-6, 8
"""Residual of rest under the forces of an answer up to which rest is tried in its place; and corrections of
these forces."""
WIDE = 60
"""Velocities from which on the matrix is kept by its blocks."""
SMOOTH, FINEST = 1.0, 1e-9
"""Smoothing of the map at the begin and at the end of a path, as a force in the units of the groups."""
FASTER, SLOWER = 0.2, 0.9
"""First factor on the smoothing; and the factor that is too near to one to go on."""
PATH, SHORT = 80, 6
"""Points of a path, and Newton steps of each, at most."""

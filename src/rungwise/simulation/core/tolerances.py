"""Numbers that both loops share: the planar one, and the one of any other system.

Lengths are over the system's length (the reach of the smallest shape in the plane).
"""

EXACT = 1e-9
"""Overlap, and in the plane opening of joints over their levers, up to which a kinematic step is not
linearised again."""
OVERLAP = 1e-4
"""Overlap beyond which a rigid step that adds to it is halved."""
NEAR = 1e-4
"""Gaps below this count as closed (in the plane over the longest lever)."""
LINEARISATIONS = 12
"""Solutions of one attempt, each linear about the end of the solution before."""
PAUSE = 2.0
"""Nominal steps: an approach no faster than loads cause within them is rest, and does not bounce."""
SINKING = 0.1
"""Deformation beyond which the compliant model fails; in the plane at most this part of half the thickness of
the pair."""
ROUNDING = 1e-12
"""Rounding of positions, over the extent of the scene, or the system's length."""
DRIVEN = 4.0
"""Displacement over the farthest of what is driven, from which on it may be a leap."""
ACROSS = 1e-3
"""How far across the edge of the range of a pull a step ends that crosses it, over the range."""
SHORTER = 1.0 / 16.0
"""Part of a step in which what vanishes with the step moves less than half as far, and a jump is as large."""
MAX_HALVINGS = 60
"""Halvings of one step, at most: to rounding of its time."""

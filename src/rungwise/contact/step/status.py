"""What comes of a step's problem."""

from __future__ import annotations

TOLERANCE = 1e-8
"""Residual, without unit, up to which a step is solved. Chosen by trial, to a decade."""
SOLVED, NO_SOLUTION = 0, 1
GUESS, PROXIMAL = 0, 1
"""What answered: the active set of the start, or proximal problems after it."""

"""Contact modes: which stratum of the state space a contact is on.

A force-limited row uses the same numbers: STICK it holds, FORWARD and BACKWARD it slips at its limit.
"""

from __future__ import annotations

OPEN, STICK, FORWARD, BACKWARD = 0, 1, 2, 3
NAMES = ("open", "stick", "forward", "backward")
"""FORWARD slips along the tangent (friction acts backward), BACKWARD against it."""

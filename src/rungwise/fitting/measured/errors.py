"""What is wrong with measured motions."""

from __future__ import annotations

from rungwise.errors import InputError


class MotionError(InputError):
    """Measured motions are not well formed, or do not fit the scene; one line that names the place."""

"""What every refusal of wrong input has in common."""

from __future__ import annotations


class InputError(ValueError):
    """Wrong input: one line that names the field, and the valid choices."""

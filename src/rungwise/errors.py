"""The common base of all errors about wrong input."""

from __future__ import annotations


class InputError(ValueError):
    """Wrong input: one line that names the field, and the valid choices."""

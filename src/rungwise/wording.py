"""Words that errors about wrong input have in common."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches

MOST, LIKE = 40, 0.6
"""Most names that a message lists, and how much alike two spellings must be (see `difflib`)."""


def choices(given: object, valid: Iterable[object]) -> str:
    """How a message goes on after an unknown name: the valid name that is spelt most like it, if there is
    one, and all that are valid."""
    names = [str(name) for name in valid]
    alike = {name.lower(): name for name in reversed(names)}
    near = get_close_matches(given[:60].lower(), alike, 1, LIKE) if isinstance(given, str) else []
    meant = f" (did you mean {alike[near[0]]}?)" if near else ""
    return f"{meant}; valid: {listed(names)}"


def listed(names: Iterable[object]) -> str:
    """Names as a message lists them: the first forty."""
    many = [str(name) for name in names]
    return ", ".join(many[:MOST]) + (", ..." if len(many) > MOST else "") if many else "none"

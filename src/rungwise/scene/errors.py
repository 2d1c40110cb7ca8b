"""Errors of scenes, and of numbers out of their bounds."""

from __future__ import annotations

import math

from rungwise.errors import InputError

STRICT, MAY_BE_INFINITE = 1, 2


class SceneError(InputError):
    """A scene, or a value given for it, is wrong; the text is one line that names the field."""


def out_of_range(value: float, low: float, high: float, kinds: int) -> str | None:
    """What is wrong with a number, in words; None for one that keeps its bounds."""
    if math.isnan(value):
        return "must be a number, not nan"
    if math.isinf(value) and not kinds & MAY_BE_INFINITE:
        return f"must be finite, not {value:g}"
    if low <= value <= high and not (kinds & STRICT and value == low):
        return None
    sign = ">" if kinds & STRICT else ">="
    bounds = f"{sign} {low:g}" + (f" and <= {high:g}" if math.isfinite(high) else "")
    return f"{value:g} must be {bounds}"

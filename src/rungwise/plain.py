"""Plain values as JSON text."""

from __future__ import annotations

import json
import math


def json_text(value: object, indent: int | None = None) -> str:
    """`value` as JSON, with null for infinity and NaN, which JSON does not have."""
    return json.dumps(_finite(value), indent=indent, allow_nan=False)


def _finite(value: object) -> object:
    match value:
        case dict():
            return {key: _finite(item) for key, item in value.items()}
        case list() | tuple():
            return [_finite(item) for item in value]
        case float() if not math.isfinite(value):
            return None
    return value

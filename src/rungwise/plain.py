"""Plain values as JSON text, and objects as short ones."""

from __future__ import annotations

import html
import json
import math
from collections.abc import Iterable, Mapping
from dataclasses import fields
from typing import Any

LONGEST, WIDEST = 60, 400
"""Most characters of a value in a short text, and of all its values."""


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


def brief(thing: Any) -> str:
    """A dataclass in one short line: its fields, arrays by their shape, what is long cut off."""
    parts = [f"{f.name}={_short(getattr(thing, f.name))}" for f in fields(thing) if f.repr]
    return f"{type(thing).__name__}({cut(', '.join(parts), WIDEST)})"


def run_of(thing: Any, rest: str) -> str:
    """What runs, or ran, in one short line: its kind, scene and model, and the rest."""
    return f"<{type(thing).__name__} of {cut(thing.scene.name)} on {cut(thing.model.name)}: {rest}>"


def cut(text: str, most: int = LONGEST) -> str:
    """The text on one line, cut off after so many characters."""
    text = " ".join(text.split())
    return text if len(text) <= most else text[: most - 3] + "..."


def _short(value: Any) -> str:
    match value:
        case float():
            return f"{value:.6g}"
        case str() | None | bool() | int():
            return cut(repr(value))
        case list() | tuple() | Mapping() if len(value) > 4:
            return f"{len(value)} of them"
    if hasattr(value, "shape") and hasattr(value, "dtype"):
        return f"array {tuple(value.shape)}"
    if isinstance(value, list | tuple):
        return f"({', '.join(_short(item) for item in value)})"
    return cut(repr(value))


def table(title: str, rows: Iterable[tuple[str, object]]) -> str:
    """A small table of names and values as HTML."""
    lines = [
        f"<tr><td style='text-align:left'><b>{html.escape(name)}</b></td>"
        f"<td style='text-align:left'>{html.escape(str(value))}</td></tr>"
        for name, value in rows
    ]
    return f"<table><caption>{html.escape(title)}</caption>{''.join(lines)}</table>"

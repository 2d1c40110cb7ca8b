"""Equality by content, of results that hold arrays."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np


class ByContent:
    """Base of frozen dataclasses (with ``eq=False``) that are equal where they are of one class and all that
    they hold is: arrays by shape and values, nan equal to nan. Fields with ``compare=False`` do not count."""

    def __eq__(self, other: object) -> bool:
        if type(self) is not type(other):
            return NotImplemented
        return self is other or _same_fields(self, other)

    def __hash__(self) -> int:
        held = ((f.name, getattr(self, f.name)) for f in fields(self) if f.compare)  # type: ignore[arg-type]
        return hash((type(self).__name__, *((name, value) for name, value in held if _is_plain(value))))


def _is_plain(value: object) -> bool:
    """Whether equal values have equal hashes: nan, to name one, has as many as there are objects."""
    return isinstance(value, str | int | None) or (isinstance(value, float) and value == value)


def _same_fields(a: Any, b: Any) -> bool:
    return all(same(getattr(a, f.name), getattr(b, f.name)) for f in fields(a) if f.compare)


def same(a: object, b: object) -> bool:
    """Whether two values are equal in content."""
    if a is b:
        return True
    if isinstance(a, np.ndarray) or isinstance(b, np.ndarray):
        return _same_arrays(a, b)
    if type(a) is not type(b):
        return isinstance(a, int | float) and isinstance(b, int | float) and a == b
    if isinstance(a, float):
        return a == b or (a != a and b != b)
    if isinstance(a, Mapping) and isinstance(b, Mapping):
        return a.keys() == b.keys() and all(same(value, b[key]) for key, value in a.items())
    if isinstance(a, list | tuple) and isinstance(b, list | tuple):
        return len(a) == len(b) and all(same(one, other) for one, other in zip(a, b, strict=True))
    if type(a).__eq__ is object.__eq__ and not callable(a):
        return hasattr(a, "__dict__") and same(vars(a), vars(b))
    if is_dataclass(a) and getattr(type(a), "__dataclass_params__").eq:  # noqa: B009
        return _same_fields(a, b)
    return bool(a == b)


def _same_arrays(a: object, b: object) -> bool:
    if not (isinstance(a, np.ndarray) and isinstance(b, np.ndarray)):
        return False
    if a.dtype.kind != b.dtype.kind or a.shape != b.shape:
        return False
    if a.dtype.kind == "O":
        return all(map(same, a.ravel().tolist(), b.ravel().tolist()))
    return np.array_equal(a, b, equal_nan=a.dtype.kind in "fc")

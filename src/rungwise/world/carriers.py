"""Robots that a task leads through free space: what places them, and the inputs that drive these places."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from rungwise.errors import InputError
from rungwise.kernel import Reals


class TaskError(InputError):
    """The scene has no task, or the task cannot be: one line that names the field."""


@dataclass(frozen=True)
class Carrier:
    """A robot that is led through free space: its body, the coordinates (k,) that place it, x and y in the
    plane, joints in space, and the inputs that drive them. Their speeds, or with `by_place` the targets of
    their servos, are matrix (k, k) @ inputs + zero (k,). Then the lengths and the angle of its pushes."""

    body: str
    places: tuple[int, ...]
    columns: tuple[int, ...]
    matrix: Reals
    zero: Reals
    by_place: bool
    speed: float
    clearance: float
    push: tuple[float, float]
    lean: float

    def levels(self, speeds: Reals, places: Reals) -> Reals:
        """Inputs (m, k) that lead it at these speeds (m, k), or to these places (m, k)."""
        wanted = places if self.by_place else speeds
        return np.asarray((wanted - self.zero) @ np.linalg.inv(self.matrix).T)


def pair(numbers: Mapping[str, float], path: str) -> tuple[float, float]:
    """Least and greatest value. Raises TaskError where they are not in this order."""
    low, high = numbers[f"{path}.0"], numbers[f"{path}.1"]
    if low > high:
        raise TaskError(f"{path}: the least, {low:g}, is above the greatest, {high:g}")
    return low, high


def pushes_of(name: str, numbers: Mapping[str, float]) -> dict[str, Any]:
    """Speed, clearance, lean and lengths of pushes of a robot in `transit`."""
    path = f"task.transit.{name}"
    own = {each: numbers[f"{path}.{each}"] for each in ("speed", "clearance", "lean")}
    return {**own, "push": pair(numbers, f"{path}.push")}

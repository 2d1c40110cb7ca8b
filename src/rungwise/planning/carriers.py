"""Robots that a task leads through free space: what places them, and the inputs that drive these places."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from rungwise.errors import InputError
from rungwise.kernel import Reals
from rungwise.scene import Bound, Scene
from rungwise.scene.expression import STACK
from rungwise.scene.numbers import evaluate_numbers
from rungwise.scene.records import SERVO, SPEED
from rungwise.scene.space import SpaceBound, SpaceScene
from rungwise.system.spatial.drives import joints_of, targets


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


def carrier_in_plane(scene: Scene, name: str, bound: Bound, numbers: Mapping[str, float]) -> Carrier:
    """A robot to lead through free space. Raises TaskError for one whose x and y no two inputs drive."""
    path, x = f"task.transit.{name}", scene.template.coordinates.index(f"{name}.x")
    kinds = bound.records.coordinates["drive"][x : x + 2].tolist()
    columns, matrix, zero = _followed(scene, x, bound)
    speeds = kinds == [SPEED, SPEED] and not zero.any()
    if len(columns) != 2 or np.linalg.matrix_rank(matrix) < 2 or not (speeds or kinds == [SERVO, SERVO]):
        raise TaskError(
            f"{path}: needs two inputs that drive the speeds of {name}.x and {name}.y, or the targets of"
            " their servos, linearly"
        )
    return Carrier(
        body=name, places=(x, x + 1), columns=tuple(columns), matrix=matrix, zero=zero, by_place=not speeds,
        **_pushes(name, numbers),
    )  # fmt: skip


def _pushes(name: str, numbers: Mapping[str, float]) -> dict[str, Any]:
    """Speed, clearance, lean and lengths of pushes of a robot in `transit`."""
    path = f"task.transit.{name}"
    own = {each: numbers[f"{path}.{each}"] for each in ("speed", "clearance", "lean")}
    return {**own, "push": pair(numbers, f"{path}.push")}


def carrier_in_space(
    scene: SpaceScene, name: str, bound: SpaceBound, numbers: Mapping[str, float]
) -> Carrier:
    """A body to lead through free space by its joints. Raises TaskError where inputs do not drive these."""
    joints = joints_of(bound.model, scene.template.bodies.index(name))
    matrix, zero, by_place = _followed_in_space(scene, joints, bound)
    columns = np.flatnonzero(np.abs(matrix).any(axis=0)).tolist()
    matrix = matrix[:, columns]
    k = len(joints)
    if not k or len(columns) != k or np.linalg.matrix_rank(matrix) < k or not (by_place or not zero.any()):
        own = [scene.template.velocities[v] for v in bound.model.jnt_dofadr[joints].tolist()]
        raise TaskError(
            f"task.transit.{name}: needs inputs, one for each of {', '.join(own) or 'its joints'}, that drive"
            " their speeds, or the targets of their servos, linearly and whatever the time"
        )
    places = tuple(bound.model.jnt_qposadr[joints].tolist())
    return Carrier(
        body=name, places=places, columns=tuple(columns), matrix=matrix, zero=zero, by_place=by_place,
        **_pushes(name, numbers),
    )  # fmt: skip


def _followed_in_space(scene: SpaceScene, joints: list[int], bound: SpaceBound) -> tuple[Reals, Reals, bool]:
    """The matrix (k, u) and zero (k,) by which targets or speeds of joints follow the inputs, nan where they
    do not, or not linearly; and whether they are targets."""
    columns = [scene.template.parameters.index(name) for name in scene.template.inputs]

    def followed(levels: Reals, time: float) -> Reals:
        values = bound.values.copy()
        values[columns], values[-1] = levels, time
        bound.tell(values)
        pace = bound.pace[bound.model.jnt_dofadr[joints]]
        return targets(bound, joints) if np.isnan(pace).all() else pace

    size = len(columns)
    zero = followed(np.zeros(size), 0.0)
    matrix = np.array([followed(one, 0.0) - zero for one in np.eye(size)]).T.reshape(len(joints), size)
    trial = np.random.default_rng(0).uniform(-1.0, 1.0, size)
    same = all(
        np.allclose(followed(trial, time), matrix @ trial + zero, rtol=1e-9, atol=1e-12)
        for time in (0.0, 1.0)
    )
    bound.tell(bound.values)
    by_place = bool(np.isnan(bound.pace[bound.model.jnt_dofadr[joints]]).all())
    return (matrix if same else np.zeros_like(matrix)), zero, by_place


def _followed(scene: Scene, x: int, bound: Bound) -> tuple[list[int], Reals, Reals]:
    """The inputs that the speeds, or the targets, of the coordinates x and x + 1 follow, the matrix, and what
    they are where these inputs are 0; no inputs where they are no linear functions of them."""
    template, drives = scene.template, bound.records.coordinates[x : x + 2]
    columns = [template.parameters.index(name) for name in template.inputs]

    def followed(levels: Reals) -> Reals:
        values = bound.values.copy()
        values[columns] = levels
        for numbers in (template.timed_speeds(), template.timed_numbers()):
            evaluate_numbers(numbers, values, np.zeros(STACK), bound.buffer)
        return np.where(drives["drive"] == SPEED, drives["drive_speed"], drives["target"])

    size = len(columns)
    zero = followed(np.zeros(size))
    matrix = np.array([followed(one) - zero for one in np.eye(size)]).T
    trial = np.random.default_rng(0).uniform(-1.0, 1.0, size)
    is_linear = np.allclose(followed(trial), matrix @ trial + zero, rtol=1e-9, atol=0.0)
    used = [k for k in range(size) if matrix[:, k].any()] if is_linear else []
    return used, matrix[:, used], zero

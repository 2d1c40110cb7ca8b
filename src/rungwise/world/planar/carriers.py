"""Robots of a planar scene that a task leads through free space."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from rungwise.kernel import Reals
from rungwise.scene import Bound, Scene
from rungwise.scene.language.expression import STACK
from rungwise.scene.template.numbers import evaluate_numbers
from rungwise.scene.template.records import SERVO, SPEED
from rungwise.world.carriers import Carrier, TaskError, pushes_of


def carrier(scene: Scene, name: str, bound: Bound, numbers: Mapping[str, float]) -> Carrier:
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
        **pushes_of(name, numbers),
    )  # fmt: skip


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

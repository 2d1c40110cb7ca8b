"""Robots that a task leads through free space: what places them, and the inputs that drive these places;
what they and objects touch there."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import numpy as np

from rungwise.errors import InputError
from rungwise.kernel import Ints, Reals


class TaskError(InputError):
    """The scene has no task, or the task cannot be: one line that names the field."""


class Link(NamedTuple):
    """A joint of a robot's chain in the plane: it turns about the point `at` (2,), or where it `slides` moves
    along `axis` (2,), both in the world where all joints are at 0; lower and upper bound it."""

    name: str
    slides: bool
    at: Reals
    axis: Reals
    lower: float
    upper: float


@dataclass(frozen=True)
class Driven:
    """How inputs place a robot.

    body: the robot; places (k,): the coordinates that place it: x and y in the plane, joints in space;
    columns (u,): the inputs that drive these. Their speeds, or with `by_place` the targets of their servos,
    are matrix (k, u) @ inputs + zero (k,), with u = k. stiffness, limit (k,): of the servos, in force per
    place and in force, infinite where speeds are given; reach: how far the body reaches from its centre.
    A robot of joints in the plane has its `links` (k,), from the ground on, which then take the part of
    places in all of these, and `home` (3,): the pose of its centre of mass where all joints are at 0; its
    `places` are those of its body's x and y all the same.
    """

    body: str
    places: tuple[int, ...]
    columns: tuple[int, ...]
    matrix: Reals
    zero: Reals
    by_place: bool
    stiffness: Reals
    limit: Reals
    reach: float
    links: tuple[Link, ...]
    home: Reals

    def levels(self, speeds: Reals, places: Reals) -> Reals:
        """Inputs (m, u) that lead it at these speeds (m, k), or to these places (m, k)."""
        wanted = places if self.by_place else speeds
        return np.asarray((wanted - self.zero) @ np.linalg.inv(self.matrix).T)

    def poses(self, joints: Reals) -> Reals:
        """Poses (m, 3) of its centre of mass in the plane, with its `links` at these places (m, k)."""
        found = np.repeat(self.home[None], len(joints), axis=0)
        for link, by in zip(self.links[::-1], joints.T[::-1], strict=True):
            if link.slides:
                found[:, :2] += by[:, None] * link.axis
                continue
            x, y = (found[:, :2] - link.at).T
            found[:, 0] = link.at[0] + np.cos(by) * x - np.sin(by) * y
            found[:, 1] = link.at[1] + np.sin(by) * x + np.cos(by) * y
            found[:, 2] += by
        return found


@dataclass(frozen=True)
class Carrier(Driven):
    """A robot that is led through free space, with the lengths and the angle of its pushes."""

    speed: float
    clearance: float
    push: tuple[float, float]
    lean: float


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


class Surfaces(NamedTuple):
    """Friction of supports at one place: lengths (r, n_v) whose rates it resists, and its greatest forces
    (r,); rows of one body share a limit surface."""

    rows: Reals
    limits: Reals


class Touches(NamedTuple):
    """What is nearer than asked at one place, and what acts there: pairs (k,) of the scene's contacts;
    features (k,), numbers that stay while the same parts of shapes are nearest; gaps (k,); points and normals
    (k, d), from the second body to the first; rows (k, d, n_v): rates of the gap, then of slip, per unit of
    each velocity; friction (k,); the least gaps (c,) of all pairs; poses (b, 3) of the bodies: centre of mass
    and angle; weight and given forces (n_v,); and friction of supports."""

    pairs: Ints
    features: Ints
    gaps: Reals
    points: Reals
    normals: Reals
    rows: Reals
    friction: Reals
    least: Reals
    poses: Reals
    loads: Reals
    supports: Surfaces


class Outline(Protocol):
    """The outline of a body in the frame of its centre of mass, by parts 0..1 of its length."""

    def __call__(self, part: Reals) -> tuple[Reals, Reals]:
        """Points (m, d) and outward normals (m, d) at parts (m,)."""

    def part_of(self, point: Reals) -> tuple[float, float]:
        """The part next to a point (d,), and how far, 0..1, it is from where the outline has corners."""


class Surroundings(Protocol):
    """What touches what in a scene at one set of parameters, and the forces that act there. stiffness, limit
    (n_v,): of the servos of coordinates, 0 and infinite where there are none; owners (n_v,): the body of each
    coordinate."""

    stiffness: Reals
    limit: Reals

    @property
    def owners(self) -> Ints: ...

    def touches(self, q: Reals, within: float) -> Touches:
        """What is nearer than `within` at a place (n_q,)."""

    def loads(self, q: Reals) -> Reals:
        """Weight and given forces (n_v,) at a place (n_q,)."""

    def poses(self, q: Reals) -> Reals:
        """Poses (b, 3) of the bodies at a place (n_q,): centre of mass and angle."""

    def outline(self, body: int) -> Outline:
        """The outline of a body, by its number. Raises ValueError for one without."""

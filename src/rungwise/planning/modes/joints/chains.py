"""Arms: which coordinates their joints move, and the joints at a place."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol, TypeAlias

import numpy as np
from numpy.typing import NDArray

from rungwise.kernel import Ints, Reals
from rungwise.planning.task.task import Task
from rungwise.world.carriers import Driven, Link
from rungwise.world.find import world_of

Flags: TypeAlias = NDArray[np.bool_]


class Chain(Protocol):
    """Joints (k,) that lead a finger: the columns of the velocities that they move (m,), and of the
    coordinates (p,); units (k,): how far a joint goes in a step, over another's."""

    @property
    def columns(self) -> Ints: ...

    @property
    def places(self) -> Ints: ...

    @property
    def units(self) -> Reals: ...

    @property
    def hinges(self) -> Flags:
        """Which joints (k,) turn."""

    @property
    def bounds(self) -> tuple[Reals, Reals]:
        """Least and greatest values (k,) of the joints."""

    @property
    def posture(self) -> Reals | None:
        """The joints (k,) near which they stay where they may move without moving what touches; None where
        that is left open."""

    @property
    def home(self) -> Reals:
        """The joints (k,) at the start."""

    def joints(self, q: Reals) -> Reals:
        """The joints (k,) at a place (n_q,)."""

    def posed(self, q: Reals, joints: Reals) -> Reals:
        """The place (n_q,) with the joints at these values (k,)."""

    def rates(self, q: Reals) -> Reals:
        """Changes (m, k) of the velocities per joint at a place (n_q,)."""


@dataclass(frozen=True)
class Joints:
    """Joints (k,) whose coordinates are those of the scene (see `Chain`), as in space."""

    columns: Ints
    places: Ints
    units: Reals
    hinges: Flags
    bounds: tuple[Reals, Reals]
    home: Reals
    posture: None = None

    def joints(self, q: Reals) -> Reals:
        return q[self.places]

    def posed(self, q: Reals, joints: Reals) -> Reals:
        found = q.copy()
        found[self.places] = joints
        return found

    def rates(self, _q: Reals) -> Reals:
        return np.eye(len(self.places))


@dataclass(frozen=True)
class Arm:
    """Hinges (k,) from the ground on, and the columns (m,) of coordinates that they move, body by body: x, y
    and angle of a free one, else its angle alone; sizes (k,): how many each has; start (m,): where they are
    while all joints are at 0."""

    links: tuple[Link, ...]
    columns: Ints
    sizes: tuple[int, ...]
    start: Reals

    @cached_property
    def _last(self) -> Ints:
        """Of each body (k,), which of the columns is its angle."""
        return np.cumsum(self.sizes) - 1

    @property
    def places(self) -> Ints:
        """Its columns of coordinates, which are those of velocities."""
        return self.columns

    @property
    def units(self) -> Reals:
        """Of hinges 1 (k,)."""
        return np.ones(len(self.links))

    @property
    def hinges(self) -> Flags:
        """All (k,)."""
        return np.ones(len(self.links), bool)

    @property
    def home(self) -> Reals:
        """Where the joints (k,) are at the start."""
        return np.zeros(len(self.links))

    @property
    def posture(self) -> Reals:
        """As at the start (k,)."""
        return self.home

    @property
    def bounds(self) -> tuple[Reals, Reals]:
        """Least and greatest values (k,) of the joints."""
        return np.array([link.lower for link in self.links]), np.array([link.upper for link in self.links])

    def joints(self, q: Reals) -> Reals:
        """The joints (k,) at a place (n,)."""
        turned = (q[self.columns] - self.start)[self._last]
        turned[1:] -= turned[:-1].copy()
        return np.asarray(turned)

    def posed(self, q: Reals, joints: Reals) -> Reals:
        """The place (n,) with the joints at these values (k,)."""
        found, column = q.copy(), 0
        for size, (turn, axis, at) in zip(self.sizes, self._frames(joints), strict=True):
            own = self.columns[column : column + size]
            home = self.start[column : column + size]
            found[own[-1]] = home[-1] + turn
            if size == 3:
                c, s = math.cos(turn), math.sin(turn)
                x, y = home[0] - at[0], home[1] - at[1]
                found[own[0]], found[own[1]] = axis[0] + c * x - s * y, axis[1] + s * x + c * y
            column += size
        return found

    def rates(self, q: Reals) -> Reals:
        """Changes (m, k) of the coordinates per joint at a place (n,)."""
        joints = self.joints(q)
        axes = [axis for _, axis, _ in self._frames(joints)]
        found, row = np.zeros((len(self.columns), len(joints))), 0
        for k, size in enumerate(self.sizes):
            found[row + size - 1, : k + 1] = 1.0
            if size == 3:
                x, y = q[self.columns[row]], q[self.columns[row + 1]]
                found[row, : k + 1] = [axis[1] - y for axis in axes[: k + 1]]
                found[row + 1, : k + 1] = [x - axis[0] for axis in axes[: k + 1]]
            row += size
        return found

    def _frames(self, joints: Reals) -> list[tuple[float, tuple[float, float], Reals]]:
        """Of each joint: the angle by which what follows it is turned, where its axis is, and where that was
        while all joints were at 0."""
        turned, x, y, before = 0.0, 0.0, 0.0, np.zeros(2)
        found = list[tuple[float, tuple[float, float], Reals]]()
        for link, by in zip(self.links, joints.tolist(), strict=True):
            c, s = math.cos(turned), math.sin(turned)
            along, up = float(link.at[0] - before[0]), float(link.at[1] - before[1])
            x, y = x + c * along - s * up, y + s * along + c * up
            turned, before = turned + by, link.at
            found.append((turned, (x, y), link.at))
        return found


def chain_of(task: Task, driven: Driven) -> Chain | None:
    """What leads a robot by joints; None for another."""
    if not driven.rates:
        return _arm_of(task, driven)
    return Joints(
        np.array(driven.rates, np.int64), np.array(driven.places, np.int64),
        np.where(driven.slides, task.size, 1.0), ~np.array(driven.slides),
        (driven.travel[0], driven.travel[1]),
        np.asarray(world_of(task.scene).at(task.parameters).q)[list(driven.places)],
    )  # fmt: skip


def _arm_of(task: Task, driven: Driven) -> Arm | None:
    """The arm of a robot that hinges hold, one body after the other; None for another."""
    if not driven.links or any(link.slides for link in driven.links):
        return None
    file, names = task.scene.file, list(task.scene.template.coordinates)
    body, bodies = driven.body, list[str]()
    for link in driven.links[::-1]:
        bodies.append(body)
        joint = file.joints.get(link.name)
        if joint is None:
            if link.name != f"{body}.angle":
                return None
            continue
        if body not in joint.between:
            return None
        body = joint.between[0] if joint.between[1] == body else joint.between[1]
    columns, sizes = list[int](), list[int]()
    for body in bodies[::-1]:
        own = [names.index(f"{body}.{axis}") for axis in ("x", "y", "angle") if f"{body}.{axis}" in names]
        if len(own) not in (1, 3) or (len(own) == 1 and columns):
            return None
        columns += own
        sizes.append(len(own))
    q = world_of(task.scene).at(task.parameters).q
    start = np.asarray(q)[columns]
    return Arm(driven.links, np.array(columns, np.int64), tuple(sizes), start)

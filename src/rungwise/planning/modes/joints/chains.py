"""Arms: which coordinates their joints move, and the joints at a place."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, TypeAlias

import numpy as np
from numpy.typing import NDArray

from rungwise.kernel import Ints, Reals
from rungwise.planning.task.task import Task
from rungwise.world.carriers import Driven, Link
from rungwise.world.find import world_of

Flags: TypeAlias = NDArray[np.bool_]
CHANGE = 1e-6
"""Change of a joint, in radians, for differences."""


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
    def bounds(self) -> tuple[Reals, Reals]:
        """Least and greatest values (k,) of the joints."""
        return np.array([link.lower for link in self.links]), np.array([link.upper for link in self.links])

    def joints(self, q: Reals) -> Reals:
        """The joints (k,) at a place (n,)."""
        turned = (q[self.columns] - self.start)[np.cumsum(self.sizes) - 1]
        return np.diff(turned, prepend=0.0)

    def posed(self, q: Reals, joints: Reals) -> Reals:
        """The place (n,) with the joints at these values (k,)."""
        found, at = q.copy(), 0
        for k, size in enumerate(self.sizes):
            if size == 1:
                found[self.columns[at]] = self.start[at] + joints[k]
            else:
                found[self.columns[at : at + 3]] = self._pose(self.start[at : at + 3], joints[: k + 1])
            at += size
        return found

    def rates(self, q: Reals) -> Reals:
        """Changes (m, k) of the coordinates per joint at a place (n,)."""
        joints = self.joints(q)
        both = [
            self.posed(q, joints + step)[self.columns] - self.posed(q, joints - step)[self.columns]
            for step in CHANGE * np.eye(len(joints))
        ]
        return np.array(both).T / (2.0 * CHANGE)

    def _pose(self, home: Reals, joints: Reals) -> Reals:
        """The pose (3,) of a body with this one at home, after the first joints (j,)."""
        pose = home.copy()
        for link, by in zip(self.links[: len(joints)][::-1], joints[::-1], strict=True):
            c, s = np.cos(by), np.sin(by)
            pose[:2] = link.at + np.array([[c, -s], [s, c]]) @ (pose[:2] - link.at)
            pose[2] += by
        return pose


def chain_of(task: Task, driven: Driven) -> Chain | None:
    """What leads a robot by joints; None for another."""
    if not driven.rates:
        return _arm_of(task, driven)
    return Joints(
        np.array(driven.rates, np.int64), np.array(driven.places, np.int64),
        np.where(driven.slides, task.size, 1.0), ~np.array(driven.slides),
        (driven.travel[0], driven.travel[1]),
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

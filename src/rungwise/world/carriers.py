"""Robots that a task leads through free space: what places them, and the inputs that drive these places;
what they and objects touch there."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple, Protocol

import numpy as np

from rungwise.errors import InputError
from rungwise.kernel import Ints, Reals

ROUNDED = 1e-9
"""Part of a gap that is to be kept by which it may be less, by rounding."""


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


class Linear(NamedTuple):
    """What k numbers are of as many inputs: matrix (k, k) @ inputs + zero (k,)."""

    matrix: Reals
    zero: Reals

    def at(self, inputs: Reals) -> Reals:
        """The numbers (k,) at inputs (k,)."""
        return np.asarray(self.matrix @ inputs + self.zero)

    def inputs(self, wanted: Reals) -> Reals:
        """The inputs (m, k) at which they are these (m, k)."""
        return np.asarray((wanted - self.zero) @ np.linalg.inv(self.matrix).T)


class Servos(NamedTuple):
    """Stiffness and limit (k,) of the servos that place a robot, in force per place and in force, infinite
    where speeds are given; and by how much time its joints in space lag behind moving targets at most."""

    stiffness: Reals
    limit: Reals
    lag: float = 0.0


@dataclass(frozen=True)
class Driven:
    """How inputs place a robot.

    body: the robot; places (k,): the coordinates that place it: x and y in the plane, joints in space;
    columns (u,): the inputs that drive these. Their speeds, or with `by_place` the targets of their servos,
    are `led` by the inputs, with u = k. `servos`: how strong they are; reach: how far the body
    reaches from its centre. In space `rates` (k,) are the columns of the joints' velocities, `slides` (k,)
    says which of these are no hinges, `levers` (k,) how far the body reaches from their axes, 1 for slides,
    and `travel` (2, k) is their range.
    A robot of joints in the plane has its `links` (k,), from the ground on, which then take the part of
    places in all of these, and `home` (3,): the pose of its centre of mass where all joints are at 0; its
    `places` are those of its body's x and y all the same.
    """

    body: str
    places: tuple[int, ...]
    columns: tuple[int, ...]
    led: Linear
    by_place: bool
    servos: Servos
    reach: float
    links: tuple[Link, ...]
    home: Reals
    rates: tuple[int, ...] = ()
    slides: tuple[bool, ...] = ()
    levers: tuple[float, ...] = ()
    travel: Reals = field(default_factory=lambda: np.zeros((2, 0)))

    def levels(self, speeds: Reals, places: Reals) -> Reals:
        """Inputs (m, u) that lead it at these speeds (m, k), or to these places (m, k)."""
        return self.led.inputs(places if self.by_place else speeds)

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

    speed: float = field(kw_only=True)
    clearance: float = field(kw_only=True)
    push: tuple[float, float] = field(kw_only=True)
    lean: float = field(kw_only=True)


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


class Beside(NamedTuple):
    """Contacts that are left out of `Touches` because others of the same face stand for them: faces (m,),
    gaps (m,), rows (m, 1 + t, n_v) and friction (m,) as there."""

    faces: Ints
    gaps: Reals
    rows: Reals
    friction: Reals


class Touches(NamedTuple):
    """What is nearer than asked at one place, and what acts there: pairs (k,) of the scene's contacts;
    features (k,), numbers that stay while the same parts of shapes are nearest; gaps (k,); points and normals
    (k, d), from the second body to the first; rows (k, 1 + t, n_v): rates of the gap, then of slip, per unit
    of each velocity, then, with torsion, of the turn about the normal, times torsional over sliding friction;
    friction (k,); the least gaps (c,) of all pairs, of those that are farther at least what
    was asked; poses (b, 3) of the bodies in the plane: centre of mass and angle, in space (b, 7): origin and
    quaternion; weight and given forces (n_v,); and friction of supports. In space, of contacts of one face
    four are told: faces (k,) are numbers of these, and `beside` are those that are left out."""

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
    faces: Ints
    beside: Beside


class Near(NamedTuple):
    """The nearest points of two bodies, however far: their gap; the point (d,) of the scene's first body;
    the normal (d,), from the second to the first, and what is across it (d - 1, d); rows (d, n_v): rates of
    the gap, and of the first body over the second along these; friction; and torsional over sliding friction,
    as a length."""

    gap: float
    point: Reals
    normal: Reals
    across: Reals
    rows: Reals
    friction: float
    twist: float = 0.0


def frame_of(pose: Reals) -> tuple[Reals, Reals]:
    """Centre (d,) and turn (d, d) of a pose: of x, y and angle in the plane, of a place and a quaternion in
    space."""
    if len(pose) == 3:
        c, s = np.cos(pose[2]), np.sin(pose[2])
        return pose[:2], np.array([[c, -s], [s, c]])
    return pose[:3], turn_of(pose[3:])


def turn_of(quaternion: Reals) -> Reals:
    """The rotation (3, 3) of a unit quaternion (4,)."""
    w, x, y, z = (quaternion / np.linalg.norm(quaternion)).tolist()
    return np.array(
        [
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
            [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
            [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
        ]
    )  # fmt: skip


class Outline(Protocol):
    """The outline of a body in the frame of its centre of mass, by parts 0..1 of its length; in space its
    surface, in the frame of its pose, by parts 0..1 of places drawn on it."""

    def __call__(self, part: Reals) -> tuple[Reals, Reals]:
        """Points (m, d) and outward normals (m, d) at parts (m,)."""

    def part_of(self, point: Reals) -> tuple[float, float]:
        """The part next to a point (d,), and how far, 0..1, it is from where the outline has corners."""


class Surroundings(Protocol):
    """What touches what in a scene at one set of parameters, and the forces that act there. stiffness, limit
    (n_v,): of the servos of coordinates, 0 and infinite where there are none; owners (n_v,), placed (n_q,):
    the body of each velocity, and of each coordinate; dimension: 2 or 3; tangents: directions in which
    contacts resist slip, 3 where some in space resist turns about their normals as well."""

    dimension: int
    tangents: int
    stiffness: Reals
    limit: Reals

    @property
    def owners(self) -> Ints: ...

    @property
    def placed(self) -> Ints: ...

    def moved_by(self, columns: Ints) -> Ints:
        """The bodies that some of these velocities (k,) move."""

    def touches(self, q: Reals, within: float) -> Touches:
        """What is nearer than `within` at a place (n_q,)."""

    def near(self, q: Reals, pair: int) -> Near:
        """The nearest points of a pair of the scene's contacts at a place (n_q,)."""

    def least(self, q: Reals, pairs: Ints, within: float = ...) -> Reals:
        """The gaps (p,) of some of the scene's contacts (p,) at a place (n_q,); of those that are farther, at
        least `within`."""

    def rows(self, q: Reals, body: int, points: Reals, normals: Reals) -> Reals:
        """Rows (m, 1 + t, n_v) as of `Touches`, of contacts at points (m, d) of a body, in the frame of its
        pose, with what stands still, along normals (m, d), in the world, that go into it; turns about the
        normals as they are."""

    def room(self, q: Reals, body: int, points: Reals, normals: Reals, pairs: Ints) -> Reals:
        """How far it is (m,) from points (m, d) of a body, in the frame of its pose, along outward normals
        (m, d), in the world, to what it may touch by these of the scene's contacts (c,); infinite where
        nothing is next in the way that is among these, and in the plane, where nobody asks."""

    def changed(self, q: Reals, change: Reals) -> Reals:
        """The place (n_q,) after a change (n_v,)."""

    def change(self, q: Reals, to: Reals) -> Reals:
        """The change (n_v,) that leads from a place (n_q,) to another."""

    def is_clear(self, a: Reals, b: Reals, length: float, least: float, pairs: Ints) -> bool:
        """Whether the gaps of these pairs (c,) stay above `least` on the straight way from a to b (n_q,), on
        which none of them shrinks by more than `length` (see `planning.motion.free_paths.is_clear`)."""

    def loads(self, q: Reals) -> Reals:
        """Weight and given forces (n_v,) at a place (n_q,)."""

    def poses(self, q: Reals) -> Reals:
        """Poses (b, 3) of the bodies at a place (n_q,), in space (b, 7) (see `Touches`)."""

    def centres(self, q: Reals) -> Reals:
        """Centres of mass (b, d) of the bodies at a place (n_q,)."""

    def outline(self, body: int) -> Outline:
        """The outline of a body, by its number. Raises ValueError for one without."""

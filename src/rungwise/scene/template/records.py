"""A scene as kernels see it: a few record arrays that are views of one flat buffer of float64.

All fields are 8 bytes wide, so that binding needs only a number's place in the buffer (its *slot*).
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from rungwise.block import Block
from rungwise.kernel import record_type
from rungwise.scene.fields.laws.contact import LAWS

FIXED, SLIDE, HINGE, FREE = 0, 1, 2, 3
NO_DRIVE, SPEED, SERVO, FORCE = 0, 1, 2, 3
ALONG, ACROSS, ANGLE = 0, 1, 2
POLYGON, BOX, CAPSULE, HALFPLANE = 0, 1, 2, 3
UNIFORM, RING, POINTS, RATIO = 0, 1, 2, 3

WORLD = record_type("", "gravity_x gravity_y tolerance duration step")
BODY = record_type(
    "motion coordinate first_shape end_shape mass_given centre_given inertia_given",
    "x y angle axis_x axis_y pivot_x pivot_y mass density inertia centre_x centre_y"
    " force_x force_y torque gyration2",
)
"""x, y, angle: the pose, then (bound) the pose of the centre of mass; gyration2: squared radius of
gyration."""

COORDINATE = record_type(
    "body drive has_target limited",
    "start speed lower upper damping dry_friction drive_speed force stiffness drive_damping"
    " target target_speed limit mass metric lever",
)
"""mass: generalised inertia M; metric: the same per unit of the body's mass (kinematic rung); lever:
its root, a length that makes an angle comparable with distances, and 1 for a distance."""

SHAPE = record_type("body first end kind", "radius at_x at_y angle size_x size_y reach width")
"""Vertices first..end, a rounding radius, and (bound) reach: the greatest distance from the body's centre;
width: the least distance of two parallel lines that enclose the shape, infinite for a halfplane."""

VERTEX = record_type("", "x y normal_x normal_y length")
"""Position in the body frame; normal and length of the edge that starts here (counter-clockwise)."""

CONTACT = record_type(
    "body_a body_b watched weighed lifts laws",
    "friction restitution stiffness tangential_stiffness coupling_stiffness"
    " damping tangential_damping coupling_damping raised"
    + "".join(f" {number.field}" for law in LAWS for number in law.numbers),
)
"""`watched`: some condition reads the gap; `weighed`: some condition reads the force; `lifts`:
one of the bodies may be raised off the plane; `raised`: how high it is: above 0, they do not touch; `laws`:
the sum of the bits of the laws that the scene names, whose numbers come last (see `fields.laws.contact`)."""
PAIR = record_type("contact shape_a shape_b", "")
POTENTIAL = record_type("", "stiffness target")
TERM = record_type("acts", "factor")
"""Factor of a coordinate in a potential (one row per coordinate), and whether the potential acts on it."""

JOINT = record_type(
    "body_a body_b kind",
    "at_x at_y axis_x axis_y a_x a_y b_x b_y angle lever",
)
"""at: in the world at the poses. Bound, a and b: the same in the bodies' frames; axis: in the frame of a;
angle: the angle of b less the angle of a; lever: a length that makes angles comparable with distances."""

MEASURE = record_type(
    "joint which held drive has_target limited",
    "stiffness damping dry_friction lower upper drive_speed force drive_damping target target_speed limit",
)
"""One of the three coordinates of b in the frame of a (along and across the axis, angle), held or free."""

SUPPORT = record_type(
    "body pressure centre_given weighed first end row exact",
    "friction load gravity ratio centre_x centre_y force",
)
"""`weighed`: the load is gravity times mass; spots first..end of the pressure. Bound: force, the greatest of
friction; ratio, its greatest torque over that; centre, from the centre of mass. `row`: the first of its rows
in the terms of a run, -1 if there is none; `exact`: whether the limit surface is that of the pressure."""
SPOT = record_type("", "x y weight")
TASK = record_type("", "value")
"""A number of the scene's task (see `scene.fields.task.numbers_of`)."""


class Records(Block):
    """Views of one buffer. Kernels get the whole, as one pointer, unless a record or one array will do."""

    world: NDArray[np.void]
    bodies: NDArray[np.void]
    coordinates: NDArray[np.void]
    shapes: NDArray[np.void]
    vertices: NDArray[np.void]
    contacts: NDArray[np.void]
    pairs: NDArray[np.void]
    potentials: NDArray[np.void]
    terms: NDArray[np.void]
    joints: NDArray[np.void]
    measures: NDArray[np.void]
    supports: NDArray[np.void]
    spots: NDArray[np.void]
    task: NDArray[np.void]


DTYPES = (
    WORLD, BODY, COORDINATE, SHAPE, VERTEX, CONTACT, PAIR, POTENTIAL, TERM, JOINT, MEASURE, SUPPORT, SPOT,
    TASK,
)  # fmt: skip


def allocate(counts: tuple[int, ...]) -> NDArray[np.float64]:
    """A zeroed buffer for `counts` records of each kind."""
    return np.zeros(sum(n * dtype.itemsize // 8 for n, dtype in zip(counts, DTYPES, strict=True)))


def views(buffer: NDArray[np.float64], counts: tuple[int, ...]) -> Records:
    """The record arrays inside `buffer`."""
    arrays = {}
    offset = 0
    for name, count, dtype in zip(Records.__annotations__, counts, DTYPES, strict=True):
        size = count * dtype.itemsize // 8
        arrays[name] = buffer[offset : offset + size].view(dtype)
        offset += size
    return Records(**arrays)


def slot(counts: tuple[int, ...], kind: str, index: int, field: str) -> int:
    """Place in the buffer of `field` of record `index` of the array `kind`."""
    first, size = _first_slot(counts, kind, field)
    return first + index * size


@lru_cache(maxsize=256)
def _first_slot(counts: tuple[int, ...], kind: str, field: str) -> tuple[int, int]:
    """Place of `field` of the first record, and how far it is from there to the next."""
    place = list(Records.__annotations__).index(kind)
    before = sum(n * d.itemsize // 8 for n, d in zip(counts[:place], DTYPES[:place], strict=True))
    dtype = DTYPES[place]
    offset = int(dtype.fields[field][1])  # type: ignore[index]
    return before + offset // 8, dtype.itemsize // 8

"""The boundary of an object, by arc length: where a robot may push."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from rungwise.kernel import Reals, RecordArray, kernel
from rungwise.scene.template.records import HALFPLANE, Records


@dataclass(frozen=True)
class Boundary:
    """Edges and arcs of all shapes of a body, one after the other; `ends` (k,): their cumulative lengths.

    A piece begins at `at` (k, 2) and goes on along `along` (k, 2); an arc of `radius` about `centre` begins
    at the angle `angle`. All are in the frame of the body's centre of mass.
    """

    ends: Reals
    at: Reals
    along: Reals
    centre: Reals
    radius: Reals
    angle: Reals

    def __call__(self, part: Reals) -> tuple[Reals, Reals]:
        """Points (m, 2) and outward normals (m, 2) at parts 0..1 (m,) of the whole length."""
        place = np.mod(part, 1.0) * self.ends[-1]
        k = np.minimum(np.searchsorted(self.ends, place, side="right"), len(self.ends) - 1)
        gone = place - np.where(k > 0, self.ends[k - 1], 0.0)
        arc = self.radius[k] > 0.0
        turned = self.angle[k] + np.where(arc, gone / np.where(arc, self.radius[k], 1.0), 0.0)
        normals = np.stack([np.cos(turned), np.sin(turned)], axis=-1)
        on_arc = self.centre[k] + self.radius[k, None] * normals
        return np.where(arc[:, None], on_arc, self.at[k] + gone[:, None] * self.along[k]), normals

    def part_of(self, point: Reals) -> tuple[float, float]:
        """The part 0..1 of the whole length next to a point (2,), and how far along, 0..1, from the nearer
        end of a straight piece to its middle the point is, 1 on an arc."""
        x, y = float(point[0]), float(point[1])
        part, inside = _part_of(
            x, y, self.ends, self.at, self.along, self.centre, self.radius, self.angle
        )  # fmt: skip
        return float(part), float(inside)


@kernel
def _part_of(
    x: float, y: float, ends: Reals, at: Reals, along: Reals, centre: Reals, radius: Reals, angle: Reals
) -> tuple[float, float]:  # fmt: skip
    """See `Boundary.part_of`."""
    best, part, inside, before = math.inf, 0.0, 1.0, 0.0
    for k in range(len(ends)):
        length = ends[k] - before
        if radius[k] > 0.0:
            turned = (math.atan2(y - centre[k, 1], x - centre[k, 0]) - angle[k]) % (2.0 * math.pi)
            gone = turned * radius[k]
            if gone > length:
                gone = 0.0 if turned > math.pi else length
            at_angle = angle[k] + gone / radius[k]
            near_x = centre[k, 0] + radius[k] * math.cos(at_angle)
            near_y = centre[k, 1] + radius[k] * math.sin(at_angle)
        else:
            gone = (x - at[k, 0]) * along[k, 0] + (y - at[k, 1]) * along[k, 1]
            gone = min(max(gone, 0.0), length)
            near_x, near_y = at[k, 0] + gone * along[k, 0], at[k, 1] + gone * along[k, 1]
        away = math.hypot(x - near_x, y - near_y)
        if away < best:
            best, part = away, before + gone
            inside = 1.0 if radius[k] > 0.0 else 2.0 * min(gone, length - gone) / length
        before = ends[k]
    return part / ends[-1], inside


def boundary(records: Records, body: int) -> Boundary:
    """The boundary of a bound body. Raises ValueError for a body without one (a point, a halfplane)."""
    pieces = []
    for s in range(records.bodies[body]["first_shape"], records.bodies[body]["end_shape"]):
        shape = records.shapes[s]
        if shape["kind"] != HALFPLANE:
            pieces += _pieces(
                records.vertices[int(shape["first"]) : int(shape["end"])], float(shape["radius"])
            )
    pieces = [piece for piece in pieces if piece[0] > 0.0]
    if not pieces:
        raise ValueError("the body has no boundary to push at")
    length, at, along, centre, radius, angle = (
        np.array(column, float) for column in zip(*pieces, strict=True)
    )
    return Boundary(np.cumsum(length), at, along, centre, radius, angle)


def _pieces(vertices: RecordArray, radius: float) -> list[tuple[Any, ...]]:
    """(length, start, direction, centre, radius, angle of the normal) of edges and arcs of one shape."""
    places = np.stack([vertices["x"], vertices["y"]], axis=-1)
    if len(vertices) == 1:
        return [(2.0 * math.pi * radius, (0.0, 0.0), (0.0, 0.0), places[0], radius, 0.0)]
    angles = np.arctan2(vertices["normal_y"], vertices["normal_x"])
    found: list[tuple[Any, ...]] = []
    for k, place in enumerate(places):
        normal = np.array([vertices[k]["normal_x"], vertices[k]["normal_y"]])
        along = np.array([-normal[1], normal[0]])
        turn = (angles[k] - angles[k - 1]) % (2.0 * math.pi)
        found.append((radius * turn, (0.0, 0.0), (0.0, 0.0), place, radius, angles[k - 1]))
        found.append(
            (float(vertices[k]["length"]), place + radius * normal, along, (0.0, 0.0), 0.0, angles[k])
        )
    return found

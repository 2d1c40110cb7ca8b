"""Free configuration space of a scene with three coordinates: its contact strata, and runs in it.

A stratum of codimension one is where one contact is closed and no other overlaps; where two contacts are
closed, two strata meet in an edge. The goal edge is the part of these edges on which the scene's goal holds.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from rungwise.scene import Scene
from rungwise.scene.language.expression import SLOTS, STACK, holds
from rungwise.system.planar.contact_manifold import allocate_manifolds
from rungwise.system.planar.corners import allocate_course
from rungwise.system.planar.find_contacts import find_contacts
from rungwise.system.planar.place import allocate_placement, place
from rungwise.system.planar.seams import allocate_seams

if TYPE_CHECKING:
    from mpl_toolkits.mplot3d import Axes3D

Points = NDArray[np.float64]
GRID = 80
"""Cells of the grid along each coordinate; a kink of a boundary that is on the grid is drawn exactly."""


class Space:
    """Gaps and goal of a scene at any q, without a run."""

    def __init__(self, scene: Scene, parameters: Mapping[str, float] | None = None) -> None:
        bound = scene.bind(parameters)
        self.scene, self.records, self._values = scene, bound.records, bound.values
        r = self.records
        r.contacts["watched"] = 1
        self._placed, self._manifolds = allocate_placement(r), allocate_manifolds(r)
        self._seams, self._course = allocate_seams(r), allocate_course(r)
        self._at = len(scene.template.parameters) + 1
        self.count = len(r.coordinates)

    def gaps(self, q: Points) -> Points:
        """Gap of each contact at q (n,), negative in overlap."""
        place(self.records, np.asarray(q, float), self._placed, True)
        find_contacts(self.records, self._placed, q, 0.0, self._manifolds, self._seams, self._course)
        return self._manifolds.gaps.copy()

    def is_goal(self, q: Points, tolerance: float) -> bool:
        """Whether the scene's goal holds at rest at q, gaps up to `tolerance` counting as closed."""
        program = self.scene.template.conditions
        first, last = (int(i) for i in program.table[0, :2])
        values, at, n = self._values.copy(), self._at, self.count
        gaps = self.gaps(q)
        values[at : at + n], values[at + n : at + 2 * n] = q, 0.0
        values[at + 2 * n : at + 2 * n + len(gaps)], values[-1] = gaps, tolerance
        values[at + 2 * n + 3 * len(gaps) :][:SLOTS] = -np.inf  # what must hold for a time has held
        stack = np.zeros(STACK)
        return last > first and holds(program.code, program.constants, first, last, values, stack)

    def coordinates_of(self, contact: int) -> list[int]:
        """The coordinates that the gap of a contact depends on."""
        bodies = self.records.coordinates["body"]
        ends = self.records.contacts[contact]
        return [i for i, body in enumerate(bodies) if body in (ends["body_a"], ends["body_b"])]


@dataclass(frozen=True)
class Strata:
    """Facets: quadrilaterals (4, 3) of the contact strata, of contact `contact[k]`. Edges: segments (2, 3)
    where two contacts are closed; goal: the edges on which the goal holds."""

    facets: list[Points]
    contact: list[int]
    edges: list[Points]
    goal: list[Points]


def strata(space: Space, low: Sequence[float], high: Sequence[float]) -> Strata:
    """Contact strata of a scene with three coordinates inside the box from `low` to `high`.

    Raises ValueError for another number of coordinates, or a contact that does not depend on just two.
    """
    if space.count != 3:
        raise ValueError(f"{space.scene.name} has {space.count} coordinates, not three")
    box = np.array([low, high], float)
    found = Strata([], [], [], [])
    tolerance = 1e-3 * float((box[1] - box[0]).max()) / GRID
    for contact in range(len(space.records.contacts)):
        pair = space.coordinates_of(contact)
        if len(pair) != 2:
            raise ValueError(f"contact {contact} of {space.scene.name} depends on {len(pair)} coordinates")
        for line in _boundary(space, contact, pair, box):
            _extrude(space, contact, pair, line, box, tolerance, found)
    return found


def _boundary(space: Space, contact: int, pair: list[int], box: Points) -> list[Points]:
    """Curves (k, 2) on which the gap of `contact` vanishes, in the plane of its two coordinates."""
    from contourpy import contour_generator

    u, w = (np.linspace(box[0, i], box[1, i], GRID + 1) for i in pair)
    q = 0.5 * (box[0] + box[1])
    gap = np.empty((len(w), len(u)))
    for j, i in np.ndindex(gap.shape):
        q[pair] = u[i], w[j]
        gap[j, i] = space.gaps(q)[contact]
    rounding = 1e-9 * float((box[1] - box[0]).max())
    return [np.asarray(line) for line in contour_generator(u, w, gap).lines(rounding)]


def _extrude(
    space: Space, contact: int, pair: list[int], line: Points, box: Points, tolerance: float, found: Strata
) -> None:
    """Facets over the curve, as far along the third coordinate as no other contact overlaps."""
    (third,) = set(range(3)) - set(pair)
    ends = [_free(space, contact, pair, point, third, box) for point in line]
    for k in range(len(line) - 1):
        corners = []
        for point, end in ((line[k], ends[k]), (line[k + 1], ends[k + 1])):
            for value in end:
                q = np.empty(3)
                q[pair], q[third] = point, value
                corners.append(q)
        first, last, first_next, last_next = corners
        found.facets.append(np.array([first, last, last_next, first_next]))
        found.contact.append(contact)
        if max(ends[k][1], ends[k + 1][1]) < box[1, third] - tolerance:
            edge = np.array([last, last_next])
            found.edges.append(edge)
            if space.is_goal(edge.mean(axis=0), tolerance):
                found.goal.append(edge)


def _free(
    space: Space, contact: int, pair: list[int], point: Points, third: int, box: Points
) -> tuple[float, float]:
    """Stretch of the third coordinate, from its low end, along which the other contacts do not overlap."""
    q = np.empty(3)
    q[pair] = point

    def least(value: float) -> float:
        q[third] = value
        return float(np.delete(space.gaps(q), contact).min(initial=np.inf))

    low, high = (float(x) for x in box[:, third])
    rounding = 1e-9 * (high - low)
    free = low
    for value in np.linspace(low, high, GRID + 1)[1:]:
        if least(value) < -rounding:
            blocked = float(value)
            while blocked - free > rounding:
                middle = 0.5 * (free + blocked)
                free, blocked = (middle, blocked) if least(middle) >= 0.0 else (free, middle)
            return low, free
        free = float(value)
    return low, high


def draw_strata(
    axes: Axes3D,
    space: Space,
    found: Strata,
    low: Sequence[float],
    high: Sequence[float],
    order: Sequence[int],
) -> None:
    """Draw facets, the edges of the box that are free, and the goal edge; `order` says which coordinate is
    drawn along x, y and z."""
    from mpl_toolkits.mplot3d.art3d import Line3DCollection, Poly3DCollection

    turned = list(order)
    shades = ("#9db4cc", "#c9b79c", "#b5c7a9", "#c6aebf")
    for contact in sorted(set(found.contact)):
        facets = [f[:, turned] for f, c in zip(found.facets, found.contact, strict=True) if c == contact]
        shade = shades[contact % len(shades)]
        axes.add_collection3d(Poly3DCollection(facets, fc=shade, ec="none", alpha=0.28, zorder=1))
        axes.add_collection3d(Line3DCollection(_creases(facets), color="0.45", lw=0.7, zorder=2))
    for edge in _box_edges(space, low, high):
        axes.plot(*edge[:, turned].T, color="0.6", lw=0.7, zorder=1)
    goal = [edge[:, turned] for edge in found.goal]
    axes.add_collection3d(Line3DCollection(goal, color="#1f6fd6", lw=5.0, alpha=0.75, zorder=4))
    names = [name.split(".")[1] for name in space.scene.template.coordinates]
    for k, axis in zip(turned, (axes.xaxis, axes.yaxis, axes.zaxis), strict=True):
        head, digits = names[k].rstrip("0123456789"), names[k].lstrip("abcdefghijklmnopqrstuvwxyz")
        axis.set_label_text(f"${head}_{{{digits}}}$" if digits and head + digits == names[k] else names[k])
    axes.set(
        xlim=(low[turned[0]], high[turned[0]]),
        ylim=(low[turned[1]], high[turned[1]]),
        zlim=(low[turned[2]], high[turned[2]]),
    )


def _creases(facets: list[Points]) -> list[Points]:
    """Sides of facets along the third coordinate where neighbours meet at an angle, and all other sides."""
    lines: list[Points] = []
    for k, facet in enumerate(facets):
        lines += [facet[[1, 2]], facet[[3, 0]]]
        before = facets[k - 1] if k > 0 else None
        joined = before is not None and np.allclose(before[3], facet[0], atol=1e-9)
        if not joined or _turn(facets[k - 1], facet) > 1e-3:
            lines.append(facet[[0, 1]])
        after = facets[k + 1] if k + 1 < len(facets) else None
        if after is None or not np.allclose(after[0], facet[3], atol=1e-9):
            lines.append(facet[[3, 2]])
    return lines


def _turn(before: Points, after: Points) -> float:
    a, b = before[3] - before[0], after[3] - after[0]
    return float(np.linalg.norm(a / np.linalg.norm(a) - b / np.linalg.norm(b)))


def _box_edges(space: Space, low: Sequence[float], high: Sequence[float]) -> list[Points]:
    """The twelve edges of the box, with nan where a contact overlaps."""
    box, edges = np.array([low, high], float), []
    rounding = 1e-9 * float((box[1] - box[0]).max())
    for along in range(3):
        others = [i for i in range(3) if i != along]
        for a in (0, 1):
            for b in (0, 1):
                edge: NDArray[Any] = np.empty((GRID + 1, 3))
                edge[:, along] = np.linspace(box[0, along], box[1, along], GRID + 1)
                edge[:, others[0]], edge[:, others[1]] = box[a, others[0]], box[b, others[1]]
                blocked = [bool((space.gaps(q) < -rounding).any()) for q in edge]
                edge[blocked] = np.nan
                edges.append(edge)
    return edges

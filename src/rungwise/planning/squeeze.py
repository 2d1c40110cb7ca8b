"""Plans of squeezes that orient a polygonal part without sensors.

After K. Y. Goldberg, Orienting polygonal parts without sensors, Algorithmica 10 (1993). Two parallel jaws
close on the part, and both touch it at once. Without friction it turns as its diameter decreases, until an
edge is flush with a jaw. What a squeeze makes of an orientation is the squeeze function, a staircase: every
orientation between two greatest diameters ends at the least one between them. A plan is built backwards, from
the widest step: before each squeeze, the widest interval of orientations is chosen whose image fits into the
interval that the next squeeze turns into what it needs.

An orientation is the angle of the part less the angle of the direction in which the jaws close.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray

from rungwise.content import ByContent
from rungwise.errors import InputError
from rungwise.keywords import keywords
from rungwise.plain import brief

_SAME = 1e-9
"""Angles, and lengths over the part's, that count as the same."""

Reals = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class SqueezeFunction(ByContent):
    """The effect of a squeeze on a part whose convex hull has these `vertices` (k, 2), given at the angle 0.

    `flush` (m,) are the orientations in 0..pi at which an edge is flush with a jaw, and `spans` (m, 2) what
    leads, up to the next of them, from the vertex at one jaw to that at the other. `maxima` (n,) and `minima`
    (n,) of the diameter, each minimum after its maximum, are within half a turn of the first. Squeezes do the
    same to orientations that are a `period` apart.
    """

    vertices: Reals
    flush: Reals
    spans: Reals
    maxima: Reals
    minima: Reals
    period: float

    __repr__ = brief

    def diameter(self, orientation: ArrayLike) -> Reals:
        """How far apart the jaws are that touch the part on both sides, at each orientation."""
        angle = np.asarray(orientation, dtype=np.float64)[..., None]
        along = self.vertices[:, 0] * np.cos(angle) - self.vertices[:, 1] * np.sin(angle)
        return np.asarray(np.ptp(along, axis=-1))

    @keywords
    def squeezed(self, orientation: ArrayLike, *, friction: float = 0.0) -> Reals:
        """The orientation after a squeeze from each orientation.

        With friction the part sticks where the line between two of its points that touch the jaws is within
        the friction cones of both.
        """
        if not 0.0 <= friction < math.inf:
            raise InputError(f"squeezed.friction: {friction!r} is not a finite number of at least 0")
        angles = np.asarray(orientation, dtype=np.float64)
        if not np.all(np.isfinite(angles)):
            raise InputError("squeezed.orientation: must be finite")
        ends = [self._end(float(angle), math.atan(friction)) for angle in angles.ravel()]
        return np.array(ends).reshape(angles.shape)

    def _end(self, angle: float, cone: float) -> float:
        """The orientation after a squeeze, with cones of this half-angle."""
        m = len(self.flush)
        turns, within = divmod(angle - self.flush[0], math.pi)
        piece = int(np.searchsorted(self.flush, within + self.flush[0], side="right")) - 1 + m * int(turns)
        tilt = self._tilt(piece, angle)
        sense = 1 if tilt > 0.0 else -1
        while sense * tilt > cone + _SAME:
            edge = piece + 1 if sense > 0 else piece
            piece, angle = piece + sense, float(self.flush[edge % m]) + math.pi * (edge // m)
            tilt = self._tilt(piece, angle)
        return angle

    def _tilt(self, piece: int, angle: float) -> float:
        """Angle by which the span of a piece is turned from where it is along the direction of the jaws."""
        x, y = self.spans[piece % len(self.flush)]
        return math.remainder(angle + math.atan2(y, x), math.pi)


class Step(NamedTuple):
    """Orientations that one squeeze is given: those from `start` on, over a `width`; and what it makes of
    them, from `low` to `high`."""

    start: float
    width: float
    low: float
    high: float


@dataclass(frozen=True, eq=False)
class SqueezePlan(ByContent):
    """Squeezes that orient a part, whatever its orientation at the start.

    `angles` are the directions in which the jaws close, one after the other, in the world; `final` is the
    angle of the part in the world after the last one, up to multiples of `period`. `steps` say which
    orientations each squeeze is given, and what it makes of them; `function` maps orientations before a
    squeeze to those after it.
    """

    angles: tuple[float, ...]
    final: float
    period: float
    steps: tuple[Step, ...]
    function: SqueezeFunction

    __repr__ = brief

    @keywords
    def predicted(self, angle: ArrayLike, *, friction: float = 0.0) -> Reals:
        """The angle of the part in the world after the plan, for each `angle` at the start; `friction` is its
        friction with the jaws."""
        found = np.asarray(angle, dtype=np.float64)
        for turn in self.angles:
            found = self.function.squeezed(found - turn, friction=friction) + turn
        return found

    def off(self, angle: ArrayLike) -> Reals:
        """The distance of each `angle` of the part from the final angle, or from the nearest one a whole
        number of periods away."""
        apart = np.asarray(angle, dtype=np.float64) - self.final
        return np.asarray(np.abs(apart - self.period * np.round(apart / self.period)))


@keywords
def squeeze_plan(vertices: ArrayLike) -> SqueezePlan:
    """The squeezes that bring a polygonal part to one orientation, up to the period of its squeeze function.

    Args:
        vertices: (k, 2), the part's outline in order, at the angle 0. It need not be convex: the jaws touch
            its convex hull.

    Raises InputError for wrong shapes, numbers that are not finite, lines that cross, and parts without area.
    """
    function = _function(_hull(vertices))
    chain = _backward(function)
    angles, turn = [0.0], 0.0
    for step, after in pairwise(chain):
        turn += (step.low + step.high - 2.0 * after.start - after.width) / 2.0
        turn = math.remainder(turn, function.period)
        angles.append(turn)
    final = math.remainder(turn + chain[-1].low, function.period)
    return SqueezePlan(tuple(angles), final, function.period, tuple(chain), function)


def _hull(vertices: ArrayLike) -> Reals:
    """The part's convex hull (k, 2), counterclockwise."""
    try:
        outline = np.array(vertices, dtype=np.float64)
    except (TypeError, ValueError):
        raise InputError("squeeze_plan.vertices: must be pairs of numbers") from None
    if outline.ndim != 2 or outline.shape[1] != 2 or len(outline) < 3:
        raise InputError(f"squeeze_plan.vertices: must be at least 3 pairs; their shape is {outline.shape}")
    if not np.all(np.isfinite(outline)):
        raise InputError("squeeze_plan.vertices: must be finite")
    size = float(np.max(np.ptp(outline, axis=0)))
    polygon = shapely.Polygon((outline - outline[0]) / size if size > 0.0 else outline)
    hull = shapely.geometry.polygon.orient(shapely.MultiPoint(polygon.exterior.coords).convex_hull, 1.0)
    if hull.area <= _SAME:
        raise InputError("squeeze_plan.vertices: lie on a line")
    if not polygon.is_valid:
        raise InputError("squeeze_plan.vertices: the outline crosses or touches itself")
    return np.asarray(np.array(hull.exterior.coords)[:-1] * size + outline[0])


def _function(hull: Reals) -> SqueezeFunction:
    """The squeeze function of a convex polygon."""
    along = np.roll(hull, -1, axis=0) - hull
    # An edge is flush where its direction, turned with the part, is across that of the jaws.
    flush = np.sort(np.mod(math.pi / 2.0 - np.arctan2(along[:, 1], along[:, 0]), math.pi))
    flush = flush[np.diff(flush, prepend=flush[-1] - math.pi) > _SAME]
    middle = (flush + np.append(flush[1:], flush[0] + math.pi)) / 2.0
    reach = np.cos(middle)[:, None] * hull[:, 0] - np.sin(middle)[:, None] * hull[:, 1]
    spans = hull[np.argmax(reach, axis=1)] - hull[np.argmin(reach, axis=1)]
    peak = -np.arctan2(spans[:, 1], spans[:, 0])
    peak = middle + np.array([math.remainder(each, math.pi) for each in peak - middle])
    # The diameter of a piece is |span| cos(angle - peak): it rises before its peak, and falls behind. Where a
    # peak is at a flush edge, a part that comes there may rest, and does.
    falls, fallen = flush - peak > _SAME, np.append(flush[1:], flush[0] + math.pi) - peak > -_SAME
    tops = np.flatnonzero(~falls & fallen)
    maxima = peak[tops]
    bottoms = [_bottom(falls, int(top)) for top in tops]
    minima = np.array([flush[k % len(flush)] + math.pi * (k // len(flush)) for k in bottoms])
    return SqueezeFunction(hull, flush, spans, maxima, minima, _period(maxima, minima))


def _bottom(falls: NDArray[np.bool_], top: int) -> int:
    """The first piece behind a peak on which the diameter rises."""
    piece = top + 1
    while falls[piece % len(falls)]:
        piece += 1
    return piece


def _period(maxima: Reals, minima: Reals) -> float:
    """The least part of half a turn by which the squeeze function can be shifted."""
    n = len(maxima)
    for shift in range(1, n):
        if n % shift == 0:
            part = math.pi * shift / n
            moved = [_unrolled(points, n + shift)[shift:] - part for points in (maxima, minima)]
            if np.allclose(moved, [maxima, minima], rtol=0.0, atol=_SAME):
                return part
    return math.pi


def _unrolled(points: Reals, count: int) -> Reals:
    """The first of points that repeat every half turn."""
    k = np.arange(count)
    return np.asarray(points[k % len(points)] + math.pi * (k // len(points)))


def _backward(function: SqueezeFunction) -> list[Step]:
    """The steps of the plan, the first squeeze first."""
    n = len(function.maxima)
    whole = round(n * function.period / math.pi)
    maxima, minima = (_unrolled(points, 2 * n + 1) for points in (function.maxima, function.minima))
    first = np.arange(whole)
    chain: list[Step] = []
    room = _SAME
    while not chain or room < function.period - _SAME:
        # From each maximum the widest interval whose image, from the first minimum to the last, fits.
        fits = minima[:whole] + room - (_SAME if chain else 0.0)
        last = np.minimum(np.searchsorted(minima, fits), first + whole)
        width, image = maxima[last] - maxima[:whole], minima[last - 1] - minima[:whole]
        # Of those equally wide, the one whose image leaves most room.
        k = int(np.lexsort((image, -np.round(width, 9)))[0])
        low, high = float(minima[k]), float(minima[last[k] - 1])
        chain.append(Step(float(maxima[k]), float(width[k]), low, high))
        if len(chain) > 1 and chain[-1].width <= room + _SAME:
            raise InputError("squeeze_plan.vertices: the part is too nearly symmetric to be oriented")
        room = chain[-1].width
    return chain[::-1]

"""Pieces of a body that lie flush, as one outline, so that no edge between them is left.

Directed edges of pieces, cut at the vertices of others that lie on them, cancel where two run against each
other; those that are left go around the outline. Pieces that overlap, or that would touch in a point, stay as
they are.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import combinations, pairwise
from typing import Any, TypeAlias

from rungwise.scene.fields.shapes import Box, Outline, Polygon, Regular, Shape
from rungwise.scene.fields.values import Number

Place: TypeAlias = tuple[float, float]
Loops: TypeAlias = Sequence[Sequence[Place]]
"""An outline, and its holes."""
Edge: TypeAlias = tuple[int, int]

FLUSH = 1e-9
"""Distance, over the size of a body, up to which its pieces are flush."""
_CORNERS = (-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)
"""Corners of a box, over its width and height."""


def loops_of(shape: Shape) -> Loops | None:
    """The outline of a polygon and its holes in the body's frame; None where some number is not known yet, or
    the polygon is rounded or wrong."""
    if not isinstance(shape, Box | Polygon | Regular | Outline):
        return None
    sizes = _known([getattr(shape, field) for field in shape.sizes])
    frame = _known([*shape.at, shape.angle, 0.0 if isinstance(shape, Outline) else shape.radius])
    if sizes is None or frame is None or frame[3] != 0.0 or any(size <= 0.0 for size in sizes):
        return None
    given: Sequence[Sequence[Sequence[Number]]] = [[(x, y) for x, y, _ in shape.core()]]
    if isinstance(shape, Outline):
        given = [shape.vertices, *shape.holes]
    elif isinstance(shape, Box):
        given = [[(x * sizes[0], y * sizes[1]) for x, y in _CORNERS]]
    x, y, angle, _ = frame
    c, s = math.cos(angle), math.sin(angle)
    loops = []
    for loop in given:
        numbers = _known([number for place in loop for number in place])
        if numbers is None:
            return None
        pairs = zip(numbers[::2], numbers[1::2], strict=True)
        loops.append([(x + c * u - s * v, y + s * u + c * v) for u, v in pairs])
    if isinstance(shape, Outline):
        return loops if all(len(set(loop)) == len(loop) for loop in loops) else None
    return loops if _is_convex(loops[0]) else None


def _known(values: Sequence[Number]) -> list[float] | None:
    """The values, if none is an expression."""
    numbers = [value for value in values if not isinstance(value, str)]
    return numbers if len(numbers) == len(values) else None


def _is_convex(loop: Sequence[Place]) -> bool:
    turns = [
        (b[0] - a[0]) * (c[1] - b[1]) - (b[1] - a[1]) * (c[0] - b[0])
        for a, b, c in zip([loop[-1], *loop[:-1]], loop, [*loop[1:], loop[0]], strict=True)
    ]
    return min(turns) > 0.0 or max(turns) < 0.0


def merged(pieces: Sequence[Loops]) -> list[tuple[list[int], Loops]]:
    """Outlines that simple polygons form together, each with the numbers of the pieces in it. They go
    counter-clockwise around from their least vertex, their holes the other way, without vertices on straight
    lines; so they do not depend on how an outline was cut into pieces."""
    if len(pieces) == 0 or (len(pieces) == 1 and len(pieces[0]) == 1 and _is_convex(pieces[0][0])):
        return [([k], piece) for k, piece in enumerate(pieces)]
    import shapely

    polygons = [shapely.Polygon(piece[0], piece[1:]) for piece in pieces]
    if not all(polygon.is_valid and polygon.area > 0.0 for polygon in polygons):
        return [([k], piece) for k, piece in enumerate(pieces)]
    near = FLUSH * max(abs(x) for piece in pieces for loop in piece for place in loop for x in place)
    lone = {
        k
        for a, b in combinations(range(len(pieces)), 2)
        if polygons[a].intersection(polygons[b]).area > near * polygons[a].length
        for k in (a, b)
    }
    places, edges = _edges([shapely.geometry.polygon.orient(polygon) for polygon in polygons], near)
    found: list[tuple[list[int], Loops]] = []
    for group in _groups([set() if k in lone else own for k, own in enumerate(edges)]):
        together = {edge for k in group for edge in edges[k]}
        loops = _loops({(a, b) for a, b in together if (b, a) not in together}, places, near)
        if loops is None and len(group) > 1:
            found += [([k], pieces[k]) for k in group]
        else:
            found.append((group, pieces[group[0]] if loops is None else loops))
    return sorted(found, key=lambda each: each[0])


def _edges(polygons: Sequence[Any], near: float) -> tuple[list[Place], list[set[Edge]]]:
    """Places, each once, and the directed edges of each polygon between them, cut at places on them."""
    places: list[Place] = []
    rings: list[list[list[int]]] = []
    for polygon in polygons:
        loops = [polygon.exterior, *polygon.interiors]
        rings.append([[_number((float(x), float(y)), places, near) for x, y in r.coords[:-1]] for r in loops])
    cut = []
    for loops in rings:
        own: set[Edge] = set()
        for loop in loops:
            for a, b in zip(loop, [*loop[1:], loop[0]], strict=True):
                if a != b:
                    own.update(pairwise([a, *_between(places[a], places[b], places, near), b]))
        cut.append(own)
    return places, cut


def _number(place: Place, places: list[Place], near: float) -> int:
    """The number of a place, which is added where it is new."""
    for k, known in enumerate(places):
        if math.dist(place, known) <= near:
            return k
    places.append(place)
    return len(places) - 1


def _between(a: Place, b: Place, places: list[Place], near: float) -> list[int]:
    """Places on the edge from a to b, in their order."""
    length = math.dist(a, b)
    along = []
    for k, (x, y) in enumerate(places):
        gone = ((x - a[0]) * (b[0] - a[0]) + (y - a[1]) * (b[1] - a[1])) / length
        if near < gone < length - near and abs(_off(a, b, (x, y))) <= near:
            along.append((gone, k))
    return [k for _, k in sorted(along)]


def _off(a: Place, b: Place, place: Place) -> float:
    """Distance of a place from the line through a and b, positive on its left."""
    x, y = b[0] - a[0], b[1] - a[1]
    return (x * (place[1] - a[1]) - y * (place[0] - a[0])) / math.hypot(x, y)


def _groups(edges: list[set[Edge]]) -> list[list[int]]:
    """Pieces that hang together by edges that run against each other."""
    group = list(range(len(edges)))
    for a, b in combinations(range(len(edges)), 2):
        if any((j, i) in edges[b] for i, j in edges[a]):
            group = [group[a] if g == group[b] else g for g in group]
    return [[k for k, g in enumerate(group) if g == name] for name in dict.fromkeys(group)]


def _loops(edges: set[Edge], places: list[Place], near: float) -> list[list[Place]] | None:
    """The edges as an outline and its holes; None where they are not one outline that goes through no place
    twice."""
    after = dict(edges)
    if len(after) < len(edges):
        return None
    outer: list[list[Place]] = []
    holes: list[list[Place]] = []
    while after:
        first, b = after.popitem()
        way = [first]
        while b != first:
            way.append(b)
            b = after.pop(b)
        loop = _without_straight([places[k] for k in way], near)
        at = loop.index(min(loop))
        loop = loop[at:] + loop[:at]
        (outer if _off(loop[-1], loop[0], loop[1]) > 0.0 else holes).append(loop)
    return [*outer, *sorted(holes)] if len(outer) == 1 else None


def _without_straight(loop: list[Place], near: float) -> list[Place]:
    kept = list(loop)
    for place in loop:
        k = kept.index(place)
        if abs(_off(kept[k - 1], kept[(k + 1) % len(kept)], place)) <= near:
            del kept[k]
    return kept

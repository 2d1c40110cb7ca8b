"""Outlines that are not convex, with or without holes, as convex pieces.

The triangulation is shapely's (constrained Delaunay: edges of the outline and diagonals, no new points);
neighbours are joined as long as the union stays convex (Hertel and Mehlhorn, FCT 1983), which leaves at most
four times the least number of pieces.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

Place = tuple[float, float]


def convex_pieces(outline: Sequence[Place], holes: Sequence[Sequence[Place]] = ()) -> list[list[int]]:
    """Convex pieces of a simple polygon, each as numbers of its vertices, counter-clockwise; vertices of
    `holes` are numbered after those of the outline.

    Raises ValueError when the outline crosses or touches itself or a hole, or has no area; holes lie inside.
    """
    import shapely

    polygon = shapely.Polygon(outline, holes)
    places = [*outline, *(place for hole in holes for place in hole)]
    if len(set(places)) < len(places) or not polygon.is_valid or not polygon.area > 0.0:
        raise ValueError(_wrong(polygon, bool(holes)))
    number = {place: k for k, place in enumerate(places)}
    pieces = []
    for triangle in shapely.constrained_delaunay_triangles(polygon).geoms:
        corners = [number[(float(x), float(y))] for x, y in triangle.exterior.coords[:3]]
        pieces.append(corners if _turn(places, *corners) > 0.0 else corners[::-1])
    return _joined(places, pieces)


def _wrong(polygon: object, holes: bool) -> str:
    import shapely

    reason = str(shapely.is_valid_reason(polygon))
    at = f" (at {', '.join(reason[:-1].split('[')[1].split())})" if "[" in reason else ""
    return f"the outline crosses or touches itself{' or a hole' * holes}, or has no area{at}"


def _turn(places: Sequence[Place], a: int, b: int, c: int) -> float:
    """Twice the area of the triangle a, b, c: positive when it turns to the left."""
    (ax, ay), (bx, by), (cx, cy) = places[a], places[b], places[c]
    return (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)


def _joined(places: Sequence[Place], pieces: list[list[int]]) -> list[list[int]]:
    """The pieces, with neighbours joined wherever the union is convex: each diagonal is tried once, for one
    that is needed stays so, and the longest first, which leaves fewer slivers."""
    least = 1e-9 * max(abs(x) for place in places for x in place) ** 2
    owner = {edge: piece for piece in pieces for edge in _edges(piece)}
    diagonals = [(a, b) for a, b in owner if a < b and (b, a) in owner]
    for a, b in sorted(diagonals, key=lambda edge: -math.dist(places[edge[0]], places[edge[1]])):
        one, other = owner[a, b], owner[b, a]
        union = _after(one, b) + _after(other, a)
        corners = zip([union[-1], *union[:-1]], union, [*union[1:], union[0]], strict=True)
        if all(_turn(places, *corner) > least for corner in corners):
            del owner[a, b], owner[b, a]
            owner.update(dict.fromkeys(_edges(union), union))
    return list({id(piece): piece for piece in owner.values()}.values())


def _edges(piece: list[int]) -> list[tuple[int, int]]:
    return list(zip(piece, [*piece[1:], piece[0]], strict=True))


def _after(piece: list[int], first: int) -> list[int]:
    """The vertices of a piece from `first` on, but for the last."""
    at = piece.index(first)
    return (piece[at:] + piece[:at])[:-1]

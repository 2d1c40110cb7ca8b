"""Outlines that are not convex, as convex pieces.

The triangulation is shapely's (constrained Delaunay: edges of the outline and diagonals, no new points);
neighbours are joined as long as the union stays convex (Hertel and Mehlhorn, FCT 1983), which leaves at most
four times the least number of pieces.
"""

from __future__ import annotations

from collections.abc import Sequence

Place = tuple[float, float]


def convex_pieces(outline: Sequence[Place]) -> list[list[int]]:
    """Convex pieces of a simple polygon, each as numbers of its vertices, counter-clockwise.

    Raises ValueError when the outline crosses or touches itself, or has no area.
    """
    import shapely

    polygon = shapely.Polygon(outline)
    if len(set(outline)) < len(outline) or not polygon.is_valid or not polygon.area > 0.0:
        raise ValueError("the outline crosses or touches itself, or has no area")
    number = {place: k for k, place in enumerate(outline)}
    pieces = []
    for triangle in shapely.constrained_delaunay_triangles(polygon).geoms:
        corners = [number[(float(x), float(y))] for x, y in triangle.exterior.coords[:3]]
        pieces.append(corners if _turn(outline, *corners) > 0.0 else corners[::-1])
    return _joined(outline, pieces)


def _turn(outline: Sequence[Place], a: int, b: int, c: int) -> float:
    """Twice the area of the triangle a, b, c: positive when it turns to the left."""
    (ax, ay), (bx, by), (cx, cy) = outline[a], outline[b], outline[c]
    return (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)


def _joined(outline: Sequence[Place], pieces: list[list[int]]) -> list[list[int]]:
    """The pieces, with neighbours joined wherever the union is convex."""
    done = False
    while not done:
        done = True
        for i, one in enumerate(pieces):
            for j in range(i + 1, len(pieces)):
                union = _union(outline, one, pieces[j])
                if union is not None:
                    pieces[i : i + 1] = [union]
                    del pieces[j]
                    done = False
                    break
            if not done:
                break
    return pieces


def _union(outline: Sequence[Place], one: list[int], other: list[int]) -> list[int] | None:
    """Both pieces as one, if they share an edge and the union is convex."""
    for k in range(len(one)):
        a, b = one[k], one[(k + 1) % len(one)]
        if b not in other or other[(other.index(b) + 1) % len(other)] != a:
            continue
        at = other.index(a)
        between = [other[(at + m) % len(other)] for m in range(1, len(other) - 1)]
        union = [*one[: k + 1], *between, *one[k + 1 :]]
        corners = zip([union[-1], *union[:-1]], union, [*union[1:], union[0]], strict=True)
        size = max(abs(x) for place in outline for x in place) ** 2
        if all(_turn(outline, *corner) > 1e-9 * size for corner in corners):
            return union
    return None

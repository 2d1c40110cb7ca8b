"""Drawings as outlines: paths joined to loops, holes told from outlines, lengths in the scene's unit."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from rungwise.scene.drawings.paths import METRES, Drawn, File, Place, read_drawing
from rungwise.scene.errors import SceneError
from rungwise.scene.fields.fields import Body, SceneFile
from rungwise.scene.fields.shapes import Drawing, Outline, Shape
from rungwise.wording import listed

if TYPE_CHECKING:
    import shapely

FINE = 1e-3
"""Default tolerance, as a part of an outline's size."""
CHORDS = 0.1
"""Part of the tolerance by which chords depart from curves; the rest goes to leaving out ends of chords."""
MOST, MOST_HOLES = 500, 32


def with_outlines(scene: SceneFile, folder: Path) -> SceneFile:
    """The scene with outlines in place of drawings, whose files are looked for in `folder`. Raises
    SceneError."""
    changed = {name: _drawn(f"bodies.{name}.shape", body, folder) for name, body in scene.bodies.items()}
    if all(changed[name] is body for name, body in scene.bodies.items()):
        return scene
    return scene.model_copy(update={"bodies": changed})


def _drawn(field: str, body: Body, folder: Path) -> Body:
    if not any(isinstance(shape, Drawing) for shape in body.shapes):
        return body
    shape: Shape | tuple[Shape, ...]
    if isinstance(body.shape, tuple):
        shape = tuple(_outline(f"{field}.{k}", each, folder) for k, each in enumerate(body.shape))
    else:
        shape = _outline(field, body.shape, folder)
    return body.model_copy(update={"shape": shape})


def _outline(field: str, shape: Shape, folder: Path) -> Shape:
    if not isinstance(shape, Drawing):
        return shape
    file = read_drawing(field, folder / shape.file, shape.path)
    drawn_in = file.unit if shape.drawn_in is None else METRES[shape.drawn_in]
    if drawn_in is None:
        raise SceneError(
            f"{field}.drawn_in: is required, because the file states no unit; valid: {', '.join(METRES)}"
        )
    scale = drawn_in / METRES[shape.unit]
    size = _size(file)
    tolerance = FINE * size if shape.tolerance is None else shape.tolerance / scale
    loops = list(_loops(field, file, CHORDS * tolerance, scale))
    whole = _nested(field, loops, scale).simplify((1.0 - CHORDS) * tolerance)
    _check_counts(field, whole)
    x, y = (whole.centroid.x, whole.centroid.y) if shape.origin == "centroid" else (0.0, 0.0)

    def vertices(ring: shapely.LinearRing) -> tuple[Place, ...]:
        return tuple((scale * (a - x), scale * (b - y)) for a, b in ring.coords[:-1])

    holes = tuple(vertices(hole) for hole in whole.interiors)
    return Outline(
        kind="outline", vertices=vertices(whole.exterior), holes=holes, at=shape.at, angle=shape.angle
    )


def _size(file: File) -> float:
    points = [point for path in file.paths(math.inf) for point in path.points]
    return max(max(x) - min(x) for x in ([p[k] for p in points] for k in (0, 1)))


def _loops(field: str, file: File, tolerance: float, scale: float) -> Iterator[tuple[str, list[Place]]]:
    """Closed paths, and open ones joined where their ends meet."""
    open_paths: list[Drawn] = []
    for path in file.paths(tolerance):
        if path.closed or _meet(path.points[0], path.points[-1], tolerance):
            yield path.name, path.points
        else:
            open_paths.append(path)
    while open_paths:
        first = open_paths.pop()
        points = list(first.points)
        while not _meet(points[0], points[-1], tolerance):
            found = next((p for p in open_paths if _continues(points[-1], p, tolerance)), None)
            if found is None:
                gap = scale * math.dist(points[0], points[-1])
                (ax, ay), (bx, by) = ((scale * x, scale * y) for x, y in (points[-1], points[0]))
                raise SceneError(
                    f"{field}.file: the path {first.name} is open from ({ax:g}, {ay:g}) to ({bx:g}, {by:g}),"
                    f" a gap of {gap:g}"
                )
            open_paths.remove(found)
            on = found.points if _meet(points[-1], found.points[0], tolerance) else found.points[::-1]
            points += on[1:]
        yield first.name, points


def _continues(end: Place, path: Drawn, tolerance: float) -> bool:
    return _meet(end, path.points[0], tolerance) or _meet(end, path.points[-1], tolerance)


def _meet(a: Place, b: Place, tolerance: float) -> bool:
    return math.dist(a, b) <= tolerance


def _nested(field: str, loops: list[tuple[str, list[Place]]], scale: float) -> shapely.Polygon:
    """One outline with the holes in it. Raises SceneError where loops cross, or there is more than one."""
    import shapely

    polygons = []
    for name, points in loops:
        polygon = shapely.Polygon(points) if len(points) > 2 else shapely.Polygon()
        if not polygon.is_valid or not polygon.area > 0.0:
            reason = str(shapely.is_valid_reason(polygon))
            at = ""
            if "[" in reason:
                x, y = (scale * float(part) for part in reason[:-1].split("[")[1].split())
                at = f" at ({x:g}, {y:g})"
            raise SceneError(f"{field}.file: the path {name} crosses or touches itself{at}, or has no area")
        polygons.append((name, polygon))
    polygons.sort(key=lambda each: -each[1].area)
    name, outer = polygons[0]
    holes: list[tuple[str, shapely.Polygon]] = []
    outside = [name]
    for other, polygon in polygons[1:]:
        if not outer.contains(polygon):
            if outer.intersects(polygon):
                raise SceneError(f"{field}.file: the paths {name} and {other} cross or touch each other")
            outside.append(other)
            continue
        for before, hole in holes:
            if hole.intersects(polygon):
                raise SceneError(
                    f"{field}.file: the holes {before} and {other} of {name} lie in each other, or cross"
                )
        holes.append((other, polygon))
    if len(outside) > 1:
        raise SceneError(
            f"{field}.path: is required, because the file draws {len(outside)} outlines side by side;"
            f" valid: {listed(dict.fromkeys(outside))}"
        )
    return shapely.Polygon(outer.exterior, [hole.exterior for _, hole in holes])


def _check_counts(field: str, whole: shapely.Polygon) -> None:
    counts = [len(ring.coords) - 1 for ring in (whole.exterior, *whole.interiors)]
    if max(counts) > MOST:
        raise SceneError(
            f"{field}.tolerance: leaves {max(counts)} vertices, and at most {MOST} may be; take a greater one"
        )
    if len(whole.interiors) > MOST_HOLES:
        raise SceneError(f"{field}.file: has {len(whole.interiors)} holes, and at most {MOST_HOLES} may be")

"""The shapes of bodies in a scene file (pydantic models, as of `fields`)."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Discriminator, Field, Tag

from rungwise.scene.fields.kinds import kinds
from rungwise.scene.fields.strict import Strict
from rungwise.scene.fields.values import Finite, Number, Pair, Text

ONE, MANY = "<one>", "<many>"
"""Tags of a field that takes one value or a list; pydantic puts them into the place of an error."""


Loop = Annotated[tuple[Pair, ...], Field(min_length=3, max_length=500)]
LengthUnit = Literal["m", "cm", "mm", "um", "nm", "in"]
Positive = Annotated[Finite, Field(gt=0.0)]


class Point(Strict):
    kind: Literal["point"]
    at: Pair = (0.0, 0.0)


class Disc(Strict):
    kind: Literal["disc"]
    radius: Number
    at: Pair = (0.0, 0.0)


class Capsule(Strict):
    """All points within `radius` of a segment of `length` along the body's x axis."""

    kind: Literal["capsule"]
    length: Number
    radius: Number
    at: Pair = (0.0, 0.0)
    angle: Number = 0.0


class Box(Strict):
    kind: Literal["box"]
    width: Number
    height: Number
    radius: Number = 0.0
    at: Pair = (0.0, 0.0)
    angle: Number = 0.0


class Polygon(Strict):
    """Convex polygon, in either sense of rotation, grown by a rounding `radius`."""

    kind: Literal["polygon"]
    vertices: Loop
    radius: Number = 0.0
    at: Pair = (0.0, 0.0)
    angle: Number = 0.0


class Outline(Strict):
    """Simple polygon that need not be convex, and may have holes; it is split into convex pieces at the
    parameters' defaults."""

    kind: Literal["outline"]
    vertices: Loop
    holes: Annotated[tuple[Loop, ...], Field(max_length=32)] = ()
    at: Pair = (0.0, 0.0)
    angle: Number = 0.0


class Drawing(Strict):
    """The outline that a file draws (SVG or DXF), read when the scene is loaded; holes are kept.

    `path` is an identifier (SVG) or a layer (DXF), needed where the file draws several outlines; `unit` is
    the scene's unit of length, `drawn_in` the file's, where it states none or another one. Curves become
    chords that depart from them by at most `tolerance` (default: a thousandth of the drawing's size). With
    the origin `centroid` the body's frame is centred on the outline, with `drawing` it is the file's, y
    upwards.
    """

    kind: Literal["drawing"]
    file: Text
    path: Text | None = None
    unit: LengthUnit = "m"
    drawn_in: LengthUnit | None = None
    tolerance: Positive | None = None
    origin: Literal["centroid", "drawing"] = "centroid"
    at: Pair = (0.0, 0.0)
    angle: Number = 0.0


class HalfPlane(Strict):
    """All points behind the line through `at` whose outward normal is `normal`."""

    kind: Literal["halfplane"]
    normal: Pair = (0.0, 1.0)
    at: Pair = (0.0, 0.0)


Shape = Annotated[
    Point | Disc | Capsule | Box | Polygon | Outline | Drawing | HalfPlane,
    Field(discriminator="kind"),
    kinds(Point, Disc, Capsule, Box, Polygon, Outline, Drawing, HalfPlane),
]
Shapes = Annotated[
    Annotated[Shape, Tag(ONE)] | Annotated[tuple[Shape, ...], Field(min_length=1, max_length=32), Tag(MANY)],
    Discriminator(lambda value: MANY if isinstance(value, list | tuple) else ONE),
]

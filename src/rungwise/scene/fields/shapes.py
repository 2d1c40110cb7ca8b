"""The shapes of bodies in a scene file (pydantic models, as of `fields`)."""

from __future__ import annotations

import math
from typing import Annotated, ClassVar, Literal, get_args

from pydantic import Discriminator, Field, Tag

from rungwise.scene.fields.kinds import kinds
from rungwise.scene.fields.strict import Strict
from rungwise.scene.fields.values import Finite, Number, Pair, Text, within

ONE, MANY = "<one>", "<many>"
"""Tags of a field that takes one value or a list; pydantic puts them into the place of an error."""


Loop = Annotated[tuple[Pair, ...], Field(min_length=3, max_length=500)]
LengthUnit = Literal["m", "cm", "mm", "um", "nm", "in"]
Positive = Annotated[Finite, Field(gt=0.0)]


class Solid(Strict):
    """What a shape says of itself: a convex polygon, grown by its field `radius` if it has one.

    `is_round`: the radius must be greater than 0; `sizes`: fields that must be, two at most.
    """

    is_round: ClassVar[bool] = False
    sizes: ClassVar[tuple[str, ...]] = ()

    def core(self) -> list[tuple[Number, Number, str]]:
        """Vertices before `at` and `angle`, numbers or expressions, each with the field that it is from."""
        return [(0.0, 0.0, "at")]


class Point(Solid):
    kind: Literal["point"]
    at: Pair = (0.0, 0.0)


class Disc(Solid):
    is_round: ClassVar[bool] = True

    kind: Literal["disc"]
    radius: Number
    at: Pair = (0.0, 0.0)


class Capsule(Solid):
    """All points within `radius` of a segment of `length` along the body's x axis."""

    is_round: ClassVar[bool] = True
    sizes: ClassVar[tuple[str, ...]] = ("length",)

    kind: Literal["capsule"]
    length: Number
    radius: Number
    at: Pair = (0.0, 0.0)
    angle: Number = 0.0

    def core(self) -> list[tuple[Number, Number, str]]:
        return [(0.0, 0.0, "length")] * 2  # binding fills them in, from the length


class Box(Solid):
    sizes: ClassVar[tuple[str, ...]] = ("width", "height")

    kind: Literal["box"]
    width: Number
    height: Number
    radius: Number = 0.0
    at: Pair = (0.0, 0.0)
    angle: Number = 0.0

    def core(self) -> list[tuple[Number, Number, str]]:
        return [(0.0, 0.0, "width")] * 4  # binding fills them in, from the sizes


class Polygon(Solid):
    """Convex polygon, in either sense of rotation, grown by a rounding `radius`."""

    kind: Literal["polygon"]
    vertices: Loop
    radius: Number = 0.0
    at: Pair = (0.0, 0.0)
    angle: Number = 0.0

    def core(self) -> list[tuple[Number, Number, str]]:
        return [(x, y, f"vertices.{k}") for k, (x, y) in enumerate(self.vertices)]


class Regular(Solid):
    """Regular polygon whose corners are at the distance `reach` from `at`, the first of them along the
    body's x axis; grown by a rounding `radius`."""

    sizes: ClassVar[tuple[str, ...]] = ("reach",)

    kind: Literal["regular"]
    corners: Annotated[int, within(3, 100)]
    reach: Number
    radius: Number = 0.0
    at: Pair = (0.0, 0.0)
    angle: Number = 0.0

    def core(self) -> list[tuple[Number, Number, str]]:
        turns = (2.0 * math.pi * k / self.corners for k in range(self.corners))
        return [(_times(math.cos(t), self.reach), _times(math.sin(t), self.reach), "reach") for t in turns]


class Outline(Solid):
    """Simple polygon that need not be convex, and may have holes; it is split into convex pieces at the
    parameters' defaults."""

    kind: Literal["outline"]
    vertices: Loop
    holes: Annotated[tuple[Loop, ...], Field(max_length=32)] = ()
    at: Pair = (0.0, 0.0)
    angle: Number = 0.0


class Drawing(Solid):
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


class HalfPlane(Solid):
    """All points behind the line through `at` whose outward normal is `normal`."""

    kind: Literal["halfplane"]
    normal: Pair = (0.0, 1.0)
    at: Pair = (0.0, 0.0)

    def core(self) -> list[tuple[Number, Number, str]]:
        return [(0.0, 0.0, "normal"), (*self.normal, "normal")]


def _times(factor: float, size: Number) -> Number:
    return f"{factor!r} * ({size})" if isinstance(size, str) else factor * size


_Shape = Point | Disc | Capsule | Box | Polygon | Regular | Outline | Drawing | HalfPlane
Shape = Annotated[_Shape, Field(discriminator="kind"), kinds(*get_args(_Shape))]
Shapes = Annotated[
    Annotated[Shape, Tag(ONE)] | Annotated[tuple[Shape, ...], Field(min_length=1, max_length=32), Tag(MANY)],
    Discriminator(lambda value: MANY if isinstance(value, list | tuple) else ONE),
]

"""Parts of a scene for `SceneBuilder`: shapes, motions, drives, pressures of supports, as a scene file holds
them. Fields that are left out take the defaults of the scene file; see there for what they mean.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, TypeAlias

from rungwise.keywords import keywords

Number: TypeAlias = float | str
"""A number, or an expression of the scene's parameters."""
Pair: TypeAlias = Sequence[Number]
Part: TypeAlias = Mapping[str, Any]


def part(kind: str | None, given: Mapping[str, Any]) -> dict[str, Any]:
    """The fields that are given, with their kind first."""
    fields = {name: value for name, value in given.items() if value is not None}
    return fields if kind is None else {"kind": kind} | fields


@keywords
def point(at: Pair | None = None) -> Part:
    return part("point", locals())


@keywords
def disc(radius: Number, at: Pair | None = None) -> Part:
    return part("disc", locals())


@keywords
def capsule(length: Number, radius: Number, at: Pair | None = None, angle: Number | None = None) -> Part:
    return part("capsule", locals())


@keywords
def box(
    width: Number,
    height: Number,
    radius: Number | None = None,
    at: Pair | None = None,
    angle: Number | None = None,
) -> Part:
    return part("box", locals())


@keywords
def polygon(
    vertices: Sequence[Pair],
    radius: Number | None = None,
    at: Pair | None = None,
    angle: Number | None = None,
) -> Part:
    return part("polygon", locals())


@keywords
def regular(
    corners: int,
    reach: Number,
    radius: Number | None = None,
    at: Pair | None = None,
    angle: Number | None = None,
) -> Part:
    return part("regular", locals())


@keywords
def outline(
    vertices: Sequence[Pair],
    holes: Sequence[Sequence[Pair]] | None = None,
    at: Pair | None = None,
    angle: Number | None = None,
) -> Part:
    return part("outline", locals())


@keywords
def drawing(
    file: str,
    path: str | None = None,
    unit: str | None = None,
    drawn_in: str | None = None,
    tolerance: float | None = None,
    origin: str | None = None,
    at: Pair | None = None,
    angle: Number | None = None,
) -> Part:
    return part("drawing", locals())


@keywords
def halfplane(normal: Pair | None = None, at: Pair | None = None) -> Part:
    return part("halfplane", locals())


@keywords
def fixed() -> Part:
    return part("fixed", {})


@keywords
def slide(axis: Pair, name: str | None = None) -> Part:
    return part("slide", locals())


@keywords
def hinge(pivot: Pair, name: str | None = None) -> Part:
    return part("hinge", locals())


@keywords
def free() -> Part:
    return part("free", {})


@keywords
def speed(speed: Number) -> Part:
    return part("speed", locals())


@keywords
def servo(
    stiffness: Number,
    damping: Number | None = None,
    target: Number | None = None,
    target_speed: Number | None = None,
    limit: Number | None = None,
) -> Part:
    return part("servo", locals())


@keywords
def force(force: Number) -> Part:
    return part("force", locals())


@keywords
def coordinate(
    start: Number | None = None,
    speed: Number | None = None,
    lower: Number | None = None,
    upper: Number | None = None,
    damping: Number | None = None,
    dry_friction: Number | None = None,
    drive: Part | None = None,
) -> Part:
    return part(None, locals())


@keywords
def support(
    friction: Number,
    load: Number | None = None,
    gravity: Number | None = None,
    pressure: Part | None = None,
    centre: Pair | None = None,
    limit_surface: str | None = None,
) -> Part:
    return part(None, locals())


@keywords
def uniform() -> Part:
    return part("uniform", {})


@keywords
def ring(radius: Number) -> Part:
    return part("ring", locals())


@keywords
def points(points: Sequence[Pair], weights: Sequence[Number] | None = None) -> Part:
    return part("points", locals())


@keywords
def ratio(ratio: Number) -> Part:
    return part("ratio", locals())

"""Supports of free bodies: friction, load and pressure as written."""

from __future__ import annotations

from rungwise.scene.errors import SceneError
from rungwise.scene.fields.fields import Body, Free, Points, Ratio, Ring, SceneFile, Support
from rungwise.scene.template import records as rec
from rungwise.scene.template.writer import Writer

_PRESSURES = {"uniform": rec.UNIFORM, "ring": rec.RING, "points": rec.POINTS, "ratio": rec.RATIO}


def supports(scene: SceneFile) -> dict[str, Support]:
    """Supports of the scene by body, in order."""
    return {name: body.support for name, body in scene.bodies.items() if body.support is not None}


def spot_count(support: Support) -> int:
    """How many points carry the body."""
    return len(support.pressure.points) if isinstance(support.pressure, Points) else 0


def write_supports(writer: Writer, scene: SceneFile) -> None:
    """All supports of the scene. Raises SceneError, naming the field."""
    bodies, spot = tuple(scene.bodies), 0
    for index, (name, support) in enumerate(supports(scene).items()):
        _refuse(scene.bodies[name], f"bodies.{name}")
        writer.records.supports[index]["body"] = bodies.index(name)
        writer.records.supports[index]["first"] = spot
        _write(writer, index, support, f"bodies.{name}.support")
        spot += spot_count(support)
        writer.records.supports[index]["end"] = spot


def _refuse(body: Body, path: str) -> None:
    if not isinstance(body.motion, Free):
        raise SceneError(
            f"{path}.support: is for bodies whose motion is free, not {body.motion.kind};"
            " dry_friction is for single coordinates"
        )
    for name, coordinate in body.coordinates.items():
        if coordinate.dry_friction != 0.0:
            raise SceneError(
                f"{path}.coordinates.{name}.dry_friction: the body has a support; give one of them"
            )


def _write(writer: Writer, index: int, support: Support, path: str) -> None:
    record, pressure = writer.records.supports[index], support.pressure
    record["pressure"] = _PRESSURES[pressure.kind]
    record["exact"] = support.limit_surface == "exact"
    record["weighed"] = support.load is None
    record["centre_given"] = support.centre is not None
    for field in ("friction", "load", "gravity"):
        value = getattr(support, field)
        writer.put("supports", index, field, 0.0 if value is None else value, f"{path}.{field}", at_least=0.0)
    for k, value in enumerate(support.centre or (0.0, 0.0)):
        writer.put("supports", index, ("centre_x", "centre_y")[k], value, f"{path}.centre.{k}")
    path += ".pressure"
    match pressure:
        case Ring(radius=radius):
            writer.put("supports", index, "ratio", radius, f"{path}.radius", above=0.0)
        case Ratio(ratio=ratio):
            writer.put("supports", index, "ratio", ratio, f"{path}.ratio", at_least=0.0)
        case Points(points=points):
            weights = pressure.weights or (1.0,) * len(points)
            for k, ((x, y), weight) in enumerate(zip(points, weights, strict=True)):
                spot = int(record["first"]) + k
                writer.put("spots", spot, "x", x, f"{path}.points.{k}.0")
                writer.put("spots", spot, "y", y, f"{path}.points.{k}.1")
                writer.put("spots", spot, "weight", weight, f"{path}.weights.{k}", at_least=0.0)

"""The numbers of a scene file, each with the dimension of the place where it stands."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

from pydantic import BaseModel

from rungwise.scene.dimensions.expressions import NONE, Powers
from rungwise.scene.fields import fields as planar
from rungwise.scene.fields import shapes
from rungwise.scene.fields.laws.contact import Contact
from rungwise.scene.fields.stated import Stated
from rungwise.scene.space import fields as spatial


class Kind(NamedTuple):
    """What stands in a place, with an article; its dimension; and a unit that fits."""

    name: str
    powers: Powers
    unit: str


LENGTH, ANGLE, TIME = (
    Kind("a length", Powers(1), "m"),
    Kind("an angle", NONE, "rad or deg"),
    Kind("a time", Powers(0, 0, 1), "s"),
)
MASS, RATIO = Kind("a mass", Powers(0, 1), "kg"), Kind("a ratio", NONE, "1")
FORCE, TORQUE = Kind("a force", Powers(1, 1, -2), "N"), Kind("a torque", Powers(2, 1, -2), "N*m")
GRAVITY = Kind("an acceleration", Powers(1, 0, -2), "m/s^2")
AREA_DENSITY = Kind("a mass per area", Powers(-2, 1), "kg/m^2")
DENSITY = Kind("a mass per volume", Powers(-3, 1), "kg/m^3")
INERTIA = Kind("a moment of inertia", Powers(2, 1), "kg*m^2")
SPEED, TURN = Kind("a speed", Powers(1, 0, -1), "m/s"), Kind("an angular speed", Powers(0, 0, -1), "rad/s")
STIFFNESS, DAMPING = (
    Kind("a stiffness", Powers(0, 1, -2), "N/m"),
    Kind("a damping", Powers(0, 1, -1), "N*s/m"),
)
TURN_STIFFNESS = Kind("a torque per angle", TORQUE.powers, "N*m/rad")
TURN_DAMPING = Kind("a torque per angular speed", Powers(2, 1, -1), "N*m*s/rad")

_LAW = {
    "friction": RATIO, "restitution": RATIO, "static_friction": RATIO,
    "stiffness": STIFFNESS, "damping": DAMPING,
    "tangential_stiffness": STIFFNESS, "tangential_damping": DAMPING, "coupling_stiffness": STIFFNESS,
    "coupling_damping": DAMPING, "yield_speed": SPEED, "adhesion": FORCE, "adhesion_range": LENGTH,
    "torsional_friction": LENGTH, "rolling_friction": LENGTH,
}  # fmt: skip
_WHOLE = {"gravity": GRAVITY, "tolerance": LENGTH, "duration": TIME, "step": TIME}
_OWN: Mapping[type[BaseModel], Mapping[str, Kind]] = {
    planar.SceneFile: _WHOLE,
    Stated: {"duration": TIME, "step": TIME},
    spatial.SpaceFile: _WHOLE,
    planar.Pose: {"x": LENGTH, "y": LENGTH, "angle": ANGLE},
    planar.Body: {
        "mass": MASS, "density": AREA_DENSITY, "centre": LENGTH, "inertia": INERTIA, "force": FORCE,
        "torque": TORQUE, "raised": LENGTH,
    },
    planar.Hinge: {"pivot": LENGTH},
    planar.Support: {"friction": RATIO, "load": FORCE, "gravity": GRAVITY, "centre": LENGTH},
    planar.Ring: {"radius": LENGTH},
    planar.Ratio: {"ratio": LENGTH},
    planar.Points: {"points": LENGTH},
    planar.Joint: {
        "at": LENGTH, "stiffness": STIFFNESS, "damping": DAMPING, "angular_stiffness": TURN_STIFFNESS,
        "angular_damping": TURN_DAMPING,
    },
    shapes.Solid: dict.fromkeys(
        ("radius", "length", "width", "height", "reach", "at", "vertices", "holes"), LENGTH
    ) | {"angle": ANGLE},
    Contact: _LAW,
    spatial.Contact: _LAW,
    spatial.Part: {"xyz": LENGTH, "rpy": ANGLE},
}  # fmt: skip
_ALONG: Mapping[type[BaseModel], Mapping[str, tuple[Kind, Kind]]] = {
    planar.JointCoordinate: {
        "start": (LENGTH, ANGLE), "lower": (LENGTH, ANGLE), "upper": (LENGTH, ANGLE), "speed": (SPEED, TURN),
        "damping": (DAMPING, TURN_DAMPING), "dry_friction": (FORCE, TORQUE),
    },
    planar.Speed: {"speed": (SPEED, TURN)},
    planar.Force: {"force": (FORCE, TORQUE)},
    planar.Servo: {
        "stiffness": (STIFFNESS, TURN_STIFFNESS), "damping": (DAMPING, TURN_DAMPING),
        "target": (LENGTH, ANGLE), "target_speed": (SPEED, TURN), "limit": (FORCE, TORQUE),
    },
}  # fmt: skip
"""Along a coordinate that is a length, and one that is an angle."""
_ELEMENTS = {
    ("geoms", "size"): LENGTH, ("geoms", "pos"): LENGTH, ("geoms", "mass"): MASS,
    ("geoms", "density"): DENSITY, ("bodies", "pos"): LENGTH, ("bodies", "mass"): MASS,
    ("option", "gravity"): GRAVITY, ("option", "timestep"): TIME,
}  # fmt: skip
"""Fields of a model in space that have one dimension whatever their element is."""


class Place(NamedTuple):
    """A number of a scene, where it stands, and what stands there."""

    path: str
    text: str
    kind: Kind


def places(file: BaseModel, coordinates: Mapping[str, Kind]) -> Iterator[Place]:
    """The expressions of a scene file that stand where the dimension is known. `coordinates` says what each
    coordinate is, by its name, and velocities by ``speed(name)``."""
    yield from _within(file, "", None)
    if isinstance(file, spatial.SpaceFile):
        for name, value in file.start.places.items():
            yield from _of(value, f"start.places.{name}", coordinates.get(name))
        for field in ("velocities", "speeds"):
            where = "start.velocities" if field == "velocities" else field
            given = file.start.velocities if field == "velocities" else file.speeds
            for name, value in given.items():
                yield from _of(value, f"{where}.{name}", coordinates.get(f"speed({name})"))
        for group, settings in file.model.set:
            flat = {"": settings} if group == "option" else settings
            for name, fields in flat.items():
                for field, value in fields.items():
                    path = ".".join(each for each in ("model.set", group, name, field) if each)
                    yield from _of(value, path, _ELEMENTS.get((group, field)))


def _within(owner: BaseModel, path: str, turns: bool | None) -> Iterator[Place]:
    """`turns`: whether the coordinate within which this is turns; None outside coordinates."""
    own: dict[str, Kind] = {}
    for kind, fields in _OWN.items():
        own |= fields if isinstance(owner, kind) else {}
    for kind, both in _ALONG.items():
        if isinstance(owner, kind) and turns is not None:
            own |= {field: pair[turns] for field, pair in both.items()}
    for field, value in owner:
        inner = f"{path}.{field}" if path else field
        if isinstance(value, BaseModel):
            about = (
                owner.kind == "hinge" if isinstance(owner, planar.Joint) and field == "coordinate" else turns
            )
            yield from _within(value, inner, about)
        elif isinstance(owner, planar.Body) and field == "coordinates":
            for name, each in value.items():
                angular = isinstance(owner.motion, planar.Hinge) or (
                    isinstance(owner.motion, planar.Free) and name == "angle"
                )
                yield from _within(each, f"{inner}.{name}", angular)
        elif isinstance(value, dict | tuple | list):
            yield from _many(value, inner, own.get(field), turns)
        else:
            yield from _of(value, inner, own.get(field))


def _many(value: Any, path: str, kind: Kind | None, turns: bool | None) -> Iterator[Place]:
    for name, each in value.items() if isinstance(value, dict) else enumerate(value):
        inner = f"{path}.{name}"
        if isinstance(each, BaseModel):
            yield from _within(each, inner, turns)
        elif isinstance(each, tuple | list | dict):
            yield from _many(each, inner, kind, turns)
        else:
            yield from _of(each, inner, kind)


def _of(value: Any, path: str, kind: Kind | None) -> Iterator[Place]:
    if isinstance(value, tuple | list):
        for k, each in enumerate(value):
            yield from _of(each, f"{path}.{k}", kind)
    elif isinstance(value, str) and kind is not None:
        yield Place(path, value, kind)

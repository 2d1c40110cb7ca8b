"""The fields of a scene file: bodies, motion, drives, contacts, goal (pydantic models); shapes in `shapes`,
contacts in `laws`.

Every `Number` is a number or an expression of the scene's parameters (see `expression`); numbers marked
*timed* may also use the time ``t``. Units are the scene's own, as long as they are
consistent; parameters are converted (see `language.units`).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Literal

from pydantic import Field, model_validator
from pydantic_core import PydanticCustomError

from rungwise.scene.fields.kinds import kinds
from rungwise.scene.fields.laws.contact import Contact
from rungwise.scene.fields.shapes import Shape, Shapes
from rungwise.scene.fields.strict import Strict
from rungwise.scene.fields.task import Task
from rungwise.scene.fields.values import Finite, Name, Number, Pair, Text, Unit, of_dimension
from rungwise.scene.language.units import Conversion, conversions


class Parameter(Strict):
    """A named number of the scene that users, sets and designs may vary."""

    default: Finite
    range: tuple[Finite, Finite] | None = None
    unit: Unit = "1"
    about: Text = ""

    @model_validator(mode="after")
    def _ordered(self) -> Parameter:
        if self.range is not None and not self.range[0] <= self.default <= self.range[1]:
            raise PydanticCustomError("range", "range must be [low, high] with low <= default <= high")
        return self


class Speed(Strict):
    """Prescribed speed (timed): the coordinate moves so whatever it takes; the reaction is reported."""

    kind: Literal["speed"]
    speed: Number


class Servo(Strict):
    """Force ``stiffness (target - q) + damping (target_speed - v)``, at most `limit` (timed targets).

    Without `target` the servo follows ``start + target_speed t`` (a `target_speed` that uses t needs a
    target).
    """

    kind: Literal["servo"]
    stiffness: Number
    damping: Number = 0.0
    target: Number | None = None
    target_speed: Number = 0.0
    limit: Number = "inf"


class Force(Strict):
    """Given force or torque along the coordinate (timed)."""

    kind: Literal["force"]
    force: Number


Drive = Annotated[Speed | Servo | Force, Field(discriminator="kind"), kinds(Speed, Servo, Force)]


class Fixed(Strict):
    kind: Literal["fixed"] = "fixed"


class Slide(Strict):
    """One coordinate: the distance from the pose along `axis`."""

    kind: Literal["slide"]
    axis: Pair
    name: Name = "s"


class Hinge(Strict):
    """One coordinate: the angle turned from the pose about `pivot`, a point of the world."""

    kind: Literal["hinge"]
    pivot: Pair
    name: Name = "angle"


class Free(Strict):
    """Three coordinates: x and y of the centre of mass, and the angle."""

    kind: Literal["free"]


Motion = Annotated[
    Fixed | Slide | Hinge | Free, Field(discriminator="kind"), kinds(Fixed, Slide, Hinge, Free)
]


class JointCoordinate(Strict):
    """What a joint leaves free: travel, support and drive."""

    lower: Number = "-inf"
    upper: Number = "inf"
    damping: Number = 0.0
    dry_friction: Number = 0.0
    drive: Drive | None = None


class Coordinate(JointCoordinate):
    """One coordinate of a body: besides what a joint's has, its start (as a displacement from the pose).
    Travel (lower and upper) bounds the coordinate itself."""

    start: Number = 0.0
    speed: Number = 0.0


class Pose(Strict):
    x: Number = 0.0
    y: Number = 0.0
    angle: Number = 0.0


class Uniform(Strict):
    """The load is spread evenly over the outline of the body's shapes."""

    kind: Literal["uniform"] = "uniform"


class Ring(Strict):
    """The load rests on a thin ring of this radius about the centre of pressure."""

    kind: Literal["ring"]
    radius: Number


class Points(Strict):
    """The load rests on points of the body's frame, each with its part of the weights (default: equal)."""

    kind: Literal["points"]
    points: Annotated[tuple[Pair, ...], Field(min_length=1, max_length=1000)]
    weights: Annotated[tuple[Number, ...], Field(min_length=1, max_length=1000)] | None = None

    @model_validator(mode="after")
    def _as_many(self) -> Points:
        if self.weights is not None and len(self.weights) != len(self.points):
            raise PydanticCustomError(
                "support", "weights must be as many as points, {points}, not {weights}",
                {"points": len(self.points), "weights": len(self.weights)},
            )  # fmt: skip
        return self


class Ratio(Strict):
    """The greatest friction torque over the greatest friction force, a length."""

    kind: Literal["ratio"]
    ratio: Number


Pressure = Annotated[
    Uniform | Ring | Points | Ratio, Field(discriminator="kind"), kinds(Uniform, Ring, Points, Ratio)
]


class Support(Strict):
    """Dry friction with a plane parallel to the scene, on which a free body lies.

    Friction force f and torque m about the centre of pressure (`centre`, in the body's frame) oppose its
    twist, in |f|^2 + (m / c)^2 <= (friction * load)^2; `pressure` gives c. With `limit_surface: exact` they
    are instead what the pressure makes of Coulomb's law at each of its points. The load is given as a force,
    or by the acceleration of `gravity` normal to the plane.
    """

    friction: Number
    load: Number | None = None
    gravity: Number | None = None
    pressure: Pressure = Uniform()
    centre: Pair | None = None
    limit_surface: Literal["ellipsoid", "exact"] = "ellipsoid"

    @model_validator(mode="after")
    def _has_a_pressure(self) -> Support:
        if self.limit_surface == "exact" and isinstance(self.pressure, Ratio):
            raise PydanticCustomError(
                "support", "limit_surface: exact needs a pressure: uniform, ring or points"
            )
        if self.limit_surface == "exact" and self.centre is not None and not isinstance(self.pressure, Ring):
            raise PydanticCustomError(
                "support", "limit_surface: exact has its centre where the pressure has it; leave centre out"
            )
        return self

    @model_validator(mode="after")
    def _has_one_load(self) -> Support:
        if (self.load is None) == (self.gravity is None):
            raise PydanticCustomError("support", "needs either load, a force, or gravity, an acceleration")
        return self


class Body(Strict):
    """A rigid body. Mass, centre and inertia (about it) follow from outline and density if not given. A robot
    may be `raised` off the plane (a timed height): above 0 it touches no objects."""

    role: Literal["robot", "object", "obstacle"]
    shape: Shapes
    pose: Pose = Pose()
    motion: Motion = Fixed()
    coordinates: dict[Name, Coordinate] = {}
    mass: Number | None = None
    density: Number = 1.0
    centre: Pair | None = None
    inertia: Number | None = None
    force: Pair = (0.0, 0.0)
    torque: Number = 0.0
    support: Support | None = None
    raised: Number | None = None

    @property
    def shapes(self) -> tuple[Shape, ...]:
        return self.shape if isinstance(self.shape, tuple) else (self.shape,)

    @property
    def coordinate_names(self) -> tuple[str, ...]:
        match self.motion:
            case Slide(name=name) | Hinge(name=name):
                return (name,)
            case Free():
                return ("x", "y", "angle")
        return ()


class Joint(Strict):
    """Holds two bodies together where they are in their poses, at the point `at` of the world.

    A weld leaves no freedom, a hinge the angle, a slide the distance along `axis`; that is the joint's
    coordinate, 0 in the poses. What is held is rigid, or yields with stiffness and damping: translation, and
    (weld, slide) the angle. On the kinematic rung all of it is rigid.
    """

    kind: Literal["weld", "hinge", "slide"]
    between: tuple[Name, Name]
    at: Pair
    axis: Pair = (1.0, 0.0)
    stiffness: Number = "inf"
    damping: Number = 0.0
    angular_stiffness: Number | None = None
    angular_damping: Number | None = None
    coordinate: JointCoordinate | None = None

    @model_validator(mode="after")
    def _fits_its_kind(self) -> Joint:
        if self.kind == "weld" and self.coordinate is not None:
            raise PydanticCustomError("joint", "a weld has no coordinate")
        angular = self.angular_stiffness is not None or self.angular_damping is not None
        if self.kind == "hinge" and angular:
            raise PydanticCustomError(
                "joint", "a hinge does not hold the angle: no angular_stiffness or _damping"
            )
        for prefix in ("", "angular_"):
            stiffness, damping = getattr(self, f"{prefix}stiffness"), getattr(self, f"{prefix}damping")
            if damping not in (None, 0.0) and stiffness in (None, "inf"):
                raise PydanticCustomError(
                    "joint", f"{prefix}damping: what is rigid has none; give a finite {prefix}stiffness"
                )
        return self


class Potential(Strict):
    """Energy ``stiffness/2 (sum of factor * coordinate - target)^2`` whose gradient drives `on`.

    `on` defaults to the coordinates of `terms` that belong to robots.
    """

    stiffness: Number
    terms: Annotated[dict[Text, Number], Field(min_length=1)]
    target: Number = 0.0
    on: tuple[Text, ...] | None = None


class Units(Strict):
    """The units in which a scene counts; forces are in what is made of them, such as g*mm/ms^2."""

    length: Annotated[Unit, of_dimension(1, 0, 0)] = "m"
    mass: Annotated[Unit, of_dimension(0, 1, 0)] = "kg"
    time: Annotated[Unit, of_dimension(0, 0, 1)] = "s"


def conversions_of(parameters: Mapping[str, Parameter], units: Units | None) -> dict[str, Conversion]:
    """For each parameter whose unit is not the scene's, how it is converted. Raises SceneError."""
    own = None if units is None else units.model_dump()
    return conversions({name: each.unit for name, each in parameters.items()}, own)


class SceneFile(Strict):
    """A whole scene as written: see `Scene` for one that has been read and checked.

    `inputs` are parameters that a schedule may change during a run: timed numbers follow them, all others
    keep the values of the start. `task` is what planners may do, and how instances are drawn.
    """

    name: Name
    about: Text = ""
    parameters: dict[Name, Parameter] = {}
    units: Units | None = None
    inputs: tuple[Name, ...] = ()
    gravity: Pair = (0.0, 0.0)
    bodies: Annotated[dict[Name, Body], Field(min_length=1, max_length=2000)]
    joints: Annotated[dict[Name, Joint], Field(max_length=500)] = {}
    contacts: tuple[Contact, ...] = ()
    potentials: tuple[Potential, ...] = ()
    goal: Text | None = None
    unsafe: Text | None = None
    doomed: Text | None = None
    tolerance: Number = 1e-6
    duration: Number = 10.0
    step: Number = 1e-3
    task: Task | None = None

"""Scenes built in Python: the same content as a scene file, field by field."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

from rungwise.keywords import KeywordError, keywords
from rungwise.scene.builder.parts import Number, Pair, Part, part
from rungwise.scene.builder.symbol import Symbol
from rungwise.scene.errors import SceneError
from rungwise.scene.fields.laws.contact import LAWS, OWN
from rungwise.scene.fields.values import shown
from rungwise.scene.scene import Scene, load
from rungwise.wording import choices

F = TypeVar("F", bound=Callable[..., Any])

DRIVES = ("speed", "servo", "force")


def _with_laws(method: F) -> F:
    """The method with the fields of the laws of contact in its signature and description."""
    own = inspect.signature(method)
    given = [each for each in own.parameters.values() if each.kind != each.VAR_KEYWORD]
    laws = [inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=None) for name in OWN]
    method.__signature__ = own.replace(parameters=given + laws)  # type: ignore[attr-defined]
    lines = "".join(f"    {law.about}\n        " for law in LAWS)
    method.__doc__ = f"{method.__doc__}{lines}"
    return method


class SceneBuilder:
    """A scene while it is written; `load` reads it as a file would be read, with the same checks.

    Fields are those of a scene file and mean the same; what is left out takes the file's default. Numbers may
    be expressions: texts, or arithmetic on what `parameter` returns. Conditions are texts. Shapes, motions
    and drives come from `rungwise.parts`, or are mappings.
    """

    @keywords
    def __init__(
        self,
        name: str,
        *,
        about: str | None = None,
        units: Mapping[str, str] | None = None,
        gravity: Pair | None = None,
        goal: str | None = None,
        unsafe: str | None = None,
        doomed: str | None = None,
        tolerance: Number | None = None,
        duration: Number | None = None,
        step: Number | None = None,
        task: Part | None = None,
    ) -> None:
        """
        Args:
            name: of the scene.
            about: a sentence for people.
            units: units of length, mass and time in which the scene counts.
            gravity: acceleration of every body that moves.
            goal, unsafe, doomed: conditions that end a run with that outcome.
            tolerance: gap that counts as closed in conditions.
            duration, step: end of the run, and length of a step.
            task: what planners may do, as a mapping of the fields of a scene file.
        """
        self.name, self.about, self.gravity = name, about, gravity
        self.units = None if units is None else dict(units)
        self.goal, self.unsafe, self.doomed = goal, unsafe, doomed
        self.tolerance, self.duration, self.step, self.task = tolerance, duration, step, task
        self.parameters: dict[str, Part] = {}
        self.inputs: list[str] = []
        self.bodies: dict[str, Part] = {}
        self.joints: dict[str, Part] = {}
        self.contacts: list[Part] = []
        self.potentials: list[Part] = []

    def __repr__(self) -> str:
        return f"<SceneBuilder {self.name}: bodies {', '.join(self.bodies) or 'none'}>"

    @keywords
    def parameter(
        self,
        name: str,
        default: float,
        *,
        range: Sequence[float] | None = None,
        unit: str | None = None,
        about: str | None = None,
        is_input: bool = False,
    ) -> Symbol:
        """Add a number that users and sets may vary; it is returned for use in expressions.

        Args:
            name: its name.
            default: the value if none is given.
            range: least and greatest value.
            unit: such as "m/s" or "deg".
            about: a sentence for people.
            is_input: whether schedules may change it during a run.
        """
        _new("parameters", name, self.parameters)
        self.parameters[name] = part(None, {"default": default, "range": range, "unit": unit, "about": about})
        if is_input:
            self.inputs.append(name)
        return Symbol(name)

    @keywords
    def body(
        self,
        name: str,
        role: str,
        shape: Part | Sequence[Part],
        *,
        pose: Sequence[Number] | Part | None = None,
        motion: Part | None = None,
        coordinates: Mapping[str, Part] | None = None,
        mass: Number | None = None,
        density: Number | None = None,
        centre: Pair | None = None,
        inertia: Number | None = None,
        force: Pair | None = None,
        torque: Number | None = None,
        support: Part | None = None,
        raised: Number | None = None,
    ) -> None:
        """Add a rigid body. Numbers may be expressions of parameters; what is not given has the default of
        the scene file.

        Args:
            name: its name in contacts, conditions and results.
            role: "robot", "object" or "obstacle".
            shape: a shape of `rungwise.parts`, or several.
            pose: (x, y) or (x, y, angle), where all coordinates are 0.
            motion: `parts.fixed`, `slide`, `hinge` or `free`.
            coordinates: by name, `parts.coordinate` with start, travel and drive; a drive alone will do.
            mass, density: the mass, or the mass per area.
            centre, inertia: centre of mass in the body's frame, and inertia about it.
            force, torque: on the centre of mass, in world axes.
            support: `parts.support`, friction with the plane on which a free body lies.
            raised: of a robot, its height above the plane.
        """
        given = {key: value for key, value in locals().items() if key not in ("self", "name")}
        _new("bodies", name, self.bodies)
        if isinstance(pose, Sequence) and len(pose) in (2, 3):
            given["pose"] = dict(zip(("x", "y", "angle"), pose, strict=False))
        if coordinates is not None:
            given["coordinates"] = {key: _coordinate(value) for key, value in coordinates.items()}
        self.bodies[name] = part(None, given)

    @keywords
    def joint(
        self,
        name: str,
        kind: str,
        between: Sequence[str],
        at: Pair,
        *,
        axis: Pair | None = None,
        stiffness: Number | None = None,
        damping: Number | None = None,
        angular_stiffness: Number | None = None,
        angular_damping: Number | None = None,
        coordinate: Part | None = None,
    ) -> None:
        """Add a joint that holds two bodies together.

        Args:
            name: its name.
            kind: "weld", "hinge" or "slide".
            between: names of the two bodies.
            at: the point of the joint in the world, with all bodies in their poses.
            axis: direction of a slide.
            stiffness, damping: of the directions that are held; rigid if not given.
            angular_stiffness, angular_damping: of the angle that a weld or a slide holds.
            coordinate: `parts.coordinate`, travel and drive of the free direction or angle.
        """
        given = {key: value for key, value in locals().items() if key not in ("self", "name")}
        _new("joints", name, self.joints)
        if coordinate is not None:
            given["coordinate"] = _coordinate(coordinate)
        self.joints[name] = part(None, given)

    @keywords
    @_with_laws
    def contact(
        self,
        one: str,
        other: str,
        *,
        friction: Number | None = None,
        restitution: Number | None = None,
        stiffness: Number | None = None,
        damping: Number | None = None,
        tangential_stiffness: Number | None = None,
        tangential_damping: Number | None = None,
        coupling_stiffness: Number | None = None,
        coupling_damping: Number | None = None,
        **laws: Number | None,
    ) -> None:
        """Add an entry of bodies that may touch; the first entry that fits a pair applies.

        Args:
            one, other: names of bodies; ``*`` matches any part of a name.
            friction: Coulomb coefficient.
            restitution: of rigid impacts.
            stiffness, damping: normal, on compliant rungs.
            tangential_stiffness, tangential_damping: tangential; as the normal ones if not given.
            coupling_stiffness, coupling_damping: off the diagonal.
        """
        fields = {k: x for k, x in locals().items() if k not in ("self", "one", "other", "laws")}
        for name in laws:
            if name not in OWN:
                known = (*fields, *OWN)
                raise KeywordError(f"SceneBuilder.contact: unknown keyword {name!r}{choices(name, known)}")
        self.contacts.append(part(None, {"between": [one, other]} | fields | laws))

    @keywords
    def potential(
        self,
        stiffness: Number,
        terms: Mapping[str, Number],
        *,
        target: Number | None = None,
        on: Sequence[str] | None = None,
    ) -> None:
        """Add the energy ``stiffness/2 (sum of factor * coordinate - target)^2``.

        Args:
            stiffness: of the spring.
            terms: the factor of each coordinate, by the coordinate's name ("body.x").
            target: the sum at which the energy is 0.
            on: coordinates that the gradient drives; by default those of robots.
        """
        given = {key: value for key, value in locals().items() if key != "self"}
        self.potentials.append(part(None, given))

    def data(self) -> dict[str, Any]:
        """The content of the scene file."""
        given = {k: x for k, x in vars(self).items() if k == "units" or not isinstance(x, dict | list) or x}
        return part(None, given)

    def load(self) -> Scene:
        """The scene, read and checked. Raises SceneError: one line that names the field."""
        return load(self.data())

    def yaml(self) -> str:
        """The text of the scene file."""
        return self.load().yaml()

    def save(self, file: str | Path) -> None:
        """Write the scene file. Raises SceneError, OSError."""
        Path(file).write_text(self.yaml(), "utf-8")


def _coordinate(given: Part) -> Part:
    is_drive = isinstance(given, Mapping) and given.get("kind") in DRIVES
    return {"drive": given} if is_drive else given


def _new(field: str, name: str, known: Mapping[str, Part]) -> None:
    if name in known:
        raise SceneError(f"{field}.{name}: {shown(name)} is given twice")

"""From a scene as written to a template: records with their literal numbers, and programs for the others."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import chain, islice

import numpy as np

from rungwise.scene.drawings.flush import loops_of, merged
from rungwise.scene.drawings.outline import convex_pieces
from rungwise.scene.errors import SceneError
from rungwise.scene.fields.fields import Coordinate, Hinge, SceneFile, Slide, conversions_of
from rungwise.scene.fields.laws.contact import CHOICES, LAWS, Contact, named_by
from rungwise.scene.fields.shapes import Outline, Polygon, Shape
from rungwise.scene.fields.task import numbers_of
from rungwise.scene.fields.values import Number, Pair, shown
from rungwise.scene.language.expression import CONDITIONS, STACK, Programs
from rungwise.scene.language.names import Names, with_times
from rungwise.scene.template import records as rec
from rungwise.scene.template.joints import write_joint
from rungwise.scene.template.numbers import evaluate_numbers
from rungwise.scene.template.pairing import matched, shape_pairs
from rungwise.scene.template.supports import spot_count, supports, write_supports
from rungwise.scene.template.task import write_task
from rungwise.scene.template.template import Template, block_of
from rungwise.scene.template.writer import INF, Writer
from rungwise.wording import choices, listed

MAX_PAIRS = 600_000
"""Most pairs of shapes that may touch: with more pairs, a small file would need all memory."""


def build(scene: SceneFile) -> Template:
    """The template of a scene. Raises SceneError, naming the field."""
    return _Builder(scene).build()


class _Builder:
    def __init__(self, scene: SceneFile) -> None:
        self.scene = scene
        self.parameters = tuple(scene.parameters)
        self.bodies = tuple(scene.bodies)
        self.coordinates = tuple(
            f"{name}.{c}" for name, body in scene.bodies.items() for c in body.coordinate_names
        )
        self.joints = tuple(scene.joints)
        self.matched = list(matched(scene))
        self.contacts = tuple(pair for pair, _, _ in self.matched)
        self.units = conversions_of(scene.parameters, scene.units)
        self.names = Names(
            self.parameters, self.coordinates, self.contacts, bodies=self.bodies, units=self.units
        )
        self.shapes = {name: list(self._convex_shapes(name)) for name in self.bodies}
        self.pairs = list(islice(shape_pairs(self.shapes, self.contacts), MAX_PAIRS + 1))
        if len(self.pairs) > MAX_PAIRS:
            raise SceneError(
                f"contacts: more than {MAX_PAIRS} pairs of shapes may touch; name fewer bodies in between"
            )
        supported = supports(scene).values()
        counts = (
            1,
            len(self.bodies),
            len(self.coordinates),
            sum(len(shapes) for shapes in self.shapes.values()),
            sum(len(shape.core()) for shapes in self.shapes.values() for _, shape in shapes),
            len(self.contacts),
            len(self.pairs),
            len(scene.potentials),
            len(scene.potentials) * len(self.coordinates),
            len(scene.joints),
            3 * len(scene.joints),
            len(supported),
            sum(spot_count(support) for support in supported),
            0 if scene.task is None else len(numbers_of(scene.task)),
        )
        for place, name in enumerate(scene.inputs):
            if name not in self.parameters or name in scene.inputs[:place]:
                known = name in self.parameters
                wrong = "given twice:" if known else "unknown parameter"
                valid = f"; valid: {listed(self.parameters)}" if known else choices(name, self.parameters)
                raise SceneError(f"inputs.{place}: {wrong} {shown(name)}{valid}")
        self.writer = Writer(counts, self.names, scene.inputs)
        self.put, self.records = self.writer.put, self.writer.records

    def build(self) -> Template:
        for field in ("tolerance", "duration", "step"):
            self.put("world", 0, field, getattr(self.scene, field), field, above=0.0)
        for k, value in enumerate(self.scene.gravity):
            self.put("world", 0, ("gravity_x", "gravity_y")[k], value, f"gravity.{k}")
        for index in range(len(self.bodies)):
            self._body(index)
        for index, (pair, entry, contact) in enumerate(self.matched):
            self._contact(index, pair, f"contacts.{entry}", contact)
        for index, (contact_index, a, b) in enumerate(self.pairs):
            self.records.pairs[index] = (contact_index, a, b)
        self._unused_contacts()
        self._unused_heights()
        for index in range(len(self.joints)):
            write_joint(self.writer, self.scene, index)
        write_supports(self.writer, self.scene)
        if self.scene.task is not None:
            write_task(self.writer, self.scene)
        for index in range(len(self.scene.potentials)):
            self._potential(index)
        for place, (name, paths) in enumerate(self.writer.readers.items()):
            if not paths:
                raise SceneError(
                    f"inputs.{place}: {name} is read by no speed, target or force of a drive, nor by a"
                    " force on a body, nor raises one"
                )
        conditions = [self.names.condition(getattr(self.scene, name), name, name) for name in CONDITIONS[:-1]]
        for index in self.names.read["gap"]:
            self.records.contacts[index]["watched"] = 1
        for index in self.names.read["force"]:
            self.records.contacts[index]["weighed"] = 1
        written = self.writer
        return Template(
            counts=written.counts,
            buffer=written.buffer,
            numbers=Programs([code for code, _ in written.static]),
            targets=np.array([target for _, target in written.static], np.int64),
            timed=Programs([code for code, _ in written.timed]),
            timed_targets=np.array([target for _, target in written.timed], np.int64),
            speeds=Programs([code for code, _ in written.speeds]),
            speeds_targets=np.array([target for _, target in written.speeds], np.int64),
            conditions=Programs([*conditions, *with_times(conditions)]),
            checks=written.checks,
            parameters=self.parameters,
            inputs=self.scene.inputs,
            readers={name: tuple(paths) for name, paths in written.readers.items()},
            reads_time=written.reads_time,
            awaits_time=any(len(self.parameters) in code.reads for code in conditions),
            bodies=self.bodies,
            coordinates=self.coordinates,
            contacts=self.contacts,
            joints=self.joints,
            units=self.units,
        )

    def _body(self, index: int) -> None:
        name = self.bodies[index]
        body = self.scene.bodies[name]
        path = f"bodies.{name}"
        record = self.records.bodies[index]
        for field in ("x", "y", "angle"):
            self.put("bodies", index, field, getattr(body.pose, field), f"{path}.pose.{field}")
        record["motion"] = ("fixed", "slide", "hinge", "free").index(body.motion.kind)
        direction = body.motion.axis if isinstance(body.motion, Slide) else (1.0, 0.0)
        pivot = body.motion.pivot if isinstance(body.motion, Hinge) else (0.0, 0.0)
        for field, value, source in (
            ("axis_x", direction[0], "motion.axis.0"), ("axis_y", direction[1], "motion.axis.1"),
            ("pivot_x", pivot[0], "motion.pivot.0"), ("pivot_y", pivot[1], "motion.pivot.1"),
            ("force_x", body.force[0], "force.0"), ("force_y", body.force[1], "force.1"),
            ("torque", body.torque, "torque"),
        ):  # fmt: skip
            self.put("bodies", index, field, value, f"{path}.{source}", timed=not source.startswith("motion"))
        self.put("bodies", index, "density", body.density, f"{path}.density", at_least=0.0)
        for field in ("mass", "inertia"):
            value = getattr(body, field)
            record[f"{field}_given"] = value is not None
            self.put("bodies", index, field, 0.0 if value is None else value, f"{path}.{field}", at_least=0.0)
        record["centre_given"] = body.centre is not None
        for k, value in enumerate(body.centre or (0.0, 0.0)):
            self.put("bodies", index, ("centre_x", "centre_y")[k], value, f"{path}.centre.{k}")
        self._shapes(index)
        self._coordinates(index, path)

    def _coordinates(self, index: int, path: str) -> None:
        name = self.bodies[index]
        body = self.scene.bodies[name]
        names = body.coordinate_names
        for given in body.coordinates:
            if given not in names:
                valid = names or ("none (fixed)",)
                raise SceneError(f"{path}.coordinates: unknown coordinate {given!r}{choices(given, valid)}")
        first = self.coordinates.index(f"{name}.{names[0]}") if names else 0
        self.records.bodies[index]["coordinate"] = first
        for offset, coordinate_name in enumerate(names):
            self._coordinate(index, first + offset, coordinate_name, f"{path}.coordinates.{coordinate_name}")

    def _coordinate(self, body: int, index: int, name: str, path: str) -> None:
        given = self.scene.bodies[self.bodies[body]].coordinates.get(name, Coordinate())
        record = self.records.coordinates[index]
        record["body"] = body
        self.put("coordinates", index, "start", given.start, f"{path}.start")
        self.put("coordinates", index, "speed", given.speed, f"{path}.speed")
        self.put("coordinates", index, "lower", given.lower, f"{path}.lower", infinite=True)
        self.put("coordinates", index, "upper", given.upper, f"{path}.upper", infinite=True)
        self.put("coordinates", index, "damping", given.damping, f"{path}.damping", at_least=0.0)
        self.put(
            "coordinates", index, "dry_friction", given.dry_friction, f"{path}.dry_friction", at_least=0.0
        )
        self.writer.drive("coordinates", index, given.drive, f"{path}.drive")

    def _convex_shapes(self, name: str) -> Iterator[tuple[str, Shape]]:
        """The body's shapes with the paths of their fields, those that lie flush as one outline, outlines in
        convex pieces. Whether shapes lie flush is known where all their numbers are."""
        body = self.scene.bodies[name]
        shapes = body.shapes
        paths = [
            f"bodies.{name}.shape" + (f".{k}" if isinstance(body.shape, tuple) else "")
            for k in range(len(shapes))
        ]
        known = {k: loops for k, shape in enumerate(shapes) if (loops := loops_of(shape)) is not None}
        numbers = list(known)
        groups = {numbers[group[0]]: (group, loops) for group, loops in merged(list(known.values()))}
        for k, shape in enumerate(shapes):
            group, loops = groups.get(k, ([], []))
            if len(group) > 1 or (group and isinstance(shape, Outline)):
                outer, *holes = (tuple(loop) for loop in loops)
                yield from self._pieces(
                    Outline.model_construct(
                        kind="outline", vertices=outer, holes=tuple(holes), at=(0.0, 0.0), angle=0.0
                    ),
                    paths[k],
                )
            elif group or k not in known:
                yield from (
                    self._pieces(shape, paths[k]) if isinstance(shape, Outline) else [(paths[k], shape)]
                )

    def _pieces(self, shape: Outline, path: str) -> Iterator[tuple[str, Shape]]:
        """An outline in convex pieces."""
        places = self._places(shape.vertices, f"{path}.vertices")
        holes = [self._places(hole, f"{path}.holes.{k}") for k, hole in enumerate(shape.holes)]
        try:
            pieces = convex_pieces(places, holes)
        except ValueError as error:
            raise SceneError(f"{path}: {error}") from None
        all_vertices = [*shape.vertices, *chain.from_iterable(shape.holes)]
        for piece in pieces:
            vertices = tuple(all_vertices[k] for k in piece)
            yield (
                path,
                Polygon.model_construct(kind="polygon", vertices=vertices, at=shape.at, angle=shape.angle),
            )

    def _places(self, vertices: Sequence[Pair], path: str) -> list[tuple[float, float]]:
        return [
            (self._at_defaults(x, f"{path}.{k}.0"), self._at_defaults(y, f"{path}.{k}.1"))
            for k, (x, y) in enumerate(vertices)
        ]

    def _at_defaults(self, value: Number, path: str) -> float:
        """A number of the scene with every parameter at its default."""
        if not isinstance(value, str):
            return value
        program = Programs([self.names.number(value, path)])
        values = np.array([*(p.default for p in self.scene.parameters.values()), 0.0])
        found = np.zeros(1)
        evaluate_numbers(block_of(program, np.zeros(1, np.int64)), values, np.zeros(STACK), found)
        if not np.isfinite(found[0]):
            raise SceneError(
                f"{path}: must be {'a number' if np.isnan(found[0]) else 'finite'}, not {found[0]:g}"
            )
        return float(found[0])

    def _shapes(self, body: int) -> None:
        earlier = [self.shapes[name] for name in self.bodies[:body]]
        shapes = self.shapes[self.bodies[body]]
        first = sum(len(many) for many in earlier)
        vertex = sum(len(shape.core()) for many in earlier for _, shape in many)
        self.records.bodies[body]["first_shape"] = first
        self.records.bodies[body]["end_shape"] = first + len(shapes)
        for offset, (where, shape) in enumerate(shapes):
            index = first + offset
            core = shape.core()
            record = self.records.shapes[index]
            record["body"] = body
            record["first"], record["end"] = vertex, vertex + len(core)
            record["kind"] = _KINDS.get(shape.kind, rec.POLYGON)
            self.put(
                "shapes", index, "radius", getattr(shape, "radius", 0.0), f"{where}.radius",
                above=0.0 if shape.is_round else None, at_least=0.0,
            )  # fmt: skip
            self.put("shapes", index, "at_x", shape.at[0], f"{where}.at.0")
            self.put("shapes", index, "at_y", shape.at[1], f"{where}.at.1")
            self.put("shapes", index, "angle", getattr(shape, "angle", 0.0), f"{where}.angle")
            for field, size in zip(("size_x", "size_y"), shape.sizes, strict=False):
                self.put("shapes", index, field, getattr(shape, size), f"{where}.{size}", above=0.0)
            for x, y, source in core:
                self.put("vertices", vertex, "x", x, f"{where}.{source}.0")
                self.put("vertices", vertex, "y", y, f"{where}.{source}.1")
                vertex += 1

    def _contact(self, index: int, pair: tuple[str, str], path: str, contact: Contact) -> None:
        record = self.records.contacts[index]
        record["body_a"], record["body_b"] = (self.bodies.index(name) for name in pair)

        def put(field: str, value: Number, above: float | None = None, at_most: float = INF) -> None:
            self.put(
                "contacts", index, field, value, f"{path}.{field}", above=above, at_least=0.0, at_most=at_most
            )

        put("friction", contact.friction)
        put("restitution", contact.restitution, at_most=1.0)
        put("stiffness", contact.stiffness, above=0.0)
        put("damping", contact.damping)
        tangential = contact.tangential_stiffness
        put("tangential_stiffness", contact.stiffness if tangential is None else tangential, above=0.0)
        tangential = contact.tangential_damping
        put("tangential_damping", contact.damping if tangential is None else tangential)
        for field in ("coupling_stiffness", "coupling_damping"):
            self.put("contacts", index, field, getattr(contact, field), f"{path}.{field}")
        self._laws(index, path, contact)
        self._raised(index, pair)

    def _laws(self, index: int, path: str, contact: Contact) -> None:
        """What the scene names beside the common laws of contact, and the numbers that leave those as they
        are."""
        self.records.contacts[index]["laws"] = named_by(contact)
        for number in (number for law in LAWS for number in law.numbers):
            given = getattr(contact, number.field)
            value = number.otherwise(contact, self.scene.tolerance) if given is None else given
            self.put(
                "contacts", index, number.field, value, f"{path}.{number.field}",
                above=number.above, at_least=0.0, infinite=number.infinite,
            )  # fmt: skip

    def _raised(self, index: int, pair: tuple[str, str]) -> None:
        """How high a robot is above an object, where it may be raised."""
        for robot, other in (pair, pair[::-1]):
            raised = self.scene.bodies[robot].raised
            if raised is not None and self.scene.bodies[other].role == "object":
                self.records.contacts[index]["lifts"] = 1
                path = f"bodies.{robot}.raised"
                self.put("contacts", index, "raised", raised, path, at_least=0.0, timed=True)

    def _unused_heights(self) -> None:
        """What is raised must be a robot that an object may touch."""
        for name, body in self.scene.bodies.items():
            if body.raised is None:
                continue
            path = f"bodies.{name}.raised"
            if body.role != "robot":
                raise SceneError(
                    f"{path}: only robots are raised off the plane, and {name} is an {body.role}"
                )
            others = {other for pair in self.contacts if name in pair for other in pair}
            if all(self.scene.bodies[other].role != "object" for other in others):
                raise SceneError(f"{path}: {name} touches no object; no entry of contacts names one with it")

    def _unused_contacts(self) -> None:
        """Expressions of entries that hold for no pair must be right, too."""
        used = {entry for _, entry, _ in self.matched}
        for entry, contact in enumerate(self.scene.contacts):
            for field, value in contact:
                if entry not in used and field not in CHOICES and isinstance(value, str):
                    self.names.number(value, f"contacts.{entry}.{field}")

    def _potential(self, index: int) -> None:
        potential = self.scene.potentials[index]
        path = f"potentials.{index}"
        self.put("potentials", index, "stiffness", potential.stiffness, f"{path}.stiffness", at_least=0.0)
        self.put("potentials", index, "target", potential.target, f"{path}.target")
        named = [("terms", name) for name in potential.terms]
        named += [(f"on.{k}", name) for k, name in enumerate(potential.on or ())]
        for field, name in named:
            if name not in self.coordinates:
                raise SceneError(
                    f"{path}.{field}: unknown coordinate {shown(name)}{choices(name, self.coordinates)}"
                )
        for place, name in enumerate(self.coordinates):
            row = index * len(self.coordinates) + place
            robot = self.scene.bodies[name.split(".")[0]].role == "robot"
            acts = robot if potential.on is None else name in potential.on
            self.put("terms", row, "factor", potential.terms.get(name, 0.0), f"{path}.terms.{name}")
            self.records.terms[row]["acts"] = acts


_KINDS = {"box": rec.BOX, "capsule": rec.CAPSULE, "halfplane": rec.HALFPLANE}

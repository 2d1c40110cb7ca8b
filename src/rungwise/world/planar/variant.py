"""A planar scene on a rung, taken apart into ingredients, and put together from two (see `Variant`)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Self

import numpy as np

from rungwise.kernel import Ints
from rungwise.scene import Scene, load
from rungwise.scene.fields.laws.contact import told, written
from rungwise.scene.fields.laws.law import ALWAYS, FRICTION, RESTITUTION
from rungwise.scene.language.expression import STACK
from rungwise.scene.template.numbers import evaluate_numbers
from rungwise.scene.template.records import POINTS, RING, Records
from rungwise.world.ingredients import CONDITIONS, Variant

GIVE = (
    "stiffness", "damping", "tangential_stiffness", "tangential_damping", "coupling_stiffness",
    "coupling_damping",
)  # fmt: skip
RESISTS = ("damping", "dry_friction")


class PlanarVariant(Variant):
    """See `Variant`."""

    scene: Scene

    @property
    def records(self) -> Records:
        """The scene's numbers at its parameters, with inputs and times as at the start."""
        bound, template = self.scene.bind(self.parameters), self.scene.template
        for numbers in (template.timed_numbers(), template.timed_speeds()):
            evaluate_numbers(numbers, bound.values, np.zeros(STACK), bound.buffer)
        return bound.records

    def effective(self, ingredient: str) -> Any:
        """What the ingredient amounts to in this world: plain values that are equal where it is the same."""
        model, contacts = self.model, self.records.contacts
        match ingredient:
            case "balance":
                return not model.metric
            case "friction":
                return [contacts["friction"].tolist(), *told(contacts, FRICTION)] if model.friction else 0.0
            case "support":
                return self._support() if model.loads else 0.0
            case "compliance":
                return [contacts[name].tolist() for name in GIVE] if model.compliant else 0.0
            case "inertia":
                return model.inertia
            case "restitution":
                bounces = model.inertia > 0.0 and not model.compliant and contacts["restitution"].any()
                return [contacts["restitution"].tolist(), *told(contacts, RESTITUTION)] if bounces else 0.0
            case "accuracy":
                return self.tol
        return self._others()

    @property
    def objects(self) -> Ints:
        """Coordinates of objects."""
        names, bodies = self.scene.template.coordinates, self.scene.file.bodies
        return np.flatnonzero([bodies[name.split(".")[0]].role == "object" for name in names])

    def resolved(self, friction: Self, support: Self, give: Self, bounce: Self) -> Scene:
        """The scene without conditions, with numbers of contacts and supports from these variants."""
        file = self.scene.file.model_dump(mode="json", exclude_unset=True, exclude=set(CONDITIONS))
        slips, gives = friction.records.contacts, give.records.contacts
        own, rebounds = self.records.contacts, bounce.records.contacts
        bounces = rebounds["restitution"] if bounce.effective(RESTITUTION) else np.zeros(len(slips))
        file["contacts"] = [
            {
                "between": list(pair), "friction": float(slips[k]["friction"]),
                "restitution": float(bounces[k]),
                **{name: float(gives[name][k]) for name in GIVE},
                **written(slips[k], FRICTION), **written(rebounds[k], RESTITUTION),
                **written(own[k], ALWAYS),
            }
            for k, pair in enumerate(self.scene.template.contacts)
        ]  # fmt: skip
        _put_support(file["bodies"], self, support)
        return load(file)

    def _support(self) -> Any:
        """What resists the motion of objects: friction of supports, damping and dry friction."""
        supports, coordinates = self.records.supports, self.records.coordinates[self.objects]
        values = [supports[name].tolist() for name in ("force", "ratio", "centre_x", "centre_y")]
        values += [coordinates[name].tolist() for name in RESISTS]
        if supports["exact"].any():
            values += [supports["exact"].tolist(), self.records.spots.tobytes()]
        return values if supports["force"].any() or any(coordinates[name].any() for name in RESISTS) else 0.0

    def _others(self) -> Any:
        """All numbers of bodies, shapes, drives, joints and springs."""
        records = self.records
        coordinates = records.coordinates.copy()
        for name in RESISTS:
            coordinates[name][self.objects] = 0.0
        kinds = ("bodies", "shapes", "vertices", "potentials", "terms", "joints", "measures")
        gravity = [float(records.world[0][name]) for name in ("gravity_x", "gravity_y")]
        return [
            gravity,
            told(records.contacts, ALWAYS),
            coordinates.tobytes(),
            *(getattr(records, kind).tobytes() for kind in kinds),
        ]


def _put_support(bodies: dict[str, Any], base: PlanarVariant, world: PlanarVariant) -> None:
    """Write what resists the motion of objects, as numbers, into the bodies of a scene's mapping."""
    records, template, loads = world.records, base.scene.template, world.model.loads
    for support in records.supports:
        body = records.bodies[int(support["body"])]
        centre = [float(body[f"centre_{axis}"] + support[f"centre_{axis}"]) for axis in "xy"]
        pressure: dict[str, Any] = {"kind": "ratio", "ratio": float(support["ratio"])}
        given: dict[str, Any] = {"friction": 1.0, "load": float(support["force"]) if loads else 0.0}
        if support["exact"]:
            pressure = _pressure(records, support)
            given |= {"limit_surface": "exact"}
        if pressure["kind"] in ("ratio", "ring"):
            given |= {"centre": centre}
        bodies[template.bodies[int(support["body"])]]["support"] = given | {"pressure": pressure}
    for k in base.objects:
        name, coordinate = template.coordinates[k].split(".")
        for field in RESISTS:
            _put_number(
                bodies[name], coordinate, field, float(records.coordinates[k][field]) if loads else 0.0
            )


def _pressure(records: Records, support: Any) -> dict[str, Any]:
    """What a support's load lies on, as it is written."""
    if support["pressure"] == RING:
        return {"kind": "ring", "radius": float(support["ratio"])}
    spots = records.spots[int(support["first"]) : int(support["end"])]
    if support["pressure"] == POINTS:
        points = np.stack([spots["x"], spots["y"]], axis=1).tolist()
        return {"kind": "points", "points": points, "weights": spots["weight"].tolist()}
    return {"kind": "uniform"}


def _put_number(body: dict[str, Any], coordinate: str, field: str, value: float) -> None:
    own: Mapping[str, Any] = body.get("coordinates", {}).get(coordinate, {})
    if value or field in own:
        body.setdefault("coordinates", {}).setdefault(coordinate, {})[field] = value

"""Contents of a scene, for `rungwise check`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rungwise.scene import Scene
from rungwise.scene.fields.fields import Drive, Joint
from rungwise.scene.fields.laws.contact import in_words, written
from rungwise.system.planar.place import turns
from rungwise.world.moving.description import common, heading, stated


def describe(scene: Scene, parameters: Mapping[str, float]) -> dict[str, Any]:
    """Bodies with mass, inertia, centre and coordinates; contacts; parameters; conditions. Plain values."""
    bound = scene.bind(parameters)
    template, records, file = scene.template, bound.records, scene.file
    bodies: dict[str, Any] = {}
    for name, record in zip(template.bodies, records.bodies, strict=True):
        body = file.bodies[name]
        bodies[name] = {
            "role": body.role,
            "shapes": [shape.kind for shape in body.shapes],
            "motion": body.motion.kind,
            "mass": float(record["mass"]),
            "inertia": float(record["inertia"]),
            "centre": [float(record["x"]), float(record["y"])],
            "coordinates": {},
        }
    for record in records.supports:
        bodies[template.bodies[int(record["body"])]]["support"] = {
            "force": float(record["force"]),
            "ratio": float(record["ratio"]),
            "centre": [float(record["centre_x"]), float(record["centre_y"])],
        } | ({"limit_surface": "exact"} if record["exact"] else {})
    places, _ = scene.start(parameters)
    for number, (name, record) in enumerate(zip(template.coordinates, records.coordinates, strict=True)):
        body_name, coordinate = name.split(".")
        given = file.bodies[body_name].coordinates.get(coordinate)
        drive = None if given is None else given.drive
        bodies[body_name]["coordinates"][coordinate] = {
            "start": float(places[number]),
            "lower": float(record["lower"]),
            "upper": float(record["upper"]),
            "unit": "rad" if turns(records.bodies[record["body"]], number) else "length",
            "drive": None if drive is None else drive.kind,
            "law": _law(drive),
        }
    contacts: list[dict[str, Any]] = [
        {"between": list(pair)}
        | {field: float(record[field]) for field in ("friction", "restitution", "stiffness", "damping")}
        | written(record)
        for pair, record in zip(template.contacts, records.contacts, strict=True)
    ]
    joints: dict[str, Any] = {}
    for index, (name, joint) in enumerate(file.joints.items()):
        own = records.measures[records.measures["joint"] == index]
        joints[name] = {"kind": joint.kind, "between": list(joint.between)} | _freedom(joint, own)
    own = {"bodies": bodies, "joints": joints, "contacts": contacts}
    return heading(scene) | own | common(scene, parameters, bound)


def _law(drive: Drive | None) -> str:
    """What a drive is told to do, as it is written: "speed v * ux"."""
    if drive is None:
        return ""
    told = drive.model_dump(exclude={"kind"}, exclude_unset=True)
    return ", ".join(f"{name.replace('_', ' ')} {value}" for name, value in told.items())


def _freedom(joint: Joint, measures: NDArray[np.void]) -> dict[str, Any]:
    """Travel, resistance and drive of the coordinate that a joint leaves free; nothing for a weld."""
    free = measures[measures["held"] == 0]
    if len(free) == 0:
        return {}
    drive = None if joint.coordinate is None else joint.coordinate.drive
    fields = ("lower", "upper", "damping", "dry_friction")
    return {
        "coordinate": {field: float(free[0][field]) for field in fields}
        | {"drive": None if drive is None else drive.kind, "law": _law(drive)}
    }


def described(report: Mapping[str, Any]) -> str:
    """The description as lines of text."""
    lines = [f"{report['scene']}: {report['about']}", "bodies"]
    for name, body in report["bodies"].items():
        x, y = body["centre"]
        lines.append(
            f"  {name:12s} {body['role']:9s} {'+'.join(body['shapes']):10s} {body['motion']:6s}"
            f" mass {body['mass']:.6g}"
            f"  inertia {body['inertia']:.6g}  centre ({x:.6g}, {y:.6g})"
        )
        if "support" in body:
            x, y = body["support"]["centre"]
            lines.append(
                f"    {name} lies on a support: friction up to {body['support']['force']:.6g}, torque up to"
                f" {body['support']['ratio']:.6g} times that, about ({x:.6g}, {y:.6g}) from the centre"
                + (", by its pressure" if "limit_surface" in body["support"] else "")
            )
        for coordinate, c in body["coordinates"].items():
            unit = " rad" if c["unit"] == "rad" else ""
            lines.append(
                f"    {name}.{coordinate}: starts at {c['start']:.6g}{unit}, {_travel(c, unit)}{_driven(c)}"
            )
    if report["joints"]:
        lines.append("joints")
    for name, joint in report["joints"].items():
        line = f"  {name:12s} {joint['kind']:6s} {' | '.join(joint['between'])}"
        if "coordinate" in joint:
            c = joint["coordinate"]
            line += f"  {_travel(c, ' rad' if joint['kind'] == 'hinge' else '')}"
            line += "".join(f"  {field} {c[field]:.6g}" for field in ("damping", "dry_friction") if c[field])
            line += _driven(c)
        lines.append(line)
    lines.append("contacts")
    for c in report["contacts"]:
        a, b = c["between"]
        lines.append(
            f"  {a} | {b}: friction {c['friction']:.6g}, restitution {c['restitution']:.6g},"
            f" stiffness {c['stiffness']:.6g}, damping {c['damping']:.6g}" + in_words(c)
        )
    lines += stated(report, 12)
    return "\n".join(lines)


def _travel(coordinate: Mapping[str, Any], unit: str) -> str:
    low, high = coordinate["lower"], coordinate["upper"]
    if np.isinf(low) and np.isinf(high):
        return "travels freely"
    return f"travels {low:.6g} to {high:.6g}{unit}"


def _driven(coordinate: Mapping[str, Any]) -> str:
    if not coordinate["drive"]:
        return ""
    by = "" if coordinate["drive"] in ("speed", "force") else f"a {coordinate['drive']}: "
    return f", driven by {by}{coordinate['law']}"

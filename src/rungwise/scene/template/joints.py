"""Joints of a scene, written as the three measures that each holds or leaves free."""

from __future__ import annotations

from rungwise.scene.errors import SceneError
from rungwise.scene.fields.fields import JointCoordinate, SceneFile
from rungwise.scene.fields.values import shown
from rungwise.scene.template import records as rec
from rungwise.scene.template.writer import INF, Writer
from rungwise.wording import choices


def write_joint(writer: Writer, scene: SceneFile, index: int) -> None:
    """Joint `index` of the scene. Raises SceneError, naming the field."""
    bodies = tuple(scene.bodies)
    name = tuple(scene.joints)[index]
    joint = scene.joints[name]
    path = f"joints.{name}"
    record = writer.records.joints[index]
    for k, body in enumerate(joint.between):
        if body not in bodies:
            raise SceneError(f"{path}.between.{k}: unknown body {shown(body)}{choices(body, bodies)}")
    if all(not scene.bodies[body].coordinate_names for body in joint.between):
        raise SceneError(f"{path}.between: of {' and '.join(joint.between)} neither moves")
    if joint.between[0] == joint.between[1]:
        raise SceneError(f"{path}.between: must name two bodies")
    record["body_a"], record["body_b"] = (bodies.index(body) for body in joint.between)
    record["kind"] = ("weld", "hinge", "slide").index(joint.kind)
    for k, field in enumerate("xy"):
        writer.put("joints", index, f"at_{field}", joint.at[k], f"{path}.at.{k}")
        writer.put("joints", index, f"axis_{field}", joint.axis[k], f"{path}.axis.{k}")
    free = {"weld": None, "hinge": rec.ANGLE, "slide": rec.ALONG}[joint.kind]
    for which in (rec.ALONG, rec.ACROSS, rec.ANGLE):
        measure = 3 * index + which
        record = writer.records.measures[measure]
        record["joint"], record["which"], record["held"] = index, which, which != free
        if which == free:
            _freedom(writer, measure, joint.coordinate or JointCoordinate(), f"{path}.coordinate")
            continue
        prefix = "angular_" if which == rec.ANGLE else ""
        for field, above, default in (("stiffness", 0.0, INF), ("damping", None, 0.0)):
            value = getattr(joint, prefix + field)
            writer.put(
                "measures", measure, field, default if value is None else value,
                f"{path}.{prefix}{field}",
                above=above, at_least=0.0, infinite=default == INF,
            )  # fmt: skip


def _freedom(writer: Writer, measure: int, given: JointCoordinate, path: str) -> None:
    writer.put("measures", measure, "lower", given.lower, f"{path}.lower", at_most=0.0, infinite=True)
    writer.put("measures", measure, "upper", given.upper, f"{path}.upper", at_least=0.0, infinite=True)
    for field in ("damping", "dry_friction"):
        writer.put("measures", measure, field, getattr(given, field), f"{path}.{field}", at_least=0.0)
    writer.drive("measures", measure, given.drive, f"{path}.drive")

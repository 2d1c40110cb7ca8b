"""Contents of a scene in space, for `rungwise check`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from rungwise.scene.fields.laws.contact import in_words, written
from rungwise.scene.space import SpaceBound, SpaceScene
from rungwise.scene.space.elements import equality, named
from rungwise.scene.space.labels import wholes
from rungwise.scene.space.laws import touching
from rungwise.world.moving.description import common, heading, stated

if TYPE_CHECKING:
    import mujoco

JOINTS = ("free", "ball", "slide", "hinge")
LAW = (
    "stiffness", "tangential_stiffness", "damping", "tangential_damping", "restitution", "friction",
    "torsional_friction", "rolling_friction",
)  # fmt: skip
"""What the columns of laws of contact are; the last three are of friction."""
SHAPES = ("plane", "hfield", "sphere", "capsule", "ellipsoid", "cylinder", "box", "mesh", "sdf")


def describe(scene: SpaceScene, parameters: Mapping[str, float]) -> dict[str, Any]:
    """Bodies with mass and coordinates, tendons, equalities, actuators, laws of contact, parameters, and
    conditions. Plain values."""
    bound = scene.bind(parameters)
    model, names = bound.model, scene.labels
    own = {
        "bodies": {name: _body(scene, bound, b) for b, name in enumerate(names.bodies)},
        "tendons": {named(model.tendon(t).name, t): _tendon(model, t) for t in range(model.ntendon)},
        "equalities": {
            own.name: {"kind": own.kind, "between": list(own.between), "active": bool(model.eq_active0[e])}
            for e, own in enumerate(equality(model, names, e) for e in range(model.neq))
        },
        "actuators": {name: _actuator(model, a, bound) for a, name in enumerate(names.actuators)},
        "contacts": [_law(*each) for each in zip(bound.laws, bound.named, strict=True)],
    }
    return heading(scene) | own | common(scene, parameters, bound)


def _body(scene: SpaceScene, bound: SpaceBound, b: int) -> dict[str, Any]:
    model = bound.model
    geoms = range(int(model.body_geomadr[b]), int(model.body_geomadr[b]) + int(model.body_geomnum[b]))
    of = wholes(model)
    solid = np.unique([of[g] for g in geoms if touching(model)[g]]).astype(int).tolist()
    first = int(model.body_jntadr[b])
    coordinates = {}
    for j in range(first, first + int(model.body_jntnum[b])):
        at, to = int(model.jnt_qposadr[j]), int(model.jnt_dofadr[j])
        kind = JOINTS[int(model.jnt_type[j])]
        limits = [float(x) for x in model.jnt_range[j]] if model.jnt_limited[j] else [-np.inf, np.inf]
        coordinates[scene.template.coordinates[at]] = {
            "joint": kind,
            "start": float(bound.place[at]),
            "places": _places(scene, bound, j),
            "lower": limits[0],
            "upper": limits[1],
            "damping": float(model.dof_damping[to]),
            "dry_friction": float(model.dof_frictionloss[to]),
            "speed": None if np.isnan(bound.pace[to]) else float(bound.pace[to]),
        }
    return {
        "mass": float(model.body_mass[b]),
        "inertia": [float(x) for x in model.body_inertia[b]],
        "shapes": [SHAPES[int(model.geom_type[g])] for g in solid],
        "friction": sorted({float(model.geom_friction[g, 0]) for g in solid}),
        "coordinates": coordinates,
    }


def _places(scene: SpaceScene, bound: SpaceBound, j: int) -> dict[str, float]:
    """Where all coordinates of a joint start, by their names without the body's."""
    at, stop = [*bound.model.jnt_qposadr.tolist(), bound.model.nq][j : j + 2]
    labels = scene.template.coordinates[at:stop]
    return {label.partition(".")[2]: float(x) for label, x in zip(labels, bound.place[at:], strict=False)}


def _tendon(model: mujoco.MjModel, t: int) -> dict[str, Any]:
    limited = bool(model.tendon_limited[t])
    return {
        "length": float(model.tendon_length0[t]),
        "lower": float(model.tendon_range[t, 0]) if limited else -np.inf,
        "upper": float(model.tendon_range[t, 1]) if limited else np.inf,
        "stiffness": float(model.tendon_stiffness[t]),
        "damping": float(model.tendon_damping[t]),
        "dry_friction": float(model.tendon_frictionloss[t]),
    }


def _actuator(model: mujoco.MjModel, a: int, bound: SpaceBound) -> dict[str, Any]:
    stiff, damp = (float(-x) for x in model.actuator_biasprm[a, 1:3])
    limited = bool(model.actuator_forcelimited[a])
    return {
        "kind": "servo" if stiff > 0.0 else "speed" if damp > 0.0 else "force",
        "stiffness": stiff,
        "damping": damp,
        "control": float(bound.control[a]),
        "force": [float(x) for x in model.actuator_forcerange[a]] if limited else [-np.inf, np.inf],
    }


def _law(row: Any, named: Any) -> dict[str, Any]:
    own = {name: None if np.isnan(x) else float(x) for name, x in zip(LAW, row, strict=True)}
    return own | written(named)


def described(report: Mapping[str, Any]) -> str:
    """The description as lines of text."""
    lines = [f"{report['scene']}: {report['about']}", "bodies"]
    for name, body in report["bodies"].items():
        friction = ", ".join(f"{x:.4g}" for x in body["friction"])
        lines.append(
            f"  {name:20s} {'+'.join(body['shapes']) or 'no shape':20s} mass {body['mass']:.6g}"
            + (f"  friction {friction}" if friction else "")
        )
        for label, c in body["coordinates"].items():
            driven = "" if c["speed"] is None else f", driven at the speed {c['speed']:.6g}"
            travel = "" if np.isinf(c["lower"]) else f", travels {c['lower']:.6g} to {c['upper']:.6g}"
            places = ", ".join(f"{own} = {x:.6g}" for own, x in c["places"].items())
            begins = f"{name}: {c['joint']}, starts at {places}"
            if len(c["places"]) == 1:
                begins = f"{label}: {c['joint']}, starts at {c['start']:.6g}"
            lines.append(f"    {begins}{travel}{driven}")
    if report["tendons"]:
        lines.append("tendons")
    for name, t in report["tendons"].items():
        travel = "" if np.isinf(t["lower"]) else f", travels {t['lower']:.6g} to {t['upper']:.6g}"
        spring = f", stiffness {t['stiffness']:.6g}" if t["stiffness"] else ""
        drag = f", damping {t['damping']:.6g}" if t["damping"] else ""
        lines.append(f"  {name:20s} length {t['length']:.6g} at the model's own pose{travel}{spring}{drag}")
    if report["equalities"]:
        lines.append("equalities")
    for name, e in report["equalities"].items():
        off = "" if e["active"] else ", inactive"
        lines.append(f"  {name:20s} {e['kind']} of {' and '.join(e['between'])}{off}")
    if report["actuators"]:
        lines.append("actuators")
    for name, a in report["actuators"].items():
        force = "" if np.isinf(a["force"][0]) else f", force {a['force'][0]:.6g} to {a['force'][1]:.6g}"
        gains = f" K_p {a['stiffness']:.6g} K_d {a['damping']:.6g}" if a["kind"] != "force" else ""
        lines.append(f"  {name:20s} {a['kind']}{gains}{force}, control {a['control']:.6g}")
    lines.append("contacts (the last line is for pairs that no entry names)")
    for law in [*report["contacts"][1:], report["contacts"][0]]:
        given = [f"{name.replace('_', ' ')} {law[name]:.6g}" for name in LAW[5:] if law[name] is not None]
        friction = ", ".join(given) or "the model's friction"
        lines.append(
            f"  {friction}, restitution {law['restitution']:.6g}, stiffness {law['stiffness']:.6g},"
            f" damping {law['damping']:.6g}{in_words(law)}"
        )
    return "\n".join([*lines, *stated(report, 20)])

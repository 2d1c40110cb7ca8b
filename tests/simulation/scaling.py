"""One scene in other units: every number that has a unit is multiplied, the parameters are left alone."""

from __future__ import annotations

import ast
from dataclasses import dataclass
from typing import Any

import numpy as np

import rungwise as rw
from rungwise.simulation.planar.state.workspace import recorded as memory
from rungwise.simulation.result import Run

Dimension = tuple[int, int, int]
"""Powers of length, mass and time."""
NUMBER, LENGTH, MASS, TIME = (0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)
FORCE, ENERGY = (1, 1, -2), (2, 1, -2)


def times(a: Dimension, b: Dimension) -> Dimension:
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


def over(a: Dimension, b: Dimension) -> Dimension:
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


SHAPE = dict.fromkeys(("at", "radius", "length", "width", "height", "vertices"), LENGTH)
BODY = {
    "mass": MASS, "density": (-2, 1, 0), "centre": LENGTH, "inertia": (2, 1, 0),
    "force": FORCE, "torque": ENERGY,
}  # fmt: skip
JOINT = {
    "at": LENGTH, "stiffness": (0, 1, -2), "damping": (0, 1, -1),
    "angular_stiffness": ENERGY, "angular_damping": (2, 1, -1),
}  # fmt: skip
SUPPORT = {"load": FORCE, "gravity": (1, 0, -2), "centre": LENGTH}
PRESSURE = dict.fromkeys(("radius", "points", "ratio"), LENGTH)
CONTACT = {
    f"{which}{kind}": (0, 1, -2 if kind == "stiffness" else -1)
    for which in ("", "tangential_", "coupling_")
    for kind in ("stiffness", "damping")
} | {"adhesion": FORCE, "adhesion_range": LENGTH, "yield_speed": (1, 0, -1)}
WORLD = {"gravity": (1, 0, -2), "tolerance": LENGTH, "duration": TIME, "step": TIME}
CONDITIONS = ("goal", "unsafe", "doomed")


def coordinate(place: Dimension) -> dict[str, Dimension]:
    """Dimensions of what a coordinate whose value has the dimension `place` may be given, its drive's too."""
    force, rate = over(ENERGY, place), over(place, TIME)
    own = dict.fromkeys(("start", "lower", "upper", "target"), place)
    own |= dict.fromkeys(("speed", "target_speed"), rate) | dict.fromkeys(
        ("dry_friction", "limit", "force"), force
    )
    return own | {"damping": over(force, rate), "stiffness": over(force, place)}


@dataclass(frozen=True)
class Units:
    """Old units in new ones: a length x is written length * x, and so on."""

    length: float = 1.0
    mass: float = 1.0
    time: float = 1.0

    def factor(self, dimension: Dimension) -> float:
        l, m, t = dimension
        return float(self.length**l * self.mass**m * self.time**t)


def scaled(scene: rw.Scene, units: Units) -> dict[str, Any]:
    """The scene's mapping, defaults written out, in these units."""
    return _Scaler(scene, units).scene()


class _Scaler:
    def __init__(self, scene: rw.Scene, units: Units) -> None:
        self.data = scene.file.model_dump(mode="json", exclude_none=True)
        self.units = units
        self.places = places(scene)

    def scene(self) -> dict[str, Any]:
        data = self.data
        self.fields(data, WORLD)
        for body in data["bodies"].values():
            self.body(body)
        for joint in data["joints"].values():
            self.fields(joint, JOINT)
            self.coordinate(joint.get("coordinate", {}), NUMBER if joint["kind"] == "hinge" else LENGTH)
        for contact in data["contacts"]:
            self.fields(contact, CONTACT)
        for potential in data["potentials"]:
            self.fields(potential, {"stiffness": (0, 1, -2), "target": LENGTH})
            self.fields(
                potential["terms"], {name: over(LENGTH, self.places[name]) for name in potential["terms"]}
            )
        for name in CONDITIONS:
            if name in data:
                data[name] = ast.unparse(_Names(self).visit(ast.parse(data[name], mode="eval")))
        return data

    def body(self, body: dict[str, Any]) -> None:
        self.fields(body, BODY)
        self.fields(body["pose"], {"x": LENGTH, "y": LENGTH})
        self.fields(body["motion"], {"pivot": LENGTH})
        self.fields(body.get("support", {}), SUPPORT)
        self.fields(body.get("support", {}).get("pressure", {}), PRESSURE)
        for shape in body["shape"] if isinstance(body["shape"], list) else [body["shape"]]:
            self.fields(shape, SHAPE)
        turning = body["motion"]["kind"] == "hinge"
        for name, given in body["coordinates"].items():
            turns = turning or (body["motion"]["kind"] == "free" and name == "angle")
            self.coordinate(given, NUMBER if turns else LENGTH)

    def coordinate(self, given: dict[str, Any], place: Dimension) -> None:
        own = coordinate(place)
        self.fields(given, own)
        self.fields(given.get("drive", {}), own)

    def fields(self, part: dict[str, Any], dimensions: dict[str, Dimension]) -> None:
        for name in part.keys() & dimensions.keys():
            part[name] = self.value(part[name], self.units.factor(dimensions[name]))

    def value(self, value: Any, factor: float) -> Any:
        if isinstance(value, list):
            return [self.value(one, factor) for one in value]
        if not isinstance(value, str):
            return value * factor
        if value in ("inf", "-inf"):
            return value
        text = ast.unparse(_Names(self).visit(ast.parse(value.strip(), mode="eval")))
        return f"({text}) * {factor!r}"


class _Names(ast.NodeTransformer):
    """What an expression reads, back in the old units."""

    def __init__(self, scaler: _Scaler) -> None:
        self.scaler = scaler

    def old(self, node: ast.expr, dimension: Dimension) -> ast.expr:
        return ast.BinOp(node, ast.Div(), ast.Constant(self.scaler.units.factor(dimension)))

    def visit_Name(self, node: ast.Name) -> ast.expr:
        known = {"t": TIME, "tolerance": LENGTH}
        return self.old(node, known[node.id]) if node.id in known else node

    def visit_Attribute(self, node: ast.Attribute) -> ast.expr:
        return self.old(node, self.scaler.places[ast.unparse(node)])

    def visit_Call(self, node: ast.Call) -> ast.expr:
        name = ast.unparse(node.func)
        between = {"gap": LENGTH, "force": FORCE, "impulse": times(FORCE, TIME)}
        if name in between:
            return self.old(node, between[name])
        if name == "speed":
            return self.old(node, over(self.scaler.places[ast.unparse(node.args[0])], TIME))
        node.args = [self.visit(one) for one in node.args]
        return node


def places(scene: rw.Scene) -> dict[str, Dimension]:
    """Dimension of each coordinate of the scene."""
    turning = {"hinge"}
    found = {}
    for name in scene.template.coordinates:
        body, own = name.split(".")
        kind = scene.file.bodies[body].motion.kind
        found[name] = NUMBER if kind in turning or (kind == "free" and own == "angle") else LENGTH
    return found


def recorded(run: Run, units: Units) -> dict[str, Any]:
    """What a run did, frame by frame, brought back from `units`."""
    report: dict[str, Any] = {"outcome": str(run.outcome), "steps": run.steps, "attempts": run.attempts}
    report["certificate"] = None if run.certificate is None else run.certificate.kind
    report["worst_residual"] = run.worst_residual
    if run.workspace is None:
        return report
    frames, state = run.workspace.frames, run.workspace.state
    cut = slice(0, int(state.clock[0]["frames"]))
    where = list(places(run.scene).values())
    q = np.array([units.factor(place) for place in where])
    rate = np.array([units.factor(over(place, TIME)) for place in where])
    force = np.array([units.factor(over(ENERGY, place)) for place in where])
    pairs = len(state.manifolds.points)
    report["time"] = memory(run.workspace, "time") / units.time
    report["q"] = memory(run.workspace, "q") / q
    report["v"] = memory(run.workspace, "v") / rate
    report["gap"] = memory(run.workspace, "gaps") / units.length
    report["mode"] = memory(run.workspace, "modes")
    if run.model.loads:
        report["force"] = memory(run.workspace, "force")[:, :pairs] / units.factor(FORCE)
        report["impulse"] = frames.impulse[cut, :pairs] / units.factor(times(FORCE, TIME))
    report["reaction"] = frames.reaction[cut] / force
    report["deformation"] = state.deformation / units.length
    scalars = frames.scalars[cut]
    report["residual"] = scalars[:, 0].copy()
    report["energies"] = scalars[:, 1:] / units.factor(ENERGY)
    return report


NOTHING = 1e-250
"""Below this, products run out of the range of numbers, and of digits with it."""


def differing(one: dict[str, Any], two: dict[str, Any]) -> list[str]:
    """Names of what is not the same in two reports, bit for bit."""
    return [name for name in one | two if not np.array_equal(_kept(one.get(name)), _kept(two.get(name)))]


def _kept(value: Any) -> Any:
    array = np.asarray(value)
    return np.where(np.abs(array) < NOTHING, 0.0, array) if array.dtype == np.float64 else array

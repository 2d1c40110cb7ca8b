"""Scenes of all that a scene file can say, by number: bodies in a row that touch or nearly do, on a floor or
in the plane, driven, jointed, coupled and held by supports, for a few steps."""

from __future__ import annotations

from typing import Any

import numpy as np

SHAPES = ("point", "disc", "capsule", "box", "rounded", "polygon", "outline", "pair")
ROOM = (0.0, 0.0, 1e-3, 0.02)
"""Gaps between neighbours."""


def random_scene(number: int) -> dict[str, Any]:
    """The scene of that number, as `load` takes it."""
    return _Maker(np.random.default_rng(number), np.random.default_rng([number, 1])).scene(number)


class _Maker:
    def __init__(self, rng: np.random.Generator, beside: np.random.Generator) -> None:
        self.rng = rng
        self.beside = beside
        """For what was added later: the other draws stay as they were."""
        self.bodies: dict[str, Any] = {}
        self.places: dict[str, tuple[float, float]] = {}
        self.value = float(rng.uniform(0.5, 2.0))
        self.kinds = SHAPES
        """Shapes to choose from; after one body of several shapes all others have one."""
        self.rubs = self.chance(0.5)
        """Whether everything is damped: a quasistatic motion has an answer then."""

    def chance(self, part: float) -> bool:
        return bool(self.rng.random() < part)

    def of(self, *options: Any) -> Any:
        return options[int(self.rng.integers(len(options)))]

    def between(self, low: float, high: float) -> float:
        return float(self.rng.uniform(low, high))

    def number(self, value: float) -> float | str:
        """A number as such, or by way of the scene's parameter."""
        return f"{value / self.value!r} * p" if self.chance(0.3) else value

    def timed(self, size: float) -> float | str:
        """A number that may depend on time."""
        return self.of(
            size,
            self.number(size),
            f"{size!r} * cos(30 * t)",
            f"{size!r} if t < 4.5e-3 else {-0.5 * size!r}",
            f"p * {size!r} * min(1, 100 * t)",
        )

    def scene(self, number: int) -> dict[str, Any]:
        if self.chance(0.7):
            self.bodies["floor"] = {"role": "obstacle", "shape": {"kind": "halfplane"}}
        edge = 0.0
        for k in range(int(self.rng.integers(1, 3))):
            edge = self.body(f"o{k}", "object", edge)
        for k in range(int(self.rng.integers(1, 3))):
            edge = self.body(f"r{k}", "robot", edge)
        scene: dict[str, Any] = {
            "name": f"random{number}",
            "bodies": self.bodies,
            "contacts": self.contacts(),
        }
        scene["parameters"] = {"p": {"default": self.value}}
        if self.chance(0.8 if self.rubs or "floor" in self.bodies else 0.1):
            scene["gravity"] = [self.of(0.0, 1.5), self.number(-9.81)]
        joints = self.joints()
        if joints:
            scene["joints"] = joints
        sliding = [
            f"{name}.s" for name, body in self.bodies.items() if body.get("motion", {}).get("kind") == "slide"
        ]
        if sliding and self.chance(0.5):
            terms = {name: self.number(self.between(-1.0, 1.0)) for name in sliding} | {"o0.angle": 0.02}
            scene["potentials"] = [
                {
                    "stiffness": self.between(10.0, 1e3),
                    "terms": terms,
                    "target": 0.01,
                    "on": [sliding[0], "o0.angle"],
                }
            ]
        if self.chance(0.3):
            scene["goal"] = self.of(
                "o0.x > 0.01 and abs(speed(o0.angle)) <= 0.2", "t >= 4.5e-3 and abs(o0.angle) > 1e-4",
                "speed(o0.x) < 1e3 * tolerance and t > 5.5e-3",
            )  # fmt: skip
        if "floor" in self.bodies and self.chance(0.3):
            scene["unsafe"] = "force(o0, floor) > 300 or gap(o0, floor) > 0.05"
        step = self.of(1e-3, 1e-3, 4e-3)
        scene |= {"step": step, "duration": self.number(12.5 * step), "tolerance": self.of(1e-6, 1e-5)}
        return scene

    def body(self, name: str, role: str, edge: float) -> float:
        """Put a body beside what ends at x = edge; returns where it ends."""
        shape, places, radius = self.shape()
        angle = self.of(0.0, 0.0, self.between(-1.0, 1.0))
        c, s = np.cos(angle), np.sin(angle)
        x, y = c * places[:, 0] - s * places[:, 1], s * places[:, 0] + c * places[:, 1]
        left, low = float(x.min()) - radius, float(y.min()) - radius
        room = self.of(*ROOM) if role == "object" else self.of(0.0, 1e-4)
        at = (edge + room - left, self.of(*ROOM) - low)
        motion: dict[str, Any] = {"kind": "free"}
        if role == "robot":
            motion = self.of(
                {"kind": "slide", "axis": [-1.0, 0.0]},
                {"kind": "slide", "axis": [-1.0, -0.2]},
                {"kind": "hinge", "pivot": [at[0] + 0.1, at[1] + self.of(0.0, 0.3)]},
                {"kind": "free"},
            )
        body: dict[str, Any] = {"role": role, "shape": shape, "motion": motion}
        body["pose"] = {"x": self.number(at[0]), "y": at[1], "angle": angle}
        if self.chance(0.3) or "point" in str(shape):
            body |= {"mass": self.number(self.between(0.2, 3.0)), "inertia": self.between(2e-3, 2e-2)}
        elif self.chance(0.5):
            body["density"] = self.between(5.0, 100.0)
        if self.chance(0.2):
            body["force"] = [self.timed(3.0), -1.0]
            body["torque"] = self.timed(0.1)
        names = {"free": ("x", "y", "angle"), "hinge": ("angle",), "slide": ("s",)}[motion["kind"]]
        body["coordinates"] = {own: self.coordinate(role, own, motion["kind"], angle) for own in names}
        self.support(body)
        self.bodies[name] = body
        self.places[name] = at
        return at[0] + float(x.max()) + radius

    def shape(self) -> tuple[Any, np.ndarray[Any, Any], float]:
        """A shape, the places whose hull it is, and how far it is grown."""
        kind, a, b = self.of(*self.kinds), self.between(0.05, 0.2), self.between(0.05, 0.2)
        box = np.array([[-a, -b], [a, -b], [a, b], [-a, b]])
        if kind == "point":
            return {"kind": "point"}, np.zeros((1, 2)), 0.0
        if kind == "disc":
            return {"kind": "disc", "radius": self.number(a)}, np.zeros((1, 2)), a
        if kind == "capsule":
            ends = np.array([[-b, 0.0], [b, 0.0]])
            return {"kind": "capsule", "length": 2 * b, "radius": 0.3 * a}, ends, 0.3 * a
        if kind == "box":
            return {"kind": "box", "width": self.number(2 * a), "height": 2 * b}, box, 0.0
        if kind == "rounded":
            return {"kind": "box", "width": 2 * a, "height": 2 * b, "radius": 0.01}, box, 0.01
        if kind == "polygon":
            places = np.array([[-a, -b], [a, -b], [0.3 * a, b]])
            return {"kind": "polygon", "vertices": places.tolist()}, places, 0.0
        if kind == "outline":
            self.kinds = SHAPES[:-2]
            places = np.array([[-a, -b], [a, -b], [a, 0.0], [0.0, 0.0], [0.0, b], [-a, b]])
            return {"kind": "outline", "vertices": places.tolist()}, places, 0.0
        self.kinds = SHAPES[:-2]
        discs = [{"kind": "disc", "radius": 0.5 * a, "at": [side * a, 0.0]} for side in (-1, 1)]
        return discs, np.array([[-a, 0.0], [a, 0.0]]), 0.5 * a

    def coordinate(self, role: str, name: str, motion: str, angle: float) -> dict[str, Any]:
        given: dict[str, Any] = {}
        if self.chance(0.4):
            given["speed"] = self.number(self.between(-1.0, 1.0))
        if self.rubs or self.chance(0.3):
            given["damping"] = self.number(self.between(0.5, 30.0) * (0.1 if name == "angle" else 1.0))
        if self.chance(0.25):
            given["dry_friction"] = self.between(0.1, 4.0) * (0.1 if name == "angle" else 1.0)
        if (name == "angle" or motion == "slide") and self.chance(0.3):
            start = angle if motion == "free" else 0.0
            given |= {"lower": start - 1e-3, "upper": start + self.of(1e-3, 0.02)}
        if role == "robot" and self.chance(0.8 if motion != "free" else 0.4):
            given["drive"] = self.drive(0.1 if name == "angle" else 1.0)
        return given

    def drive(self, size: float) -> dict[str, Any]:
        speed = self.between(0.3, 2.0)
        servo: dict[str, Any] = {
            "kind": "servo", "stiffness": 500 * size, "damping": self.of(0.0, 20 * size),
            "target": self.timed(0.03),
        }  # fmt: skip
        rate = {"kind": "servo", "stiffness": 200 * size, "target_speed": speed}
        return self.of(
            {"kind": "speed", "speed": self.timed(speed)},
            {"kind": "speed", "speed": speed},
            servo,
            servo | {"limit": self.number(3.0 * size)},
            rate,
            rate | {"limit": 1.0 * size},
            {"kind": "force", "force": self.timed(5.0 * size)},
        )

    def support(self, body: dict[str, Any]) -> None:
        """Let every fourth free body lie on a support, of any pressure."""
        if body["motion"]["kind"] != "free" or self.beside.random() > 0.25:
            return
        for coordinate in body["coordinates"].values():
            coordinate.pop("dry_friction", None)
        x, y, c = self.beside.uniform(0.01, 0.1, 3).tolist()
        pressures: list[dict[str, Any]] = [
            {"kind": "ratio", "ratio": f"{c!r} * p"},
            {"kind": "ring", "radius": c},
            {"kind": "points", "points": [[x, 0.0], [0.0, y], [-x, -y]], "weights": [1.0, "p", 2.0]},
            {"kind": "uniform"},
        ]
        kind = pressures[int(self.beside.integers(3 if "point" in str(body["shape"]) else 4))]
        body["support"] = {"friction": float(self.beside.uniform(0.1, 0.8)), "pressure": kind}
        body["support"] |= {"load": f"{20.0 * x!r} * p"} if self.beside.random() < 0.5 else {"gravity": 9.81}
        if self.beside.random() < 0.5:
            shapes = body["shape"] if isinstance(body["shape"], list) else [body["shape"]]
            at = [0.25 * x, 0.0] if kind["kind"] == "points" else shapes[0].get("at", [0.0, 0.0])
            if kind["kind"] == "points" or shapes[0]["kind"] in ("point", "disc", "capsule", "box"):
                body["support"]["centre"] = at

    def contacts(self) -> list[dict[str, Any]]:
        def contact(a: str, b: str) -> dict[str, Any]:
            entry = {"between": [a, b], "friction": self.of(0.0, 0.3, 1.2), "restitution": self.of(0.0, 0.5)}
            if self.chance(0.6):
                entry |= {
                    "stiffness": self.number(self.between(1e3, 1e5)),
                    "damping": self.of(0.0, 5.0, 100.0),
                }
            if self.chance(0.2):
                entry |= {"stiffness": 2e4, "tangential_stiffness": 1e4, "coupling_stiffness": 3e3}
            return entry

        return [contact("floor", "*")] * ("floor" in self.bodies) + [contact("*", "*")]

    def joints(self) -> dict[str, Any]:
        names = [name for name in self.bodies if name != "floor"]
        if len(names) < 2 or not self.chance(0.35):
            return {}
        a, b = names[0], names[1]
        x, y = (0.5 * (p + q) for p, q in zip(self.places[a], self.places[b], strict=True))
        joint: dict[str, Any] = {"kind": self.of("weld", "hinge", "slide"), "between": [a, b], "at": [x, y]}
        joint["axis"] = [1.0, self.of(0.0, 0.5)]
        if self.chance(0.3):
            joint |= {"stiffness": 1e4, "damping": 10.0}
        if joint["kind"] != "weld":
            own: dict[str, Any] = {}
            if self.chance(0.6):
                own["drive"] = self.drive(0.1 if joint["kind"] == "hinge" else 1.0)
            if self.chance(0.3):
                own |= {"damping": 0.1, "dry_friction": self.of(0.0, 0.05)}
            if self.chance(0.3):
                own |= {"lower": -1e-3, "upper": 2e-3}
            joint["coordinate"] = own
        return {"joint": joint}

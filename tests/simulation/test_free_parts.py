"""Parts that nothing holds but contacts: pinches, V-grips, linkages into stops, and pulls away from contacts.

Scenes are drawn at random in sizes, masses and times over decades; what mechanics says of them is exact.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import rungwise as rw
from rungwise.simulation.result import Run

Data = dict[str, Any]
Random = np.random.Generator

FEW = 12
"""Steps by which faint damping may lengthen a run: its bodies come to rest more slowly."""


def units(random: Random) -> tuple[float, float, float]:
    """Length, mass and time of a scene."""
    length, mass, time = 10.0 ** random.uniform((-3, -6, -2), (3, 6, 2))
    return float(length), float(mass), float(time)


def law(random: Random, between: list[str], mu: float, stiffness: float, time: float) -> Data:
    """A compliant contact, maybe damped, and maybe softer along the surface."""
    found: Data = {"between": between, "friction": mu, "stiffness": stiffness}
    if random.random() < 0.5:
        found["damping"] = stiffness * time * 10.0 ** random.uniform(-4, -1)
    if random.random() < 0.3:
        found["tangential_stiffness"] = stiffness * 10.0 ** random.uniform(-1, 0)
    return found


def drag(length: float) -> Data:
    """Support damping c of a free body."""
    return {"x": {"damping": "c"}, "y": {"damping": "c"}, "angle": {"damping": f"c * {0.1 * length**2!r}"}}


def driven(axis: list[float], travel: float, time: float) -> Data:
    drive = {"kind": "speed", "speed": travel / time}
    return {
        "motion": {"kind": "slide", "axis": axis, "name": "s"},
        "coordinates": {"s": {"upper": travel, "drive": drive}},
    }


def outcomes(data: Data, dampings: list[float], model: rw.Rung = rw.QUASISTATIC_COMPLIANT) -> list[Run]:
    scene = rw.load(data)
    return [rw.simulate(scene, model, parameters={"c": c}, frames=3) for c in dampings]


def faint(random: Random, most: float) -> list[float]:
    """No damping, and three dampings of at most `most` over many decades."""
    return [0.0, *(most * 10.0 ** random.choice(np.arange(-12, 1), 3, replace=False)).tolist()]


def agree(runs: list[Run]) -> None:
    """One verdict, which is no failure, in about as many attempts whatever the damping."""
    assert {run.outcome.name for run in runs} <= {"goal", "missed", "model_invalid"}, runs[0].reason
    assert len({run.outcome.name for run in runs}) == 1
    assert max(run.worst_residual for run in runs) <= 1e-8
    attempts = [run.attempts for run in runs]
    assert max(attempts) - min(attempts) <= FEW or "missed" in {run.outcome.name for run in runs}


class Pinch:
    """A free part at any angle, and fingers (discs) that close in on it."""

    def __init__(self, random: Random) -> None:
        self.random = random
        self.length, self.mass, self.time = units(random)
        self.pose = random.uniform(
            (-3 * self.length, -3 * self.length, 0), (3 * self.length, 3 * self.length, 6)
        )
        self.squeeze = 2e-4 * self.length
        self.mu = float(random.uniform(0.1, 0.9))
        self.stiffness = self.mass / self.time**2 * 10.0 ** float(random.uniform(-3, 9))
        self.bodies: Data = {}

    def turned(self, x: float, y: float) -> list[float]:
        c, s = math.cos(self.pose[2]), math.sin(self.pose[2])
        return [float(c * x - s * y), float(s * x + c * y)]

    def finger(self, at: tuple[float, float], normal: float, push: float) -> None:
        """It meets the part at a point where the outer normal has this angle, moving at the angle `push`."""
        radius, gap = 0.3 * self.length, 0.05 * self.squeeze * self.random.uniform(0.5, 1.0)
        away = radius + gap
        x, y = self.turned(at[0] + away * math.cos(normal), at[1] + away * math.sin(normal))
        self.bodies[f"f{len(self.bodies)}"] = {
            "role": "robot",
            "shape": {"kind": "disc", "radius": radius},
            "pose": {"x": x + self.pose[0], "y": y + self.pose[1]},
            **driven(self.turned(math.cos(push), math.sin(push)), self.squeeze, 0.5 * self.time),
        }

    def scene(self, shape: Data) -> Data:
        fingers = list(self.bodies)
        part = {"role": "object", "mass": self.mass, "shape": shape, "motion": {"kind": "free"}}
        part["pose"] = dict(zip(("x", "y", "angle"), map(float, self.pose), strict=True))
        part["coordinates"] = drag(self.length)
        held = 0.05 * self.stiffness * self.squeeze
        return {
            "name": "pinch",
            "parameters": {"c": {"default": 0.0}},
            "bodies": {**self.bodies, "part": part},
            "contacts": [law(self.random, ["part", "*"], self.mu, self.stiffness, self.time)],
            "goal": " and ".join(f"force({finger}, part) >= {held!r}" for finger in fingers),
            "duration": 3.0 * self.time,
            "step": self.time / 40.0,
        }

    def dampings(self) -> list[float]:
        """So little that no force that it causes counts."""
        return faint(self.random, 1e-4 * self.stiffness * self.time)


def two_fingers(random: Random) -> tuple[Pinch, Data, bool]:
    """Two fingers on opposite faces, off-centre, or on a chord of a disc; whether the line between the
    contacts is inside both cones."""
    pinch = Pinch(random)
    closes = bool(random.random() < 0.5)
    slope = pinch.mu * float(random.uniform(0.1, 0.9) if closes else random.uniform(1.1, 1.6))
    half, kind = 0.5 * pinch.length, random.choice(["box", "polygon", "disc"])
    lean = math.atan(slope) if kind == "disc" else 0.0
    for normal, push in ((math.pi - lean, 0.0), (lean, math.pi)):
        side = math.copysign(half, math.cos(normal))
        at = (half * math.cos(normal), half * math.sin(normal)) if lean else (side, -side * slope)
        pinch.finger(at, normal, push)
    tall = float(random.uniform(1.6, 3.0)) * half
    right = [[half, -tall], [half, tall], [0.0, 1.2 * tall]]
    shapes = {
        "box": {"kind": "box", "width": 2.0 * half, "height": 2.0 * tall},
        "disc": {"kind": "disc", "radius": half},
        "polygon": {
            "kind": "polygon",
            "vertices": [*right, [-half, tall], [-half, -tall], [0.0, -1.2 * tall]],
        },
    }
    return pinch, pinch.scene(shapes[str(kind)]), closes


@pytest.mark.few(5)
@pytest.mark.parametrize("seed", range(25))
def test_two_fingers_hold_what_the_line_between_them_allows(seed: int) -> None:
    """Force closure iff the line between the contacts is inside both cones; otherwise the part turns away."""
    pinch, data, closes = two_fingers(np.random.default_rng(seed))
    runs = outcomes(data, pinch.dampings())
    agree(runs)
    assert runs[0].outcome.name == ("goal" if closes else "missed")
    del data["goal"]
    for model in (rw.QUASISTATIC_RIGID, rw.DYNAMIC_RIGID):
        (rigid,) = outcomes(data, [0.0], model)
        assert (rigid.outcome.name == "jammed") == closes, (model.name, rigid.reason)
        assert (rigid.certificate is not None) == closes


@pytest.mark.parametrize("seed", range(20))
def test_more_fingers_never_jam_a_compliant_rung(seed: int) -> None:
    """Three or four, anywhere on a polygon or a disc, one after the other."""
    random = np.random.default_rng((1, seed))
    pinch = Pinch(random)
    count, half = int(random.integers(3, 5)), 0.5 * pinch.length
    if random.random() < 0.3:
        shape: Data = {"kind": "disc", "radius": half}
        angles, apothem = random.uniform(0.0, 2.0 * math.pi, count), half
    else:
        sides = int(random.integers(count, 7))
        corners = 2.0 * math.pi * np.arange(sides) / sides
        shape = {"kind": "polygon", "vertices": (half * np.c_[np.cos(corners), np.sin(corners)]).tolist()}
        angles = random.choice(corners, count, replace=False) + math.pi / sides
        apothem = half * math.cos(math.pi / sides)
    for a in angles:
        off = 0.1 * pinch.length * random.uniform(-1, 1) if "vertices" in shape else 0.0
        at = apothem * np.array([math.cos(a), math.sin(a)]) + off * np.array([-math.sin(a), math.cos(a)])
        pinch.finger((float(at[0]), float(at[1])), float(a), float(a) + math.pi)
    agree(outcomes(pinch.scene(shape), pinch.dampings()))


@pytest.mark.few(8)
@pytest.mark.parametrize("seed", range(30))
def test_a_v_grip_ejects_iff_friction_is_below_the_slope(seed: int) -> None:
    """Two walls at an angle beta to the vertical close on a disc: it leaves iff mu < tan beta."""
    random = np.random.default_rng((2, seed))
    length, mass, time = units(random)
    beta = math.radians(random.uniform(5, 60))
    leaves = bool(random.random() < 0.5)
    mu = math.tan(beta) * float(random.uniform(0.2, 0.93) if leaves else random.uniform(1.07, 2))
    stiffness = mass / time**2 * 10.0 ** float(random.uniform(-3, 9))
    gap, squeeze = 0.01 * length, 0.02 * length
    c, s = math.cos(beta), math.sin(beta)
    walls: Data = {}
    for name, side in (("left", 1.0), ("right", -1.0)):
        plane = {"kind": "halfplane", "normal": [side * c, s], "at": [-side * (length + gap) / c, 0.0]}
        walls[name] = {"role": "robot", "shape": plane} | driven([side, 0.0], squeeze + gap / c, time)
    disc = {"role": "object", "shape": {"kind": "disc", "radius": length}, "mass": mass}
    disc |= {"motion": {"kind": "free"}, "coordinates": drag(length)}
    data = {
        "name": "v_grip",
        "parameters": {"c": {"default": 0.0}},
        "bodies": {**walls, "disc": disc},
        "contacts": [law(random, ["disc", "*"], mu, stiffness, time)],
        "duration": 2.0 * time,
        "step": time / float(random.uniform(6, 50)),
    }
    runs = outcomes(data, faint(random, 1e-6 * stiffness * time))
    agree(runs)
    for run in runs:
        # What sticks yields along the walls by no more than they press in.
        rise = run.final["disc"]["y"] / squeeze
        assert rise == pytest.approx(c / s, rel=1e-3) if leaves else abs(rise) < 0.9 * c / s


@pytest.mark.parametrize("seed", range(12))
def test_a_linkage_deforms_a_compliant_stop_until_the_model_is_invalid(seed: int) -> None:
    """One or two driven links turn into a disc that cannot leave; the first always reaches it."""
    random = np.random.default_rng((3, seed))
    length, mass, time = units(random)
    stiffness = mass / time**2 * 10.0 ** float(random.uniform(-2, 8))
    thick, x, links, joints = 0.03 * length, 0.0, {}, {}
    for i in range(int(random.integers(1, 3))):
        long = length * float(random.uniform(0.8, 1.4))
        links[f"link{i}"] = {
            "role": "robot",
            "mass": mass * 10.0 ** float(random.uniform(-2, 2)),
            "shape": {"kind": "capsule", "length": 0.9 * long, "radius": thick},
            "pose": {"x": x + 0.5 * long},
            "motion": {"kind": "free"},
        }
        speed = {"kind": "speed", "speed": (0.3 if i == 0 else float(random.uniform(0.0, 0.3))) / time}
        between = [f"link{i - 1}" if i else "base", f"link{i}"]
        joints[f"joint{i}"] = {
            "kind": "hinge",
            "between": between,
            "at": [x, 0.0],
            "coordinate": {"drive": speed},
        }
        x += long
    radius = 0.15 * length
    rise = radius + thick + length * float(random.uniform(0.05, 0.3))
    stop = {
        "role": "obstacle",
        "shape": {"kind": "disc", "radius": radius},
        "pose": {"x": 0.5 * length, "y": rise},
    }
    data = {
        "name": "linkage",
        "parameters": {"c": {"default": 0.0}},
        "bodies": {"base": {"role": "obstacle", "shape": {"kind": "point"}}, **links, "stop": stop},
        "joints": joints,
        "contacts": [law(random, ["*", "stop"], float(random.uniform(0.0, 1.0)), stiffness, time)],
        "duration": 4.0 * time,
        "step": time * 10.0 ** float(random.uniform(-2.3, -1.3)),
    }
    (run,) = outcomes(data, [0.0])
    assert run.outcome.name == "model_invalid", run.reason
    assert run.worst_residual <= 1e-8


@pytest.mark.few(10)
@pytest.mark.parametrize("seed", range(40))
def test_what_is_pulled_away_is_not_held(seed: int) -> None:
    """However stiff the contact, and whatever presses elsewhere: loads that point away have no support, and
    loads that press have one."""
    random = np.random.default_rng((4, seed))
    length, mass, time = units(random)
    force = mass * length / time**2 * 10.0 ** float(random.uniform(-3, 3))
    stiffness = force / length * 10.0 ** float(random.uniform(0, 14))
    mu = float(random.choice([0.0, random.uniform(0, 1)]))
    away, tilt = bool(random.random() < 0.7), float(random.uniform(-0.5, 0.5))
    up, along = np.array([-math.sin(tilt), math.cos(tilt)]), np.array([math.cos(tilt), math.sin(tilt)])
    lean = float(random.uniform(-1.4, 1.4))
    pull = force * (math.cos(lean) * up + math.sin(lean) * along) if away else -force * up
    box = {"kind": "box", "width": 3.0 * length, "height": 2.0 * length}
    shape = {"kind": "disc", "radius": length} if random.random() < 0.5 else box

    def body(at: Any, shape: Data, mass: float, load: Any) -> Data:
        pose = {"x": float(at[0]), "y": float(at[1]), "angle": tilt}
        free = {"kind": "free"}
        return {
            "role": "object",
            "mass": mass,
            "shape": shape,
            "pose": pose,
            "motion": free,
            "force": load.tolist(),
        }

    bodies: Data = {"floor": {"role": "obstacle", "shape": {"kind": "halfplane", "normal": up.tolist()}}}
    bodies["part"] = body(length * up, shape, mass, pull)
    contacts = [{"between": ["part", "floor"], "friction": mu, "stiffness": stiffness}]
    if random.random() < 0.5:
        weight = force * 10.0 ** float(random.uniform(-6, 6))
        heavy = mass * 10.0 ** float(random.uniform(-3, 6))
        bodies["other"] = body(length * (up + 20.0 * along), box, heavy, -weight * up)
        contacts.append({"between": ["other", "floor"], "friction": mu, "stiffness": stiffness})
    data = {
        "name": "pull",
        "parameters": {"c": {"default": 0.0}},
        "bodies": bodies,
        "contacts": contacts,
        "duration": time,
        "step": time / 5.0,
    }
    for model in (rw.QUASISTATIC_RIGID, rw.QUASISTATIC_COMPLIANT):
        (run,) = outcomes(data, [0.0], model)
        assert run.outcome.name == ("unsupported" if away else "timeout"), (model.name, run.reason)
        assert (run.certificate is not None) == away

"""Members of classes of pushing tasks: sizes, masses, friction, starts and goals are drawn."""

from __future__ import annotations

import json
import math
from typing import Any

import numpy as np

import rungwise as rw
from rungwise.kernel import Reals


def two_boxes(seed: int, speed: float = 0.02) -> rw.Scene:
    """A rod and two boxes on a table, which both must go somewhere."""
    rng = np.random.default_rng(seed)
    sizes = rng.uniform(0.06, 0.14, (2, 2))
    reaches = 0.5 * np.hypot(*sizes.T)
    starts, goals = (_apart(rng, reaches, width) for width in (0.25, 0.3))
    friction, boxes, terms = float(rng.uniform(0.1, 0.5)), {}, []
    for k, name in enumerate("ab"):
        mass, angle, turn = (float(rng.uniform(*of)) for of in ((0.3, 2.0), (-0.7, 0.7), (-1.0, 1.0)))
        boxes[name] = {
            "role": "object", "mass": mass, "motion": {"kind": "free"},
            "shape": {"kind": "box", "width": float(sizes[k, 0]), "height": float(sizes[k, 1])},
            "pose": {"x": float(starts[k, 0]), "y": float(starts[k, 1]), "angle": angle},
            "support": {"friction": float(rng.uniform(0.2, 0.5)), "load": 9.81 * mass},
        }  # fmt: skip
        x, y = goals[k].tolist()
        terms.append(f"hypot({name}.x - ({x}), {name}.y - ({y})) <= 0.015")
        terms.append(f"abs({name}.angle - ({angle + turn})) <= 0.15")
    bounds = {name: {"range": [-1, 1]} for name in ("ux", "uy")}
    return rw.load(
        {
            "name": "two_boxes",
            "parameters": {"v": {"default": speed}, "ux": {"default": 0.0}, "uy": {"default": 0.0}},
            "inputs": ["ux", "uy"],
            "bodies": {"rod": _rod(), **boxes},
            "contacts": [{"between": ["*", "*"], "friction": friction, "stiffness": 1e6, "damping": 1e3}],
            "goal": " and ".join(terms), "tolerance": 1e-7, "duration": "0.1 / v", "step": "1e-4 / v",
            "task": {
                "inputs": bounds, "moves": [1, 8],
                "transit": {"rod": {"speed": "v", "clearance": 0.005, "push": [0.003, 0.4]}},
            },
        }
    )  # fmt: skip


def push(seed: int, **values: float) -> rw.Scene:
    """The scene `push` with drawn sizes, mass and friction, and these values of parameters."""
    rng = np.random.default_rng(seed)
    file: dict[str, Any] = json.loads(rw.load("push").file.model_dump_json(exclude_unset=True))
    width, height, mass, mu, mu_s = rng.uniform([0.07, 0.07, 0.4, 0.15, 0.2], [0.13, 0.13, 1.2, 0.5, 0.5])
    drawn = {"width": width, "height": height, "mass": mass, "mu": mu, "mu_s": mu_s} | values
    for name, value in drawn.items():
        file["parameters"][name]["default"] = float(value)
    return rw.load(file)


def _rod() -> dict[str, Any]:
    speeds = {"x": "v * ux", "y": "v * uy", "angle": 0.0}
    return {
        "role": "robot", "shape": {"kind": "disc", "radius": 0.006}, "pose": {"x": -0.5, "y": 0.0},
        "motion": {"kind": "free"},
        "coordinates": {name: {"drive": {"kind": "speed", "speed": speed}} for name, speed in speeds.items()},
    }  # fmt: skip


def _apart(rng: np.random.Generator, reaches: Reals, width: float) -> Reals:
    """Two places, within a square, at which boxes of these reaches are apart."""
    while True:
        places = rng.uniform(-width, width, (2, 2))
        if math.dist(*places) > float(reaches.sum()) + 0.03:
            return np.asarray(places)


def lifted_block(seed: int) -> rw.Scene:
    """Two fingers on springs of limited force over a block on a floor, which gravity holds there."""
    rng = np.random.default_rng(seed)
    size, mass, friction = rng.uniform(0.015, 0.03), rng.uniform(0.005, 0.02), float(rng.uniform(0.4, 0.9))
    height = rng.uniform(0.6, 1.2) * size
    inputs = ("x1", "y1", "x2", "y2")
    places = dict(zip(inputs, (-1.2 * size, 0.5 * size, 1.2 * size, 0.5 * size), strict=True))
    contact = {"stiffness": 1e5, "damping": 1e2}
    return rw.load(
        {
            "name": "lifted_block",
            "gravity": [0, -9.81],
            "parameters": {name: {"default": place} for name, place in places.items()},
            "inputs": list(inputs),
            "bodies": {
                **{f"finger{k}": _finger(k) for k in (1, 2)},
                "part": {
                    "role": "object", "mass": float(mass), "motion": {"kind": "free"},
                    "shape": {"kind": "box", "width": float(size), "height": float(height)},
                    "pose": {"y": float(height) / 2},
                },
                "floor": {"role": "obstacle", "shape": {"kind": "halfplane"}},
            },
            "contacts": [
                {"between": ["finger*", "part"], "friction": friction, **contact},
                {"between": ["part", "floor"], "friction": float(rng.uniform(0.2, 0.6)), **contact},
                {"between": ["finger*", "floor"], "friction": 0, **contact},
                {"between": ["finger1", "finger2"], "friction": 0, **contact},
            ],
            "goal": f"part.x >= {3.0 * size}",
            "tolerance": 1e-8,
            "duration": 60,
            "step": 0.01,
            "task": {
                "inputs": {
                    name: {"range": [-0.05, 0.05] if name[0] == "x" else [0.0021, 0.06]} for name in inputs
                },
                "moves": [1, 4],
                "transit": {
                    f"finger{k}": {"speed": 0.05, "clearance": 1e-3, "push": [1e-3, 0.03]} for k in (1, 2)
                },
            },
        }
    )  # fmt: skip


def _finger(number: int) -> dict[str, Any]:
    def spring(target: str) -> dict[str, Any]:
        drive = {"kind": "servo", "stiffness": 100, "damping": 2.8, "target": target, "limit": 2}
        return {"drive": drive}

    x, y = f"x{number}", f"y{number}"
    return {
        "role": "robot", "mass": 0.02, "force": [0, 0.1962], "shape": {"kind": "disc", "radius": 0.002},
        "pose": {"x": x, "y": y}, "motion": {"kind": "free"},
        "coordinates": {"x": spring(x), "y": spring(y), "angle": {"drive": {"kind": "speed", "speed": 0}}},
    }  # fmt: skip


def unnamed_hand(turn: float, moves: int) -> rw.Scene:
    """Two fingers of two links, which the task does not call fingers, turn a disc by an angle."""
    data = rw.load("planar_hand").file.model_dump(mode="json", exclude_unset=True)
    del data["task"]["fingers"]
    data["task"] |= {"moves": [1, moves], "duration": ["0.05 / rate", "0.3 / rate"]}
    data["parameters"]["turn"]["default"] = turn
    return rw.load(data)

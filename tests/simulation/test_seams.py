"""What slides over flush neighbours moves as over one piece, with the same steps."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.random import Generator

import rungwise as rw

LENGTH = 3.0
MODELS = rw.LADDER[1:]
Data = dict[str, Any]


def slabs(rng: Generator) -> list[tuple[float, float, float]]:
    """Start, width and depth of flush slabs that together are LENGTH long."""
    cuts = np.sort(rng.uniform(0.0, LENGTH, int(rng.integers(1, 5))))
    places = [0.0, *(float(x) for x in cuts), LENGTH]
    return [
        (a, b - a, float(rng.choice([0.2, rng.uniform(0.05, 0.4)])))
        for a, b in zip(places, places[1:], strict=False)
    ]


def box(x: float, y: float, width: float, height: float, **more: float) -> Data:
    return {"kind": "box", "width": width, "height": height, "at": [x, y], **more}


def floor(rng: Generator, kind: str) -> dict[str, Data]:
    """Bodies whose common top is y = 0 from 0 to LENGTH, as bodies, shapes of one, or an outline."""
    pieces = slabs(rng)
    shapes = [box(x + width / 2, -depth / 2, width, depth) for x, width, depth in pieces]
    if kind == "bodies":
        order = rng.permutation(len(shapes))
        return {f"f{k}": {"role": "obstacle", "shape": shapes[k]} for k in order}
    if kind == "shapes":
        return {"f": {"role": "obstacle", "shape": shapes}}
    below = [[x, -depth] for start, width, depth in pieces for x in (start, start + width)]
    if len({depth for _, _, depth in pieces}) < len(pieces):
        below = [[0.0, -0.3], [1.2, -0.3], [1.5, -0.1], [1.8, -0.3], [LENGTH, -0.3]]
    outline = {"kind": "outline", "vertices": [*below, [LENGTH, 0.0], [0.0, 0.0]]}
    return {"f": {"role": "obstacle", "shape": outline}}


def one_floor() -> dict[str, Data]:
    return {"f": {"role": "obstacle", "shape": box(LENGTH / 2, -0.1, LENGTH, 0.2)}}


def slider(rng: Generator, kind: str) -> tuple[Data | list[Data], Data, float]:
    """Shape in pieces, the same in one, and the height of its origin when it rests."""
    width, height = float(rng.uniform(0.1, 1.5)), float(rng.uniform(0.1, 0.4))
    radius = float(rng.choice([0.0, 0.02]))
    if kind == "disc":
        one: Data = {"kind": "disc", "radius": height / 2}
        return one, one, height / 2
    if kind == "capsule":
        one = {"kind": "capsule", "length": width, "radius": height / 2}
        return one, one, height / 2
    if kind == "polygon":
        places = [[-width / 2, 0.0], [width / 3, 0.0], [width / 2, height / 2], [-width / 4, height]]
        one = {"kind": "polygon", "vertices": places, "radius": radius}
        return one, one, radius
    one = box(0.0, height / 2, width, height, radius=radius)
    if kind == "box":
        return one, one, radius
    cut = sorted(float(x) for x in rng.uniform(-width / 2, width / 2, int(rng.integers(1, 3))))
    places = [-width / 2, *cut, width / 2]
    pieces = [
        box((a + b) / 2, height / 2, b - a, height, radius=radius)
        for a, b in zip(places, places[1:], strict=False)
    ]
    return pieces, one, radius


def turned(data: Data, angle: float) -> Data:
    """The scene turned about the origin."""
    c, s = math.cos(angle), math.sin(angle)

    def turn(x: float, y: float) -> tuple[float, float]:
        return c * x - s * y, s * x + c * y

    for body in data["bodies"].values():
        pose = {"x": 0.0, "y": 0.0, "angle": 0.0, **body.get("pose", {})}
        x, y = turn(pose["x"], pose["y"])
        body["pose"] = {"x": x, "y": y, "angle": pose["angle"] + angle}
        if body["role"] == "object":
            speeds = body["coordinates"]
            vx, vy = turn(speeds["x"]["speed"], speeds["y"]["speed"])
            speeds["x"], speeds["y"] = {"speed": vx}, {"speed": vy}
        elif "motion" in body:
            body["motion"]["axis"] = list(turn(*body["motion"]["axis"]))
    data["gravity"] = list(turn(*data["gravity"]))
    return data


def scenes(rng: Generator, floors: str, kind: str, pushed: bool) -> tuple[Data, Data]:
    """A random scene with seams, and the same without."""
    pieces, one, height = slider(rng, kind)
    angle = float(rng.choice([0.0, rng.uniform(-3.0, 3.0)]))
    speed, mu = float(rng.uniform(0.5, 4.0)), float(rng.choice([0.0, rng.uniform(0.0, 0.6)]))
    x, lift = float(rng.uniform(0.2, 0.9)), float(rng.choice([0.0, 0.0, rng.uniform(0.0, 0.05)]))
    spin = 0.0 if lift == 0.0 else float(rng.uniform(-1.0, 1.0))
    global SPEED
    SPEED = speed
    made = []
    for ground, shape in ((floor(rng, floors), pieces), (one_floor(), one)):
        part: Data = {
            "role": "object",
            "shape": shape,
            "mass": 1.0,
            "inertia": 0.05,
            "centre": [0.0, 0.1],
            "motion": {"kind": "free"},
            "pose": {"x": x, "y": height + lift},
            "coordinates": {"x": {"speed": speed}, "y": {"speed": 0.0}, "angle": {"speed": spin}},
        }
        bodies = {**ground, "part": part} if rng.random() < 0.5 else {"part": part, **ground}
        contacts = [
            {
                "between": ["part", "f*"],
                "friction": mu,
                "stiffness": 1e5,
                "damping": 200.0,
                "restitution": 0.3,
            }
        ]
        if pushed:
            part["coordinates"]["x"]["speed"] = 0.0
            part["pose"]["y"], part["coordinates"]["angle"]["speed"] = height, 0.0
            bodies["push"] = {
                "role": "robot",
                "shape": {"kind": "disc", "radius": 0.02},
                "pose": {"x": x - 1.2, "y": height + 0.05},
                "motion": {"kind": "slide", "axis": [1.0, 0.0], "name": "x"},
                "coordinates": {"x": {"drive": {"kind": "speed", "speed": speed}}},
            }
            contacts.append({"between": ["push", "part"], "friction": 0.1})
        data = {"name": "seam", "gravity": [0.0, -9.81], "bodies": bodies, "contacts": contacts}
        made.append(turned(data, angle))
    return made[0], made[1]


KINDS = ("box", "disc", "capsule", "polygon", "pieces")


@pytest.mark.parametrize("pushed", [False, True], ids=["thrown", "pushed"])
@pytest.mark.parametrize("floors", ["bodies", "shapes", "outline"])
@pytest.mark.parametrize("model", MODELS, ids=str)
def test_moves_as_over_one_piece(model: rw.Rung, floors: str, pushed: bool) -> None:
    rng = np.random.default_rng(len(floors) + 10 * pushed)
    for kind in KINDS:
        many, one = scenes(rng, floors, kind, pushed)
        step = float(rng.choice([0.01, 0.05, 0.2]))
        runs = [rw.simulate(data, model, step=step, duration=few(many) * step) for data in (many, one)]
        positions = [
            run.trajectory.position.sel(coordinate=["part.x", "part.y", "part.angle"]).values for run in runs
        ]
        assert runs[0].outcome == runs[1].outcome
        assert positions[0].shape == positions[1].shape
        assert np.abs(positions[0] - positions[1]).max() < 1e-9

"""What slides over flush neighbours moves as over one piece, with the same steps."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from numpy.random import Generator

import rungwise as rw

LENGTH = 3.0
MODELS = rw.LADDER[1:]
WELL_POSED = (rw.KINEMATIC, rw.DYNAMIC_RIGID, rw.DYNAMIC_COMPLIANT)
"""Rungs whose step does not magnify rounding: quasistatic steps over one slab differ by 1e-8 and more when
its corners are rounded differently."""
Data = dict[str, Any]


def slabs(rng: Generator) -> list[tuple[float, float, float]]:
    """Start, width and depth of flush slabs that together are LENGTH long."""
    cuts = np.sort(rng.uniform(0.0, LENGTH, int(rng.integers(1, 5))))
    places = [0.0, *(float(x) for x in cuts), LENGTH]
    return [(a, b - a, float(rng.choice([0.2, rng.uniform(0.05, 0.4)]))) for a, b in pairwise(places)]


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
    pieces = [box((a + b) / 2, height / 2, b - a, height, radius=radius) for a, b in pairwise(places)]
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


def scenes(rng: Generator, floors: str, kind: str, pushed: bool) -> tuple[Data, Data, float, int]:
    """A random scene with seams, the same without, the step, and how many keep the part on the floor."""
    pieces, one, height = slider(rng, kind)
    angle = float(rng.choice([0.0, rng.uniform(-3.0, 3.0)]))
    speed, mu = float(rng.uniform(0.5, 4.0)), float(rng.choice([0.0, rng.uniform(0.0, 0.6)]))
    x, lift = float(rng.uniform(0.2, 0.9)), float(rng.choice([0.0, 0.0, rng.uniform(0.0, 0.05)]))
    spin = 0.0 if lift == 0.0 else float(rng.uniform(-1.0, 1.0))
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
    step = float(rng.choice([0.01, 0.05, 0.2]))
    return made[0], made[1], step, max(1, min(12, int(1.2 / (step * speed))))


KINDS = ("box", "disc", "capsule", "polygon", "pieces")


@pytest.mark.few(1)
@pytest.mark.parametrize("pushed", [False, True], ids=["thrown", "pushed"])
@pytest.mark.parametrize("floors", ["bodies", "shapes", "outline"])
@pytest.mark.parametrize("model", WELL_POSED, ids=str)
def test_moves_as_over_one_piece(model: rw.Rung, floors: str, pushed: bool) -> None:
    """Compared where the run over one piece takes the steps that it is given: how a step is halved depends on
    the lengths of all shapes, too."""
    rng = np.random.default_rng([len(floors), pushed])
    compared = 0
    for kind in 3 * KINDS:
        many, one, step, steps = scenes(rng, floors, kind, pushed)
        compared += compare(many, one, model, step, steps)
    assert compared >= 4


def compare(many: Data, one: Data, model: rw.Rung, step: float, steps: int) -> bool:
    """Compare both runs, if that over one piece is not halved; whether it was."""
    reference = rw.simulate(one, model, step=step, duration=steps * step)
    if reference.attempts > steps:
        return False
    run = rw.simulate(many, model, step=step, duration=steps * step)
    assert run.outcome == reference.outcome
    first, second = (
        run.trajectory.position.sel(coordinate=["part.x", "part.y", "part.angle"]).values
        for run in (run, reference)
    )
    assert np.abs(first - second).max() < 1e-9
    return True


def row(pieces: list[tuple[float, float]], speed: float, friction: float) -> Data:
    """A box that slides at 2 m/s, and below it belts (start, width) that move at `speed`."""
    bodies: dict[str, Data] = {
        f"f{k}": {
            "role": "robot",
            "shape": box(start + width / 2, -0.1, width, 0.2),
            "motion": {"kind": "slide", "axis": [1.0, 0.0], "name": "x"},
            "coordinates": {"x": {"drive": {"kind": "speed", "speed": speed}}},
        }
        for k, (start, width) in enumerate(pieces)
    }
    bodies["part"] = {
        "role": "object",
        "shape": box(0.0, 0.05, 0.3, 0.1),
        "density": 100.0,
        "motion": {"kind": "free"},
        "pose": {"x": 0.4, "y": 0.0},
        "coordinates": {"x": {"speed": 2.0}},
    }
    contacts = [{"between": ["*", "*"], "friction": friction, "stiffness": 1e5, "damping": 200.0}]
    return {"name": "belts", "gravity": [0.0, -9.81], "bodies": bodies, "contacts": contacts}


@pytest.mark.parametrize("model", MODELS[1:], ids=str)
def test_belts_that_move_together_are_one_belt(model: rw.Rung) -> None:
    for speed, mu in ((0.4, 0.2), (-1.0, 0.5)):
        many = row([(0.0, 0.9), (0.9, 0.3), (1.2, 1.8)], speed, mu)
        assert compare(many, row([(0.0, 3.0)], speed, mu), model, 0.01, 40)


def obstacle(shapes: list[Data], speed: float = 2.0) -> Data:
    """A box that slides from x = 0.3 over a floor of these shapes, each a body."""
    bodies: dict[str, Data] = {f"f{k}": {"role": "obstacle", "shape": s} for k, s in enumerate(shapes)}
    data = row([(0.0, 1.0)], 0.0, 0.2)["bodies"]["part"] | {"coordinates": {"x": {"speed": speed}}}
    bodies["part"] = data | {"pose": {"x": 0.3, "y": 0.0}}
    contacts = [{"between": ["part", "f*"], "friction": 0.2, "stiffness": 1e6, "damping": 1e3}]
    return {"name": "stop", "gravity": [0.0, -9.81], "bodies": bodies, "contacts": contacts}


DYNAMIC = (rw.DYNAMIC_RIGID, rw.DYNAMIC_COMPLIANT)
SLAB = box(0.5, -0.1, 1.0, 0.2)


@pytest.mark.parametrize("model", DYNAMIC, ids=str)
@pytest.mark.parametrize(
    "shapes",
    [
        [SLAB, box(1.5, -0.099, 1.0, 0.2)],
        [SLAB, box(1.5, 0.05, 1.0, 0.5)],
        [SLAB, box(1.5, -0.1, 1.0, 0.2), box(1.05, 0.25, 0.1, 0.5)],
        [box(1.0, -0.1, 2.0, 0.2), box(1.05, 0.25, 0.1, 0.5)],
    ],
    ids=["1 mm step", "high step", "wall on a seam", "wall on a floor"],
)
def test_what_is_not_flush_still_stops(model: rw.Rung, shapes: list[Data]) -> None:
    run = rw.simulate(obstacle(shapes), model, step=5e-3, duration=0.5)
    right = run.final["part"]["x"] + 0.15
    assert 0.99 < right < 1.0 + 1e-3
    assert np.abs(run.trajectory.velocity.sel(coordinate="part.x").values[-1]) < 1e-2


@pytest.mark.parametrize("model", DYNAMIC, ids=str)
def test_a_step_down_is_fallen_off(model: rw.Rung) -> None:
    run = rw.simulate(obstacle([SLAB, box(1.5, -0.15, 1.0, 0.2)]), model, step=5e-3, duration=0.7)
    assert run.final["part"]["x"] > 1.1
    assert run.final["part"]["y"] < 0.03

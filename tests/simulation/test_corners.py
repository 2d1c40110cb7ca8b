"""What slides over level tiles, with gaps between them or free to move, is not stopped at their sides."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.random import Generator

import rungwise as rw

Data = dict[str, Any]
GRAVITY = 9.81
SUNK = 2.0 * (10.0 / 2.0 + 1.0) * GRAVITY / 1e6
"""Twice how far a free tile and a part on it sink into springs: what sinks swings so far."""
MOVING = (rw.QUASISTATIC_RIGID, rw.QUASISTATIC_COMPLIANT, rw.DYNAMIC_RIGID, rw.DYNAMIC_COMPLIANT)
DYNAMIC = (rw.DYNAMIC_RIGID, rw.DYNAMIC_COMPLIANT)


def box(x: float, y: float, width: float, height: float, **more: float) -> Data:
    return {"kind": "box", "width": width, "height": height, "at": [x, y], **more}


def tiles(rng: Generator, gap: float, drop: float, free: bool) -> tuple[dict[str, Data], list[Data]]:
    """Tiles from x = -0.6 to beyond 2.4, their tops at 0, or `drop` lower from one to the next; on the ground
    and of one weight if they are free."""
    bodies: dict[str, Data] = {}
    start, top = -0.6, 0.0
    while start < 2.4:
        width = float(rng.uniform(0.3, 0.9)) if bodies else 1.2
        height = 0.2 if free else float(rng.uniform(0.05, 0.3))
        tile: Data = {"role": "obstacle", "shape": box(0.0, -height / 2, width, height)}
        if free:
            tile |= {"role": "object", "mass": 10.0, "motion": {"kind": "free"}}
        bodies[f"f{len(bodies)}"] = tile | {"pose": {"x": start + width / 2, "y": top}}
        start, top = start + width + gap, top - drop
    if not free:
        return bodies, []
    bodies["ground"] = {"role": "obstacle", "shape": {"kind": "halfplane"}, "pose": {"y": -0.2}}
    material = {"friction": 0.9, "stiffness": 1e6, "damping": 1e3}
    return bodies, [{"between": [one, other], **material} for one, other in (("f*", "ground"), ("f*", "f*"))]


def slider(rng: Generator) -> Data:
    """A box, 0.3 m long, or a polygon with a flat base as long, whose weight stays above its middle."""
    height = float(rng.uniform(0.05, 0.15))
    radius = float(rng.choice([0.0, 0.01]))
    if rng.random() < 0.5:
        return box(0.0, height / 2 + radius, 0.3, height, radius=radius)
    top = [[0.15, radius + 0.8 * height], [0.0, radius + height], [-0.14, radius + 0.7 * height]]
    return {
        "kind": "polygon",
        "vertices": [[-0.15, radius], [0.15, radius], *top],
        "radius": radius,
    }


def scene(rng: Generator, gap: float, drop: float, free: bool, speed: float, pushed: bool) -> Data:
    bodies, contacts = tiles(rng, gap, drop, free)
    part: Data = {
        "role": "object",
        "shape": slider(rng),
        "mass": 1.0,
        "inertia": 0.01,
        "centre": [0.0, 0.03],
        "motion": {"kind": "free"},
        "coordinates": {"x": {"speed": 0.0 if pushed else speed}},
    }
    bodies["part"] = part
    bounce = float(rng.choice([0.0, 0.6]))
    material = {"friction": 0.2, "restitution": bounce, "stiffness": 1e6, "damping": 1e3}
    contacts.append({"between": ["part", "f*"], **material})
    if pushed:
        bodies["push"] = {
            "role": "robot",
            "shape": {"kind": "disc", "radius": 0.01},
            "pose": {"x": -0.17, "y": 0.025},
            "motion": {"kind": "slide", "axis": [1.0, 0.0], "name": "x"},
            "coordinates": {"x": {"drive": {"kind": "speed", "speed": speed}}},
        }
        contacts.append({"between": ["push", "part"], "stiffness": 1e6, "damping": 1e3})
    return {"name": "tiles", "gravity": [0.0, -GRAVITY], "bodies": bodies, "contacts": contacts}


@pytest.mark.few(1)
@pytest.mark.parametrize("free", [False, True], ids=["fixed", "free"])
@pytest.mark.parametrize("model", DYNAMIC, ids=str)
def test_thrown_over_tiles_stops_where_friction_stops_it(model: rw.Rung, free: bool) -> None:
    rng = np.random.default_rng(free)
    for _ in range(10):
        gap = float(rng.choice([0.0, 10.0 ** rng.uniform(-6.0, -1.7)]))
        speed, step = float(rng.uniform(1.0, 2.8)), float(rng.choice([1e-3, 4e-3]))
        data = scene(rng, gap, 0.0, free, speed, False)
        run = rw.simulate(data, model, step=step, duration=speed / (0.2 * GRAVITY) + 0.05)
        place, height = (run.trajectory.position.sel(coordinate=f"part.{c}").values for c in "xy")
        stop = speed**2 / (0.4 * GRAVITY) - speed * step / 2
        assert place[-1] == pytest.approx(stop, abs=1e-3 if model.compliant or free else 1e-5)
        assert np.abs(height - height[0]).max() < (1e-9 if not model.compliant else SUNK)


@pytest.mark.few(1)
@pytest.mark.parametrize("free", [False, True], ids=["fixed", "free"])
@pytest.mark.parametrize("model", MOVING, ids=str)
def test_pushed_over_tiles_stays_flat(model: rw.Rung, free: bool) -> None:
    rng = np.random.default_rng([1, free])
    for _ in range(4):
        gap = float(rng.choice([0.0, 10.0 ** rng.uniform(-6.0, -1.7)]))
        speed = float(rng.uniform(0.2, 1.0))
        step = float(rng.choice([2e-3, 1e-2])) / speed
        data = scene(rng, gap, 0.0, free, speed, True)
        run = rw.simulate(data, model, step=step, duration=1.5 / speed)
        assert str(run.outcome) == "timeout"
        place, height = (run.trajectory.position.sel(coordinate=f"part.{c}").values for c in "xy")
        assert place[-1] == pytest.approx(1.49, abs=0.02)
        assert np.abs(height - height[0]).max() < (1e-8 if model is rw.QUASISTATIC_RIGID else SUNK)


@pytest.mark.few(5)
@pytest.mark.parametrize("gap", [0.0, 1e-9, 1e-6, 1e-3])
@pytest.mark.parametrize("model", DYNAMIC, ids=str)
def test_a_disc_rolls_over_gaps(model: rw.Rung, gap: float) -> None:
    """It sinks by gap^2 / (8 r) between two tiles, and hops no higher than its compression."""
    radius = 0.1
    for speed, step in ((1.0, 8e-3), (1.0, 2e-3), (3.0, 2e-3), (3.0, 8e-3)):
        bodies: dict[str, Data] = {
            f"f{k}": {"role": "obstacle", "shape": box(k * (0.3 + gap), -0.1, 0.3, 0.2)} for k in range(5)
        }
        bodies["part"] = {
            "role": "object",
            "shape": {"kind": "disc", "radius": radius},
            "mass": 1.0,
            "motion": {"kind": "free"},
            "pose": {"y": radius},
            "coordinates": {"x": {"speed": speed}, "angle": {"speed": -speed / radius}},
        }
        contacts = [{"between": ["part", "f*"], "friction": 0.3, "stiffness": 1e6, "damping": 1e3}]
        data = {"name": "roll", "gravity": [0.0, -GRAVITY], "bodies": bodies, "contacts": contacts}
        run = rw.simulate(data, model, step=step, duration=0.9 / speed)
        height = run.trajectory.position.sel(coordinate="part.y").values - radius
        assert np.abs(height).max() < (1e-5 if gap < 1e-3 else 1e-3)
        assert run.final["part"]["x"] == pytest.approx(0.9, abs=1e-3 if gap < 1e-3 else 5e-3)
        assert run.notes == ()


def mirrored(data: Data) -> Data:
    """The scene with x reversed."""
    bodies = {}
    for name, body in data["bodies"].items():
        shape, pose = dict(body["shape"]), dict(body.get("pose", {}))
        if "at" in shape:
            shape["at"] = [-shape["at"][0], shape["at"][1]]
        if "vertices" in shape:
            shape["vertices"] = [[-x, y] for x, y in shape["vertices"][::-1]]
        if "x" in pose:
            pose["x"] = -pose["x"]
        bodies[name] = {**body, "shape": shape, "pose": pose}
        if "x" in body.get("coordinates", {}):
            x = body["coordinates"]["x"]
            if "speed" in x:
                bodies[name]["coordinates"] = {"x": {"speed": -x["speed"]}}
            else:
                bodies[name]["motion"] = {**body["motion"], "axis": [-1.0, 0.0]}
    return {**data, "bodies": bodies}


@pytest.mark.few(3)
@pytest.mark.parametrize(
    ("model", "pushed"),
    [*((model, True) for model in MOVING), *((model, False) for model in DYNAMIC)],
    ids=str,
)
def test_mirrored_tiles_mirror_the_motion(model: rw.Rung, pushed: bool) -> None:
    rng = np.random.default_rng(4)
    for _ in range(4):
        gap = float(10.0 ** rng.uniform(-6.0, -1.7))
        data = scene(rng, gap, 0.0, False, 1.2, pushed)
        one, other = (rw.simulate(d, model, step=2e-3, duration=0.6) for d in (data, mirrored(data)))
        assert one.final["part"]["x"] == pytest.approx(-other.final["part"]["x"], abs=1e-8)
        assert one.final["part"]["y"] == pytest.approx(other.final["part"]["y"], abs=1e-8)


@pytest.mark.parametrize("model", DYNAMIC, ids=str)
def test_what_slides_down_a_small_step_is_not_stopped_by_it(model: rw.Rung) -> None:
    """Landing costs no more than friction times the impulses of the fall."""
    rng = np.random.default_rng(2)
    for _ in range(10):
        drop, speed = float(10.0 ** rng.uniform(-6.0, -2.5)), float(rng.uniform(1.5, 2.8))
        data = scene(rng, 0.0, drop, False, speed, False)
        run = rw.simulate(data, model, step=1e-3, duration=0.5)
        lost = 3.0 * 4.0 * 0.2 * math.sqrt(2.0 * GRAVITY * drop)
        least = speed - 0.2 * GRAVITY * 0.5 - lost
        assert run.trajectory.velocity.sel(coordinate="part.x").values[-1] > least - 1e-3


@pytest.mark.parametrize(
    ("model", "high"),
    [*((rw.DYNAMIC_RIGID, high) for high in (1e-6, 1e-4, 0.02)), (rw.DYNAMIC_COMPLIANT, 0.02)],
    ids=str,
)
def test_a_step_up_stops(model: rw.Rung, high: float) -> None:
    """Fixed tiles, of which the second is higher than the first by more than contacts are compressed in the
    impact."""
    rng = np.random.default_rng(3)
    data = scene(rng, 0.0, -high, False, 2.0, False)
    data["bodies"]["part"]["shape"] = box(0.0, 0.05, 0.3, 0.1)
    edge = data["bodies"]["f1"]["pose"]["x"] - data["bodies"]["f1"]["shape"]["width"] / 2
    run = rw.simulate(data, model, step=1e-3, duration=0.5)
    assert run.final["part"]["x"] < edge

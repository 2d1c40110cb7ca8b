"""What next to nothing resists is not moved by the rounding of the forces that hold it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import rungwise as rw

Data = dict[str, Any]
GRAVITY, STEP = 9.81, 1e-3
QUASISTATIC = (rw.QUASISTATIC_RIGID, rw.QUASISTATIC_COMPLIANT)
GROUND: Data = {"role": "obstacle", "shape": {"kind": "halfplane"}}


def part(x: float, mass: float, damping: float) -> Data:
    coordinates = {axis: {"damping": damping} for axis in ("x", "y", "angle")}
    return {
        "role": "object",
        "mass": mass,
        "shape": {"kind": "box", "width": 0.4, "height": 0.2},
        "pose": {"x": x, "y": 0.1},
        "motion": {"kind": "free"},
        **({"coordinates": coordinates} if damping > 0.0 else {}),
    }


def mover(mass: float, damping: float, force: str | float, side: float, **pose: float) -> Data:
    return {
        "role": "robot",
        "mass": mass,
        "shape": {"kind": "disc", "radius": 0.1},
        "pose": pose,
        "motion": {"kind": "slide", "axis": [side, 0.0]},
        "coordinates": {"s": {"damping": damping, "drive": {"kind": "force", "force": force}}},
    }


@pytest.mark.few(10)
@pytest.mark.parametrize("rung", QUASISTATIC, ids=lambda rung: rung.name)
@pytest.mark.parametrize("seed", range(16))
def test_a_push_begins_and_goes_on_as_friction_and_damping_say(rung: rw.Rung, seed: int) -> None:
    """A growing force drives a pusher, 1e4 times heavier to lighter than a box: x' = (F - mu m g) / c."""
    rng = np.random.default_rng(seed)
    light = 10.0 ** rng.uniform(-4, 2)
    heavy = light * 10.0 ** rng.uniform(-4, 4)
    side, friction = float(rng.choice([-1.0, 1.0])), float(rng.uniform(0.1, 0.5))
    weight = friction * light * GRAVITY
    damping = weight * 10.0 ** rng.uniform(-3, 1)
    material = {"stiffness": 1e6 * light, "damping": 1e3 * light}
    data = {
        "name": "push",
        "gravity": [0.0, -GRAVITY],
        "bodies": {
            "ground": GROUND,
            "pusher": mover(heavy, damping, f"{2.0 * weight} * t", side, x=-0.3 * side, y=0.1),
            "part": part(0.0, light, 0.0),
        },
        "contacts": [
            {"between": ["part", "ground"], "friction": friction, **material},
            {"between": ["pusher", "part"], "friction": 0.0, **material},
        ],
    }
    run = rw.simulate(data, rung, step=STEP, duration=0.6)
    assert str(run.outcome) == "timeout", run.reason
    assert run.attempts <= 620
    times = STEP * np.arange(1, 601)
    way = side * STEP * np.maximum(2.0 * weight * times - weight, 0.0).sum() / damping
    sunk = 1e-4 if rung.compliant else 1e-9
    assert run.final["part"]["x"] == pytest.approx(way, rel=0.02, abs=sunk)
    assert run.final["part"]["y"] == pytest.approx(0.1, abs=sunk)
    assert run.final["part"]["angle"] == pytest.approx(0.0, abs=sunk)


@pytest.mark.few(8)
@pytest.mark.parametrize("rung", QUASISTATIC, ids=lambda rung: rung.name)
@pytest.mark.parametrize("damping", [0.0, 1e-10, 1e-8, 7e-7, 1e-6, 1e-5])
@pytest.mark.parametrize("seed", range(4))
def test_a_row_rests_while_something_else_moves(rung: rw.Rung, damping: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    count, mass = int(rng.integers(1, 4)), 10.0 ** rng.uniform(-1, 1)
    force, friction = 10.0 ** rng.uniform(-2, 1), float(rng.uniform(0.2, 1.0))
    bodies: Data = {"ground": GROUND, "mover": mover(1.0, 1.0, force, 1.0, y=9.0)}
    for i in range(count):
        bodies[f"p{i}"] = part(0.4 * i, mass, damping)
    bodies["wall"] = {
        "role": "obstacle",
        "shape": {"kind": "box", "width": 0.2, "height": 2.0},
        "pose": {"x": 0.4 * count - 0.1, "y": 1.0},
    }
    pairs = [("p*", "ground"), ("p*", "wall")] + [("p*", "p*")] * (count > 1)
    material = {"friction": friction, "stiffness": 1e6, "damping": 1e3}
    data = {
        "name": "row",
        "gravity": [0.0, -GRAVITY],
        "bodies": bodies,
        "contacts": [{"between": list(pair), **material} for pair in pairs],
    }
    run = rw.simulate(data, rung, step=2e-3, duration=1.0)
    assert str(run.outcome) == "timeout", run.reason
    assert run.steps <= 510
    for i in range(count):
        assert run.final[f"p{i}"]["x"] == pytest.approx(0.4 * i, abs=1e-8)
        assert run.final[f"p{i}"]["y"] == pytest.approx(0.1, abs=1e-4 if rung.compliant else 1e-9)

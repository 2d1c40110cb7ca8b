"""Impacts and jumps against what is known of them: energy, the end of bouncing, Painleve's rod."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import rungwise as rw

G = 10.0
FLOOR = {"role": "obstacle", "shape": {"kind": "halfplane"}}


def thrown(rng: np.random.Generator) -> rw.Scene:
    """A rod of two ends, or a box, thrown at a floor with random friction, restitution and motion."""
    angle = rng.uniform(-1.4, 1.4)
    points = [{"kind": "point", "at": [-0.5, 0]}, {"kind": "point", "at": [0.5, 0]}]
    box = {"kind": "box", "width": 1.0, "height": rng.uniform(0.1, 1.0)}
    shape, low = (points, 0.5) if rng.random() < 0.7 else (box, 0.5 * math.hypot(1.0, box["height"]))
    body = {
        "role": "object",
        "shape": shape,
        "mass": 10.0 ** rng.uniform(-2.0, 2.0),
        "centre": [0, 0],
        "inertia": 10.0 ** rng.uniform(-2.0, 1.0),
        "pose": {"y": low + 0.01, "angle": angle},
        "motion": {"kind": "free"},
        "coordinates": {
            "x": {"speed": rng.uniform(-2.0, 2.0)},
            "y": {"speed": -(10.0 ** rng.uniform(-1.0, 1.0))},
            "angle": {"speed": rng.uniform(-3.0, 3.0)},
        },
    }
    contact = {
        "between": ["rod", "floor"],
        "friction": rng.uniform(0.0, 1.5),
        "restitution": rng.uniform(0.0, 1.0),
    }
    data = {
        "name": "thrown",
        "bodies": {"rod": body, "floor": FLOOR},
        "contacts": [contact],
        "gravity": [0, 0],
    }
    return rw.load(data | {"duration": 1.0, "step": 1e-2})


@pytest.mark.long
def test_energy_that_impacts_add_is_reported_to_rounding() -> None:
    """Without loads, kinetic energy rises by what contacts add, and by nothing else."""
    rng, gained = np.random.default_rng(11), 0
    for k in range(150):
        scene = thrown(rng)
        run = rw.simulate(scene, rw.DYNAMIC_RIGID)
        body = scene.file.bodies["rod"]
        speeds = run.trajectory.velocity.values
        inertia = np.array([float(body.mass)] * 2 + [float(body.inertia)])
        energy = 0.5 * (inertia * speeds**2).sum(axis=1)
        rises = np.maximum(np.diff(energy), 0.0)
        rises = rises[rises > 1e-13 * energy.max()].sum()
        assert run.energy_gained == pytest.approx(rises, rel=1e-9, abs=1e-12 * energy.max()), k
        gained += bool(rises > 0.0)
    assert gained >= 4


@pytest.mark.parametrize("e", [0.3, 0.6, 0.8])
def test_the_end_of_bouncing_converges_with_the_tolerance(e: float) -> None:
    """A ball that falls from height H comes to rest after sqrt(2 H / g) (1 + e) / (1 - e)."""
    height, step = 0.5, 1e-4
    ball = {
        "role": "object",
        "shape": {"kind": "disc", "radius": 0.1},
        "mass": 2.0,
        "pose": {"y": 0.1 + height},
    }
    ball |= {"motion": {"kind": "slide", "axis": [0, 1]}}
    data: dict[str, Any] = {"name": "ball", "bodies": {"ball": ball, "floor": FLOOR}, "gravity": [0, -G]}
    data |= {"contacts": [{"between": ["ball", "floor"], "restitution": e}], "duration": 10.0, "step": step}
    scene = rw.load(data | {"goal": f"force(ball, floor) >= {0.9 * 2.0 * G}"})
    end = math.sqrt(2.0 * height / G) * (1.0 + e) / (1.0 - e)
    for tol in (1e-3, 1e-4, 1e-5, 1e-6):
        run = rw.simulate(scene, rw.DYNAMIC_RIGID, tol=tol)
        # A bounce that would rise by less than tol, and all after it, are left out; force looks back.
        left_out = math.sqrt(2.0 * tol / G) * 2.0 / (1.0 - e)
        assert run.outcome.name == "goal" and abs(run.time - end) <= left_out + 5.0 * step, (
            tol,
            run.time,
            end,
        )


def leaning(mu: float, angle: float, speed: float) -> rw.Scene:
    """The end of a uniform rod of length 2 slides on a floor; its centre is behind it where speed > 0."""
    rod = {
        "role": "object",
        "shape": {"kind": "point", "at": [1, 0]},
        "mass": 1.0,
        "centre": [0, 0],
        "inertia": 1.0 / 3.0,
        "pose": {"y": math.sin(angle), "angle": -angle},
        "motion": {"kind": "free"},
        "coordinates": {"x": {"speed": speed}},
    }
    data = {"name": "leaning", "bodies": {"rod": rod, "floor": FLOOR}, "gravity": [0, -G]}
    data |= {"contacts": [{"between": ["rod", "floor"], "friction": mu}], "duration": 3e-3, "step": 1e-3}
    return rw.load(data)


def test_jumps_without_a_collision_are_named() -> None:
    """Painleve's region: mu > (1 + 3 cos^2) / (3 sin cos), and the end that slides leads."""
    rng, named = np.random.default_rng(12), 0
    for k in range(60):
        angle, speed = rng.uniform(0.3, 1.4), rng.uniform(1.0, 5.0)
        least = (1.0 + 3.0 * math.cos(angle) ** 2) / (3.0 * math.sin(angle) * math.cos(angle))
        mu = least * rng.choice([rng.uniform(0.2, 0.8), rng.uniform(1.05, 2.0)])
        leads = rng.random() < 0.7
        run = rw.simulate(leaning(mu, angle, speed if leads else -speed), rw.DYNAMIC_RIGID)
        said = any("without a collision" in note for note in run.notes)
        assert said == (leads and mu > least), (k, mu, least, leads)
        assert run.summary()["notes"] == list(run.notes)
        named += said
    assert 10 < named < 40


def test_collisions_and_smooth_motion_are_not_named() -> None:
    rng = np.random.default_rng(13)
    for name in ("two_finger", "slide_roll", "blocks", "two_link"):
        run = rw.simulate(name, rw.DYNAMIC_RIGID)
        assert not any("without a collision" in note for note in run.notes), name
    for _ in range(30):
        run = rw.simulate(thrown(rng), rw.DYNAMIC_RIGID)
        assert not any("without a collision" in note for note in run.notes)

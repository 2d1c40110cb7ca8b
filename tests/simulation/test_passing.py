"""Nothing goes through anything unseen, however fast or thin; steps are shortened only where they must be."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import rungwise as rw

from .conftest import MOVING

FAST = (rw.DYNAMIC_RIGID, rw.DYNAMIC_COMPLIANT)
AT = 0.5
"""Where the wall stands; bullets come from the left."""


def shape(rng: np.random.Generator, size: float) -> dict[str, Any]:
    """A disc, a rod, a box, a triangle or a point of about this size."""
    kind = rng.choice(["disc", "capsule", "box", "polygon", "point"])
    if kind == "point":
        return {"kind": "point"}
    if kind == "disc":
        return {"kind": "disc", "radius": size}
    if kind == "capsule":
        return {"kind": "capsule", "length": size, "radius": size * 10.0 ** rng.uniform(-3.0, -0.5)}
    if kind == "box":
        return {"kind": "box", "width": size, "height": size * 10.0 ** rng.uniform(-2.0, 0.0)}
    high = size * rng.uniform(0.1, 1.0)
    corners = [[-0.4 * size, -high / 3.0], [0.6 * size, -high / 3.0], [-0.2 * size, 2.0 * high / 3.0]]
    return {"kind": "polygon", "vertices": corners}


def wall(rng: np.random.Generator, thick: float) -> dict[str, Any]:
    """A wall from x = AT on, far higher than bullets get."""
    plain = {"kind": "box", "width": thick, "height": 20, "at": [AT + 0.5 * thick, 0]}
    round_ = {"kind": "capsule", "length": 20, "radius": 0.5 * thick, "at": [AT + 0.5 * thick, 0]}
    return plain if rng.random() < 0.7 else round_ | {"angle": "90 * deg"}


def shot(rng: np.random.Generator, driven: bool) -> tuple[rw.Scene, float]:
    """A bullet on its way to a wall, free or on a rail that prescribes its speed; and the wall's middle."""
    size, speed = 10.0 ** rng.uniform(-3.0, -1.0), 10.0 ** rng.uniform(0.0, 6.0)
    heading = rng.uniform(-0.5, 0.5)
    body: dict[str, Any] = {"role": "robot" if driven else "object", "shape": shape(rng, size), "mass": 1.0}
    body |= {"inertia": max(size, 1e-3) ** 2, "pose": {"angle": rng.uniform(-3.0, 3.0)}}
    if driven:
        drive = {"kind": "speed", "speed": speed}
        body["motion"] = {"kind": "slide", "axis": [math.cos(heading), math.sin(heading)]}
        body["coordinates"] = {"s": {"drive": drive}}
    else:
        spin = speed * rng.choice([0.0, rng.uniform(-3.0, 3.0)])
        body["motion"] = {"kind": "free"}
        body["coordinates"] = {
            "x": {"speed": speed * math.cos(heading)},
            "y": {"speed": speed * math.sin(heading)},
            "angle": {"speed": spin},
        }
    contact = {
        "between": ["bullet", "wall"],
        "friction": rng.choice([0.0, rng.uniform(0.0, 1.0)]),
        "restitution": rng.choice([0.0, rng.uniform(0.0, 1.0)]),
        "stiffness": 10.0 ** rng.uniform(2.0, 8.0),
        "damping": rng.choice([0.0, 10.0 ** rng.uniform(0.0, 4.0)]),
    }
    thick = 10.0 ** rng.uniform(-6.0, -1.0)
    bodies = {"bullet": body, "wall": {"role": "obstacle", "shape": wall(rng, thick)}}
    data = {"name": "shot", "bodies": bodies, "contacts": [contact], "duration": 2.0 / speed}
    return rw.load(data | {"step": 2.0 / speed / 10.0 ** rng.uniform(0.0, 2.0)}), AT + 0.5 * thick


def options(rng: np.random.Generator) -> dict[str, float]:
    return {} if rng.random() < 0.6 else {"tol": 10.0 ** rng.uniform(-4.0, -1.0)}


def farthest(run: rw.Run) -> float:
    """Greatest x of the bullet's centre in any recorded state."""
    data = run.trajectory
    names = [str(name) for name in data.coordinate.values]
    if "bullet.x" in names:
        return float(data.position.sel(coordinate="bullet.x").max())
    axis = run.scene.file.bodies["bullet"].motion.axis  # type: ignore[union-attr]
    return float(data.position.max()) * float(axis[0]) / math.hypot(*map(float, axis))


def check_stopped(model: rw.Rung, seed: int, count: int, driven: bool, outcomes: set[str]) -> None:
    rng = np.random.default_rng(seed)
    for k in range(count):
        scene, middle = shot(rng, driven=driven)
        run = rw.simulate(scene, model, **options(rng))
        assert farthest(run) < middle, (k, run.outcome.name, farthest(run), middle)
        assert run.outcome.name in outcomes, (k, run.reason)


@pytest.mark.long
@pytest.mark.parametrize("model", FAST, ids=str)
def test_a_bullet_is_never_beyond_the_wall(model: rw.Rung) -> None:
    check_stopped(model, 5, 150, False, {"timeout", "model_invalid"})


@pytest.mark.few(1)
@pytest.mark.parametrize("model", MOVING, ids=str)
def test_what_is_driven_never_passes_either(model: rw.Rung) -> None:
    check_stopped(model, 6, 60, True, {"model_invalid" if model.compliant else "jammed"})


def swept(rng: np.random.Generator, count: int) -> rw.Scene:
    """A long thin bar turns by 1 to 2 rad in `count` steps, and sweeps up a small disc."""
    turn, speed = rng.uniform(1.0, 2.0), 10.0 ** rng.uniform(-1.0, 4.0)
    radius, far, ahead = 10.0 ** rng.uniform(-2.5, -1.5), rng.uniform(0.2, 0.6), rng.uniform(0.3, 0.7)
    bar = {"kind": "capsule", "length": 2, "radius": 10.0 ** rng.uniform(-3.0, -1.5)}
    hinge = {"kind": "hinge", "pivot": [0, 0]}
    bodies = {
        "bar": {
            "role": "robot",
            "shape": bar,
            "motion": hinge,
            "coordinates": {"angle": {"drive": {"kind": "speed", "speed": speed}}},
        },
        "dot": {
            "role": "object",
            "shape": {"kind": "disc", "radius": radius},
            "mass": 1.0,
            "pose": {"x": far * math.cos(ahead), "y": far * math.sin(ahead)},
            "motion": {"kind": "free"},
        },
    }
    contact = {"between": ["bar", "dot"], "friction": 0.0, "stiffness": 10.0 ** rng.uniform(3.0, 6.0)}
    data = {"name": "swept", "bodies": bodies, "contacts": [contact], "duration": turn / speed}
    return rw.load(data | {"step": turn / speed / count})


@pytest.mark.few(1)
@pytest.mark.parametrize("model", MOVING, ids=str)
def test_sweeps_take_about_as_many_steps_as_asked_for(model: rw.Rung) -> None:
    rng = np.random.default_rng(7)
    for k in range(30):
        count = int(rng.integers(10, 60))
        run = rw.simulate(swept(rng, count), model)
        final, outcome = run.final, run.outcome.name
        assert outcome == "timeout" or (model == rw.DYNAMIC_COMPLIANT and outcome == "model_invalid"), k
        assert run.steps <= 2 * count, (k, count, run.steps)
        x, y = final["dot"]["x"], final["dot"]["y"]
        c, s = math.cos(final["bar"]["angle"]), math.sin(final["bar"]["angle"])
        # Before the bar, or beyond its tip.
        assert c * y - s * x > 0.0 or math.hypot(x, y) > 1.0, (k, outcome)

"""Rows of boxes, flush or not, that two plates press together: they rest if friction can hold them, however
hard they are pressed and however faintly they are damped, and slip if it cannot."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.random import Generator

import rungwise as rw

Data = dict[str, Any]
GRAVITY, FRICTION, PLATE = 9.81, 0.5, 0.08
QUASISTATIC = (rw.QUASISTATIC_RIGID, rw.QUASISTATIC_COMPLIANT)
MOVING = (*QUASISTATIC, rw.DYNAMIC_RIGID, rw.DYNAMIC_COMPLIANT)
STEPS = 20


def heights_of(rng: Generator) -> list[float]:
    """Of up to six boxes, all of one height, or half of them."""
    count, alike = int(rng.integers(1, 7)), float(rng.choice([0.5, 1.0]))
    return [0.1 if rng.random() < alike else float(rng.uniform(0.09, 0.14)) for _ in range(count)]


def stiffness_for(force: float) -> float:
    """So much that the force presses nothing in by more than half a millimetre."""
    return max(1e6, 2e3 * force)


def holding(heights: list[float], width: float) -> float:
    """Force that holds a row of boxes of mass 1 in the air, by friction at its ends and against bending."""
    weight = GRAVITY * len(heights)
    bending = weight * width * len(heights) / 8.0
    return max(weight / (2.0 * FRICTION), bending / (0.5 * min(PLATE, *heights)))


def scene(rng: Generator, heights: list[float], force: float, damping: float, ground: bool) -> Data:
    width = float(rng.uniform(0.05, 0.1))
    bodies: Data = {}
    damped = {"x": {"damping": damping}, "y": {"damping": damping}, "angle": {"damping": 0.01 * damping}}
    for i, height in enumerate(heights):
        bodies[f"p{i}"] = {
            "role": "object",
            "mass": 1.0,
            "shape": {"kind": "box", "width": width, "height": height},
            "pose": {"x": width * i, "y": 0.5 * height - 0.05},
            "motion": {"kind": "free"},
            **({"coordinates": damped} if damping > 0.0 else {}),
        }
    for name, side in (("left", 1.0), ("right", -1.0)):
        middle = 0.5 * width * (len(heights) - 1)
        bodies[name] = {
            "role": "robot",
            "mass": 1.0,
            "shape": {"kind": "box", "width": 0.02, "height": PLATE},
            "pose": {"x": middle - side * (0.5 * width * len(heights) + 0.01)},
            "motion": {"kind": "slide", "axis": [side, 0.0], "name": "x"},
            "coordinates": {"x": {"drive": {"kind": "force", "force": force}, "damping": 10.0}},
        }
    if ground:
        bodies["ground"] = {"role": "obstacle", "shape": {"kind": "halfplane"}, "pose": {"y": -0.05}}
    pairs = (
        [("left", "p*"), ("right", "p*")] + [("p*", "p*")] * (len(heights) > 1) + [("p*", "ground")] * ground
    )
    names = rng.permutation(list(bodies))
    material = {"friction": FRICTION, "stiffness": stiffness_for(force), "damping": 1e3}
    return {
        "name": "row",
        "gravity": [0.0, -GRAVITY],
        "bodies": {str(name): bodies[name] for name in names},
        "contacts": [{"between": list(pair), **material} for pair in pairs],
    }


def motion(run: rw.Run, axis: str) -> np.ndarray[Any, Any]:
    """How far each box has come from its start along an axis, at all times."""
    names = [name for name in run.trajectory.coordinate.values if name[0] == "p" and name.endswith(axis)]
    places = run.trajectory.position.sel(coordinate=names).values
    return np.asarray(places - places[0])


@pytest.mark.few(11)
@pytest.mark.parametrize("rung", MOVING, ids=lambda rung: rung.name)
@pytest.mark.parametrize("seed", range(24))
def test_what_friction_holds_rests(rung: rw.Rung, seed: int) -> None:
    rng = np.random.default_rng(seed)
    heights, ground = heights_of(rng), bool(seed % 2)
    damping = float(rng.choice([0.0, 1e-10, 1e-9, 1e-6, 1e-3]))
    force = holding(heights, 0.1) * float(10.0 ** rng.uniform(0.2, 2.5))
    data = scene(rng, heights, force, damping, ground)
    run = rw.simulate(data, rung, step=1e-2, duration=1e-2 * STEPS)
    assert str(run.outcome) == "timeout", run.reason
    assert run.steps <= 1.5 * STEPS
    assert not run.notes
    count, alike = len(heights), set(heights) == {0.1}
    pressed = force / stiffness_for(force) if rung.compliant else 0.0
    sagged = GRAVITY / stiffness_for(force) if rung.compliant else 0.0
    tilted = 0.0 if alike else count * pressed
    assert np.abs(motion(run, ".x")).max() <= 2.0 * count * pressed + 1e-8
    assert np.abs(motion(run, ".y")).max() <= 2.0 * count**3 * sagged + tilted + 1e-8
    assert motion(run, ".y").max() <= 0.5 * sagged + tilted + 1e-8


@pytest.mark.few(6)
@pytest.mark.parametrize("rung", QUASISTATIC, ids=lambda rung: rung.name)
@pytest.mark.parametrize("damping", [0.0, 10.0, 100.0])
@pytest.mark.parametrize("seed", range(6))
def test_what_friction_cannot_hold_slips(rung: rw.Rung, damping: float, seed: int) -> None:
    """At the speed that damping gives, or, without any, unsupported, as a checked certificate says."""
    rng = np.random.default_rng(100 + seed)
    heights = [0.1, 0.12][: 1 + seed % 2]
    weight = GRAVITY * len(heights)
    force = float(rng.uniform(0.3, 0.95)) * weight / (2.0 * FRICTION)
    run = rw.simulate(scene(rng, heights, force, damping, False), rung, step=1e-3, duration=15e-3)
    if damping == 0.0:
        assert str(run.outcome) == "unsupported", run.reason
        assert run.certificate is not None
    else:
        speed = (weight - 2.0 * FRICTION * force) / (len(heights) * damping)
        assert np.mean(motion(run, ".y")[-1] - motion(run, ".y")[-2]) == pytest.approx(
            -1e-3 * speed, rel=1e-3
        )

"""Runs whose steps are short, or lead nowhere, say where and why."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import rungwise as rw

DISC = {"kind": "disc", "radius": 0.1}


@pytest.mark.parametrize("number", range(5))
def test_short_steps_name_a_contact_that_bounces(number: int) -> None:
    """A ball goes to and fro between two walls several times within a step."""
    rng = np.random.default_rng([number, 6])
    room = rng.uniform(0.002, 0.005)
    ball = {"role": "object", "shape": DISC, "mass": 1.0, "motion": {"kind": "slide", "axis": [1.0, 0.0]}}
    bodies: dict[str, Any] = {"ball": ball | {"coordinates": {"s": {"speed": 1.0}}}}
    for name, side in (("left", -1.0), ("right", 1.0)):
        wall = {"kind": "halfplane", "normal": [-side, 0.0]}
        bodies[name] = {"role": "obstacle", "shape": wall, "pose": {"x": side * (0.1 + room)}}
    contacts = [{"between": ["ball", "*"], "friction": 0.25, "restitution": 1.0}]
    scene = {"name": "between", "bodies": bodies, "contacts": contacts, "duration": 0.4, "step": 0.02}
    run = rw.simulate(scene, "dynamic-rigid")
    notes = [note for note in run.notes if "steps were taken" in note]
    assert run.steps > 40 and len(notes) == 1
    assert "(friction 0.25, restitution 1), and a step ends where they meet" in notes[0]
    assert "bodies bounce between ball and left" in notes[0] or "between ball and right" in notes[0]


@pytest.mark.parametrize("model", ["dynamic-rigid", "dynamic-compliant"])
def test_a_run_whose_steps_lead_nowhere_ends(model: str) -> None:
    """A disc that is shaken a hundred thousand times within the step that is asked for."""
    disc = {"role": "object", "shape": DISC, "mass": 1.0, "motion": {"kind": "free"}}
    bodies = {"disc": disc | {"force": ["1e9 * sin(1e6 * t)", 0.0]}}
    scene = {"name": "shaken", "bodies": bodies, "contacts": [], "duration": 1e3, "step": 1.0}
    run = rw.simulate(scene, model, tol=1e-6, frames=100)
    assert run.outcome == "not_converged" and 10_000 < run.attempts < 110_000
    assert "attempts at steps advanced by" in run.reason and "--tol" in run.reason


def tower(number: int, softness: float, top: float) -> dict[str, Any]:
    """Eccentric blocks below a heavy one; contacts would yield by so much of the blocks' reach."""
    rng = np.random.default_rng([number, 7])
    count, offset = int(rng.integers(2, 7)), float(rng.uniform(0.02, 0.06))
    shape = {"kind": "box", "width": 1.0, "height": 0.5}
    bodies: dict[str, Any] = {"floor": {"role": "obstacle", "shape": {"kind": "halfplane"}}}
    for i in range(count):
        block = {"role": "object", "shape": shape, "mass": top if i == count - 1 else 1.0}
        place = {"x": offset * i, "y": 0.25 + 0.5 * i}
        bodies[f"b{i}"] = block | {"motion": {"kind": "free"}, "pose": place}
    stiffness = (count - 1 + top) * 10.0 / 2.0 / (softness * 0.25)
    contacts = [{"between": ["*", "*"], "friction": 0.5, "stiffness": stiffness}]
    return {"name": "tower", "gravity": [0, -10], "bodies": bodies, "contacts": contacts, "duration": 0.02}


@pytest.mark.few(1)
@pytest.mark.parametrize("top", [1.0, 1e2, 1e4, 1e6])
@pytest.mark.parametrize("softness", [30.0, 100.0, 1000.0])
@pytest.mark.parametrize("number", range(4))
def test_a_tower_that_crushes_its_contacts_leaves_the_model(number: int, softness: float, top: float) -> None:
    scene = tower(number, softness, top)
    run = rw.simulate(scene, "quasistatic-compliant")
    assert run.outcome == "model_invalid", run.reason
    assert "would yield by" in run.reason or "a local deformation outgrew" in run.reason

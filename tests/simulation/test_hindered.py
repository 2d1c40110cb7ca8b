"""Runs whose steps are short, or lead nowhere, say where and why."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import rungwise as rw
from tests.simulation.random_scenes import random_scene

DISC = {"kind": "disc", "radius": 0.1}


@pytest.mark.parametrize("number", range(5))
def test_short_steps_name_a_contact_that_bounces(number: int) -> None:
    """A ball goes to and fro between two walls several times within a step."""
    rng = np.random.default_rng([number, 6])
    restitution, room = rng.uniform(0.97, 1.0), rng.uniform(0.002, 0.005)
    ball = {"role": "object", "shape": DISC, "mass": 1.0, "motion": {"kind": "slide", "axis": [1.0, 0.0]}}
    bodies: dict[str, Any] = {"ball": ball | {"coordinates": {"s": {"speed": 1.0}}}}
    for name, side in (("left", -1.0), ("right", 1.0)):
        wall = {"kind": "halfplane", "normal": [-side, 0.0]}
        bodies[name] = {"role": "obstacle", "shape": wall, "pose": {"x": side * (0.1 + room)}}
    contacts = [{"between": ["ball", "*"], "friction": 0.25, "restitution": restitution}]
    scene = {"name": "between", "bodies": bodies, "contacts": contacts, "duration": 0.4, "step": 0.02}
    run = rw.simulate(scene, "dynamic-rigid")
    notes = [note for note in run.notes if "steps were taken" in note]
    assert run.steps > 40 and len(notes) == 1
    assert f"(friction 0.25, restitution {restitution:.3g}), and a step ends where they meet" in notes[0]
    assert "bodies bounce between ball and left" in notes[0] or "between ball and right" in notes[0]


def test_steps_that_open_joints_say_so() -> None:
    """A scene whose joints have no way on without momentum; another rung, which is named, goes on."""
    run = rw.simulate(random_scene(76), "quasistatic-rigid")
    assert run.outcome == "not_converged"
    assert "would open a rigid joint" in run.reason and "dynamic-rigid" in run.reason
    assert rw.simulate(random_scene(76), "dynamic-rigid").outcome != "not_converged"


def test_a_crawl_between_jointed_bodies_ends() -> None:
    run = rw.simulate(random_scene(50), "quasistatic-rigid", tol=1e-5)
    assert run.outcome == "not_converged" and run.attempts < 20_000
    assert "attempts at steps led on by" in run.reason

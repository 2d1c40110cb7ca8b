"""Conditions on forces and impulses mean the same at every step: verdict and time tend to a limit."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import rungwise as rw

G = 10.0
FLOOR = {"role": "obstacle", "shape": {"kind": "halfplane"}}


def scene(
    bodies: dict[str, Any], goal: str, duration: float, step: float, g: float = G, **contact: Any
) -> rw.Scene:
    contacts = [{"between": ["part", "*"], **contact}]
    data = {"name": "made", "bodies": bodies, "contacts": contacts, "goal": goal, "duration": duration}
    return rw.load(data | {"step": step, "gravity": [0, -g]})


def box(rng: np.random.Generator, height: float, **fields: Any) -> dict[str, Any]:
    shape = {"kind": "box", "width": rng.uniform(0.5, 1.0), "height": 0.6}
    body = {"role": "object", "shape": shape, "mass": rng.uniform(0.3, 3.0), "pose": {"y": 0.3 + height}}
    return body | {"motion": {"kind": "free"}} | fields


def dropped(rng: np.random.Generator, part: float, step: float) -> rw.Scene:
    """A box falls flat, maybe bounces, and rests: the floor carries its weight then, and never more."""
    body = box(rng, rng.uniform(0.05, 0.3))
    e = rng.choice([0.0, rng.uniform(0.1, 0.5)])
    goal = f"force(part, floor) >= {part * body['mass'] * G}"
    return scene({"part": body, "floor": FLOOR}, goal, 1.5, step, friction=0.5, restitution=e)


def struck(rng: np.random.Generator, part: float, step: float) -> rw.Scene:
    """A box that rests is hit from above: the floor carries both weights after that, and never more."""
    body = box(rng, 0.0)
    ball = {"role": "object", "shape": {"kind": "disc", "radius": 0.1}, "mass": rng.uniform(0.3, 3.0)}
    ball |= {"pose": {"y": 0.6 + 0.1 + rng.uniform(0.05, 0.2)}, "motion": {"kind": "slide", "axis": [0, -1]}}
    goal = f"force(part, floor) >= {body['mass'] * G + part * ball['mass'] * G}"
    return scene({"part": body, "floor": FLOOR, "ball": ball}, goal, 1.5, step)


def pushed(rng: np.random.Generator, part: float, step: float) -> rw.Scene:
    """A finger meets a box at some speed and pushes it on, faster and faster: its force is m a t."""
    body = box(rng, 0.0) | {"motion": {"kind": "slide", "axis": [1, 0]}}
    a = rng.uniform(0.1, 1.0)
    drive = {"kind": "speed", "speed": f"{rng.uniform(0.2, 1.0)} + {a} * t**2 / 2"}
    finger = {"role": "robot", "shape": {"kind": "disc", "radius": 0.1}, "pose": {"x": -0.7, "y": 0.3}}
    finger |= {"motion": {"kind": "slide", "axis": [1, 0]}, "coordinates": {"s": {"drive": drive}}}
    goal = f"force(part, finger) >= {part * body['mass'] * a * 2.0}"
    return scene({"part": body, "finger": finger}, goal, 2.0, step)


def squeezed(rng: np.random.Generator, part: float, step: float) -> rw.Scene:
    """Two fingers squeeze a box off-centre, beyond what friction holds: it turns, and resists by inertia."""
    mu, speed = rng.uniform(0.1, 0.5), rng.uniform(0.05, 0.2)
    offset = 0.25 * mu * rng.uniform(1.3, 1.8)
    body = box(rng, 0.0) | {"pose": {}, "shape": {"kind": "box", "width": 0.5, "height": 0.5}}
    bodies: dict[str, Any] = {"part": body}
    for name, side in (("left", -1), ("right", 1)):
        bodies[name] = {
            "role": "robot",
            "shape": {"kind": "disc", "radius": 0.1},
            "pose": {"x": side * 0.4, "y": side * -offset},
            "motion": {"kind": "slide", "axis": [-side, 0]},
            "coordinates": {"s": {"upper": 0.06, "drive": {"kind": "speed", "speed": speed}}},
        }
    force = part * body["mass"] * speed * 10.0 ** rng.uniform(1.0, 3.0)
    goal = f"force(part, left) >= {force} and force(part, right) >= {force}"
    return scene(bodies, goal, 1.5, step, g=0.0, friction=mu)


@pytest.mark.few(1)
@pytest.mark.parametrize("part", [0.7, 1.3], ids=["reached", "not reached"])
@pytest.mark.parametrize("make", [dropped, struck, pushed, squeezed], ids=lambda make: make.__name__)
def test_force_has_a_limit(make: Any, part: float) -> None:
    """Verdict and time of the verdict at h, h / 4 and h / 16."""
    for seed in range(8):
        h = 10.0 ** np.random.default_rng(100 + seed).uniform(-2.5, -2.0)
        # A box that turns between fingers may jam soon after its force was large enough.
        h = 0.1 * h if make is squeezed else h
        runs = [
            rw.simulate(make(np.random.default_rng(seed), part, h / k), rw.DYNAMIC_RIGID)
            for k in (1.0, 4.0, 16.0)
        ]
        reached = runs[-1].outcome.name == "goal" if make is squeezed else part < 1.0
        for k, run in zip((1.0, 4.0, 16.0), runs, strict=True):
            assert (run.outcome.name == "goal") == reached, (seed, k, run.reason)
            assert abs(run.time - runs[-1].time) <= 20.0 * h / k, (seed, k, run.time, runs[-1].time)


@pytest.mark.parametrize("model", [rw.DYNAMIC_RIGID, rw.DYNAMIC_COMPLIANT], ids=str)
@pytest.mark.parametrize("step", [1e-2, 1e-3])
def test_impulse_is_that_of_the_whole_contact(model: rw.Rung, step: float) -> None:
    """A ball that falls from rest and comes to rest has passed all of its weight's impulse to the floor."""
    rng = np.random.default_rng(3)
    for _ in range(4):
        body = box(rng, rng.uniform(0.02, 0.1))
        bodies = {"part": body, "floor": FLOOR}
        made = scene(bodies, "t < 0", 1.0, step, stiffness=1e5 * body["mass"], damping=1e3 * body["mass"])
        run = rw.simulate(made, model)
        assert run.workspace is not None
        weight = body["mass"] * G * run.time
        assert run.workspace.state.impulses[0] == pytest.approx(weight, rel=1e-6)


@pytest.mark.parametrize("model", [rw.DYNAMIC_RIGID, rw.QUASISTATIC_RIGID, rw.QUASISTATIC_COMPLIANT], ids=str)
@pytest.mark.parametrize("step", [1e-1, 1e-2, 1e-3])
def test_static_load_is_a_force(model: rw.Rung, step: float) -> None:
    body = box(np.random.default_rng(1), 0.0)
    weight = body["mass"] * G
    for part, outcome in ((0.999, "goal"), (1.001, "timeout")):
        made = scene({"part": body, "floor": FLOOR}, f"force(part, floor) >= {part * weight}", 1.0, step)
        run = rw.simulate(made, model, step=step)
        assert run.outcome.name == outcome and (outcome != "goal" or run.time <= 3.0 * step * (1.0 + 1e-9))


def test_kinematics_knows_no_forces() -> None:
    body = box(np.random.default_rng(1), 0.0)
    made = scene({"part": body, "floor": FLOOR}, "force(part, floor) > 0 or impulse(part, floor) > 0", 1, 0.1)
    assert rw.simulate(made, rw.KINEMATIC).outcome.name == "timeout"


@pytest.mark.parametrize("tol", [None, 1e-3])
@pytest.mark.parametrize("model", [rung for rung in rw.LADDER if rung.moves], ids=str)
def test_what_rests_may_wait_for_a_time(model: rw.Rung, tol: float | None) -> None:
    """A run whose inputs are spent goes on while a condition waits for the time."""
    box = {"role": "object", "shape": {"kind": "disc", "radius": 1}, "motion": {"kind": "free"}}
    hand = box | {"role": "robot", "pose": {"x": 5.0}, "motion": {"kind": "slide", "axis": [1, 0]}}
    bodies = {
        "box": box | {"coordinates": {key: {"damping": 1.0} for key in ("x", "y", "angle")}},
        "hand": hand | {"coordinates": {"s": {"drive": {"kind": "speed", "speed": 0.0}}}},
    }
    still = {"name": "still", "bodies": bodies, "duration": 1.0, "step": 0.01}
    run = rw.simulate(rw.load(still | {"goal": "t >= 0.5 and abs(box.x) <= 1"}), model, tol=tol)
    assert run.outcome == "goal" and 0.5 <= run.time <= 1.0
    assert rw.simulate(rw.load(still | {"goal": "box.x >= 1"}), model, tol=tol).time < 0.5


@pytest.mark.few(2)
@pytest.mark.parametrize("model", [rung for rung in rw.LADDER if rung.moves], ids=lambda rung: rung.name)
def test_speeds_of_the_start_are_of_rungs_with_momentum(model: rw.Rung) -> None:
    """A prescribed speed is there on every rung."""
    drags = {"x": {"speed": 1.0, "damping": 1.0}, "y": {"damping": 1.0}}
    part = {"role": "object", "shape": {"kind": "disc", "radius": 0.1}, "motion": {"kind": "free"}}
    slide = {"kind": "slide", "axis": [1, 0], "name": "x"}
    rod = part | {"role": "robot", "motion": slide, "pose": {"y": 1.0}}
    rod["coordinates"] = {"x": {"speed": 2.0, "drive": {"kind": "speed", "speed": 1.0}}}
    bodies = {"part": part | {"coordinates": drags, "pose": {"y": 0.5}}, "rod": rod, "floor": FLOOR}
    for name, reached in (("part", model.inertia > 0.0), ("rod", True)):
        made = scene(bodies, f"speed({name}.x) >= 0.99", 0.01, 1e-3)
        run = rw.simulate(made, model)
        assert (run.outcome, run.time == 0.0) == (("goal", True) if reached else ("timeout", False))
        found = rw.rollout(made, model, states=None, inputs=None, durations=[[0.01]])
        assert (found.outcome[0] == rw.Code.GOAL) == reached

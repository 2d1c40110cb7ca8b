"""Bodies with restitution slide on others that turn: curvature makes each step an approach, and no impact."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import rungwise as rw

STEPS = 250


def outline(rng: np.random.Generator, size: float) -> tuple[dict[str, Any], float]:
    """A shape, and how far it reaches down."""
    kind = rng.choice(["disc", "box", "rounded", "capsule", "ellipse"])
    if kind == "disc":
        return {"kind": "disc", "radius": size}, size
    if kind == "box":
        return {"kind": "box", "width": 2.0 * size, "height": 1.2 * size}, 0.6 * size
    if kind == "rounded":
        return {"kind": "box", "width": 1.6 * size, "height": 0.8 * size, "radius": 0.2 * size}, 0.6 * size
    if kind == "capsule":
        return {"kind": "capsule", "length": size, "radius": 0.5 * size}, 0.5 * size
    count = int(rng.integers(6, 17))
    turn = np.linspace(0.0, 2.0 * math.pi, count, endpoint=False) - math.pi / 2.0 + math.pi / count
    places = size * np.stack([np.cos(turn), 0.6 * np.sin(turn)], axis=-1)
    return {"kind": "polygon", "vertices": places.tolist()}, -float(places[:, 1].min())


def sliding(number: int, restitution: float | None = None) -> dict[str, Any]:
    """A puck that slides outwards on a plank that turns towards it: free, on a hinge, or driven."""
    rng = np.random.default_rng([number, 30])
    size = rng.uniform(0.1, 0.3)
    shape, low = outline(rng, size)
    base, mu = rng.choice(["free", "hinge", "driven"]), rng.choice([0.0, 0.1, 0.3, 0.8])
    e = float(rng.choice([0.01, 0.05, 0.1, 0.15, 0.25, 0.5, 0.9]))
    free = {"kind": "free"}
    puck = {"role": "object", "shape": shape, "mass": 1.0, "motion": free} | {
        "pose": {"x": rng.uniform(0.0, 0.3), "y": low},
        "coordinates": {"x": {"speed": rng.uniform(0.2, 1.5)}, "angle": {"speed": rng.uniform(-1.0, 3.0)}},
    }
    turning: dict[str, Any] = {"speed": rng.uniform(0.2, 2.0)}
    if base == "driven":
        turning = {"drive": {"kind": "speed", "speed": turning["speed"]}}
    motion = free if base == "free" else {"kind": "hinge", "pivot": [rng.uniform(-1.0, 0.0), -0.05]}
    plank = {"role": "robot" if base == "driven" else "object", "motion": motion} | {
        "shape": {"kind": "box", "width": 4.0, "height": 0.1},
        "mass": rng.uniform(0.3, 10.0),
        "pose": {"y": -0.05},
        "coordinates": {"angle": turning},
    }
    contact = {"between": ["puck", "plank"], "friction": mu} | {
        "restitution": e if restitution is None else restitution
    }
    return {"name": f"sliding{number}", "bodies": {"puck": puck, "plank": plank}, "contacts": [contact]} | {
        "gravity": [0.0, -float(rng.choice([0.0, 0.0, 0.3]))], "duration": 0.5, "step": 0.5 / STEPS,
        "tolerance": 1e-6,
    }  # fmt: skip


def ended(run: rw.Run) -> np.ndarray[Any, Any]:
    return np.array([value for body in run.final.values() for value in body.values()])


@pytest.mark.few(5)
@pytest.mark.parametrize("number", [*range(18), 248, 432, 747, 1945, 2870, 3330])
def test_a_contact_that_slides_takes_hardly_more_steps_than_it_is_given(number: int) -> None:
    plastic = rw.simulate(sliding(number, 0.0), rw.DYNAMIC_RIGID)
    for restitution in (None, 1e-2, 1e-4):
        run = rw.simulate(sliding(number, restitution), rw.DYNAMIC_RIGID)
        assert run.outcome == "timeout" and run.worst_residual <= 1e-8
        assert max(run.steps, plastic.steps) <= 2 * STEPS, restitution
        overlap = -run.trajectory.gap.values.min(axis=1)
        assert overlap.max() <= 1.2e-4 * 0.3
    # Impacts end steps where something may bounce, and lie within them where nothing does.
    assert ended(run) == pytest.approx(ended(plastic), abs=1e-2)


@pytest.mark.parametrize("number", [74, 747, 1784, 3330])
def test_overlap_that_turning_adds_is_taken_back_without_work(number: int) -> None:
    """Contacts that brake what slides would be off by a hundred times as much."""
    fine = sliding(number, 0.0) | {"step": 0.5 / STEPS / 16}
    run, exact = rw.simulate(sliding(number, 0.0), rw.DYNAMIC_RIGID), rw.simulate(fine, rw.DYNAMIC_RIGID)
    assert ended(run) == pytest.approx(ended(exact), abs=3e-5)


@pytest.mark.few(3)
@pytest.mark.parametrize("number", [21, 22, 73, 78, 134, 154, 337])
def test_corners_that_strike_in_turn_move_as_without_restitution_as_it_vanishes(number: int) -> None:
    """Each strike is an impact: what it throws off is of the order of e, and of the step's error."""

    def end(restitution: float, parts: int) -> np.ndarray[Any, Any]:
        scene = sliding(number, restitution) | {"step": 0.5 / STEPS / parts}
        return ended(rw.simulate(scene, rw.DYNAMIC_RIGID))

    plastic = end(0.0, 16)
    coarse = np.abs(end(1e-6, 1) - end(0.0, 1)).max()
    least, less, more = (np.abs(end(e, 16) - plastic).max() for e in (1e-6, 1e-3, 1e-2))
    assert coarse > 1e-3 and least <= 0.25 * coarse
    assert less <= 0.3 * more + 2.0 * least + 1e-5

"""Bodies on supports that a bar, or each other, push about: none may stop a quasistatic run."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import rungwise as rw


def swept(seed: int) -> dict[str, Any]:
    """A bar on a hinge sweeps a capsule off its way, until they part at the bar's tip."""
    rng = np.random.default_rng(seed)
    bar = {
        "role": "robot",
        "shape": {"kind": "capsule", "length": 0.5, "radius": 0.03},
        "pose": {"x": 0.25},
        "motion": {"kind": "hinge", "pivot": [0, 0]},
        "coordinates": {"angle": {"drive": {"kind": "speed", "speed": float(rng.uniform(0.5, 6.0))}}},
    }
    pushed = {
        "role": "object",
        "shape": {"kind": "capsule", "length": 0.1, "radius": 0.05},
        "mass": 1.0,
        "motion": {"kind": "free"},
        "pose": {"x": float(rng.uniform(0.2, 0.5)), "y": float(rng.uniform(0.3, 0.5))},
        "support": {"friction": 0.3, "gravity": 9.81},
    }
    contacts = [{"between": ["bar", "pushed"], "friction": 0.3}]
    return {"name": "swept", "bodies": {"bar": bar, "pushed": pushed}, "contacts": contacts} | {
        "duration": 2.0,
        "step": 1e-3,
    }


def train(seed: int) -> dict[str, Any]:
    """A rod pushes a body against the next and so on; those ahead hold fast for a while."""
    rng = np.random.default_rng(seed)
    count, speed = 2 + seed % 3, (0.02, 0.2, 1.5)[seed % 3]
    polygon = {"kind": "polygon", "vertices": [[-0.05, -0.05], [0.05, -0.04], [0, 0.05]]}
    shapes = [{"kind": "disc", "radius": 0.05}, {"kind": "box", "width": 0.1, "height": 0.08}, polygon]
    rod = {
        "role": "robot",
        "shape": {"kind": "disc", "radius": 0.02},
        "pose": {"x": -0.1, "y": float(rng.uniform(-0.03, 0.03))},
        "motion": {"kind": "slide", "axis": [1, 0], "name": "s"},
        "coordinates": {"s": {"drive": {"kind": "speed", "speed": speed}}},
    }
    bodies: dict[str, Any] = {"rod": rod}
    for k in range(count):
        low, high = (-0.03, -0.3), (0.03, 0.3)
        y, angle = (float(x) for x in rng.uniform(low, high))
        bodies[f"b{k}"] = {
            "role": "object",
            "shape": shapes[rng.integers(3)],
            "mass": float(10.0 ** rng.uniform(-0.5, 0.5)),
            "pose": {"x": 0.13 * k, "y": y, "angle": angle},
            "motion": {"kind": "free"},
            "support": {
                "friction": float(rng.uniform(0.1, 0.6)),
                "gravity": 9.81,
                "centre": rng.uniform(-0.02, 0.02, 2).tolist(),
            },
        }
    contacts = [{"between": ["*", "*"], "friction": float(rng.choice([0.0, 0.3, 0.8]))}]
    return {"name": "train", "bodies": bodies, "contacts": contacts} | {
        "duration": 0.25 / speed,
        "step": 2.5e-4 / speed,
    }


@pytest.mark.few(1)
@pytest.mark.parametrize(
    ("make", "tolerances"), [(swept, (None, 1e-3, 1e-5)), (train, (1e-3, 1e-5))], ids=["swept", "train"]
)
def test_nothing_stops_what_is_pushed(make: Any, tolerances: tuple[float | None, ...]) -> None:
    """Of the bar, runs stopped where the two came within 0.1 rad of parallel beside each other's ends; of the
    train, where a body stood fast against another that turned fast, and its rest was taken for slipping."""
    for seed in range(25):
        scene = rw.load(make(seed))
        for tol in tolerances:
            run = rw.simulate(scene, rw.QUASISTATIC_RIGID, tol=tol)
            assert str(run.outcome) == "timeout", (seed, tol, run.reason)
            assert run.steps < 20.0 / np.sqrt(tol or 1e-5), (seed, tol)

"""Drops of a square part onto a table, made by a rung, with noise as a camera has it."""

from __future__ import annotations

from typing import Any

import numpy as np

import rungwise as rw

SCENE: dict[str, Any] = {
    "name": "square_drop",
    "parameters": {
        "mu": {"default": 0.5, "range": [0.0, 1.0]},
        "e": {"default": 0.5, "range": [0.0, 1.0]},
        "mass": {"default": 1.0, "range": [0.1, 10.0]},
        "tilt": {"default": 0.0, "range": [-0.1, 0.1]},
    },
    "gravity": [0, -9.81],
    "bodies": {
        "square": {
            "role": "object",
            "shape": {"kind": "box", "width": 0.06, "height": 0.06},
            "motion": {"kind": "free"},
            "mass": "mass",
        },
        "table": {"role": "obstacle", "shape": {"kind": "halfplane", "normal": ["-sin(tilt)", "cos(tilt)"]}},
    },
    "contacts": [{"between": ["square", "table"], "friction": "mu", "restitution": "e"}],
    "tolerance": 1e-5,
    "duration": 0.4,
    "step": 1e-3,
}
TRUE = {"mu": 0.25, "e": 0.4}
PLACE, TURN, SPEED, RATE = 3e-4, 3e-3, 2e-2, 2e-1
"""Deviations of the measurement, in m, rad, m/s and rad/s."""
NAMES = ("square.x", "square.y", "square.angle")
DEVIATIONS = {
    "square.x": PLACE, "square.y": PLACE, "square.angle": TURN, "speed(square.x)": SPEED,
    "speed(square.y)": SPEED, "speed(square.angle)": RATE,
}  # fmt: skip


def drops(
    trials: int, frames: int = 30, *, seed: int = 0, rates: bool = True, noise: float = 1.0,
    scene: dict[str, Any] = SCENE, rung: str = "dynamic-rigid", tol: float = 1e-4, **true: float,
) -> rw.Motions:  # fmt: skip
    """Measured drops at these parameters."""
    rng = np.random.default_rng(seed)
    q = np.column_stack([np.zeros(trials), rng.uniform(0.06, 0.09, trials), rng.uniform(-3.0, 3.0, trials)])
    v = np.column_stack(
        [rng.uniform(-1.0, 1.0, trials), rng.uniform(-1.5, -0.5, trials), rng.uniform(-10.0, 10.0, trials)]
    )
    found = rw.rollout(
        scene, rung, np.hstack([q, v]), durations=np.full((trials, frames), 0.004),
        parameters={n: x for n, x in (TRUE | true).items() if n in scene["parameters"]}, tol=tol, threads=1,
    )  # fmt: skip
    places = np.concatenate([q[:, None], found.q], axis=1)
    speeds = np.concatenate([v[:, None], found.v], axis=1)
    places += noise * rng.normal(size=places.shape) * [PLACE, PLACE, TURN]
    speeds += noise * rng.normal(size=speeds.shape) * [SPEED, SPEED, RATE]
    times = 0.004 * np.arange(frames + 1)
    return rw.Motions(
        NAMES, times, places, speeds if rates else None, deviations=DEVIATIONS if rates else None
    )

"""Drops of a square part onto a table, made by a rung, with noise as a camera has it."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np

import rungwise as rw

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))
from fit_coverage import CASES as CASES
from fit_coverage import DROP, PLACE, RATE, SPEED, TURN, falling
from fit_coverage import pushes as pushes

SCENE: dict[str, Any] = DROP | {
    "name": "square_drop",
    "parameters": {name: DROP["parameters"][name] for name in ("mu", "e", "mass")}
    | {"tilt": {"default": 0.0, "range": [-0.1, 0.1]}},
    "bodies": {
        "square": DROP["bodies"]["part"],
        "table": {"role": "obstacle", "shape": {"kind": "halfplane", "normal": ["-sin(tilt)", "cos(tilt)"]}},
    },
    "contacts": [{"between": ["square", "table"], "friction": "mu", "restitution": "e"}],
    "duration": 0.4,
}
TRUE = {"mu": 0.25, "e": 0.4}
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
    start = falling(trials, rng)
    q, v = start[:, :3], start[:, 3:]
    found = rw.rollout(
        scene, rung, start, durations=np.full((trials, frames), 0.004),
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

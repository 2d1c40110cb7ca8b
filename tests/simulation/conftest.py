"""Runs of the shipped scenes, and the two-finger scene's closed forms."""

from __future__ import annotations

from typing import Any

import pytest

import rungwise as rw

RIGID = (rw.KINEMATIC, rw.QUASISTATIC_RIGID, rw.DYNAMIC_RIGID)
MOVING = rw.LADDER[1:]
GEOMETRIES = (
    {},
    {"half_base": 1.3, "height": 0.8, "offset": 0.4, "travel": 1.7},
    {"half_base": 0.5, "height": 2.0, "offset": 0.2, "travel": 2.5, "mass": 3.0},
    {"half_base": 2.0, "height": 1.0, "offset": 0.9, "travel": 1.5, "mass": 0.2},
)
"""The paper's, and three others in which a finger meets only the upper part of its face before it closes."""


def lowest_ratio(geometry: dict[str, float], restitution: float = 0.0) -> float:
    """Least v2/v1 that captures: closure before the part has gone `offset`, after the first impact.

    Finger 1 meets its face at depth d and pushes the part at v1/k (k the slope of the face), (1 + e) times
    that after an impact; finger 2 meets its face at x2 = d - k x3.
    """
    half_base, height = geometry.get("half_base", 1.0), geometry.get("height", 1.0)
    offset, travel = geometry.get("offset", 0.5), geometry.get("travel", 2.0)
    k = height / half_base
    d = travel - height * (1.0 - offset / half_base)
    return (d - k * offset) / (d + k * offset / (1.0 + restitution))


@pytest.fixture(scope="session")
def two_finger() -> rw.Scene:
    return rw.load("two_finger")


def captured(scene: rw.Scene, model: rw.Rung, r: float, v1: float = 1.0, **options: Any) -> bool:
    """Whether the run with v2 = r v1 ends in the goal; every accepted step must be solved to 1e-8."""
    parameters = {**options.pop("parameters", {}), "v1": v1, "v2": r * v1}
    run = rw.simulate(scene, model, parameters=parameters, frames=3, **options)
    assert run.worst_residual <= 1e-8
    assert run.outcome.name in ("goal", "doomed", "missed"), run.reason
    return run.outcome.name == "goal"


def threshold(scene: rw.Scene, model: rw.Rung, low: float, high: float, **options: Any) -> float:
    """The ratio between `low` (missed) and `high` (captured) where capture begins, by bisection to 4e-5."""
    assert not captured(scene, model, low, **_fresh(options)) and captured(
        scene, model, high, **_fresh(options)
    )
    while high - low > 4e-5:
        middle = 0.5 * (low + high)
        if captured(scene, model, middle, **_fresh(options)):
            high = middle
        else:
            low = middle
    return high


def _fresh(options: dict[str, Any]) -> dict[str, Any]:
    return {**options, "parameters": dict(options.get("parameters", {}))}

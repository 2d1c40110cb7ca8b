"""A servo whose limit is not reached moves as one without: also where nothing else loads what it moves."""

from __future__ import annotations

import math

import numpy as np
import pytest

import rungwise as rw

MEMBERS = 40


def scene(limit: float | None) -> rw.Scene:
    """The peg, led down by a stiff servo, into a hole with errors of place and angle; its springs are at rest
    at the start, so that no load is left beside the force of the servo."""
    data = rw.load("peg_in_hole").file.model_dump(mode="json", exclude_unset=True)
    drive = data["bodies"]["peg"]["coordinates"]["y"]["drive"]
    drive |= {"stiffness": 2e4, "damping": 2.0 * math.sqrt(2e3)}
    if limit is not None:
        drive["limit"] = limit
    return rw.load(data)


@pytest.fixture(scope="module")
def errors() -> dict[str, list[float]]:
    rng = np.random.default_rng(7)
    x, angle = rng.uniform(-1e-3, 1e-3, MEMBERS).tolist(), rng.uniform(-5e-3, 5e-3, MEMBERS).tolist()
    return {"x": [*x, -0.0004677394554154148], "angle": [*angle, math.radians(0.13805170852671633)]}


@pytest.mark.parametrize("limit", [100.0, 1000.0])
def test_servo_below_its_limit_is_a_spring(limit: float, errors: dict[str, list[float]]) -> None:
    free, limited = (
        rw.rollout(scene(each), "quasistatic-rigid", parameters=errors, tol=1e-3) for each in (None, limit)
    )
    assert list(limited.outcomes) == list(free.outcomes)
    np.testing.assert_allclose(limited.final, free.final, rtol=0.0, atol=1e-3)

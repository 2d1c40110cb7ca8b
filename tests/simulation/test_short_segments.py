"""Segments that are hardly longer than the rounding of the time at which they begin."""

from __future__ import annotations

import numpy as np
import pytest

import rungwise as rw


@pytest.mark.few(6)
@pytest.mark.parametrize("seed", range(60))
def test_runs_lead_on_past_segments_that_take_hardly_any_time(seed: int) -> None:
    """Half of a step to the end of such a segment may be less than what the time can show."""
    rng = np.random.default_rng(seed)
    short = 10.0 ** rng.uniform(-9.0, -6.0)
    inputs = [
        rw.Segment({"ux": 0.3}, float(rng.uniform(1.0, 3.0))),
        rw.Segment({"ux": 0.2}, short, ramp=bool(rng.random() < 0.8)),
        rw.Segment({"ux": 0.1}, 0.01),
    ]
    run = rw.simulate("push", "dynamic-compliant", inputs=inputs, tol=1e-5)
    assert run.outcome == rw.Outcome.MISSED, run.reason
    assert run.time == pytest.approx(sum(segment.duration for segment in inputs), abs=1e-12)
    assert run.steps < 100

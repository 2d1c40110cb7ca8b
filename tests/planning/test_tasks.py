"""Every task that ships is solved on drawn instances, and its plans hold at a tenth of their accuracy."""

from __future__ import annotations

import pytest

import rungwise as rw


@pytest.mark.few(1)
@pytest.mark.parametrize("name", ["push", "two_finger", "four_finger", "grasp"])
@pytest.mark.parametrize("seed", [1000, 1003])
def test_task_is_solved(name: str, seed: int) -> None:
    found = rw.plan(name, task_seed=seed)
    assert found.found, str(found)
    assert found.stage is not None and found.stage.model is rw.DYNAMIC_COMPLIANT
    assert str(found.replay(tol=found.tol / 10).outcome) == "goal"

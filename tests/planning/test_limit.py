"""A limit in seconds holds wherever a call is: in searches, long runs, replays, diagnoses, in space; and
progress is told on the way."""

from __future__ import annotations

import itertools
import time
from typing import Any

import numpy as np
import pytest

import rungwise as rw
from rungwise.planning import climb
from rungwise.planning.predict import Budget, TimeOver
from tests.planning.members import push

LATE = 2.5
"""Seconds after its limit by which a call may return on a machine that does other work."""


def timed(scene: rw.Scene, limit: float, **options: Any) -> tuple[rw.Plan, float, list[float]]:
    """A plan, how long it took beyond its limit, and when progress was told."""
    began, told = time.monotonic(), list[float]()
    plan = rw.plan(scene, limit=limit, on_progress=lambda _: told.append(time.monotonic()), **options)
    return plan, time.monotonic() - began - limit, told


def test_a_limit_holds_in_a_search_without_budget() -> None:
    exact = {"near": 1e-7, "aligned": 1e-7}
    rw.plan(push(0), parameters=exact, task_seed=0, budget=200)
    plan, late, told = timed(push(0), 2.0, parameters=exact, task_seed=0, budget=None)
    assert not plan.found and "the time is over" in plan.reason
    assert late < LATE
    assert len(told) >= 8 and np.median(np.diff(told)) < 0.4


def test_a_limit_holds_in_the_replay_that_confirms(monkeypatch: pytest.MonkeyPatch) -> None:
    """A plan that was found is returned, with a reason that it is not confirmed."""
    rw.plan(push(0), task_seed=0)
    _, taken, _ = timed(push(0), 60.0, task_seed=0)
    monkeypatch.setattr(climb, "TENTH", 1e-7)  # replays for about four times as long as plans are sought
    plan, late, told = timed(push(0), 2.5 * (taken + 60.0), task_seed=0)
    assert not plan.found and climb.UNCONFIRMED in plan.reason and "the time is over" in plan.reason
    assert plan.segments and late < LATE
    assert np.median(np.diff(told)) < 0.4


def test_what_progress_raises_ends_a_diagnosis() -> None:
    counted = itertools.count()

    def look(_run: object) -> None:
        if next(counted) >= 1:
            raise TimeOver

    inputs = [rw.Segment({"ux": 1.0}, 5.0)]
    began = time.monotonic()
    with pytest.raises(TimeOver):
        rw.diagnose("push", "dynamic-rigid", "dynamic-compliant", inputs=inputs, tol=1e-13, on_progress=look)
    assert time.monotonic() - began < 30.0


def test_parts_of_a_budget_are_given_back() -> None:
    budget = Budget(1000, 100.0)
    ends = budget.ends
    with pytest.raises(TimeOver), budget.part(0.1):
        assert budget.most == 100 and budget.ends < ends - 80.0
        budget.ends = time.monotonic() - 1.0
        budget.look()
    assert (budget.most, budget.ends) == (1000, ends)
    budget.look()

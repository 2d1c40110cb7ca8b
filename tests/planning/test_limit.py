"""A limit in seconds holds wherever a call is: in searches, long runs, replays, diagnoses, in space; and
progress is told on the way."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import pytest

import rungwise as rw
from rungwise.deadline import Deadline, TimeOver, clock
from rungwise.planning.execution.feedback import Replanner
from rungwise.planning.lift import lift as climb
from rungwise.planning.motion.budget import Budget
from rungwise.planning.search.problem import Work
from tests.planning.members import push

LATE = 2.5
"""Seconds after its limit by which a call may return on a machine that does other work. Compilation
does not count (`clock`)."""


def timed(scene: rw.Scene, limit: float, **options: Any) -> tuple[rw.Plan, float, list[float]]:
    """A plan, how long it took beyond its limit, and when progress was told."""
    began, told = clock(), list[float]()
    plan = rw.plan(scene, limit=limit, on_progress=lambda _: told.append(clock()), **options)
    return plan, clock() - began - limit, told


@pytest.mark.long
def test_a_limit_holds_in_a_search_without_budget() -> None:
    exact = {"near": 1e-7, "aligned": 1e-7}
    rw.plan(push(0), parameters=exact, task_seed=0, budget=200)
    plan, late, told = timed(push(0), 2.0, parameters=exact, task_seed=0, budget=None)
    assert not plan.found and "the time is over" in plan.reason
    assert late < LATE
    assert len(told) >= 8 and np.median(np.diff(told)) < 0.4


@pytest.mark.long
def test_a_limit_holds_in_the_replay_that_confirms(monkeypatch: pytest.MonkeyPatch) -> None:
    """A plan that was found is returned, with a reason that it is not confirmed: the limit is set to end
    one second after the replay has begun, however long the search took."""
    confirmed, ends = climb._is_confirmed, list[float]()

    def begun(work: Work, plan: rw.Plan) -> bool:
        ends.append(clock() + 1.0)
        work.budget.end = Deadline(1.0)
        return confirmed(work, plan)

    monkeypatch.setattr(climb, "_is_confirmed", begun)
    monkeypatch.setattr(climb, "TENTH", 1e-7)  # replays for about four times as long as plans are sought
    plan, _, told = timed(push(0), 1e6, task_seed=0)
    late = clock() - ends[0]
    assert not plan.found and climb.UNCONFIRMED in plan.reason and "the time is over" in plan.reason
    assert len(ends) == 1 and plan.segments and late < LATE
    assert np.median(np.diff(told)) < 0.4


def test_what_progress_raises_ends_a_diagnosis() -> None:
    counted = itertools.count()

    def look(_run: object) -> None:
        if next(counted) >= 1:
            raise TimeOver

    inputs = [rw.Segment({"ux": 1.0}, 5.0)]
    began = clock()
    with pytest.raises(TimeOver):
        rw.diagnose("push", "dynamic-rigid", "dynamic-compliant", inputs=inputs, tol=1e-13, on_progress=look)
    assert clock() - began < 30.0


@pytest.mark.parametrize("limit", [None, 100.0])
def test_parts_of_a_budget_are_parts_of_steps_and_given_back(limit: float | None) -> None:
    """Whatever time is left: a search does the same on a slow machine."""
    budget = Budget(1000, limit)
    ends = budget.end.ends
    with budget.part(0.1):
        assert budget.most == 100 and budget.end.ends == ends
        with budget.part(0.5):
            assert budget.most == 50
    assert budget.most == 1000
    with pytest.raises(TimeOver), budget.part(0.1):
        budget.end = Deadline.at(clock() - 1.0)
        budget.look()
    assert budget.most == 1000 and not budget.is_in_time()


@pytest.fixture(scope="module")
def varied() -> rw.Plan:
    """A plan of a task that calls something uncertain."""
    found = rw.plan("push", task_seed=4, to="quasistatic-rigid")
    assert found.found
    return found


def over_after(monkeypatch: pytest.MonkeyPatch, looks: int) -> None:
    """The time of every budget is over after so many looks at it."""
    left = itertools.count(looks, -1)
    monkeypatch.setattr(Budget, "is_in_time", lambda _: next(left) > 0)


@pytest.mark.parametrize("mode", ["open loop", pytest.param("re-planning", marks=pytest.mark.long)])
def test_a_verification_keeps_the_samples_that_were_run(varied: rw.Plan, mode: str) -> None:
    """What is told on the way may end it, too: the clock of its limit is set by hand."""
    whole = rw.verify(varied, samples=20, mode=mode)
    assert not whole.unfinished

    def late(monkeypatch: pytest.MonkeyPatch, samples: int) -> rw.Verification:
        in_time = [True]
        monkeypatch.setattr(Budget, "is_in_time", lambda _: in_time[0])

        def told(done: int) -> None:
            in_time[0] = done < samples

        return rw.verify(varied, samples=20, mode=mode, limit=1e9, on_progress=told)

    with pytest.MonkeyPatch.context() as patch:
        cut = late(patch, 10)
    assert 0 < cut.samples <= 10 and f"{cut.samples} of 20 samples" in cut.unfinished
    assert cut.unfinished in str(cut) and cut.summary()["unfinished"] == cut.unfinished
    first = {each.number for each in whole.worst if each.number < cut.samples}
    assert first <= {each.number for each in cut.worst}
    assert cut.successes <= whole.successes and cut.lower < whole.upper


def test_a_limit_of_nothing_leaves_a_verification_open(varied: rw.Plan) -> None:
    none = rw.verify(varied, samples=20, limit=0.0)
    assert (none.samples, none.successes, none.lower, none.upper) == (0, 0, 0.0, 1.0)
    assert "0 of 20 samples" in str(none)
    long = rw.verify(varied, samples=20, limit=1e9)
    assert long.failures == rw.verify(varied, samples=20).failures


def test_causes_that_were_not_sought_are_named(varied: rw.Plan, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = rw.verify(varied, samples=20)
    assert whole.causes
    in_time = [True]
    monkeypatch.setattr(Budget, "is_in_time", lambda _: in_time[0])

    def told(done: int) -> None:
        in_time[0] = done < 20

    cut = rw.verify(varied, samples=20, on_progress=told)
    assert cut.successes == whole.successes and not cut.causes and "causes" in cut.unfinished


@pytest.mark.few(1)
@pytest.mark.parametrize(
    "options",
    [{}, {"robust": True, "samples": 10, "draws": 4}, {"from_": "kinematic"}],
    ids=lambda o: list(o),
)
def test_a_design_keeps_what_it_found(options: dict[str, Any], monkeypatch: pytest.MonkeyPatch) -> None:
    """Whenever the time is over, what is known of the design is told, and what is not is named."""
    wanted: dict[str, Any] = {
        "model": "quasistatic-rigid",
        "box": {"v2": (0.2, 2.2)},
        "budget": 400,
        **options,
    }
    known = list[tuple[bool, bool, bool]]()
    for looks in (0, 4, 8, 16, 32, 64):
        with monkeypatch.context() as patch:
            over_after(patch, looks)
            found = rw.design("two_finger", ("v2",), **wanted)
        assert found.unfinished or found.drift, looks
        assert found.found or (found.reason and found.unfinished), looks
        assert found.unfinished in str(found), looks
        known.append((found.found, found.found and found.samples > 0, bool(found.drift)))
    assert not known[0][2], known
    whole = rw.design("two_finger", ("v2",), limit=1e9, **wanted)
    assert whole.found and not whole.unfinished and whole.drift


def test_a_set_ends_with_the_cells_that_are_known() -> None:
    with pytest.raises(rw.LimitError, match="before the first cells"):
        rw.feasible_set("two_finger", "kinematic", ("v1", "v2"), limit=0.0)


def test_re_planned_samples_are_kept_one_by_one(varied: rw.Plan, monkeypatch: pytest.MonkeyPatch) -> None:
    """Executions are stand-ins, and the time is over in the eighth."""
    executed = itertools.count(1)
    in_time = [True]
    monkeypatch.setattr(Budget, "is_in_time", lambda _: in_time[0])

    def execute(*_: object) -> tuple[rw.Code, tuple[rw.Segment, ...]]:
        if next(executed) == 8:
            in_time[0] = False
            raise TimeOver
        return rw.Code.GOAL, ()

    monkeypatch.setattr(Replanner, "execute", execute)
    cut = rw.verify(varied, samples=20, mode="re-planning", limit=1e9)
    assert (cut.samples, cut.successes) == (7, 7) and cut.unfinished.startswith("7 of 20 samples")

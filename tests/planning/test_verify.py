"""Verification draws what the task says, bounds the rate of success, and replays what failed."""

from __future__ import annotations

import copy
import math

import numpy as np
import pytest
import yaml
from scipy.stats import binom

import rungwise as rw
from rungwise.planning.execution.feedback import Replanner
from rungwise.scene.scene import LIBRARY


def scene(uncertain: dict[str, object]) -> rw.Scene:
    file = yaml.safe_load((LIBRARY / "push.yaml").read_text("utf-8"))
    file = copy.deepcopy(file)
    file["task"]["uncertain"] = uncertain
    return rw.load(file)


PUSH = scene({"mu": {"uniform": ["0.5 * mu", "2 * mu"]}, "ux": {"normal": [0, 0.01]}})


@pytest.fixture(scope="module")
def plan() -> rw.Plan:
    found = rw.plan(PUSH, task_seed=4, to="quasistatic-rigid")
    assert found.found
    return found


@pytest.mark.long
def test_bound_is_that_of_clopper_and_pearson(plan: rw.Plan) -> None:
    """At the lower bound, as many successes or more have a probability of 5 %."""
    found = rw.verify(plan, samples=60)
    k, n = found.successes, found.samples
    assert 0 < k < n, "the test needs successes and failures"
    assert binom.sf(k - 1, n, found.lower) == pytest.approx(0.05, rel=1e-6)
    assert binom.cdf(k, n, found.upper) == pytest.approx(0.05, rel=1e-6)
    assert sum(found.failures.values()) == n - k


@pytest.mark.long
def test_samples_that_failed_fail_again(plan: rw.Plan) -> None:
    found = rw.verify(plan, samples=60)
    assert found.worst
    for sample in found.worst:
        assert str(found.replay(sample).outcome) == sample.outcome
        assert 0.5 * 0.25 <= sample.parameters["mu"] <= 2 * 0.25 and sample.inputs["ux"] != 0.0
    margins = [sample.margin for sample in found.worst]
    assert margins == sorted(margins)


@pytest.mark.long
def test_re_planning_reads_the_actual_state_and_mends(plan: rw.Plan) -> None:
    """Samples that fail open loop come to the goal, and executions are reproducible."""
    blind = rw.verify(plan, samples=60)
    assert plan.stage is not None
    replanner = Replanner(plan, plan.stage, plan.tol)
    ends = [replanner.execute(sample.parameters, sample.inputs, 0) for sample in blind.worst[-2:]]
    assert [outcome for outcome, _ in ends] == [rw.Code.GOAL, rw.Code.GOAL]
    again = replanner.execute(blind.worst[-1].parameters, blind.worst[-1].inputs, 0)
    assert again == ends[-1]


def test_mode_is_named(plan: rw.Plan) -> None:
    found = rw.verify(plan, samples=1, mode="re-planning")
    assert found.mode == "re-planning" and "re-planning" in str(found)
    with pytest.raises(
        rw.TaskError, match="mode: unknown 'zzz'; valid: open loop, guarded moves, re-planning"
    ):
        rw.verify(plan, mode="zzz")


def test_same_seed_same_samples_whatever_the_threads(plan: rw.Plan) -> None:
    one, two = (rw.verify(plan, samples=20, seed=5, threads=threads) for threads in (1, 2))
    assert one.summary() == two.summary()
    assert rw.verify(plan, samples=20, seed=6).summary() != one.summary()


@pytest.mark.long
def test_nothing_that_varies_much_always_succeeds() -> None:
    sure = scene({"mu": {"uniform": ["mu", "mu * (1 + 1e-9)"]}})
    plan = rw.plan(sure, task_seed=4, to="quasistatic-rigid")
    found = rw.verify(plan, samples=59)
    assert found.successes == 59
    assert found.lower == pytest.approx(0.05 ** (1 / 59)) and found.upper == 1.0


def test_what_cannot_be_verified_is_refused(plan: rw.Plan) -> None:
    none = rw.plan(PUSH, task_seed=4, schedule="direct", budget=400)
    with pytest.raises(rw.TaskError, match="plan: there is none"):
        rw.verify(none)
    with pytest.raises(rw.ModelError, match="samples: must be a whole number"):
        rw.verify(plan, samples=0)


@pytest.mark.long
def test_without_uncertainty_the_plan_is_run_as_it_is() -> None:
    plan = rw.plan(scene({}), task_seed=4, to="quasistatic-rigid")
    found = rw.verify(plan)
    assert (found.samples, found.successes, found.lower, found.upper) == (1, 1, 1.0, 1.0)
    assert "the plan as it is reaches the goal" in str(found)
    lost = rw.verify(plan, "kinematic")
    assert (lost.samples, lost.successes, lost.lower) == (1, 0, 0.0)
    assert "the plan as it is ends missed" in str(lost) and lost.failures == {"missed": 1}


def test_draws_keep_the_ranges_of_parameters() -> None:
    given = PUSH.parameters()
    rng = np.random.default_rng(0)
    from rungwise.planning.task.task import drawn

    wide = scene({"mu": {"normal": [0, 100]}})
    found = [drawn(wide, "uncertain", given, rng) for _ in range(200)]
    kept = [values["mu"] for values in found if values is not None]
    assert 20 < len(kept) < 120
    assert all(0.0 <= mu <= 100.0 and math.isfinite(mu) for mu in kept)
